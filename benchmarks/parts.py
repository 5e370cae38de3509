"""What each part of a scene costs: its undamped run in LAMMPS with a feature and without it, in turns.

    python benchmarks/parts.py scenes/paper.toml

Both runs of a feature take so many steps in a turn as need ten milliseconds, in turns, of which every other begins with
the second. The ratio is that of two runs in one turn, of processor time; the median over the turns is printed with its
quartiles, since the slowest turns would dominate a mean.
"""

import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from mpi4py import MPI

from faultgouge.assessment.explain import affordable, features, run_of
from faultgouge.assessment.timing import in_turns
from faultgouge.pywrap import Scene, settle

TURNS, SECONDS_A_TURN, TRIAL = 12, 10e-3, 200


def main() -> None:
    """Print a row of Markdown for each feature of the scene that is named."""
    scene, _ = affordable(Scene.from_toml(sys.argv[1]))
    run = run_of(scene, settle(scene).packing)
    print("| feature | with it : without it [quartiles] | us a step without |\n|---|---|---|")
    with TemporaryDirectory() as folder:
        for feature in features(run, Path(folder) / "contacts"):
            with feature.without.start(MPI.COMM_SELF) as (_, plain), feature.with_it.start(MPI.COMM_SELF) as (_, other):
                plain.advance(TRIAL)
                begin = time.process_time()
                plain.advance(TRIAL)
                steps = max(50, int(SECONDS_A_TURN * TRIAL / (time.process_time() - begin)))
                other.advance(2 * TRIAL)
                jobs = [lambda one=one, steps=steps: one.advance(steps) for one in (plain, other)]
                _, seconds = in_turns(jobs, TURNS, time.process_time)
            low, middle, high = np.quantile(seconds[1:, 1] / seconds[1:, 0], (0.25, 0.5, 0.75))
            without = 1e6 * np.median(seconds[1:, 0]) / steps
            print(f"| {feature.name} | {middle:.2f} [{low:.2f}, {high:.2f}] | {without:.1f} |")


if __name__ == "__main__":
    main()
