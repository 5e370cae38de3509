r"""Distance to an equilibrium over the time that it takes to get there.

The load of a packing in equilibrium is raised by one increment. Four methods lead to the next equilibrium: the paper's
overdamped dynamics :math:`\mathbf v = \mathbf F/\gamma`, velocity Verlet with viscous drag, FIRE, and Newton's method.

Friction remembers the path, and a minimizer's path is no motion. FIRE (Bitzek et al., Phys. Rev. Lett. 97, 170201,
2006) is set up like Newton's method: its unknown is the displacement q from the last
equilibrium, and slips advance along the straight path from there, never from an iterate. So F(q) is a function, and
both methods have the same root. F has no energy, but K is nearly symmetric, and FIRE needs no more than the sign of the
power :math:`F \cdot v`. LAMMPS's own minimizers advance no slips and are refused by the pair style.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ....analysis import Packing, dynamical_matrix
from ....analysis.arrays import Floats
from ....pywrap import Engine, Equilibrium, equilibrate
from ....pywrap.equilibria.quasistatic import rounding_floor
from .work_precision_study import COMPENSATED_SUFFIX, Run, Settings, Study, Theory, compensate, study_of, timed_points

FROM, TO = 0.010, 0.011
"""F_x before and after: an increment far from the onset."""

DECKS, OVERDAMPED, FIRE = "overdamped, step of the decks", "overdamped", "FIRE"
VERLET, NEWTON = "Verlet with drag", "Newton"
STEPS_PER_LOOK = 200
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
        At `TO`, by Newton's method in compensated arithmetic.
    """

    engine: Engine
    start: Equilibrium
    end: Packing

    def distance(self, packing: Packing) -> float:
        """Largest difference of a coordinate (x, y, R theta) of a disk with contacts, length."""
        apart = packing.position - self.end.position + (_low(packing) - _low(self.end))
        turned = packing.scaled_angle - self.end.scaled_angle
        return float(np.abs(np.delete(np.column_stack([apart, turned]), self.end.rattlers, axis=0)).max())

    def relax_overdamped(self, time_step: float | None, tolerance: float) -> tuple[Packing, int]:
        """The paper's dynamics until no disk feels more than a force."""
        self.engine.restore(self.start.packing)
        self.engine.set_fx(TO)
        steps = self.engine.relax(tolerance, time_step=time_step, chunk=STEPS_PER_LOOK).steps
        return self.engine.packing, steps

    def verlet(self, time_step: float, rate: float, steps: int) -> tuple[Packing, int]:
        """Newton's dynamics with viscous drag."""
        self.engine.restore(self.start.packing)
        self.engine.set_fx(TO)
        with self.engine.undamped(time_step, drag_time=1 / rate) as dynamics:
            dynamics.advance(steps)
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
        Largest number of evaluations.

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


def _low(packing: Packing) -> Floats:
    return np.zeros_like(packing.position) if packing.position_low is None else packing.position_low


def relaxation(settings: Settings) -> Study:
    """The study: four methods, each with several accuracies, and three of them in both arithmetics."""
    plain = settings.at(FROM)
    careful = compensate(plain)
    with Engine(plain.packing) as engine, Engine(careful.packing) as careful_engine:
        end = equilibrate(careful_engine, careful, TO)
        values = np.linalg.eigvals(dynamical_matrix(end.packing)[0].toarray()).real
        slowest, fastest = float(values.min()), float(values.max())
        dynamics = STABLE * 2 / fastest, STABLE * 2 / np.sqrt(fastest), 2 * np.sqrt(slowest)
        increment = Increment(engine, plain, end.packing)
        runs = _runs(increment, Increment(careful_engine, careful, end.packing), dynamics, settings.quick)
        # errors of the forces as independent ones on all coordinates, through K^-1
        softness = float(np.sqrt(np.mean(values**-2.0)))
        reference_error = end.floor * softness
        # both increments end at the same packing
        points = timed_points(runs, settings, lambda packing: increment.distance(packing) or reference_error)
    first, (relax_step, verlet_step, drag) = increment.distance(plain.packing), dynamics
    decay = {OVERDAMPED: slowest * relax_step, VERLET: 0.5 * drag * verlet_step}
    theory = [_decay(f"slowest mode, {name}", first, rate, np.geomspace(10, 3e4, 100)) for name, rate in decay.items()]
    return study_of(
        "relaxation",
        points=points,
        numbers={"disks": len(end.packing), "start": FROM, "to": TO, "slowest": slowest, "fastest": fastest},
        reference_error=reference_error,
        theory=(*theory, Theory("rounding of doubles", (rounding_floor(plain.packing) * softness,))),
    )


def _runs(
    plain: Increment, careful: Increment, dynamics: tuple[float, float, float], quick: bool
) -> list[Run[Packing]]:
    """The methods that find the equilibrium; `dynamics` are the steps of dynamics and of Verlet, and its drag."""
    relax_step, verlet_step, drag = dynamics
    forces = np.logspace(-3, -9, 4 if quick else 7).tolist()
    most = (1e-1, 1e-4, 1e-7, 0.0)
    counts = (50, 100, 200, 400, 800)
    return [
        # FIRE's evaluations are slow, and its convergence steady
        *((FIRE, force, partial(plain.fire, verlet_step, force)) for force in forces if force > 1e-6),
        *((NEWTON, force, partial(plain.newton, force or None)) for force in most),
        *(
            (NEWTON + COMPENSATED_SUFFIX, force, partial(careful.newton, force or None))
            for force in (*most[:3], 1e-12, 0.0)
        ),
        *((VERLET, steps, partial(plain.verlet, verlet_step, drag, steps)) for steps in counts),
        *((VERLET + COMPENSATED_SUFFIX, steps, partial(careful.verlet, verlet_step, drag, steps)) for steps in counts),
        *((OVERDAMPED, force, partial(plain.relax_overdamped, relax_step, force)) for force in forces),
        *(
            (OVERDAMPED + COMPENSATED_SUFFIX, force, partial(careful.relax_overdamped, relax_step, force))
            for force in (1e-5, 1e-9, 1e-13)
        ),
        *((DECKS, force, partial(plain.relax_overdamped, None, force)) for force in forces),
    ]


def _decay(label: str, first: float, rate: float, steps: Floats) -> Theory:
    """first exp(-rate n), as far as it is above 1e-14."""
    error = first * np.exp(-rate * steps)
    seen = error > 1e-14
    return Theory(label, tuple(error[seen].tolist()), tuple(steps[seen].tolist()))
