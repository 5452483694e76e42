#!/usr/bin/env python3
"""Fails when a module includes a sideways or higher module (docs/adr/0006-floors.md)."""
import pathlib
import re
import sys

FLOOR = {
    "base": 0, "math": 1, "mesh": 2, "image": 2, "stats": 2, "spatial": 3, "io": 3, "render": 3,
    "surface": 4, "mls": 5, "scalespace": 5, "warp": 5, "crest": 6, "features": 6,
    "registration": 7, "retrieval": 7, "faces": 8, "gallery": 8,
}
EXCEPTIONS = set()  # (from, to): at most two, each with its reason
INCLUDE = re.compile(r'^\s*#\s*include\s+"dupin/([a-z_]+)/', re.M)


def main():
    root = pathlib.Path(__file__).resolve().parent.parent
    problems = []
    for path in sorted((root / "src/dupin").rglob("*")):
        if path.suffix not in (".h", ".cpp"):
            continue
        module = path.relative_to(root / "src/dupin").parts[0]
        if module not in FLOOR:
            problems.append(f"{path.relative_to(root)}: module '{module}' has no floor")
            continue
        text = path.read_text(encoding="utf-8")
        for target in INCLUDE.findall(text):
            allowed = target == module or FLOOR.get(target, 99) < FLOOR[module]
            if not allowed and (module, target) not in EXCEPTIONS:
                problems.append(f"{path.relative_to(root)}: {module} (floor {FLOOR[module]}) includes {target}")
        if module != "base" and re.search(r"#\s*include\s+<(thread|mutex|atomic|tbb/|omp)", text):
            problems.append(f"{path.relative_to(root)}: threads live in base/ only")
        if module != "io" and re.search(r"#\s*include\s+<(fstream|cstdio|fcntl|unistd)", text) and path.name != "assert.h":
            problems.append(f"{path.relative_to(root)}: files are touched in io/ only")
    for directory in ("apps", "tests", "bench", "examples", "fuzz"):
        for path in sorted((root / directory).rglob("*.cpp")):
            if re.search(r'#\s*include\s+"src/', path.read_text(encoding="utf-8")):
                problems.append(f"{path.relative_to(root)}: includes src/ directly")
    print("\n".join(problems) if problems else "floors: in order")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
