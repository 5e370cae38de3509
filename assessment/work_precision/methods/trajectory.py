r"""Error of a trajectory over the time step.

Three disks: one is pressed down between two others that lie on the floor. They roll and slide apart. All four
contacts stay closed and slide at some time, two stick again, two turn by 16 and 19 degrees, and the overlaps swing by
their own size. The packing is soft, so that all this shows in the slips.

Velocity Verlet is of second order as long as the slip increment is. The force is continuously differentiable at
Coulomb's bound and the clamp is applied at the end of the step, so that passing the bound costs no order. A contact
that *forms* during the run would: its slip begins with zero at the end of a step.

A readable version in NumPy is the reference for the motion that the pair style integrates. A step moves the disks by
:math:`\mathbf v\,\Delta t` with the velocities of the half step, advances each slip by

.. math:: \Delta s = \boldsymbol\tau \cdot \Delta(\mathbf r_i - \mathbf r_j) - (\Delta u_i + \Delta u_j)

and clamps it. While a contact turns by :math:`\Delta\varphi` and is compressed by :math:`\Delta\delta`, the tangent at
the end of the step errs by :math:`\tfrac12 \Delta\varphi\, \Delta\delta` in each step, and so by the first order of
:math:`\Delta t` in a given time; the tangent at the middle by the second order.
"""

from __future__ import annotations

from functools import partial
from typing import Literal

import numpy as np

from ....analysis import MindlinLaw, Packing, touching
from ....analysis.arrays import Floats
from ....pywrap import Engine
from .work_precision_study import Point, Settings, Study, Theory, fit_order, study_of, time_jobs

TIME = 2.0
"""Length of the run: two swings of the overlaps."""

COARSEST = 200
"""Steps of the coarsest run: 60 to a period of the fastest mode."""

LAMMPS, MIDPOINT, END = "LAMMPS, tangent at the middle", "NumPy, tangent at the middle", "NumPy, tangent at the end"
Tangent = Literal["midpoint", "end"]
TANGENTS: dict[str, Tangent] = {MIDPOINT: "midpoint", END: "end"}


def three_disks() -> Packing:
    """A disk between two on the floor, under a load that is not straight down; forces are out of balance."""
    overlap, gap = 0.03, 0.02
    radius = np.array([0.5, 0.5, 0.4])
    x, y = 0.5 * (1 + gap), 0.5 - overlap
    height = y + np.sqrt((0.9 - overlap) ** 2 - x**2)
    position = np.array([[-x, y], [x, y], [0.0, height]])
    law = MindlinLaw(kn=100.0, kt=100.0 * 2 / 7, mu=0.5)
    contacts = touching(position, radius)
    return Packing(
        position=position, radius=radius, contacts=contacts, law=law, top=np.array([False, False, True]), fx=0.3, fy=3.0
    )


def in_lammps(engine: Engine, packing: Packing, steps: int) -> Floats:
    """(x, y, u) after `TIME`, by the pair style; shape (3, N), length."""
    engine.restore(packing)
    with engine.undamped(TIME / steps) as dynamics:
        dynamics.advance(steps)
        end = engine.packing
    return np.array([*end.position.T, end.scaled_angle])


def verlet(packing: Packing, tangent: Tangent, dt: float, steps: int) -> Floats:
    """(x, y, u) of the disks after so many steps from rest, shape (3, N), length; no contact may form or open."""
    i, j, pair = packing.contacts.i, packing.contacts.j, ~packing.contacts.floor
    mass = packing.mass * np.array([[1.0], [1.0], [packing.inertia_factor]])
    velocity = np.zeros_like(mass)
    for _ in range(steps):
        velocity += 0.5 * dt / mass * packing.net_force.reshape(mass.shape)
        step = dt * velocity
        moved, turned = step[:2, i] - step[:2, j] * pair, step[2, i] + step[2, j] * pair
        position, angle = packing.position + step[:2].T, packing.angle + step[2] / packing.radius
        there = packing.moved(position, angle, packing.contacts)
        middle = packing.moved(position - 0.5 * step[:2].T, angle, packing.contacts)
        along = (middle if tangent == "midpoint" else there).geometry.tangent
        slip = packing.contacts.slip + np.sum(along.T * moved, axis=0) - turned
        clamped = packing.law.clamped(there.geometry.overlap, slip)
        packing = packing.moved(position, angle, packing.contacts.slipped(clamped))
        velocity += 0.5 * dt / mass * packing.net_force.reshape(mass.shape)
    return np.array([*packing.position.T, packing.scaled_angle])


def _reference(engine: Engine, packing: Packing, finest: int) -> tuple[Floats, float]:
    """Richardson's extrapolation of LAMMPS's runs with `finest` and half as many steps, and its error."""
    runs = [in_lammps(engine, packing, steps) for steps in (finest // 4, finest // 2, finest)]
    coarse, fine = ((4 * runs[k + 1] - runs[k]) / 3 for k in (0, 1))
    return fine, float(np.abs(fine - coarse).max())


def trajectory(settings: Settings) -> Study:
    """The study: LAMMPS and NumPy with the tangent at the middle of the step, NumPy with the tangent at its end."""
    packing = three_disks()
    fine, coarse = (8, 5) if settings.quick else (10, 7)
    with Engine(packing) as engine:
        exact, reference_error = _reference(engine, packing, 204_800 if settings.quick else 819_200)
        jobs = {(LAMMPS, n): partial(in_lammps, engine, packing, n) for n in _steps(fine)}
        for method, tangent in TANGENTS.items():
            jobs |= {(method, n): partial(verlet, packing, tangent, TIME / n, n) for n in _steps(coarse)}
        found, seconds = time_jobs([*jobs.values()], settings)
    ends = dict(zip(jobs, found, strict=True))
    points = tuple(
        Point(method, TIME / steps, float(np.abs(end - exact).max()), spent, steps)
        for ((method, steps), end), spent in zip(ends.items(), seconds, strict=True)
    )
    same = min(point.error for point in points if point.method == END)
    numbers = {
        "apart": max(float(np.abs(ends[MIDPOINT, n] - ends[LAMMPS, n]).max()) for n in _steps(coarse)),
        "needed": next(p for p in points if p.method == MIDPOINT and p.error < same).evaluations,
        "finest": _steps(coarse)[-1],
    }
    expected = {LAMMPS: 2, MIDPOINT: 2, END: 1}
    return study_of(
        "trajectory",
        points=points,
        numbers=numbers,
        reference_error=reference_error,
        orders=tuple(fit_order(points, name, order, least=100 * reference_error) for name, order in expected.items()),
        theory=_slopes(fine),
    )


def _slopes(count: int) -> tuple[Theory, ...]:
    """Lines of the first and of the second order over the time steps of so many runs."""
    first, last = TIME / COARSEST, TIME / COARSEST / 2 ** (count - 1)
    return tuple(
        Theory(f"order {order}", (start, start * (last / first) ** order), (first, last))
        for order, start in ((1, 4e-4), (2, 2e-4))
    )


def _steps(count: int) -> list[int]:
    return [COARSEST * 2**k for k in range(count)]
