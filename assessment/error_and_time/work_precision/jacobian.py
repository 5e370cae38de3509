r"""Error of the stability operator K over the time that it takes, and over the step where it is a difference.

A central difference errs by :math:`h^2 |F'''|/6` and by the rounding of the coordinates, :math:`\epsilon |x| k/h`:
with :math:`f_n = k_n \delta^{3/2}` the two meet at a relative error that goes as :math:`\epsilon^{2/3}`. The third
derivative is largest at the smallest overlap, and for steps above that the contact opens. Where slips change sign the
force has a kink in its second derivative, which adds a term of first order for steps above the smallest slip.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ....analysis import Packing, stiffness_matrix
from ....analysis.packing.packing import Floats
from ....pywrap import Engine
from .forces import central_differences, complex_step
from .study import Run, Settings, Study, Theory, best_of, study_of, timed_points

ANALYTIC, PAPER, COMPLEX = "analytic", "analytic, paper's form", "complex step"
DIFFERENCES, LAMMPS = "central differences", "central differences in LAMMPS"


def in_lammps(engine: Engine, packing: Packing, step: float) -> Floats:
    """K by central differences of LAMMPS's forces, shape (3N, 3N), a column at a time."""
    matrix = np.empty((3 * len(packing),) * 2)
    for column, unit in enumerate(np.eye(len(matrix))):
        forces = []
        for sign in (1, -1):
            engine.displace(packing, sign * step * unit)
            forces.append(engine.net_force)
        matrix[:, column] = (forces[1] - forces[0]) / (2 * step)
    return matrix


def jacobian(settings: Settings) -> Study:
    """The study, on a packing under shear, so that slips are not zero."""
    packing = settings.at(0.02).packing
    exact = complex_step(packing, np.clongdouble)
    scale = np.abs(exact).max()
    steps = np.logspace(-11, -5, 5 if settings.quick else 13)
    with Engine(packing) as engine:
        runs = _runs(engine, packing, steps)
        points = timed_points(runs, settings, lambda matrix: float(np.abs(matrix - exact).max() / scale))
    own, analytic = (_rounding(packing, number) / float(scale) for number in (np.longdouble, np.float64))
    fine = np.geomspace(steps[0], steps[-1], 60)
    truncation, rounding = _difference_errors(packing, float(scale), fine)
    return study_of(
        "jacobian",
        points=points,
        numbers={
            "fx": packing.fx,
            "disks": len(packing),
            "size": 3 * len(packing),
            "milliseconds": best_of(points)[ANALYTIC].seconds * 1e3,
            "overlap": packing.geometry.overlap.min(),
        },
        reference_error=own,
        theory=(
            Theory("truncation + rounding", tuple((truncation + rounding).tolist()), tuple(fine.tolist())),
            Theory("overlaps as plain differences", (analytic,)),
        ),
    )


def _runs(engine: Engine, packing: Packing, steps: Floats) -> list[Run[Floats]]:
    """What computes K, by steps of differences."""
    size = 3 * len(packing)
    runs: list[Run[Floats]] = [
        (ANALYTIC, None, partial(_counted, 1, lambda: stiffness_matrix(packing).toarray())),
        (PAPER, None, partial(_counted, 1, lambda: stiffness_matrix(packing, "paper").toarray())),
        (COMPLEX, None, partial(_counted, size, complex_step, packing)),
    ]
    for step in steps:
        runs.append((DIFFERENCES, step, partial(_counted, 2 * size, central_differences, packing, step)))
    for step in steps[::2]:
        runs.append((LAMMPS, step, partial(_counted, 2 * size, in_lammps, engine, packing, step)))
    return runs


def _counted(evaluations: int, compute: Callable[..., Floats], *arguments: Any) -> tuple[Floats, int]:
    return compute(*arguments), evaluations


def _rounding(packing: Packing, number: type) -> float:
    """Error of the stiffness of the contact with the smallest overlap, which is a difference of lengths, force /
    length."""
    overlap, distance = packing.geometry.overlap, packing.geometry.distance
    unit = 0.5 * float(np.finfo(number).eps) * float(distance.max())
    return float(packing.law.normal_curvature(overlap.min())) * unit


def _difference_errors(packing: Packing, scale: float, steps: Floats) -> tuple[Floats, Floats]:
    """Truncation of f_n at the smallest overlap and rounding of the coordinates at the stiffest contact, over steps."""
    law, overlap = packing.law, packing.geometry.overlap
    third = abs(float(law.normal_curvature(overlap.min(), order=3)))
    stiffest = float(law.normal_stiffness(overlap).max())
    unit = 0.5 * float(np.finfo(float).eps) * float(np.abs(packing.position).max())
    return steps**2 * third / 6 / scale, stiffest * unit / steps / scale
