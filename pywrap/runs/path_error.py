r"""The part of an onset's error that comes from the path of equilibria.

Friction remembers the path, and a ramp takes the path in finite increments h. Between two equilibria the slips advance
along a straight line with the tangent at its middle: an error of order h^3 an increment, and so of h^2 at the onset. A
contact that closes within an increment begins without slip at the end of the increment. It loses the slip that it would
have had by then, which is an error of order h. Where a contact reaches Coulomb's bound or leaves it the order is the
second, but the coefficient depends on where in the increment that happens.

**Contacts do not change.** The path is solved once more, to the onset F_h of the ramp, through every second load of the
ramp. On this path the same pair of eigenvalues coalesces at F_2h. With the increments :math:`h_i` of either path the
remaining error is

.. math:: F_h - F = \frac{F_{2h} - F_h}{S_{2h}/S_h - 1}, \qquad S = \sum_i h_i^3,

Richardson's extrapolation for increments that need not be equal. The onset is given at F. Its uncertainty is twice the
largest difference that rounding of both onsets allows. A ramp with fewer than `FEWEST_INCREMENTS` increments
up to the onset is compared with the path through the middles of its increments, which has the smaller S, by the same
formula.

**Contacts change.** Nothing is extrapolated, and three effects are bounded.

- A contact that closes loses slip. The path through fewer loads leaves out the load after an increment with a change:
  the contact then loses the slip of up to two increments, and :math:`|F_{2h} - F_h|` shows how much that is.
- The loss depends on where in its increment the contact closes. So does the place of a rattler, which is moved when a
  neighbour meets it. A path through loads of the ramp may meet both as the ramp does, however small the increments are.
  Two more paths therefore have the increments of the ramp, moved up by a third and by two thirds of an increment. If a
  change at the share :math:`\varphi` of its increment makes an error :math:`c \varphi`, the errors on these paths are
  :math:`c` times :math:`\varphi - 1/3` and :math:`\varphi - 2/3`, modulo 1, and the three onsets span :math:`2c/3`. A
  contact becomes stiff soon after it closes. If the error grows as the root of :math:`\varphi`, the three onsets span
  at least :math:`0.42 c`. Twice the span is therefore :math:`c`, the largest loss, or nearly so.
- Increments in which a contact begins to slide are as long on all these paths. Their error, of order h^2, shows on a
  path through the middles of all increments: :math:`F_h - F_{h/2}` is three quarters of it.

The stated error is the largest of :math:`|F_{2h} - F_h|`, twice the span, and :math:`2 |F_h - F_{h/2}|`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError

from ...analysis import NoEquilibriumError, Onset, OnsetError, Packing
from ...analysis.arrays import Floats
from ...analysis.windows import System, Window, eigenvalues_near
from ..equilibria.quasistatic import Equilibrium
from ..load_path import LoadPath

Vanishes = Callable[[Packing], float]
Known = dict[str | float, list[Equilibrium]]

FEWEST_INCREMENTS = 4
"""Increments up to the onset from which on every second load may be left out."""

LEAST_BEARING_FORCE = 1e-9
"""Normal force, in units of F_y, from which on a contact counts; that of a disk that carries nothing is noise."""

PATH_FAILURES = NoEquilibriumError, OnsetError, LinAlgError
"""Errors of another path, which cost the error of the path alone and not the onset."""

LOAD_SHIFTS = 1 / 3, 2 / 3
"""Shares of an increment by which the loads of two other paths are moved up where contacts change."""

LONGEST_RUN = 2
"""Loads that may be left out one after the other."""

UNCERTAINTY_OF_CORRECTION = 2.0
"""Uncertainty of an extrapolated onset, in units of the correction. As a rule a correction is good to a tenth.
Where its coefficient changes sign along the path, the correction is wrong by more than itself."""

SECANT_STEPS = 8
"""Secant steps to the onset on the other path; two or three do."""

WIDENINGS = 20
"""Factors of two between the half of an increment and the smallest step in which a jump is looked for."""

NOISE_IN_ROUNDINGS = 10
"""Rounding errors about which the last of the secant steps may still jump."""

SLOPE_TOLERANCE = 1e-3
"""Distance of a root, in half increments, up to which the slope of what vanishes is the same on all paths: both its
curvature and the paths' difference change the slope by about this share."""

