"""`stability` of large beds of spheres, and its rates beside Bloch's theorem: `python benchmarks/verdict.py [--fast]`.

Fifty spheres are poured on a slope in LAMMPS, come to rest, and are copied side by side in a periodic box. By Bloch's
theorem a motion of the copies is one of the fifty times exp(i k r), with a wave vector k that fits the box. So the
eigenvalues of thousands of spheres, with all contacts sticking, are those of a small matrix for each wave vector, of
which two opposite ones have the same but for the sign of Im s.
"""

import multiprocessing
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from faultgouge.analysis import Configuration, LinearisedContacts, stability
from faultgouge.analysis.contacts import PER_CONTACT
from faultgouge.analysis.motion.linear import linear_verdict
from faultgouge.analysis.motion.motion import Motion

sys.path.insert(0, str(Path(__file__).parents[1]))
from research.lammps_laws.compute import pour, rest

HEAD = """## Does a bed of thousands of spheres move?

`stability` of beds that are poured in LAMMPS, and of copies of fifty spheres side by side, with contacts at Coulomb's
bound. D is the mean square displacement: its fastest growth or slowest decay, or its largest value over the square of
the push where contacts at the bound bring the motion to rest.

| | spheres | at the bound | verdict | D | s | GB |
|---|---|---|---|---|---|---|"""

BLOCH = """
With all contacts sticking, the slowest decay 2 Re s by the certificate and the slow motions one by one
([how](contacts_at_bound.md)), and by Bloch's theorem:

| copies of fifty | coordinates | found | its error | by Bloch | s | GB |
|---|---|---|---|---|---|---|"""

BEDS = {
    "at rest": ("granular hertz, mindlin/force", 0.3, 40.0),
    "growing": ("gran/hertz/history", 0.3, 4.0),
}
"""Law, slope and dashpots of the fifty spheres."""

NEIGHBOURS = 5
"""Copies along each axis in which those that a copy touches are told apart."""


def bed(law: str, count: int, slope: float, dashpot: float) -> Configuration:
    """Spheres at rest on a slope."""
    with TemporaryDirectory() as folder:
        lmp = pour(law, 3, count, 0.5, 1, Path(folder) / "log", dashpot)
        lmp.command(f"variable slope equal {slope}")
        found = rest(lmp)
        lmp.close()
    if found is None:
        sys.exit(f"{count} spheres on a slope of {slope} do not come to rest: take a smaller slope")
    return found


def tiled(cell: Configuration, across: int, deep: int) -> Configuration:
    """Copies of spheres that are periodic in x and y, side by side, in balance as they are."""
    c, copies, edges = cell.contacts, across * deep, np.diag(cell.box)[:2]
    branch = np.where(np.isfinite(c.distance), c.distance, 0.0)[:, None] * c.normal
    apart = (cell.position[c.i] - np.where(c.wall[:, None], cell.position[c.i], cell.position[c.j] + branch))[:, :2]
    image = np.round(apart / edges).astype(int)  # of j, which the contact is with
    x, y = (place.ravel()[:, None] for place in np.divmod(np.arange(copies), deep))
    other = (x + image[:, 0]) % across * deep + (y + image[:, 1]) % deep
    given = {name: np.concatenate([getattr(c, name)] * copies) for name in PER_CONTACT}
    given["i"] = (c.i + len(cell) * np.arange(copies)[:, None]).ravel()
    given["j"] = np.where(c.wall, c.j, c.j + len(cell) * other).ravel()
    shift = np.column_stack([edges[0] * x, edges[1] * y, 0 * x])
    each = {name: np.concatenate([getattr(cell, name)] * copies) for name in ("radius", "mass", "inertia", "load")}
    return Configuration(
        dimension=3,
        position=(cell.position + shift[:, None]).reshape(-1, 3),
        contacts=LinearisedContacts(**given),
        box=cell.box * np.array([across, deep, 1])[:, None],
        origin=cell.origin,
        periodic=cell.periodic,
        **each,
    )


