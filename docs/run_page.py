"""Run a page of the documentation, and compare what its commands print with what stands on the page.

    python docs/run_page.py docs/tutorial.md FOLDER

A fenced block of a page is used by its language:

- ``toml``, ``python`` or ``text`` whose first line is ``# NAME`` alone is the file NAME;
- ``console`` has commands, each after ``$ ``, and below each what it prints, standard error and output together. A line
  ``...`` stands for any lines.

Words must be equal. Numbers must agree to one part in a thousand; what is below 1e-9 is noise of the rounding, which
depends on the machine's libraries: there a factor of a thousand counts as agreement.
"""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NAME = re.compile(r"# ([\w.-]+\.\w+)\n")
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?:\(\d+\))?$")
PROGRESS = re.compile(r"(settling|calibrating|equilibria|samples|frames|searching|driving|states|scenes)\b[^;]*")
"""A line that a command says every minute of long work: on a fast machine there is none."""
NOISE = 1e-9
LIMIT = 900.0
"""Seconds for one command on a busy machine."""


@dataclass(frozen=True)
class Command:
    """A command of a page, and the lines that the page shows below it."""

    line: str
    shown: tuple[str, ...]


def files(page: Path) -> dict[str, str]:
    """The files that a page asks its reader to write."""
    found = {}
    for language, text in BLOCK.findall(page.read_text()):
        name = NAME.match(text)
        if language in ("toml", "python", "text") and name:
            found[name[1]] = text
    return found


def commands(page: Path) -> Iterator[Command]:
    """The commands of a page in their order."""
    for language, text in BLOCK.findall(page.read_text()):
        if language == "console":
            for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
                line, *shown = part.rstrip().split("\n")
                yield Command(line, tuple(shown))


def words_of(lines: tuple[str, ...]) -> list[str]:
    """Words without the rules that tables draw, and without white space."""
    return re.sub(r"[─━]+", " ", "\n".join(lines)).replace(",", " ").replace(";", " ").split()


def alike(shown: str, printed: str) -> bool:
    """Whether a word of the page equals the printed word."""
    if shown == printed:
        return True
    if not (NUMBER.match(shown) and NUMBER.match(printed)):
        return False
    a, b = (float(word.split("(")[0]) for word in (shown, printed))
    if 0 < abs(a) < NOISE:
        return 0 < abs(b) < 1e3 * NOISE and 1e-3 < abs(a / b) < 1e3
    return abs(a - b) <= 1e-3 * abs(a)


def difference(shown: tuple[str, ...], printed: str) -> str:
    """Where the page is wrong, in a sentence; empty if it is right."""
    if not shown:
        return ""
    rest = words_of(tuple(line for line in printed.split("\n") if not PROGRESS.fullmatch(line)))
    whole = True
    for part in "\n".join(shown).split("..."):
        words = words_of((part,))
        starts = [0] if whole else range(len(rest) - len(words) + 1)
        at = next((k for k in starts if all(map(alike, words, rest[k:])) and len(rest) >= k + len(words)), None)
        if at is None:
            return f"the page shows\n{part.strip()}\nand printed is\n{printed.strip()}"
        rest, whole = rest[at + len(words) :], False
    if rest and not shown[-1].endswith("..."):
        return f"the page lacks {' '.join(rest)!r}"
    return ""


def run(page: Path, folder: Path) -> list[str]:
    """Write the files of a page into a folder, run its commands there, and say where the page is wrong."""
    for name, text in files(page).items():
        (folder / name).write_text(text)
    beside = str(Path(sys.executable).parent)
    environment = os.environ | {"PATH": f"{beside}:{os.environ['PATH']}", "COLUMNS": "80"}
    wrong = []
    for command in commands(page):
        done = subprocess.run(
            ["bash", "-c", command.line],
            cwd=folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=LIMIT,
        )
        why = f"exit code {done.returncode}: {done.stdout}" if done.returncode else ""
        why = why or difference(command.shown, done.stdout)
        if why:
            wrong.append(f"$ {command.line}\n{why}")
    return wrong


if __name__ == "__main__":
    where = Path(sys.argv[2])
    where.mkdir(parents=True, exist_ok=True)
    complaints = run(Path(sys.argv[1]), where)
    print("\n\n".join(complaints) or "the page is right")
    sys.exit(bool(complaints))