SECANT_TOLERANCE = 0.02
"""Last secant step, in units of the shift, at which the shift is known: it only has to tell the size of an error."""


def with_path_error(
    onset: Onset, path: LoadPath[Equilibrium], with_dashpots: Callable[[Packing], Packing] = lambda packing: packing
) -> Onset:
    """An onset with the error of its path: extrapolated where that can be done, bounded where not.

    The path is the ramp, at least up to the last window, and the onset has errors of rounding alone. `with_dashpots`
    gives a packing of the path the dissipation with which the onset was found. Windows then have the onset of the exact
    path and the whole error; so has the onset without dissipation. A window keeps its own, and a `path_error` of None,
    where the ramp has no equilibrium at the onset that the search has found there.
    """
    known: Known = {}

    def whole(window: Window) -> Window:
        growth = growth_near(window.frequency, with_dashpots)
        vanishes = growth if window.dissipative else squared_gap(window.eigenvalue)
        try:
            correction, error = path_error(path, window.fx_onset, vanishes, window.onset.error, known)
        except PATH_FAILURES:
            return window
        return replace(window, onset=replace(window.onset, fx=window.fx_onset + correction), path_error=error)

    def each(found: Onset) -> Onset:
        beyond = path.equilibria[0].fx  # where the path begins, nothing adds to the error
        return replace(found, windows=tuple(whole(one) if one.fx_onset > beyond else one for one in found.windows))

    return replace(each(onset), undamped=onset.undamped and each(onset.undamped))


def path_error(
    path: LoadPath[Equilibrium], fx: float, vanishes: Vanishes, rounding: float, known: Known | None = None
) -> tuple[float, float]:
    """The effect of the increments on the onset fx of a ramp: its correction and its uncertainty, force.

    The correction is 0 where it is no more than rounding, or contacts change. The uncertainty is an increment where the
    onset is not found on another path. `vanishes` takes a packing to what goes through zero at the onset: `squared_gap`
    or `growth_near`. `rounding` is the uncertainty of fx from rounding. `known` has equilibria of the other paths of
    this ramp by their names: onsets have these in common for the most part. Raises NoEquilibriumError if the ramp has
    no equilibrium at fx.
    """
    changed, known = contact_changes(path, fx), {} if known is None else known
    ramp = np.array([*(each.fx for each in path.equilibria if each.fx < fx), fx])
    steps, few = np.diff(ramp), len(changed) < FEWEST_INCREMENTS
    halved = np.sort(np.concatenate([ramp, 0.5 * (ramp[1:] + ramp[:-1])]))
    other = halved if few else _thin_loads(ramp, changed)
    increment, slope = float(steps.max()), None

    def shift(name: str | float, through: Floats) -> float:
        """The onset on the path through some loads, less fx; the path goes on from its known equilibria."""
        nonlocal slope
        inner, before, common = through[1:-1], known.get(name, path.equilibria[:1]), 0
        while common < min(len(inner), len(before) - 1) and before[common + 1].fx == inner[common]:
            common += 1
        there = LoadPath(path.solver, before[: common + 1], onward=False)
        try:
            for load in inner[common:].tolist():
                there(load)
                known[name] = [*there.equilibria]
            root, slope = nearby_root(lambda load: vanishes(there(load)), fx, rounding, 0.5 * increment, slope)
        except PATH_FAILURES:
            return np.nan
        return root - fx

    coarse, weight = shift("coarser", other), float(np.sum(np.diff(other) ** 3) / np.sum(steps**3)) - 1
    hidden = 2 * rounding
    if not changed.any():
        correction = -coarse / weight if abs(coarse) > hidden else 0.0
        error = UNCERTAINTY_OF_CORRECTION * (abs(coarse) + hidden) / abs(weight)
        return correction, increment if np.isnan(coarse) else error
    finer = 0.0 if few else shift("finer", halved)
    moved = [shift(share, np.concatenate([ramp[:1], ramp[:-1] + share * steps, ramp[-1:]])) for share in LOAD_SHIFTS]
    part = 1.0 if weight > 0 else 2.0  # the ramp is the coarser path of the two
    error = np.max([part * abs(coarse), 2 * abs(finer), 2 * np.ptp([0.0, *moved])]) + hidden
    return 0.0, increment if np.isnan(error) else float(error)


