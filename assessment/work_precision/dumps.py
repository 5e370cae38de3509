r"""Digits that the eigenvalues lose on the way through a file.

An overlap is a small difference of coordinates: an error :math:`\Delta x` of these changes the stiffness
:math:`\tfrac32 k_n \delta^{1/2}` of a contact by the share :math:`\Delta x/(2\delta)`, and the overlaps of a packing
under load are 1e-5 to 1e-3 of a radius. So text with the six digits of ``%g``, and the float32 of a trajectory, lose
most of the stiffness of the weakest contacts, and contacts open that were closed. Besides, a trajectory has no slips.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ...analysis import Packing, RunFile, read_dump, stiffness_matrix, touching
from ...analysis.motion.eigenvalues import Complexes
from ...analysis.operators.damping import coordinate_mass
from ...pywrap import Engine
from .study import Run, Settings, Study, study_of, timed

TEXT, HDF5 = "text", "HDF5 (run.h5)"
SINGLE, NO_SLIPS = "float32 trajectory, slips kept", "positions in doubles, slips lost"


def eigenvalues(packing: Packing) -> Complexes:
    """All 3N eigenvalues of M^(-1) K, zeros of rattlers included, 1 / time^2."""
    return np.linalg.eigvals(stiffness_matrix(packing).toarray() / coordinate_mass(packing)[:, None])


def dumps(settings: Settings) -> Study:
    """The study, on a packing under shear: ways through a file, each with the bytes that it takes."""
    from scipy.optimize import linear_sum_assignment  # slow to import

    packing = settings.at(0.02).packing
    exact, box, radius = eigenvalues(packing), packing.box_length, packing.radius
    # %g has six
    digits = (6, 9, 12, 15, 16, 17) if settings.quick else (6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17)

    def loss(found: Packing) -> float:
        """Largest change of an eigenvalue, in units of the largest; eigenvalues are matched to their nearest."""
        apart = np.abs(eigenvalues(found)[:, None] - exact)
        return float(apart[linear_sum_assignment(apart)].max() / np.abs(exact).max())

    with tempfile.TemporaryDirectory(prefix="faultgouge-") as name:
        folder = Path(name)
        with Engine(packing) as engine:
            engine.dump(folder / "packing")

        def text(digits: int) -> tuple[Packing, int]:
            """The deck's dumps with other digits: a format of LAMMPS's and one of Python's write the same."""
            size = 0
            for suffix in (".disks", ".contacts", ".params"):
                lines = (folder / f"packing{suffix}").read_text().splitlines()
                heads = [k for k, line in enumerate(lines) if line.startswith(("ITEM: ATOMS", "ITEM: ENTRIES"))]
                for k in range(heads[0] + 1 if heads else len(lines), len(lines)):
                    lines[k] = " ".join(f"{float(word):.{digits}g}" for word in lines[k].split())
                size += (folder / f"copy{suffix}").write_text("\n".join(lines) + "\n")
            return read_dump(folder / "copy.disks"), size

        def hdf5() -> tuple[Packing, int]:
            path = folder / "run.h5"
            with RunFile.create(path, packing) as file:
                file.append(packing)
            with RunFile(path) as file:
                return file.packing(), path.stat().st_size

        def single() -> tuple[Packing, int]:
            """As MDAnalysis reads positions. Angles and slips come from elsewhere; new contacts have no slip."""
            position, known = packing.position.astype(np.float32).astype(np.float64), packing.contacts
            found = touching(position, radius, box)
            slips = dict(zip(zip(known.i, known.j, strict=True), known.slip, strict=True))
            slip = [slips.get(pair, 0.0) for pair in zip(found.i, found.j, strict=True)]
            return replace(packing, position=position, contacts=found.slipped(slip)), 3 * 4 * len(packing)

        def no_slips() -> tuple[Packing, int]:
            return replace(packing, contacts=touching(packing.position, radius, box)), packing.position.nbytes

        runs: list[Run[Packing]] = [(TEXT, n, partial(text, n)) for n in digits]
        runs += [(HDF5, None, hdf5), (SINGLE, None, single), (NO_SLIPS, None, no_slips)]
        points, _ = timed(runs, settings, loss)
    overlap, furthest = packing.geometry.overlap, np.abs(packing.position).max()
    weakest = float(packing.law.normal_curvature(overlap.min()) / packing.law.normal_stiffness(overlap).max())
    # half a unit of the last digit of the largest coordinate
    expected = [0.5 * 10.0 ** (np.ceil(np.log10(furthest)) - n) * weakest for n in digits]
    sizes = [float(point.evaluations or 0) for point in points if point.method == TEXT]
    theory = [("rounding of the coordinates", expected, sizes)]
    return study_of("dumps", points, float(np.finfo(float).eps), {"packing": packing, "furthest": furthest}, theory)
