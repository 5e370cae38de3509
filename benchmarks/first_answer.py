"""Where the time of `faultgouge onset` goes: the scene of README, from the start of Python to F_x^c.

One process after the other does what the command does, and says how long each part has taken:

    imports     Python, NumPy, SciPy, MPI, LAMMPS and faultgouge, from files that are in memory already
    settling    LAMMPS brings the loose packing to rest, and rattlers move to the middle of their cages
    onset       the ramp, the search for the first complex pair, and the error of the path

Seconds of the clock, with one thread: medians of several processes, and the share of each. The last row is the command
itself; it prints what it has found, and does all of the above.

    python benchmarks/first_answer.py [--turns 9]
"""

import argparse
import os
import platform
import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"
ENVIRONMENT = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}

PARTS = """
import sys, time
from pathlib import Path
import scipy.optimize, scipy.spatial
import faultgouge.commands.onset
from faultgouge.pywrap import Scene
from faultgouge.pywrap.onset import onset_run
from faultgouge.pywrap.settling.settle import settle_bed

imports = time.time()
scene = Scene.from_toml(Path("scene.toml"))
bed = settle_bed(scene)
settling = time.time()
onset_run(scene, scene.law.mus[0], first=True, bed=bed)
ends = float(sys.argv[1]), imports, settling, time.time()
print(*(later - sooner for sooner, later in zip(ends, ends[1:])))
"""


def run(folder: Path, *words: object) -> tuple[str, float]:
    """What a Python prints in a folder, and its seconds."""
    begin = time.time()
    done = subprocess.run(
        [sys.executable, *map(str, words)], cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, check=True
    )
    return done.stdout, time.time() - begin


def main() -> None:
    """Print the medians."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--turns", type=int, default=9)
    turns = parser.parse_args().turns
    (scene,) = re.findall(r"```toml\n(# scene.toml\n.*?)```", README.read_text(), re.DOTALL)
    parts, whole = [], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scene.toml").write_text(scene)
        for _ in range(turns):
            said, _ = run(folder, "-c", PARTS, time.time())
            parts.append([float(word) for word in said.split()])
            whole.append(run(folder, "-m", "faultgouge", "onset", "scene.toml")[1])
    medians = [statistics.median(part) for part in zip(*parts, strict=True)]
    print(f"{platform.machine()}; seconds, medians of {turns}")
    for label, seconds in zip(("imports", "settling", "onset"), medians, strict=True):
        print(f"  {label:22}{seconds:6.2f}{seconds / sum(medians):6.0%}")
    print(f"  {'faultgouge onset':22}{statistics.median(whole):6.2f}  [{min(whole):.2f}, {max(whole):.2f}]")


if __name__ == "__main__":
    main()
