"""`spectrum` by LAPACK beside slices of the spectrum, for growing packings: `python benchmarks/spectra.py [--fast]`."""

import multiprocessing
import resource
import sys
import time

import numpy as np
from scale import scene
from verdict import bed

import faultgouge.analysis.motion.spectrum as spectrum_module
from faultgouge.analysis import Configuration, Packing, Spectrum, dynamical_matrix, spectrum
from faultgouge.pywrap import Engine, equilibrate, settle

HEAD = """## All eigenvalues

`spectrum` by LAPACK and in slices of the spectrum, each in a process of its own: disks after ten increments of F_x by
2/N, and spheres of `gran/hertz/history` on a slope. The last column compares all complex pairs of both, relative to
each. LAPACK's time grows with the cube of the coordinates, so that the largest packing has slices alone.

| | coordinates | pairs | LAPACK, s | GB | slices, s | GB | apart |
|---|---|---|---|---|---|---|---|"""

DENSE = 4000
"""Coordinates up to which LAPACK is asked."""


def disks(count: int) -> Packing:
    """A settled packing under F_x."""
    here = settle(scene(count))
    with Engine(here.packing) as engine:
        for k in range(1, 11):
            here = equilibrate(engine, here, 2 * k / count)
    return here.packing


def spheres(count: int) -> Configuration:
    """A bed on a slope."""
    return bed("gran/hertz/history", count, 0.1, 40.0)


def measured(packing: Packing | Configuration, sliced: float) -> tuple[Spectrum, float, float]:
    """A spectrum, in slices from so many coordinates on, with its seconds and GB; in a process of its own."""
    with multiprocessing.get_context("fork").Pool(1) as pool:
        return pool.apply(_measure, (packing, sliced))


def _measure(packing: Packing | Configuration, sliced: float) -> tuple[Spectrum, float, float]:
    spectrum_module.SLICED = sliced  # type: ignore[assignment]  # infinity: no slices at all
    begin = time.process_time()
    found = spectrum(packing)
    return found, time.process_time() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def difference(one: Spectrum, other: Spectrum) -> float:
    """The largest difference of a pair, relative to the pair, and infinite if there are more of one kind."""
    a, b = (np.array([pair.eigenvalue for pair in each.pairs]) for each in (one, other))
    if len(a) != len(b):
        return np.inf
    return float((np.abs(a[:, None] - b).min(axis=1) / np.abs(a)).max(initial=0.0))


def main() -> None:
    """Print the section."""
    print(HEAD, flush=True)
    few = "--fast" in sys.argv
    for make, counts in ((disks, (100,) if few else (100, 300, 1000, 3000)), (spheres, (50,) if few else (150,))):
        for count in counts:
            packing = make(count)
            size = dynamical_matrix(packing)[0].shape[0]
            found, seconds, memory = measured(packing, 0)
            dense = " | | "
            apart = ""
            if size <= DENSE:
                known, lapack_seconds, lapack_memory = measured(packing, np.inf)
                dense, apart = f" | {lapack_seconds:.2f} | {lapack_memory:.2f}", f"{difference(known, found):.0e}"
            row = (
                f"{count} {make.__name__} | {size} | {len(found.pairs)}{dense} | {seconds:.2f} | {memory:.2f} | {apart}"
            )
            print(f"| {row} |", flush=True)


if __name__ == "__main__":
    main()
