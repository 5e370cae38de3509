"""All eigenvalues of the first bed of `benchmarks/verdict.py`: copies of fifty spheres, side by side in a periodic box.

By Bloch's theorem a motion of the copies is one of the fifty times exp(i k r), with a wave vector k that fits the box.
So the eigenvalues of 12,000 spheres, with all contacts sticking, are those of a small matrix for each of 240 wave
vectors, of which two opposite ones have the same but for the sign of Im s. The columns are: copies along x and along y;
coordinates; the slowest decay 2 Re s of the fifty alone, and of the copies; and the fastest growth without dissipation.

With `--verdict` the verdict on the copies is computed, too (`linear_verdict`, which knows nothing of Bloch): its
slowest decay, its error, seconds of the processor, and memory.

    python benchmarks/bloch.py [--copies 15 16] [--verdict]
"""

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import resource
import sys
import time

import numpy as np
from scipy.sparse import csr_array
from verdict import BEDS, bed, tiled

from faultgouge.analysis import Configuration
from faultgouge.analysis.motion.linear import linear_verdict
from faultgouge.analysis.motion.motion import Motion
from faultgouge.analysis.progress import show_progress

NEIGHBOURS = 5
"""Copies along each axis in which those that a copy touches are told apart."""


def couplings(matrix: csr_array, size: int) -> np.ndarray:
    """What the first copy feels of each copy, shape (5, 5, size, size)."""
    rows = matrix[:size].toarray().reshape(size, NEIGHBOURS, NEIGHBOURS, size)
    return np.moveaxis(rows, 0, 2)


def rates(cell: Configuration, across: int, deep: int) -> tuple[np.ndarray, np.ndarray]:
    """The largest Re s for each wave vector, shape (across, deep), with dissipation and without."""
    motion = Motion.of(tiled(cell, NEIGHBOURS, NEIGHBOURS), sliding=False)
    size = len(motion.active) // NEIGHBOURS**2
    parts = [couplings(matrix, size) for matrix in (motion.stiffness, motion.damping)]
    steps = np.fft.fftfreq(NEIGHBOURS, 1 / NEIGHBOURS)  # 0, 1, 2, -2, -1 copies away
    found = np.full((2, across, deep), -np.inf)
    for x, y in np.ndindex(across, deep):
        opposite = -x % across, -y % deep
        if (x, y) > opposite:
            found[:, x, y] = found[(slice(None), *opposite)]
            continue
        phase = np.exp(2j * np.pi * (np.add.outer(x * steps / across, y * steps / deep)))
        a, g = (np.tensordot(phase, part, 2) for part in parts)
        scale = np.sqrt(np.abs(a).sum(axis=1).max())  # so that both halves weigh as much
        first_order = np.block([[np.zeros_like(a), scale * np.eye(size)], [-a / scale, -g]])
        found[0, x, y] = np.linalg.eigvals(first_order).real.max()
        found[1, x, y] = np.sqrt(np.linalg.eigvals(-a).astype(complex)).real.max()
    return found[0], found[1]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--copies", type=int, nargs=2, default=[15, 16], help="along x and along y")
    parser.add_argument("--verdict", action="store_true", help="also the verdict on the copies")
    options = parser.parse_args()
    law, slope, dashpot = BEDS["rests"]
    cell = bed(law, 50, slope, dashpot)
    damped, undamped = (2 * each for each in rates(cell, *options.copies))
    print(f"{'copies':>10s}{'coordinates':>13s}{'of fifty':>12s}{'of all':>12s}{'undamped':>12s}")
    copies = "{} x {}".format(*options.copies)
    size = cell.coordinates * damped.size
    print(f"{copies:>10s}{size:13d}{damped[0, 0]:12.7f}{damped.max():12.7f}{undamped.max():12.7f}", flush=True)
    if options.verdict:
        begin, motion = time.process_time(), Motion.of(tiled(cell, *options.copies), sliding=False)
        with show_progress(lambda says: print(says, file=sys.stderr, flush=True)):
            found = linear_verdict(motion)
        seconds, memory = time.process_time() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        print(f"\n{found.growth_rate:.7f} +- {found.error:.1g}, {seconds:.0f} s, {memory:.2f} GB: {found.said}")


if __name__ == "__main__":
    main()