def slowest_by_bloch(cell: Configuration, across: int, deep: int) -> float:
    """The largest 2 Re s of copies, of all wave vectors."""
    motion = Motion.of(tiled(cell, NEIGHBOURS, NEIGHBOURS), sliding=False)
    size = len(motion.active) // NEIGHBOURS**2

    def couplings(matrix: csr_array) -> np.ndarray:
        """What the first copy feels of each copy, shape (5, 5, size, size)."""
        return np.moveaxis(matrix[:size].toarray().reshape(size, NEIGHBOURS, NEIGHBOURS, size), 0, 2)

    parts = [couplings(matrix) for matrix in (motion.stiffness, motion.damping)]
    steps = np.fft.fftfreq(NEIGHBOURS, 1 / NEIGHBOURS)  # 0, 1, 2, -2, -1 copies away
    largest = -np.inf
    for x, y in np.ndindex(across, deep):
        if (x, y) > (-x % across, -y % deep):
            continue
        phase = np.exp(2j * np.pi * np.add.outer(x * steps / across, y * steps / deep))
        a, g = (np.tensordot(phase, part, 2) for part in parts)
        scale = np.sqrt(np.abs(a).sum(axis=1).max())  # so that both halves weigh as much
        first_order = np.block([[np.zeros_like(a), scale * np.eye(size)], [-a / scale, -g]])
        largest = max(largest, 2 * float(np.linalg.eigvals(first_order).real.max()))
    return largest


def alone(compute: Callable[..., Any], *given: Any) -> tuple[Any, float, float]:
    """A result with its seconds and GB, from a process of its own."""
    with multiprocessing.get_context("fork").Pool(1) as pool:
        return pool.apply(_timed, (compute, *given))


def _timed(compute: Callable[..., Any], *given: Any) -> tuple[Any, float, float]:
    begin = time.process_time()
    found = compute(*given)
    return found, time.process_time() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def sticking(cell: Configuration, across: int, deep: int) -> tuple[float, float]:
    """The slowest 2 Re s of copies whose contacts all stick, and its error."""
    found = linear_verdict(Motion.of(tiled(cell, across, deep), sliding=False))
    return found.growth_rate, found.error


def main() -> None:
    """Print the section."""
    few = "--fast" in sys.argv
    print(HEAD, flush=True)
    cells = {name: bed(law, 50, slope, dashpot) for name, (law, slope, dashpot) in BEDS.items()}
    beds = {f"fifty, {name}": cell for name, cell in cells.items()}
    beds |= {"copies of the growing fifty": tiled(cells["growing"], *((2, 2) if few else (15, 16)))}
    beds |= {f"poured, dashpots {g:g}": bed("gran/hertz/history", 50 if few else 200, 0.0, g) for g in (40.0, 4.0)}
    for name, here in beds.items():
        found, seconds, memory = alone(stability, here)
        told = found.one_sided or {"growth_rate": found.growth_rate}
        bounded = found.stable is not False and found.one_sided
        size = f"{told['amplification']:.3g}" if bounded else f"exp({told['growth_rate']:.3g} t)"
        verdict = {True: "rests", False: "grows", None: "not known"}[found.stable]
        row = (name, len(here), found.at_bound, verdict, size, f"{seconds:.0f}", f"{memory:.2f}")
        print("| " + " | ".join(map(str, row)) + " |", flush=True)
    print(BLOCH, flush=True)
    for copies in ((2, 2),) if few else ((4, 5), (8, 8)):
        (rate, error), seconds, memory = alone(sticking, cells["at rest"], *copies)
        known = slowest_by_bloch(cells["at rest"], *copies)
        row = ("{} x {}".format(*copies), cells["at rest"].coordinates * np.prod(copies), f"{rate:.7f}", f"{error:.0e}")
        print("| " + " | ".join(map(str, (*row, f"{known:.7f}", f"{seconds:.0f}", f"{memory:.2f}"))) + " |", flush=True)


if __name__ == "__main__":
    main()