def contact_changes(path: LoadPath[Equilibrium], fx: float) -> NDArray[np.bool_]:
    """In which increments of a ramp up to fx contacts close, open, or reach or leave the Coulomb bound.

    Raises NoEquilibriumError if the ramp has no equilibrium at fx.
    """
    states = [bearing_contacts(each.packing) for each in path.equilibria if each.fx < fx]
    return np.array([a != b for a, b in pairwise([*states, bearing_contacts(path(fx))])])


def bearing_contacts(packing: Packing) -> frozenset[tuple[int, int, bool]]:
    """The contacts (i, j, whether it slides) that carry a force; j = -1 for the floor."""
    carrying = packing.loaded(LEAST_BEARING_FORCE * packing.fy)
    contacts = carrying.contacts
    return frozenset(zip(contacts.i.tolist(), contacts.j.tolist(), carrying.sliding.tolist(), strict=True))


def _thin_loads(loads: Floats, changed: NDArray[np.bool_]) -> Floats:
    """Every second load; after an increment with a change the load is left out, before one it is kept."""
    kept, run = [True], 0
    for k in range(1, len(loads) - 1):
        leave = (changed[k - 1] or (run == 0 and not changed[k])) and run < LONGEST_RUN
        run = run + 1 if leave else 0
        kept.append(not leave)
    return loads[[*kept, True]]


def squared_gap(eigenvalue: float) -> Vanishes:
    """(lambda_1 - lambda_2)^2 of the two eigenvalues nearest to one, 1 / time^4, as a function of the packing."""

    def discriminant(packing: Packing) -> float:
        values = eigenvalues_near(System.of(packing), eigenvalue)
        one, other = values[np.argsort(np.abs(values - eigenvalue))[:2]]
        return float(((one - other) ** 2).real)

    return discriminant


def growth_near(frequency: float, with_dashpots: Callable[[Packing], Packing]) -> Vanishes:
    """Re s of the motion nearest to a frequency, 1 / time, as a function of the packing without its dissipation."""
    last = 1j * frequency

    def growth(packing: Packing) -> float:
        nonlocal last
        values = eigenvalues_near(System.of(with_dashpots(packing), dissipation=True), last)
        last = complex(values[np.argmin(np.abs(values - last))])
        return last.real

    return growth


def nearby_root(
    function: Callable[[float], float], fx: float, rounding: float, reach: float, slope: float | None
) -> tuple[float, float | None]:
    """The load nearest to fx at which a function changes its sign, known to rounding or to a share of its distance, and
    the slope of the function there: nan beyond the reach, and None at a jump.

    By the slope of the function on another path, if that is known and the load is near; else by secants or, where the
    function jumps there, by halving.
    """
    at, step = cache(function), max(30 * rounding, 1e-9 * fx)
    if slope and abs(at(fx) / slope) < SLOPE_TOLERANCE * reach:
        return fx - at(fx) / slope, slope
    a, b = fx, fx + step
    for left in reversed(range(SECANT_STEPS)):
        if at(a) == at(b):
            break
        a, b = b, b - at(b) * (b - a) / (at(b) - at(a))
        if not abs(b - fx) < reach:
            break
        if abs(b - a) <= max(SECANT_TOLERANCE * abs(b - fx), rounding if left else NOISE_IN_ROUNDINGS * rounding):
            return b, (at(b + step) - at(b)) / step
    # a jump: steps to either side grow until the sign changes, and the last is halved
    sign, near, far = np.sign(at(fx)), 0.0, max(NOISE_IN_ROUNDINGS * rounding, reach * 2.0**-WIDENINGS)
    while far <= reach:
        for side in (-1.0, 1.0):
            if np.sign(at(fx + side * far)) == sign:
                continue
            low, high = near, far
            while high - low > max(SECANT_TOLERANCE * high, rounding):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if np.sign(at(fx + side * middle)) == sign else (low, middle)
            return fx + side * high, None
        near, far = far, 4 * far
    return np.nan, None
