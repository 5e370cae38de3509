r"""From equilibrium to equilibrium, by Newton's method (:mod:`~faultgouge.pywrap.equilibria.newton`).

The first step needs no force evaluation: from an equilibrium, the unbalanced forces are the increment on the upper
layer, and the iteration starts from the linear response to these forces. The factors of K also serve the next
iterations as long as these converge fast: a small increment needs no other factors. Between equilibria q is nearly
proportional to the increment: if a third equilibrium is known, its displacement in proportion is a better initial
guess. The ramp of an onset uses the equilibrium before the last. A stored ramp does not, so that an interrupted ramp
continues bitwise unchanged.

If Newton's method fails, the increment is halved, because friction depends on the path. If this fails, other methods
are tried (`ATTEMPTS`) before the packing is reported to flow.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ...analysis import NoEquilibriumError, Packing, nearest_image
from ...analysis.arrays import Indices
from ...analysis.counted import counted
from ..lammps.contact_graph import ContactGraph
from ..lammps.engine import Engine
from ..lammps.trial_state import rounding
from .newton import Guess, iterate_newton, too_long
from .newton_matrix import factor_stiffness

SMOOTH_FLOOR_ADVICE = (
    "; without friction (mu = 0) nothing holds a layer back on a smooth floor, so give law.mu a value above 0"
)

SMALLEST_SHARE = 2.0**-10
"""The share of an increment below which halving ends."""

INCREMENT_PARTS = 3, 7
"""Parts of an increment that are tried where halving has led nowhere: no load is one that halving has met."""

FORCE_AT_REST = 1e-9
"""Force on a disk, in units of F_y, at which dynamics end."""

FEWEST_STEPS, MOST_DYNAMICS_STEPS, DISK_STEPS = 20_000, 800_000, 80_000_000
"""Bounds of the number of steps of dynamics, and that number times the number of disks in between. Just beyond the end
of a branch the packing creeps, the longer the nearer: 800,000 steps of 100 disks take 5 s."""

LOOKS_AT_LAYER = 8
"""Looks at the layer during dynamics."""

ATTEMPTS = (
    "smaller increments, more iterations, increments of other sizes, a larger increment and back, and overdamped "
    "dynamics from the last equilibrium"
)
"""The methods that are tried before a packing is said to flow, in words."""


@dataclass(frozen=True)
class Equilibrium:
    """An equilibrium and the accuracy of its balance.

    Attributes
    ----------
    packing : Packing
        The configuration.
    residual : float
        Largest force, with torque over radius, on a disk that has a contact; of the forces in LAMMPS.
    floor : float
        Estimate of the residual that the rounding of coordinates leaves.
    evaluations : int
        Number of force evaluations since the previous equilibrium.
    way : str or None
        In words, which of the methods in `ATTEMPTS` led here, and from where; None if halving the increment was enough.
    """

    packing: Packing
    residual: float
    floor: float
    evaluations: int
    way: str | None = None

    @classmethod
    def of(cls, packing: Packing) -> "Equilibrium":
        """The record of a packing with its present forces: a starting point, balanced or not."""
        return cls(packing, packing.residual, rounding_floor(packing), 0)

    @property
    def fx(self) -> float:
        """F_x on each disk of the upper layer."""
        return self.packing.fx

    def __str__(self) -> str:
        packing = self.packing
        load = f"F_x = {packing.fx:g}: " if packing.fx else ""
        return (
            f"{load}{counted(len(packing), 'disk')}, {counted(len(packing.contacts), 'contact')}, "
            f"{counted(len(packing.rattlers), 'rattler')}; "
            f"residual {self.residual:.2g} (rounding floor {self.floor:.2g})"
        )


def rounding_floor(packing: Packing) -> float:
    """Residual that one unit in the last place of each coordinate leaves, force.

    The forces of a disk's contacts are summed as independent errors, and the largest over disks is taken.
    """
    graph = ContactGraph(packing.contacts, packing.radius)
    return rounding(packing.law.normal_stiffness(packing.geometry.overlap), graph, packing.coordinate_rounding)


def idle_disks(packing: Packing) -> Indices:
    """Disks whose contacts carry no more than the rounding of a packing."""
    return packing.loaded(rounding_floor(packing)).rattlers


def equilibrate(
    engine: Engine,
    last: Equilibrium,
    fx: float,
    force_tolerance: float | None = None,
    beside: Equilibrium | None = None,
    onward: bool = False,
) -> Equilibrium:
    """Compute the equilibrium at fx from the last equilibrium.

    Parameters
    ----------
    engine : Engine
        LAMMPS with this packing.
    last : Equilibrium
        Starting point; its fx may be lower or higher.
    fx : float
        Force along x on each disk of the upper layer.
    force_tolerance : float, optional
        Residual at which the iteration stops. By default the iteration ends at the rounding floor.
    beside : Equilibrium, optional
        Another equilibrium near the last, at another fx, whose displacement gives the initial guess. The guess changes
        the result only within rounding.
    onward : bool
        Whether to try the methods in `ATTEMPTS` if halving the increment fails. By default the branch of equilibria
        ends there.

    Raises
    ------
    NoEquilibriumError
        If no permitted method finds an equilibrium.
    """
    guess = _response(engine, last, fx) if beside is None else _in_proportion(last, beside, fx)
    here = _halve_increments(engine, last, fx, force_tolerance, guess)
    onward = onward and last.fx != fx
    if here.fx != fx and onward:
        here = _otherwise(engine, here, last, fx, force_tolerance)
    if here.fx != fx or here is last:
        tried = f"; tried were {ATTEMPTS}" if onward else ""
        raise NoEquilibriumError(
            f"no equilibrium was found beyond F_x = {here.fx:.10g}: the packing flows or slides freely there{tried}"
            f"{'' if here.packing.law.frictional else SMOOTH_FLOOR_ADVICE}",
            here.fx,
        )
    return here


def _halve_increments(
    engine: Engine, last: Equilibrium, fx: float, force_tolerance: float | None, guess: Guess | None
) -> Equilibrium:
    """The equilibrium at fx, or the furthest one, by Newton's method with increments that are halved where it fails."""
    here, target, evaluations = last, fx, 0
    while True:
        engine.set_fx(target)
        found, spent = _newton(engine, here.packing, force_tolerance, guess)
        evaluations += spent
        if found is None and guess is not None:
            guess = None
        elif found is None:
            if fx == here.fx or abs(target - here.fx) < SMALLEST_SHARE * abs(fx - last.fx):
                return here
            target = 0.5 * (here.fx + target)
        elif target == fx:
            return replace(found, evaluations=evaluations)
        else:
            here, target = found, fx


