r"""Digits that the eigenvalues lose on the way through a file.

An overlap is a small difference of coordinates: an error :math:`\Delta x` of these changes the stiffness
:math:`\tfrac32 k_n \delta^{1/2}` of a contact by the share :math:`\Delta x/(2\delta)`, and the overlaps of a packing
under load are 1e-5 to 1e-3 of a radius. So text with the six digits of ``%g``, and the float32 of a trajectory, lose
most of the stiffness of the weakest contacts, and contacts open that were closed. Besides, a trajectory has no slips.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ....analysis import Packing, RunFile, read_dump, stiffness_matrix, touching
from ....analysis.motion.eigenvalues import Complexes
from ....analysis.operators.damping import coordinate_mass
from ....pywrap import Engine
from .work_precision_study import Run, Settings, Study, Theory, study_of, timed_points

TEXT, HDF5 = "text", "HDF5 (run.h5)"
SINGLE, NO_SLIPS = "float32 trajectory, slips kept", "positions in doubles, slips lost"
G = 6
"""Digits of %g."""


def eigenvalues(packing: Packing) -> Complexes:
    """All 3N eigenvalues of M^(-1) K, zeros of rattlers included, 1 / time^2."""
    return np.linalg.eigvals(stiffness_matrix(packing).toarray() / coordinate_mass(packing)[:, None])


def loss(found: Packing, exact: Complexes) -> float:
    """Largest change of an eigenvalue, in units of the largest; eigenvalues are matched to their nearest."""
    from scipy.optimize import linear_sum_assignment  # slow to import

    apart = np.abs(eigenvalues(found)[:, None] - exact)
    return float(apart[linear_sum_assignment(apart)].max() / np.abs(exact).max())


def through_text(stem: Path, digits: int, folder: Path) -> tuple[Packing, int]:
    """Write the deck's dumps with another number of digits and read them back; also their size in bytes.

    A format of LAMMPS's and one of Python's write the same digits.
    """
    size = 0
    for suffix in (".disks", ".contacts", ".params"):
        text = stem.with_suffix(suffix).read_text()
        if suffix != ".params":
            text = _round_dump(text, digits)
        (folder / f"copy{suffix}").write_text(text)
        size += len(text)
    return read_dump(folder / "copy.disks"), size


def through_hdf5(packing: Packing, folder: Path) -> tuple[Packing, int]:
    """Write run.h5 and read it back; also its size in bytes."""
    path = folder / "run.h5"
    with RunFile.create(path, packing) as file:
        file.append(packing)
    with RunFile(path) as file:
        return file.packing(), path.stat().st_size


def through_trajectory(packing: Packing) -> tuple[Packing, int]:
    """Positions in float32, as MDAnalysis reads them. Angles and slips come from elsewhere; new contacts have none."""
    positions = np.column_stack([packing.position, np.zeros(len(packing))]).astype(np.float32)
    position, known = positions[:, :2].astype(np.float64), packing.contacts
    found = touching(position, packing.radius, packing.box_length)
    slips = {(i, j): slip for i, j, slip in zip(known.i, known.j, known.slip, strict=True)}
    slip = [slips.get(pair, 0.0) for pair in zip(found.i, found.j, strict=True)]
    return replace(packing, position=position, contacts=found.slipped(slip)), positions.nbytes


def without_slips(packing: Packing) -> tuple[Packing, int]:
    """The exact positions, with contacts that are found from positions alone and so have no slips."""
    contacts = touching(packing.position, packing.radius, packing.box_length)
    return replace(packing, contacts=contacts), packing.position.nbytes


def dumps(settings: Settings) -> Study:
    """The study, on a packing under shear."""
    packing = settings.at(0.02).packing
    exact = eigenvalues(packing)
    digits = (G, 9, 12, 15, 16, 17) if settings.quick else (G, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17)
    with tempfile.TemporaryDirectory(prefix="faultgouge-") as name:
        runs = _runs(packing, Path(name), digits)
        points = timed_points(runs, settings, lambda found: loss(found, exact))
    overlap, furthest = packing.geometry.overlap, np.abs(packing.position).max()
    stiffest = float(packing.law.normal_stiffness(overlap).max())
    weakest = float(packing.law.normal_curvature(overlap.min())) / stiffest
    # half a unit of the last digit of the largest coordinate
    expected = [0.5 * 10.0 ** (np.ceil(np.log10(furthest)) - n) * weakest for n in digits]
    sizes = [float(point.evaluations or 0) for point in points if point.method == TEXT]
    return study_of(
        "files",
        points=points,
        reference_error=float(np.finfo(float).eps),
        theory=(Theory("rounding of the coordinates", tuple(expected), tuple(sizes)),),
        numbers={
            "disks": len(packing),
            "fx": packing.fx,
            "coarse": next(point.error for point in points if (point.method, point.parameter) == (TEXT, G)),
            "overlap": overlap.min(),
            "furthest": furthest,
        },
    )


def _runs(packing: Packing, folder: Path, digits: Sequence[int]) -> list[Run[Packing]]:
    """The ways through a file: method, digits, and what takes the packing through it."""
    with Engine(packing) as engine:
        engine.dump(folder / "packing")
    return [
        *((TEXT, n, partial(through_text, folder / "packing", n, folder)) for n in digits),
        (HDF5, None, partial(through_hdf5, packing, folder)),
        (SINGLE, None, partial(through_trajectory, packing)),
        (NO_SLIPS, None, partial(without_slips, packing)),
    ]


def _round_dump(text: str, digits: int) -> str:
    """A dump of one snapshot with the numbers of its rows at so many digits; its head stays."""
    lines = text.splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith(("ITEM: ATOMS", "ITEM: ENTRIES"))) + 1
    rows = [" ".join(f"{float(word):.{digits}g}" for word in line.split()) for line in lines[first:]]
    return "\n".join([*lines[:first], *rows]) + "\n"
