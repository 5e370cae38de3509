"""Where the time of `faultgouge onset` goes, and how long other commands take to their first line: README's scene.

One process after the other does what the command does, and says how long each part has taken:

    imports     Python, NumPy, SciPy, MPI, LAMMPS and faultgouge, from files that are in memory already
    settling    LAMMPS brings the loose packing to rest, and rattlers move to the middle of their cages
    onset       the ramp, the search for the first complex pair, and the error of the path

Then the commands themselves, `spectrum` with the ramp of README. Seconds of the processor, which other work on the
machine changes little, and for commands also seconds of the clock to their first line: medians of several processes,
with one thread each.

    python benchmarks/first_answer.py [--turns 9]
"""

import argparse
import os
import platform
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from subprocess import PIPE

README = Path(__file__).parents[1] / "README.md"
ENVIRONMENT = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}

PARTS = """
import time
from pathlib import Path
import scipy.optimize, scipy.spatial
import faultgouge.commands.onset
from faultgouge.pywrap import Scene
from faultgouge.pywrap.onset import onset_run
from faultgouge.pywrap.settling.settle import settle_bed

imports = time.process_time()
scene = Scene.from_toml(Path("scene.toml"))
bed = settle_bed(scene)
settling = time.process_time()
onset_run(scene, scene.law.mus[0], first=True, bed=bed)
ends = 0.0, imports, settling, time.process_time()
print(*(later - sooner for sooner, later in zip(ends, ends[1:])))
"""


COMMANDS = {
    "onset": "onset scene.toml",
    "settle": "settle scene.toml -o settled.h5",
    "spectrum": "spectrum run.h5 --frame 10",
    "explain": "explain scene.toml",
    "report --help": "report --help",
    "--help": "--help",
}
"""Commands by the names of their rows."""


def run(folder: Path, *words: str) -> tuple[str, float, float]:
    """The output of a Python in a folder, the seconds to its first line, and those of the processor."""
    begin, before = time.time(), processor_seconds()
    with subprocess.Popen([sys.executable, *words], cwd=folder, env=ENVIRONMENT, stdout=PIPE, stderr=PIPE) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        first = time.time() - begin
        said, error = process.communicate()
    if process.returncode:
        raise SystemExit(error.decode())
    return (line + said).decode(), first, processor_seconds() - before


def processor_seconds() -> float:
    """Seconds of the processor of all processes that this one has started, and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Print the medians."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--turns", type=int, default=9)
    turns = parser.parse_args().turns
    (scene,) = re.findall(r"```toml\n(# scene.toml\n.*?)```", README.read_text(), re.DOTALL)
    parts, times = [], {name: [] for name in COMMANDS}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scene.toml").write_text(scene)
        run(folder, "-m", "faultgouge", "ramp", "scene.toml", "-o", "run.h5")
        for _ in range(turns):
            parts.append([float(word) for word in run(folder, "-c", PARTS)[0].split()])
            for label, words in COMMANDS.items():
                times[label].append(run(folder, "-m", "faultgouge", *words.split())[1:])
                (folder / "settled.h5").unlink(missing_ok=True)
    medians = [statistics.median(part) for part in zip(*parts, strict=True)]
    print(f"{platform.machine()}; medians of {turns}")
    print(f"  {'':28}{'processor':>10}{'share':>8}{'first line':>12}")
    for label, seconds in zip(("imports", "settling", "onset"), medians, strict=True):
        print(f"  {label:28}{seconds:9.2f}s{seconds / sum(medians):8.0%}")
    for label, both in times.items():
        first, processor = (statistics.median(each) for each in zip(*both, strict=True))
        print(f"  {'faultgouge ' + label:28}{processor:9.2f}s{'':8}{first:11.2f}s")


if __name__ == "__main__":
    main()