def _otherwise(
    engine: Engine, here: Equilibrium, last: Equilibrium, fx: float, force_tolerance: float | None
) -> Equilibrium:
    """The equilibrium at fx by the ways of `ATTEMPTS`, in that order; `here` if none leads there."""
    routes: list[tuple[str, Equilibrium, list[float]]] = [("more iterations", here, [fx])]
    for count in INCREMENT_PARTS:
        routes.append((f"{count} increments", last, np.linspace(last.fx, fx, count + 1)[1:].tolist()))
    routes.append(("a larger increment and back", last, [2 * fx - last.fx, fx]))
    for way, start, loads in routes:
        found = _through(engine, start, loads, force_tolerance)
        if found is not None:
            return replace(found, way=f"{way} from F_x = {start.fx:.10g}")
    near = _at_rest(engine, here, fx)
    found = None if near is None else _through(engine, near, [fx], force_tolerance)
    return here if found is None else replace(found, way=f"overdamped dynamics from F_x = {here.fx:.10g}")


def _at_rest(engine: Engine, start: Equilibrium, fx: float) -> Equilibrium | None:
    """The rest of overdamped dynamics at fx; None if the layer flows on by a diameter, or creeps too long."""
    engine.restore(start.packing)
    engine.set_fx(fx)
    here, flown, steps = start.packing, 0.0, 0
    most = min(MOST_DYNAMICS_STEPS, max(FEWEST_STEPS, DISK_STEPS // len(here)))
    while abs(flown) < 2 * here.radius.mean() and steps < most:
        rest = engine.relax(FORCE_AT_REST * here.fy, steps=max(FEWEST_STEPS, most // LOOKS_AT_LAYER))
        before, here, steps = here, engine.packing, steps + rest.steps
        if rest.status != "no":
            return Equilibrium(here, rest.residual, rounding_floor(here), steps)
        flown += float(nearest_image(here.position - before.position, here.box_length)[here.top, 0].mean())
    return None


def _through(
    engine: Engine, start: Equilibrium, loads: Iterable[float], force_tolerance: float | None
) -> Equilibrium | None:
    """The equilibrium at the last of some loads, in patient steps through all; None if one has no equilibrium."""
    here, evaluations = start, start.evaluations
    for load in loads:
        engine.set_fx(float(load))
        found, spent = _newton(engine, here.packing, force_tolerance, None, patient=True)
        if found is None:
            return None
        here, evaluations = found, evaluations + spent
    return replace(here, evaluations=evaluations)


def _response(engine: Engine, last: Equilibrium, fx: float) -> Guess | None:
    """The linear response to the increment, which is Newton's first step; None where there is none."""
    packing = last.packing
    if fx == packing.fx:
        return None
    push = np.zeros(3 * len(packing))
    push[: len(packing)][packing.top] = fx - packing.fx
    trial = engine.trial_of(packing)
    factors = factor_stiffness(trial, trial.floor)
    step = None if factors is None else factors.solve(push)
    return None if step is None or too_long(step, packing) else Guess(step, factors, abs(fx - packing.fx))


def _in_proportion(last: Equilibrium, beside: Equilibrium, fx: float) -> Guess:
    """The displacement from one equilibrium to another, (dx.., dy.., R dtheta..), in proportion to the increment."""
    a, b = last.packing, beside.packing
    moved = nearest_image(b.position - a.position, a.box_length)
    displacement = np.concatenate([moved[:, 0], moved[:, 1], b.scaled_angle - a.scaled_angle])
    return Guess(displacement * ((fx - last.fx) / (beside.fx - last.fx)))


def _newton(
    engine: Engine, base: Packing, force_tolerance: float | None, guess: Guess | None, patient: bool = False
) -> tuple[Equilibrium | None, int]:
    """Newton's method from one base at the engine's fx; None where it does not converge."""
    best, evaluations = iterate_newton(engine.try_displacement, engine.trial_of(base), force_tolerance, guess, patient)
    if best is None:
        return None, evaluations
    return Equilibrium(engine.keep(best), best.residual, best.floor, evaluations), evaluations
