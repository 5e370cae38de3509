r"""The static yield: a packing followed by Newton's method and, where that ends, by damped dynamics.

The load rises in increments of `STEP` of F_y. Newton's method gives the next equilibrium. Where Newton's method finds
none, the disks move from the last equilibrium under the new load, with a drag of time `DRAG`, which is critical for
modes of the frequency 1/(2 `DRAG`) and more than critical for slower ones. The motion is taken in segments; each one
begins at rest, and the disks without a contact at its start are held still during it. Once the disks are slow,
Newton's method is tried from where they are: its equilibrium is the proof that they rest.

An equilibrium whose K has a negative eigenvalue is none on which disks rest: Newton's method has passed a turning
point. It does not count, and dynamics goes on.

**Fails** says: within one increment the upper layer moves by more than `FAR` diameters of a small disk, or the disks do
not come to rest within `LONGEST`. The static yield F_s lies between the last load that is borne and the next one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from faultgouge.analysis import NoEquilibriumError, Packing, nearest_image, negative_eigenvalues
from faultgouge.pywrap import Engine, Equilibrium, equilibrate, time_step

STEP = 0.01
"""Increment of F_x, in units of F_y."""

DRAG = 0.1
"""Time of the drag: critical at a frequency of 5, about that of the slowest modes of 100 disks."""

SEGMENT = 5.0
"""Length of a segment, time."""

LONGEST = 400.0
"""Time in which the disks have to come to rest."""

FAR = 1.0
"""Distance that the layer moves in an increment if the packing fails, in diameters of a small disk."""

SLOW = 1e-6
"""Velocity of the fastest disk below which Newton's method is tried."""

COARSE = 4.0
"""Time step of damped dynamics in units of that of undamped runs: a fifth of the limit of stability."""


class FailedError(NoEquilibriumError):
    """The packing does not come to rest under its load."""


@dataclass(frozen=True, eq=False)
class Branch:
    """The equilibria of a packing up to its static yield.

    Attributes
    ----------
    equilibria : list of Equilibrium
        By increasing F_x, the last one being the last that is borne.
    newton : float
        F_x of the last equilibrium before Newton's method first found none.
    jumps : list of tuple of float
        F_x and distance of the layer, for each increment that dynamics took.
    """

    equilibria: list[Equilibrium]
    newton: float
    jumps: list[tuple[float, float]]

    def borne(self, fx: float) -> Equilibrium | None:
        """The equilibrium at a load, from the equilibrium below it; None if the packing fails between two of these."""
        below = next(each for each in reversed(self.equilibria) if each.fx <= fx)
        try:
            return below if below.fx == fx else next_equilibrium(below, fx)[0]
        except FailedError:
            return None


def branch(start: Equilibrium, increment: float = STEP) -> Branch:
    """Follow a packing from its first equilibrium to its static yield, in increments of F_x in units of F_y."""
    equilibria = [start]
    jumps: list[tuple[float, float]] = []
    newton: float | None = None
    step = increment * start.packing.fy
    while True:
        last = equilibria[-1]
        try:
            found, moved = next_equilibrium(last, len(equilibria) * step)
        except FailedError:
            return Branch(equilibria, last.fx if newton is None else newton, jumps)
        if moved is not None:
            newton = last.fx if newton is None else newton
            jumps.append((found.fx, moved))
        equilibria.append(found)


def next_equilibrium(last: Equilibrium, fx: float) -> tuple[Equilibrium, float | None]:
    """The equilibrium at fx by Newton's method, or by dynamics: then with the distance that the layer has moved.

    Raises
    ------
    FailedError
        If the packing does not come to rest.
    """
    with Engine(last.packing) as engine:
        try:
            return _check_rest(equilibrate(engine, last, fx)), None
        except NoEquilibriumError:
            engine.restore(last.packing)
            engine.set_fx(fx)
            return rest(engine)


def rest(engine: Engine) -> tuple[Equilibrium, float]:
    """The equilibrium that damped dynamics reaches from where the engine's disks are, and how far the layer moves.

    Raises
    ------
    FailedError
        If the packing does not come to rest.
    """
    now, moved, elapsed = engine.packing, 0.0, 0.0
    fx = now.fx
    while elapsed < LONGEST:
        before, dt = now, COARSE * time_step(now)
        with engine.undamped(dt, drag_time=DRAG) as dynamics:
            motion = dynamics.advance(int(SEGMENT / dt))
        now, elapsed = engine.packing, elapsed + SEGMENT
        moved += layer_slip(before, now)
        if abs(moved) > FAR * 2 * now.radius.min():
            raise FailedError(f"at F_x = {fx:.6g} the layer has moved by {moved:.3g}")
        if np.abs(motion.velocity).max() < SLOW:
            try:
                found = _check_rest(equilibrate(engine, Equilibrium.of(now), fx))
            except NoEquilibriumError:
                engine.restore(now)
                engine.set_fx(fx)
                continue
            return found, moved + layer_slip(now, found.packing)
    raise FailedError(f"at F_x = {fx:.6g} the disks still move after {LONGEST:g}")


def _check_rest(found: Equilibrium) -> Equilibrium:
    """The equilibrium, unless it buckles."""
    if len(negative_eigenvalues(found.packing)):
        raise NoEquilibriumError(f"at F_x = {found.fx:.6g} the equilibrium lies beyond a turning point")
    return found


def layer_slip(before: Packing, after: Packing) -> float:
    """Mean displacement of the upper layer along x, less than half a box."""
    moved = nearest_image(after.position - before.position, before.box_length)[:, 0]
    return float(moved[before.top].mean())
