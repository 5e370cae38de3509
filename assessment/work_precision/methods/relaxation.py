r"""Distance to an equilibrium over the time that it takes to get there.

The load of a packing in equilibrium is raised by one increment. Three methods lead to the next equilibrium: the paper's
overdamped dynamics :math:`\mathbf v = \mathbf F/\gamma`, velocity Verlet with viscous drag, and Newton's method, whose
unknown is the displacement from the last equilibrium. LAMMPS's own minimizers advance no slips and are refused by the
pair style.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from ....analysis import Packing, dynamical_matrix
from ....pywrap import Engine, Equilibrium, equilibrate
from ....pywrap.equilibria.quasistatic import rounding_floor
from .work_precision_study import COMPENSATED_SUFFIX, Run, Settings, Study, Theory, compensate, study_of, timed_points

FROM, TO = 0.010, 0.011
"""F_x before and after: an increment far from the onset."""

OVERDAMPED, VERLET, NEWTON = "overdamped", "Verlet with drag", "Newton"

STEPS_PER_LOOK = 200
"""Steps between two looks at the forces, so that the cost is known to so many steps."""

STABLE = 0.95
"""Share of the longest stable time step."""


class Increment(NamedTuple):
    """One increment of the load, from an equilibrium at `FROM`, and the packing at `TO` that all methods should reach.

    The first is LAMMPS with the packing; the last is by Newton's method in compensated arithmetic.
    """

    engine: Engine
    start: Equilibrium
    end: Packing

    def distance(self, packing: Packing) -> float:
        """Largest difference of a coordinate (x, y, R theta) of a disk with contacts, length."""
        low, end_low = (np.zeros(2) if each.position_low is None else each.position_low for each in (packing, self.end))
        apart = packing.position - self.end.position + (low - end_low)
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

    def newton(self, tolerance: float | None) -> tuple[Packing, int]:
        """Newton's method; to the rounding floor without a tolerance."""
        found = equilibrate(self.engine, self.start, TO, tolerance)
        return found.packing, found.evaluations


def relaxation(settings: Settings) -> Study:
    """The study: three methods, each with several accuracies, and Newton's in both arithmetics."""
    start = settings.at(FROM)
    careful_start = compensate(start)
    with Engine(start.packing) as engine, Engine(careful_start.packing) as careful_engine:
        end = equilibrate(careful_engine, careful_start, TO)
        values = np.linalg.eigvals(dynamical_matrix(end.packing)[0].toarray()).real
        slowest, fastest = float(values.min()), float(values.max())
        relax_step, verlet_step, drag = STABLE * 2 / fastest, STABLE * 2 / np.sqrt(fastest), 2 * np.sqrt(slowest)
        plain = Increment(engine, start, end.packing)
        careful = Increment(careful_engine, careful_start, end.packing)
        forces = np.logspace(-3, -9, 4 if settings.quick else 7).tolist()
        runs: list[Run[Packing]] = [
            *((NEWTON, force, partial(plain.newton, force or None)) for force in (1e-1, 1e-4, 1e-7, 0.0)),
            *(
                (NEWTON + COMPENSATED_SUFFIX, force, partial(careful.newton, force or None))
                for force in (1e-1, 1e-4, 1e-7, 1e-12, 0.0)
            ),
            *((VERLET, n, partial(plain.verlet, verlet_step, drag, n)) for n in (50, 100, 200, 400, 800)),
            *((OVERDAMPED, force, partial(plain.relax_overdamped, relax_step, force)) for force in forces),
        ]
        # errors of the forces as independent ones on all coordinates, through K^-1
        softness = float(np.sqrt(np.mean(values**-2.0)))
        reference_error = end.floor * softness
        # both increments end at the same packing
        points = timed_points(runs, settings, lambda packing: plain.distance(packing) or reference_error)
    first, steps, theory = plain.distance(start.packing), np.geomspace(10, 3e4, 100), []
    for name, rate in {OVERDAMPED: slowest * relax_step, VERLET: 0.5 * drag * verlet_step}.items():
        error = first * np.exp(-rate * steps)
        seen = error > 1e-14
        theory.append(Theory(f"slowest mode, {name}", tuple(error[seen].tolist()), tuple(steps[seen].tolist())))
    return study_of(
        "relaxation",
        points=points,
        numbers={"disks": len(end.packing), "start": FROM, "to": TO, "slowest": slowest, "fastest": fastest},
        reference_error=reference_error,
        theory=(*theory, Theory("rounding of doubles", (rounding_floor(start.packing) * softness,))),
    )
