"""What each part of a scene costs: its undamped run in LAMMPS with a feature and without it, in turns.

    python benchmarks/parts.py scenes/paper.toml

Both runs of a feature take so many steps in a turn as need ten milliseconds, in turns, of which every other begins with
the second. The ratio is that of two runs in one turn, of processor time; the median over the turns is printed with its
quartiles, since the slowest turns would dominate a mean.
"""

import sys
import time

import numpy as np

from faultgouge.assessment.explain import affordable, features, run_of, set_up
from faultgouge.pywrap import Scene, settle
from faultgouge.pywrap.lammps.dynamics import Dynamics

TURNS, SECONDS_A_TURN, TRIAL = 12, 10e-3, 200


def main() -> None:
    """Print a row of Markdown for each feature of the scene that is named."""
    scene, _ = affordable(Scene.from_toml(sys.argv[1]))
    run = run_of(scene, settle(scene).packing)
    print("| feature | with it : without it [quartiles] | us a step without |\n|---|---|---|")
    for name, _, without, with_it in features(run):
        with set_up(without[0], **without[1]) as (_, plain), set_up(with_it[0], **with_it[1]) as (_, other):
            plain.advance(TRIAL)
            steps = max(50, int(SECONDS_A_TURN * TRIAL / seconds_of(plain, TRIAL)))
            other.advance(2 * TRIAL)
            seconds = np.empty((TURNS, 2))
            for turn in range(TURNS):
                for place in (1, 0) if turn % 2 else (0, 1):
                    seconds[turn, place] = seconds_of((plain, other)[place], steps)
        low, middle, high = np.quantile(seconds[1:, 1] / seconds[1:, 0], (0.25, 0.5, 0.75))
        microseconds = 1e6 * np.median(seconds[1:, 0]) / steps
        print(f"| {name} | {middle:.2f} [{low:.2f}, {high:.2f}] | {microseconds:.1f} |")


def seconds_of(dynamics: Dynamics, steps: int) -> float:
    """Processor time of so many steps."""
    begin = time.process_time()
    dynamics.advance(steps)
    return time.process_time() - begin


if __name__ == "__main__":
    main()
