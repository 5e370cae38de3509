r"""Error of the stability operator K over the time that it takes, and over the step where it is a difference.

A central difference errs by :math:`h^2 |F'''|/6` and by the rounding of the coordinates, :math:`\epsilon |x| k/h`:
with :math:`f_n = k_n \delta^{3/2}` the two meet at a relative error that goes as :math:`\epsilon^{2/3}`. The third
derivative is largest at the smallest overlap, and for steps above that the contact opens. Where slips change sign the
force has a kink in its second derivative, which adds a term of first order for steps above the smallest slip.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from ....analysis import Packing, stiffness_matrix
from ....analysis.packing.packing import Floats
from ....pywrap import Engine
from .forces import central_differences, complex_step
from .study import Point, Settings, Study, Theory
from .timing import timed

METHODS = (
    "analytic",
    "analytic, paper's form",
    "complex step",
    "central differences",
    "central differences in LAMMPS",
)
ANALYTIC, PAPER, COMPLEX, DIFFERENCES, LAMMPS = METHODS


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
    with Engine(packing) as engine:
        return _study(settings, engine, packing)


Run = tuple[str, float | None, int, Callable[[], Floats]]


def _study(settings: Settings, engine: Engine, packing: Packing) -> Study:
    exact = complex_step(packing, np.clongdouble)
    scale = np.abs(exact).max()
    steps = np.logspace(-11, -5, 5 if settings.quick else 13)
    runs = _runs(engine, packing, steps)
    size = 3 * len(packing)
    results = timed([run for *_, run in runs], settings.repeats, settings.progress)
    points = tuple(
        Point(method, parameter, float(np.abs(matrix - exact).max() / scale), seconds, evaluations)
        for (method, parameter, evaluations, _), (matrix, seconds) in zip(runs, results, strict=True)
    )
    overlap = packing.geometry.overlap
    own, analytic = (_rounding(packing, number) / float(scale) for number in (np.longdouble, np.float64))
    fine = np.geomspace(steps[0], steps[-1], 60)
    truncation, rounding = _difference_errors(packing, float(scale), fine)
    return Study(
        name="Jacobian",
        question=f"The stability operator K = -dF/dq of {len(packing)} disks at F_x = {packing.fx:g}, {size} x {size}.",
        error="largest error of an element, in units of the largest |K|",
        parameter="step of the difference, length",
        evaluations="force evaluations",
        abscissa="parameter",
        reference="complex steps in extended precision; its error is the rounding of the smallest overlap in that "
        "precision",
        reference_error=own,
        points=points,
        advice=_advice(points),
        theory=(
            Theory("truncation + rounding", tuple((truncation + rounding).tolist()), tuple(fine.tolist())),
            Theory("overlaps as plain differences", (analytic,)),
        ),
        remarks=(
            f"The smallest overlap is {overlap.min():.1e}: a step above it opens the contact.",
            "A sparse K needs fewer differences than columns, if columns that share no row are displaced together; the "
            "errors are the same.",
        ),
    )


def _runs(engine: Engine, packing: Packing, steps: Floats) -> list[Run]:
    """Method, step, evaluations, and what computes K."""
    size = 3 * len(packing)
    runs: list[Run] = [
        (ANALYTIC, None, 1, lambda: stiffness_matrix(packing).toarray()),
        (PAPER, None, 1, lambda: stiffness_matrix(packing, "paper").toarray()),
        (COMPLEX, None, size, partial(complex_step, packing)),
    ]
    runs += [(DIFFERENCES, step, 2 * size, partial(central_differences, packing, step)) for step in steps]
    runs += [(LAMMPS, step, 2 * size, partial(in_lammps, engine, packing, step)) for step in steps[::2]]
    return runs


def _advice(points: Sequence[Point]) -> tuple[str, str]:
    best = {method: min((p for p in points if p.method == method), key=lambda p: p.error) for method in METHODS}
    return (
        f"Take the analytic K: {best[ANALYTIC].seconds * 1e3:.2g} ms and {best[ANALYTIC].error:.0e}; the "
        f"paper's form, which costs the same, is another operator, off by {best[PAPER].error:.0e}.",
        f"Take complex steps to check a law that changes, {best[COMPLEX].error:.0e} without a step to choose; "
        f"central differences, with a step of {best[LAMMPS].parameter:.0e} and at the best "
        f"{best[LAMMPS].error:.0e}, only for forces that are a black box, such as LAMMPS's.",
    )


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
