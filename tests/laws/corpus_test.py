#!/usr/bin/env python3
"""Every file of the bad-mesh corpus gets from `dupin check` exactly what its manifest says.

usage: corpus_test.py DUPIN GEN.PY [--no-memory-limit] [--leave-out=FORMAT,...]

Exit status, codes, counts, area, line, size of pictures, no warning on sound files, 2 s and 1 GiB a
file. Formats named by --leave-out=wrl,gz are left out.
Exits 77 (skipped) when GEN.PY is not there.
"""
import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

REMARKS = {"W_TOO_SMALL", "W_COMPONENTS", "W_NO_CURVATURE"}
MEMORY = 1 << 30
SECONDS = 2.0


def run(dupin, folder, name, limit):
    def prepare():
        if limit:
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))

    argument = "./" + name if name.startswith("-") else name
    start = time.monotonic()
    try:
        process = subprocess.run([dupin, "check", "--json", argument], cwd=folder, timeout=30,
                                 stdin=subprocess.DEVNULL, capture_output=True, preexec_fn=prepare)
    except subprocess.TimeoutExpired:
        return None, "", "", 30.0
    return (process.returncode, process.stdout.decode("utf-8", "replace"),
            process.stderr.decode("utf-8", "replace"), time.monotonic() - start)


def problems_of(entry, code, out, err, seconds, time_limit):
    problems = []
    if code is None:
        return ["hangs"]
    if code != entry["exit"]:
        problems.append(f"exit {code}, expected {entry['exit']}: {err.strip()[:160]}")
    if seconds > time_limit:
        problems.append(f"took {seconds:.2f} s")
    for wanted in entry["codes"]:
        if wanted not in out or wanted not in err:
            problems.append(f"{wanted} is not in both JSON and diagnostics")
    try:
        document = json.loads(out)
    except ValueError:
        return problems + [f"stdout is not one JSON document: {out[:80]!r}"]
    if code != 0:
        error = document.get("error", {})
        if error.get("exit") != code:
            problems.append(f"error.exit is {error.get('exit')}")
        if "line" in entry and error.get("line") != entry["line"]:
            problems.append(f"line {error.get('line')}, expected {entry['line']}")
        return problems
    expect = entry.get("expect", {})
    for key, field in (("v", "vertices"), ("f", "faces"), ("f_used", "faces"),
                       ("components", "components"), ("holes", "holes"), ("w", "width"), ("h", "height")):
        if key in expect and document[field] != expect[key]:
            problems.append(f"{field} {document[field]}, expected {expect[key]}")
    if expect.get("closed") and document["boundary_loops"] != 0:
        problems.append(f"{document['boundary_loops']} boundary loops, expected none")
    if "area" in expect and abs(document["area"] - expect["area"]) > 1e-9:
        problems.append(f"area {document['area']}, expected {expect['area']}")
    if entry["cls"] == "ok":
        unwelcome = {w["code"] for w in document["warnings"]} - REMARKS
        if unwelcome:
            problems.append(f"warnings on a sound file: {sorted(unwelcome)}")
    return problems


def main():
    arguments = [a for a in sys.argv[1:] if not a.startswith("--")]
    dupin, generator = arguments
    limit = "--no-memory-limit" not in sys.argv
    left_out = set()
    for option in sys.argv:
        if option.startswith("--leave-out="):
            left_out |= set(option.split("=", 1)[1].split(","))
    if not os.path.exists(generator):
        print(f"SKIPPED: the corpus generator is not on this machine: {generator}")
        return 77
    table = {}
    failed = []
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, generator, folder], check=True, stdout=subprocess.DEVNULL)
        manifest = json.loads(pathlib.Path(folder, "manifest.json").read_text(encoding="utf-8"))
        for entry in manifest["files"]:
            row = table.setdefault(entry["cls"], [0, 0, 0, 0.0])
            if entry["format"] in left_out:
                row[2] += 1
                continue
            if entry.get("needs_non_root") and os.geteuid() == 0:
                row[2] += 1
                continue
            code, out, err, seconds = run(os.path.abspath(dupin), folder, entry["file"], limit)
            problems = problems_of(entry, code, out, err, seconds, SECONDS if limit else 10 * SECONDS)
            row[0] += 1
            row[1] += 1 if problems else 0
            row[3] = max(row[3], seconds)
            failed += [f"{entry['file']!r} ({entry['cls']}): {p}" for p in problems]
        os.chmod(folder, 0o700)
    print("\n".join(failed))
    print(f"{'class':8} {'files':>6} {'wrong':>6} {'left out':>9} {'slowest':>9}")
    for name, (files, wrong, skipped, slowest) in sorted(table.items()):
        print(f"{name:8} {files:6} {wrong:6} {skipped:9} {slowest:7.3f} s")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
