"""What the tests notice: each line of tests/mutations.txt spoils one text of the product, and a test must fail then.

    python benchmarks/mutations.py [NUMBER ...]

A line is FILE | OLD TEXT | NEW TEXT | TESTS, and the old text occurs once in its file. In a copy of the tree the new
text takes its place, and `pytest -x -m "not long" TESTS` runs. Where C++ is changed the plugin is compiled anew.
"""

import os
import subprocess
import sys
from collections import Counter
from pathlib import Path
from shutil import copytree, ignore_patterns
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[1]
LIBRARIES = "src/faultgouge/lib"


def run(tree: Path, command: str) -> "subprocess.CompletedProcess[str]":
    """A shell's command in the tree, with the tree's own Python sources; what never ends is ended."""
    places = {"PYTHONPATH": f"{tree}/src", "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    limited = ["timeout", "1800", "sh", "-ec", command]
    return subprocess.run(limited, cwd=tree, env=os.environ | places, capture_output=True, text=True)


def what_happens(tree: Path, file: str, old: str, new: str, tests: str) -> str:
    """Whether a test notices the new text in place of the old one, and which."""
    source = (tree / file).read_text() if (tree / file).exists() else ""
    if source.count(old) != 1:
        return "the old text is no longer there"
    (tree / file).write_text(source.replace(old, new))
    if file.endswith((".h", ".cpp")):
        build = "cmake -S . -B build -DCMAKE_BUILD_TYPE=Release; cmake --build build -j 2"
        run(tree, f"{build}; cp build/*.so {LIBRARIES}").check_returncode()
    done = run(tree, f'python -m pytest -x -q -m "not long" -p no:cacheprovider {tests}')
    if file.endswith((".h", ".cpp")):
        run(tree, f"cp {ROOT}/{LIBRARIES}/*.so {LIBRARIES}")
    (tree / file).write_text(source)
    by = [line.split(" - ")[0].split("::", 1)[1] for line in done.stdout.splitlines() if line.startswith("FAILED")]
    known = {0: "NOT NOTICED", 1: f"noticed by {', '.join(by)}", 124: "noticed: it never ends"}
    return known.get(done.returncode, f"the tests do not run: {(done.stdout + done.stderr)[-300:]}")


def main() -> None:
    """Reads the list, and prints a line for each mutation and the counts."""
    lines = [each for each in (ROOT / "tests/mutations.txt").read_text().splitlines() if each and each[0] != "#"]
    counts = Counter[str]()
    with TemporaryDirectory() as folder:
        left_out = ignore_patterns(".git", ".venv", "build", "results", "*_cache", "__pycache__")
        tree = Path(copytree(ROOT, f"{folder}/tree", symlinks=True, ignore=left_out))
        for number in map(int, sys.argv[1:] or range(1, len(lines) + 1)):
            file, old, new, tests = (part.strip() for part in lines[number - 1].split(" | "))
            found = what_happens(tree, file, old, new, tests)
            counts[found.split(" by ")[0].split(":")[0]] += 1
            print(f"{number:3} {file}: {old} -> {new}: {found}", flush=True)
    print(", ".join(f"{count} {what}" for what, count in counts.items()))


if __name__ == "__main__":
    main()
