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

from dataclasses import dataclass, replace

import numpy as np

from ...analysis import NoEquilibriumError, Packing, nearest_image
from ...analysis.arrays import Indices
from ...analysis.counted import counted
from ..lammps.contact_graph import ContactGraph
from ..lammps.engine import Engine
from .newton import Guess, iterate_newton, too_long
from .newton_matrix import factor_stiffness

SMOOTH_FLOOR_ADVICE = "; without friction (mu = 0) nothing holds a layer back on a smooth floor, "
SMOOTH_FLOOR_ADVICE += "so give law.mu a value above 0"

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
        numbers = {"disk": len(packing), "contact": len(packing.contacts), "rattler": len(packing.rattlers)}
        parts = ", ".join(counted(number, name) for name, number in numbers.items())
        return f"{load}{parts}; residual {self.residual:.2g} (rounding floor {self.floor:.2g})"


def rounding_floor(packing: Packing) -> float:
    """Residual that one unit in the last place of each coordinate leaves, force.

    The forces of a disk's contacts are summed as independent errors, and the largest over disks is taken.
    """
    stiffness = packing.law.normal_stiffness(packing.geometry.overlap)
    return ContactGraph(packing.contacts, packing.radius).rounding(stiffness, packing.coordinate_rounding)


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
    packing, guess, begin = last.packing, None, engine.evaluations
    if beside is not None:  # the displacement to the other equilibrium in proportion
        moved = nearest_image(beside.packing.position - packing.position, packing.box_length)
        turned = beside.packing.scaled_angle - packing.scaled_angle
        share = (fx - last.fx) / (beside.fx - last.fx)
        guess = Guess(np.concatenate([moved[:, 0], moved[:, 1], turned]) * share)
    elif fx != packing.fx:  # the linear response to the increment, which is Newton's first step
        push, trial = np.zeros(3 * len(packing)), engine.trial_of(packing)
        push[: len(packing)][packing.top] = fx - packing.fx
        factors = factor_stiffness(trial, trial.floor)
        step = None if factors is None else factors.solver.solve(push)
        guess = None if step is None or too_long(step, packing) else Guess(step, factors, abs(fx - packing.fx))
    found = None if guess is None else _newton(engine, last, fx, force_tolerance, guess)
    here, target = found or last, fx
    while here.fx != fx or here is last:
        found = _newton(engine, here, target, force_tolerance)
        if found is not None:
            here, target = found, fx
        elif fx != here.fx and abs(target - here.fx) >= SMALLEST_SHARE * abs(fx - last.fx):
            target = 0.5 * (here.fx + target)
        elif found := _otherwise(engine, here, last, fx, force_tolerance) if onward and last.fx != fx else None:
            here = found
        else:
            tried = f"; tried were {ATTEMPTS}" if onward and last.fx != fx else ""
            raise NoEquilibriumError(
                f"no equilibrium was found beyond F_x = {here.fx:.10g}: the packing flows or slides freely there{tried}"
                f"{'' if packing.law.frictional else SMOOTH_FLOOR_ADVICE}",
                here.fx,
            )
    return replace(here, evaluations=engine.evaluations - begin)


def _newton(
    engine: Engine,
    base: Equilibrium,
    fx: float,
    force_tolerance: float | None,
    guess: Guess | None = None,
    patient: bool = False,
) -> Equilibrium | None:
    """Newton's method from one equilibrium, None where it does not converge."""
    best = iterate_newton(engine, base.packing, fx, force_tolerance, guess, patient)
    if best is None:
        return None
    engine.kept = best
    return Equilibrium(best.packing, best.residual, best.floor, 0)


def _otherwise(
    engine: Engine, here: Equilibrium, last: Equilibrium, fx: float, force_tolerance: float | None
) -> Equilibrium | None:
    """The equilibrium at fx by the ways of `ATTEMPTS`, in that order; None if none leads there."""

    def through(start: Equilibrium, loads: list[float], way: str) -> Equilibrium | None:
        """The equilibrium at the last of some loads, in patient steps through all; None if one has no equilibrium."""
        now: Equilibrium | None = start
        for load in loads:
            now = now and _newton(engine, now, load, force_tolerance, patient=True)
        return now and replace(now, way=way)

    routes: list[tuple[str, Equilibrium, list[float]]] = [("more iterations", here, [fx])]
    for count in INCREMENT_PARTS:
        routes.append((f"{count} increments", last, np.linspace(last.fx, fx, count + 1)[1:].tolist()))
    routes.append(("a larger increment and back", last, [2 * fx - last.fx, fx]))
    for way, start, loads in routes:
        if found := through(start, loads, f"{way} from F_x = {start.fx:.10g}"):
            return found
    # the rest of overdamped dynamics at fx, unless the layer flows on by a diameter, or creeps too long
    engine.restore(here.packing)
    engine.set_fx(fx)
    packing, flown, steps = here.packing, 0.0, 0
    most = min(MOST_DYNAMICS_STEPS, max(FEWEST_STEPS, DISK_STEPS // len(packing)))
    while abs(flown) < 2 * packing.radius.mean() and steps < most:
        rest = engine.relax(FORCE_AT_REST * packing.fy, steps=max(FEWEST_STEPS, most // LOOKS_AT_LAYER))
        before, packing, steps = packing, engine.packing, steps + rest.steps
        if rest.status != "no":
            near = Equilibrium(packing, rest.residual, rounding_floor(packing), steps)
            return through(near, [fx], f"overdamped dynamics from F_x = {here.fx:.10g}")
        flown += float(nearest_image(packing.position - before.position, packing.box_length)[packing.top, 0].mean())
    return None
