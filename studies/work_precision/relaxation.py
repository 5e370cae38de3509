r"""Distance to an equilibrium over the time that it takes to get there.

The load of a packing in equilibrium is raised by one increment. Four ways lead to the next equilibrium: overdamped
dynamics :math:`\mathbf v = \mathbf F/\gamma`, the paper's; velocity Verlet with viscous drag; FIRE; and Newton's
method.

Friction remembers the path, and a minimizer's path is no motion. FIRE (Bitzek et al., Phys. Rev. Lett. 97, 170201,
2006) is made right here in the way that Newton's method is: its unknown is the displacement q from the last
equilibrium, slips advance along the straight path from there, and never from an iterate, so that F(q) is a function
and its root the same for both. F has no energy, but K is nearly symmetric, and FIRE needs no more than the sign of the
power :math:`F \cdot v`. LAMMPS's own minimizers advance no slips and are refused by the pair style.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...analysis import Packing, dynamical_matrix
from ...analysis.packing import Floats
from ...pywrap import Engine, Equilibrium, equilibrate
from ...pywrap.quasistatic import rounding_floor
from .study import Point, Settings, Study, Theory
from .timing import timed

FROM, TO = 0.010, 0.011
"""F_x before and after: an increment far from the onset."""

METHODS = ("overdamped, step of the decks", "overdamped, step from K", "Verlet with drag", "FIRE", "Newton")
OVERDAMPED, FASTER, VERLET, FIRE, NEWTON = METHODS

CHUNK = 200
"""Steps between two looks at the forces, so that the cost is known to so many steps."""

STABLE = 0.95
"""Share of the longest stable time step."""


@dataclass(frozen=True, eq=False)
class Increment:
    """One increment of the load, and where it leads.

    Attributes
    ----------
    engine : Engine
        LAMMPS with the packing.
    start : Equilibrium
        At `FROM`.
    end : Packing
        At `TO`, by Newton's method.
    """

    engine: Engine
    start: Equilibrium
    end: Packing

    def distance(self, packing: Packing) -> float:
        """Largest difference of a coordinate (x, y, R theta) of a disk that is held, length."""
        apart = np.column_stack(
            [packing.position - self.end.position, packing.scaled_angle - self.end.scaled_angle],
        )
        return float(np.abs(np.delete(apart, self.end.rattlers, axis=0)).max())

    def overdamped(self, time_step: float | None, tolerance: float) -> tuple[Packing, int]:
        """The paper's dynamics until no disk feels more than a force."""
        self.engine.restore(self.start.packing)
        self.engine.set_fx(TO)
        steps = self.engine.relax(tolerance, time_step=time_step, chunk=CHUNK).steps
        return self.engine.packing, steps

    def verlet(self, time_step: float, rate: float, steps: int) -> tuple[Packing, int]:
        """Newton's dynamics with viscous drag."""
        self.engine.restore(self.start.packing)
        self.engine.set_fx(TO)
        with self.engine.drag(rate), self.engine.undamped(time_step):
            self.engine.advance(steps)
            return self.engine.packing, steps

    def fire(self, time_step: float, tolerance: float) -> tuple[Packing, int]:
        """FIRE on the displacement from the last equilibrium."""
        self.engine.set_fx(TO)
        free = np.ones((3, len(self.end)), dtype=bool)
        free[:, self.start.packing.rattlers] = False

        def force(displacement: Floats) -> Floats:
            self.engine.displace(self.start.packing, displacement)
            return np.where(free.ravel(), self.engine.net_force, 0.0)

        displacement, evaluations = fire(force, np.zeros(free.size), time_step, tolerance)
        return self.engine.displace(self.start.packing, displacement), evaluations

    def newton(self, tolerance: float | None) -> tuple[Packing, int]:
        """Newton's method; to the rounding floor without a tolerance."""
        found = equilibrate(self.engine, self.start, TO, tolerance)
        return found.packing, found.evaluations


def fire(
    force: Callable[[Floats], Floats], start: Floats, longest: float, tolerance: float, most: int = 20_000
) -> tuple[Floats, int]:
    """A root of F by the fast inertial relaxation engine, unit masses, with the parameters of its authors.

    Parameters
    ----------
    force : callable
        F(q), shape (n,) to (n,).
    start : ndarray, shape (n,)
        Where to begin, at rest.
    longest : float
        Longest time step; a tenth of it is the first.
    tolerance : float
        Largest component of F to end at.
    most : int
        Evaluations after which it ends in any case.

    Returns
    -------
    tuple of ndarray and int
        q, and the number of evaluations of F.
    """
    position, velocity = start.copy(), np.zeros_like(start)
    step, mixing, downhill = 0.1 * longest, 0.1, 0
    now, evaluations = force(position), 1
    while np.abs(now).max() > tolerance and evaluations < most:
        if velocity @ now > 0:
            velocity = (1 - mixing) * velocity + mixing * np.linalg.norm(velocity) / np.linalg.norm(now) * now
            downhill += 1
            if downhill > 5:
                step, mixing = min(1.1 * step, longest), 0.99 * mixing
        else:
            velocity[:], step, mixing, downhill = 0.0, 0.5 * step, 0.1, 0
        velocity = velocity + step * now
        position = position + step * velocity
        now, evaluations = force(position), evaluations + 1
    return position, evaluations


