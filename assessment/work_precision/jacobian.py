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

from ...analysis import Packing, stiffness_matrix
from ...analysis.arrays import Floats
from ...pywrap import Engine
from .study import Run, Settings, Study, study_of, timed

ANALYTIC, DIFFERENCES = "analytic", "central differences in LAMMPS"


def complex_step(packing: Packing, number: type = np.complex128) -> Floats:
    """K = -dF/dq by complex steps, shape (3N, 3N), in doubles or with ``numpy.clongdouble`` in extended precision.

    A contact knows the relative motion of its two disks alone, so that three displacements of the first give all
    derivatives of its forces. The floor is a disk more, of radius zero, above which a disk is by its y alone.
    """
    n, real, tiny = len(packing), type(number(0).real), np.finfo(number).tiny ** 0.25  # tiny^2 is nothing beside one
    i, floor, law = packing.contacts.i, packing.contacts.floor, packing.law
    j = np.where(floor, n, packing.contacts.j)
    position = np.vstack([packing.position, np.zeros((1, 2))]).astype(real)
    radius, slip = np.append(packing.radius, 0.0).astype(real), packing.contacts.slip.astype(real)
    kn, kt, mu = (real(value) for value in (law.kn, law.kt, law.mu))
    before = (position[i] - position[j]).T
    if packing.box_length is not None:
        before[0] -= real(packing.box_length) * np.round(before[0] / real(packing.box_length))
    before[0, floor] = 0
    tangent = np.array([-before[1], before[0]]) / np.sqrt(before[0] ** 2 + before[1] ** 2)
    matrix = np.zeros((3, n + 1, 3, n + 1), real)
    for axis, opposite in enumerate((-1, -1, 1)):
        moved: NDArray[Any] = np.zeros((3, len(i)), number)
        moved[axis] = 1j * tiny
        along = tangent[0] * moved[0] + tangent[1] * moved[1]  # midpoint and start differ by the square of the step
        x, y = before[0] + np.where(floor, 0, moved[0]), before[1] + moved[1]
        distance = np.sqrt(x * x + y * y)
        overlap = radius[i] + radius[j] - distance
        limit = mu * (kn / kt) * overlap
        s = slip + along - moved[2]
        s = np.where(s.real > limit.real, limit, np.where(s.real < -limit.real, -limit, s))
        share = np.where(s.real < 0, -s, s) / limit
        growth = law.growth(overlap)
        fn, ft = kn * overlap * growth, -kt * growth * (1 + share - share * share) * s
        forces = (fn * x - ft * y) / distance, (fn * y + ft * x) / distance, -ft
        for row, (force, back) in enumerate(zip(forces, (-1, -1, 1), strict=True)):
            slope = -force.imag / tiny
            for first, second, sign in ((i, i, 1), (i, j, opposite), (j, i, back), (j, j, back * opposite)):
                np.add.at(matrix[row, :, axis], (first, second), sign * slope)
    return matrix[:, :n, :, :n].reshape(3 * n, 3 * n)


def jacobian(settings: Settings) -> Study:
    """The study, on a packing under shear, so that slips are not zero."""
    packing = settings.at(0.02).packing
    law, overlap, size = packing.law, packing.geometry.overlap, 3 * len(packing)
    exact = complex_step(packing, np.clongdouble)
    scale = float(np.abs(exact).max())
    steps = np.logspace(-11, -5, 4 if settings.quick else 7)
    with Engine(packing) as engine:

        def in_lammps(step: float) -> tuple[Floats, int]:
            """Central differences of LAMMPS's forces, a column at a time, and how many forces it took."""
            matrix = np.empty((size, size))
            for column, unit in enumerate(np.eye(size)):
                forces = []
                for sign in (1, -1):
                    engine.displace(packing, sign * step * unit)
                    forces.append(engine.net_force)
                matrix[:, column] = (forces[1] - forces[0]) / (2 * step)
            return matrix, 2 * size

        runs: list[Run[Floats]] = [
            (ANALYTIC, None, lambda: (stiffness_matrix(packing).toarray(), 1)),
            ("analytic, paper's form", None, lambda: (stiffness_matrix(packing, "paper").toarray(), 1)),
            ("complex step", None, lambda: (complex_step(packing), 3)),
            *((DIFFERENCES, step, partial(in_lammps, step)) for step in steps.tolist()),
        ]
        points, _ = timed(runs, settings, lambda matrix: float(np.abs(matrix - exact).max()) / scale)
    # the stiffness of the contact with the smallest overlap, which is a difference of lengths
    lost = float(law.normal_curvature(overlap.min()) * packing.geometry.distance.max()) / scale
    own, analytic = (0.5 * float(np.finfo(number).eps) * lost for number in (np.longdouble, np.float64))
    # truncation of f_n at the smallest overlap and rounding of the coordinates at the stiffest contact
    fine = np.geomspace(steps[0], steps[-1], 60)
    truncation = fine**2 * abs(float(law.normal_curvature(overlap.min(), order=3))) / 6 / scale
    unit = 0.5 * float(np.finfo(float).eps) * float(np.abs(packing.position).max())
    rounding = float(law.normal_stiffness(overlap).max()) * unit / fine / scale
    theory = [("truncation + rounding", truncation + rounding, fine), ("overlaps as plain differences", analytic, ())]
    return study_of("jacobian", points, own, {"packing": packing}, theory)
