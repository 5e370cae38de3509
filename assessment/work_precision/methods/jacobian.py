r"""Error of the stability operator K over the time that it takes, and over the step where it is a difference.

A central difference errs by :math:`h^2 |F'''|/6` and by the rounding of the coordinates, :math:`\epsilon |x| k/h`:
with :math:`f_n = k_n \delta^{3/2}` the two meet at a relative error that goes as :math:`\epsilon^{2/3}`. The third
derivative is largest at the smallest overlap, and for steps above that the contact opens. Where slips change sign the
force has a kink in its second derivative, which adds a term of first order for steps above the smallest slip.

The forces of a displaced packing are computed in any arithmetic: doubles, extended precision, complex numbers. Their
law is that of the analysis and of the pair style, with slips that advance along the midpoint tangent of the
displacement. Comparisons look at real parts and nothing takes a modulus, so that F is analytic wherever its real
counterpart is smooth, and a *complex step*

.. math:: \frac{\partial F}{\partial q_k} = \frac{\mathrm{Im}\, F(q + i h e_k)}{h}

has neither cancellation nor, with a tiny h, truncation.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....analysis import Packing, stiffness_matrix
from ....analysis.arrays import Floats
from ....pywrap import Engine
from .work_precision_study import Run, Settings, Study, Theory, best_of, study_of, timed_points

ANALYTIC, PAPER, COMPLEX = "analytic", "analytic, paper's form", "complex step"
LAMMPS = "central differences in LAMMPS"

Numbers = NDArray[Any]


def net_force(packing: Packing, displacement: Numbers) -> Numbers:
    """F(q) without the load, for many displacements at once.

    Parameters
    ----------
    packing : Packing
        Where the displacements begin.
    displacement : ndarray, shape (3N, m)
        Columns (dx.., dy.., R dtheta..), length; their type is that of the result.

    Returns
    -------
    ndarray, shape (3N, m)
        Forces (Fx.., Fy.., T/R..) of the contacts of the packing. A contact that opens exerts no force, and no new
        contact forms.
    """
    n, m = len(packing), displacement.shape[1]
    real = displacement.real.dtype
    contacts, law = packing.contacts, packing.law
    kn, kt, mu = (real.type(number) for number in (law.kn, law.kt, law.mu))
    i, j, floor = contacts.i, np.where(contacts.floor, n, contacts.j), contacts.floor[:, None]
    q = np.concatenate([displacement.reshape(3, n, m), np.zeros((3, 1, m), displacement.dtype)], axis=1)
    position = np.concatenate([packing.position.T.astype(real), np.zeros((2, 1), real)], axis=1)[:, :, None]

    before = position[:, i] - position[:, j]
    if packing.box_length is not None:
        before[0] -= real.type(packing.box_length) * np.round(before[0] / real.type(packing.box_length))
    before[0] = np.where(floor, 0, before[0])
    moved = q[:2, i] - q[:2, j]
    turning = np.stack([np.where(floor, 0, moved[0]), moved[1]])
    after, middle = before + turning, before + turning / 2
    middle = np.where(floor, before, middle)
    distance = np.sqrt(after[0] ** 2 + after[1] ** 2)
    normal = after / distance
    reach = packing.radius[i].astype(real) + np.append(packing.radius, 0.0)[j].astype(real)
    overlap = reach[:, None] - distance
    overlap = np.where(overlap.real > 0, overlap, 0)

    along = (middle[0] * moved[1] - middle[1] * moved[0]) / np.sqrt(middle[0] ** 2 + middle[1] ** 2)
    slip = contacts.slip.astype(real)[:, None] + along - q[2, i] - q[2, j]
    limit = mu * (kn / kt) * overlap
    slip = np.where(slip.real > limit.real, limit, np.where(slip.real < -limit.real, -limit, slip))
    x = np.where(slip.real < 0, -slip, slip) / np.where(limit == 0, 1, limit)
    growth = law.growth(overlap)
    fn, ft = kn * overlap * growth, -kt * growth * (1 + x - x * x) * slip

    on_i = np.stack([fn * normal[0] - ft * normal[1], fn * normal[1] + ft * normal[0], -ft])
    total = np.zeros_like(q)
    for axis, sign in enumerate((-1, -1, 1)):
        np.add.at(total[axis], i, on_i[axis])
        np.add.at(total[axis], j, sign * on_i[axis])
    return total[:, :n].reshape(3 * n, m)


def complex_step(packing: Packing, number: type = np.complex128) -> Floats:
    """K = -dF/dq by complex steps, shape (3N, 3N), in doubles or with ``numpy.clongdouble`` in extended precision."""
    tiny = np.finfo(number).tiny ** 0.25  # any step whose square is nothing beside one
    identity: Numbers = np.eye(3 * len(packing), dtype=number)
    return -net_force(packing, 1j * tiny * identity).imag / tiny


def in_lammps(engine: Engine, packing: Packing, step: float) -> tuple[Floats, int]:
    """K by central differences of LAMMPS's forces, shape (3N, 3N), a column at a time; and how many forces it took."""
    matrix = np.empty((3 * len(packing),) * 2)
    for column, unit in enumerate(np.eye(len(matrix))):
        forces = []
        for sign in (1, -1):
            engine.displace(packing, sign * step * unit)
            forces.append(engine.net_force)
        matrix[:, column] = (forces[1] - forces[0]) / (2 * step)
    return matrix, 2 * len(matrix)


def jacobian(settings: Settings) -> Study:
    """The study, on a packing under shear, so that slips are not zero."""
    packing = settings.at(0.02).packing
    exact = complex_step(packing, np.clongdouble)
    scale = np.abs(exact).max()
    steps, size = np.logspace(-11, -5, 4 if settings.quick else 7), 3 * len(packing)
    with Engine(packing) as engine:
        runs: list[Run[Floats]] = [
            (ANALYTIC, None, lambda: (stiffness_matrix(packing).toarray(), 1)),
            (PAPER, None, lambda: (stiffness_matrix(packing, "paper").toarray(), 1)),
            (COMPLEX, None, lambda: (complex_step(packing), size)),
            *((LAMMPS, step, partial(in_lammps, engine, packing, step)) for step in steps.tolist()),
        ]
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
            "size": size,
            "milliseconds": best_of(points)[ANALYTIC].seconds * 1e3,
            "overlap": packing.geometry.overlap.min(),
        },
        reference_error=own,
        theory=(
            Theory("truncation + rounding", tuple((truncation + rounding).tolist()), tuple(fine.tolist())),
            Theory("overlaps as plain differences", (analytic,)),
        ),
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