def relaxation(settings: Settings) -> Study:
    """The four ways, each to several accuracies."""
    start = settings.at(FROM)
    with Engine(start.packing) as engine:
        end = equilibrate(engine, start, TO)
        return _study(settings, Increment(engine, start, end.packing))


def _study(settings: Settings, increment: Increment) -> Study:
    end = increment.end
    matrix, _ = dynamical_matrix(end)
    values = np.linalg.eigvals(matrix.toarray()).real
    slowest, fastest = float(values.min()), float(values.max())
    # errors of the forces as independent ones on all coordinates, through K^-1
    rounding = rounding_floor(end) * float(np.sqrt(np.mean(values**-2.0)))
    steps = {FASTER: STABLE * 2 / fastest, VERLET: STABLE * 2 / np.sqrt(fastest)}
    drag = 2 * np.sqrt(slowest)
    runs: list[tuple[str, float, Callable[[], tuple[Packing, int]]]] = []
    for force in np.logspace(-3, -9, 4 if settings.quick else 7):
        runs.append((OVERDAMPED, force, partial(increment.overdamped, None, force)))
        runs.append((FASTER, force, partial(increment.overdamped, steps[FASTER], force)))
        if force > (1e-6 if settings.quick else 1e-7):  # its evaluations are slow, and its convergence steady
            runs.append((FIRE, force, partial(increment.fire, steps[VERLET], force)))
    runs += [(VERLET, n, partial(increment.verlet, steps[VERLET], drag, n)) for n in (50, 100, 200, 400, 800)]
    runs += [(NEWTON, force, partial(increment.newton, force)) for force in (1e-1, 1e-3, 1e-6)]
    runs += [(NEWTON, 0.0, partial(increment.newton, None))]
    results = timed([run for _, _, run in runs], settings.repeats, settings.progress)
    points = tuple(
        Point(method, float(parameter), increment.distance(packing) or rounding, seconds, evaluations)
        for (method, parameter, _), ((packing, evaluations), seconds) in zip(runs, results, strict=True)
    )
    first = increment.distance(increment.start.packing)
    many = np.geomspace(10, 3e4, 100)
    decay = {FASTER: slowest * steps[FASTER], VERLET: 0.5 * drag * steps[VERLET]}
    theory = [_decay(f"slowest mode, {name}", first, rate, many) for name, rate in decay.items()]
    best = {method: min((p for p in points if p.method == method), key=lambda p: p.error) for method in METHODS}
    return Study(
        name="relaxation",
        question=f"The equilibrium of {len(end)} disks at F_x = {TO:g}, from that at {FROM:g}: how far from it the "
        "packing still is.",
        error="largest error of x, y, R theta; length",
        parameter="largest force on a disk at which it ends; Verlet: number of steps",
        evaluations="force evaluations",
        abscissa="evaluations",
        reference="Newton's equilibrium at the rounding floor; its error, estimated, is what the rounding of the "
        "forces makes through K^-1, and it is shown in the figure as that. What the dynamics differ in because of "
        "their path is in their errors",
        reference_error=rounding,
        points=points,
        advice=(
            f"Take Newton's method: {best[NEWTON].evaluations} evaluations to the rounding floor, "
            f"{best[NEWTON].seconds:.2g} s, and no parameter to choose.",
            "Take Verlet with drag where the path has to be a motion: with a drag of 2 omega_min, spins included, "
            f"it errs by {best[VERLET].error:.0e} after {best[VERLET].evaluations} steps, where the paper's "
            f"overdamped dynamics errs by {best[OVERDAMPED].error:.0e} after {best[OVERDAMPED].evaluations}.",
        ),
        theory=(*theory, Theory("rounding of the coordinates", (rounding,))),
        remarks=(
            f"The eigenvalues of K/m go from {slowest:.3g} to {fastest:.3g}: overdamped dynamics needs a number of "
            "steps proportional to their ratio, Verlet with critical drag to its root.",
            "FIRE is on the displacement from the last equilibrium, with slips advanced along the straight path "
            "from there in every evaluation, as in Newton's method; run as a motion, its stops and restarts would "
            "be in the slips. An evaluation of FIRE or Newton goes through Python, one of the dynamics does not.",
            "Nothing slides in this increment. Where contacts slide, ways that differ may end in different equilibria.",
        ),
    )


def _decay(label: str, first: float, rate: float, steps: Floats) -> Theory:
    """first exp(-rate n), as far as it is above 1e-14."""
    error = first * np.exp(-rate * steps)
    seen = error > 1e-14
    return Theory(label, tuple(error[seen].tolist()), tuple(steps[seen].tolist()))
