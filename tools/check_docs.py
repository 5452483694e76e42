#!/usr/bin/env python3
"""Fails when the documentation and the code disagree. usage: check_docs.py [DUPIN]

- every relative Markdown link resolves, with its anchor
- every file, function and test that docs/thesis_map.md names exists; so does every test that any page names
- every E_ and W_ code in the sources is in docs/guide/conventions.md, and no page names another
- the C++ program in README.md is examples/keypoints.cpp
- with DUPIN: every verb has a section in docs/guide/cli.md that names its options and no others
"""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
SOURCES = [p for d in ("src", "apps") for p in sorted((ROOT / d).rglob("*")) if p.suffix in (".h", ".cpp")]
PAGES = sorted(ROOT.glob("*.md")) + sorted((ROOT / "docs").rglob("*.md"))
CODE = re.compile(r'"([EW]_[A-Z_]+)"')


def name(path):
    return path.relative_to(ROOT)


def without_code(text):
    return re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S)


def anchors(page):
    found = set()
    for title in re.findall(r"^#+ +(.+)$", without_code(page.read_text(encoding="utf-8")), re.M):
        plain = re.sub(r"[^\w\- ]", "", title.lower().replace("`", ""))
        found.add(plain.strip().replace(" ", "-"))
    return found


def broken_links():
    for page in PAGES:
        for target in re.findall(r"\]\(([^)\s]+)\)", without_code(page.read_text(encoding="utf-8"))):
            if re.match(r"[a-z]+:", target):
                continue
            path, _, anchor = target.partition("#")
            file = (page.parent / path).resolve() if path else page
            if not file.is_file():
                yield f"{name(page)}: link to {target}, which does not exist"
            elif anchor and file.suffix == ".md" and anchor not in anchors(file):
                yield f"{name(page)}: link to {target}, which has no such heading"


def defined_tests():
    tests = set()
    for path in (ROOT / "tests").rglob("*.cpp"):
        text = path.read_text(encoding="utf-8")
        tests |= {".".join(pair) for pair in re.findall(r"\bTEST(?:_F)?\(\s*(\w+),\s*(\w+)\)", text)}
        tests |= {".".join(pair) for pair in re.findall(r"\bRC_GTEST_(?:FIXTURE_)?PROP\(\s*(\w+),\s*(\w+)", text)}
    return tests


def missing_tests():
    tests = defined_tests()
    suites = {test.split(".")[0] for test in tests}
    for page in PAGES:
        for suite, test in re.findall(r"`([A-Z]\w+)\.([A-Z]\w+|\*)`", page.read_text(encoding="utf-8")):
            if (test == "*" and suite not in suites) or (test != "*" and f"{suite}.{test}" not in tests):
                yield f"{name(page)}: no test {suite}.{test}"


def missing_places():
    page = ROOT / "docs/thesis_map.md"
    equations = set()
    for line in page.read_text(encoding="utf-8").splitlines():
        first = re.match(r"\| (5\.\d+) \|", line)
        if first and line.count("|") == 6:
            equations.add(first.group(1))
        for chunk in re.split(r"(?=`(?:src|apps|tests|tools|examples)/)", line):
            head = re.match(r"`((?:src|apps|tests|tools|examples)/[\w/.]+)`", chunk)
            if not head:
                continue
            file = ROOT / head.group(1)
            if not file.is_file():
                yield f"{name(page)}: no file {head.group(1)}"
                continue
            text = file.read_text(encoding="utf-8")
            named = chunk[head.end():].split("|")[0].split(";")[0]
            if not named.startswith(":"):
                continue
            for symbol in re.findall(r"`([\w:]+)`", named):
                for part in symbol.split("::"):
                    if not re.search(rf"\b{part}\b", text):
                        yield f"{name(page)}: {head.group(1)} has no {symbol}"
    for number in range(1, 34):
        if f"5.{number}" not in equations:
            yield f"{name(page)}: equation 5.{number} is missing"


def undocumented_codes():
    conventions = (ROOT / "docs/guide/conventions.md").read_text(encoding="utf-8")
    documented = set(re.findall(r"^\| ([EW]_[A-Z_]+) \|", conventions, re.M))
    emitted = {}
    for path in SOURCES:
        text = "\n".join(line for line in path.read_text(encoding="utf-8").splitlines()
                         if not line.lstrip().startswith("//"))
        for code in CODE.findall(re.sub(r"///<.*", "", text)):
            emitted.setdefault(code, path)
    for code, path in emitted.items():
        if code not in documented:
            yield f"{name(path)}: {code} is not in docs/guide/conventions.md"
    for code in documented - set(emitted):
        yield f"docs/guide/conventions.md: {code}, which no source emits"
    for page in PAGES:
        for code in set(re.findall(r"\b([EW]_[A-Z_]*[A-Z])\b", page.read_text(encoding="utf-8"))):
            if code not in emitted and code != "E_CODE":
                yield f"{name(page)}: {code}, which no source emits"


def stale_example():
    program = (ROOT / "examples/keypoints.cpp").read_text(encoding="utf-8")
    if f"```cpp\n{program}```" not in (ROOT / "README.md").read_text(encoding="utf-8"):
        yield "README.md: its C++ program is not examples/keypoints.cpp"


def help_of(dupin, *verb):
    return subprocess.run([dupin, *verb, "--help"], capture_output=True, text=True, timeout=60, check=True).stdout


def wrong_options(dupin):
    page = (ROOT / "docs/guide/cli.md").read_text(encoding="utf-8")
    sections = dict(re.findall(r"^## `dupin ([a-z ]+)`\n(.*?)(?=^## |\Z)", page, re.M | re.S))
    shared = re.search(r"^## Options of every verb\n(.*?)(?=^## )", page, re.M | re.S).group(1)
    known = set()
    pending = [()]
    while pending:
        verb = pending.pop()
        text = help_of(dupin, *verb)
        below = text.partition("Subcommands:\n")[2]
        if below:
            pending += [verb + (word,) for word in re.findall(r"^  ([a-z]+) ", below, re.M)]
            continue
        title = " ".join(verb)
        known.add(title)
        if title not in sections:
            yield f"docs/guide/cli.md: no section for dupin {title}"
            continue
        options = set(re.findall(r"^  (?:-\w,)?(--[a-z0-9-]+)", text, re.M))
        told = set(re.findall(r"(--[a-z][a-z0-9-]+)", re.sub(r"^```.*?^```|^    .*?$", "", sections[title], flags=re.M | re.S)))
        common = set(re.findall(r"^\| `(?:-\w, )?(--[a-z0-9-]+)", shared, re.M))
        for option in sorted(options - told - common):
            yield f"docs/guide/cli.md: dupin {title} has {option}"
        for option in sorted(told - options):
            yield f"docs/guide/cli.md: dupin {title} has no {option}"
    for title in set(sections) - known:
        yield f"docs/guide/cli.md: no verb {title}"


def main():
    problems = [*broken_links(), *missing_tests(), *missing_places(), *undocumented_codes(), *stale_example()]
    if len(sys.argv) > 1:
        problems += wrong_options(sys.argv[1])
    print("\n".join(problems) if problems else "docs: in order")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
