r"""Motion under a load that rises at a constant rate: drift, vibration, and how far this motion goes on.

The motion is proportional to the rate. Over a span of time its *drift* is the mean velocity of each particle, and its
*vibration* what is left of the velocities: root mean squares over particles and axes.

**Without contacts at Coulomb's bound** the drift u that lasts has :math:`K \dot u = \mathbf g`, with the load
:math:`t\, \mathbf g`. Where a law has two derivatives, one while a contact closes and one while it parts, K has those
of the way that each contact goes. The packing does not vibrate unless motion about the drift grows. One solution of a
sparse system says the drift, if no force is left over: a load that a free motion does not bear accelerates the packing
for ever.

**With contacts at the bound** the motion is followed in windows. A load that begins to rise makes a packing vibrate
that would follow a load which always rose, for as long as its dashpots need. So a drag takes this vibration away at
first, and fades out; what vibrates later sustains itself. Contacts may stick and slide in turn in a cycle of several
windows, so that the numbers are those of a span of many windows: all after the drag, or else the last half of them. The
motion is steady if the two halves of this span agree. The error of a number is that of the mean of the quarters of the
span, and at least what longer steps change.

Vibration may grow slowly from next to nothing, so that no packing is said to follow the load before the whole time is
over. A vibration was seen to be steady for ten windows and then to grow to another one; so half of the time at least is
followed, and from two starts, which differ in whether the drag acts on rotations. One packing may vibrate in two ways,
by its start.

**How far.** While the load rises slowly the mean motion takes sticking contacts to the bound and opens others, as
:mod:`~faultgouge.analysis.motion.next_change` says from the drift. From there on the packing is another one. A contact
that counts as at the bound lacks some force, up to the tolerance of that, and slides once the load has risen enough.
The residual forces move the packing, too, and count until the load has moved the packing ten times as far. A load that
changes another contact before has no motion of this kind.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count, islice
from typing import Any

import numpy as np
from scipy.sparse import csc_array, diags_array, eye_array

from ..arrays import Floats
from ..counted import counted
from ..errors import FaultgougeError
from ..factors.sparse_lu import general_lu
from ..progress import report_progress
from .contact_reach import LEFT_ALONE, reaching_scale
from .eigenvalues import operator_rounding, zero_uncertainty
from .next_change import next_change
from .one_sided import OneSidedSystem
from .one_sided_outcome import WINDOWS_OF_TIME, window_and_most
from .rates import rates_of

SAMPLES_OF_WINDOW = 400
"""Velocities that a window of a load that rises has."""

WINDOWS = 0.2
"""Relative difference of the vibrations of two halves of a span below which a motion is steady."""

ERROR_OF_STEPS = 0.02
"""Relative error of drift and vibration by time steps of a tenth of the stable one."""

TREND = 0.1
"""The same of the whole time after the drag, so that all of it counts, and not the last half alone: in a packing whose
vibration grew slowly for a third of the time it is 0.18."""

VIBRATION_ERROR = 0.1
"""Relative error of the vibration from which on a motion is not followed any longer."""

FADE_WINDOWS = 4
"""Windows in which the drag fades out."""

DRAG = 20.0
"""That drag at first, 1/tau in units of 1/window: it leaves exp(-DRAG FADE_WINDOWS/6) = 2e-6 of a mode's amplitude."""

ONE_START = 6000
"""Coordinates beyond which one start stands for two: each takes a minute or more."""

VIBRATION_SHARE = 1e-2
"""Vibration over drift of a packing that follows the load."""

LEAST_WINDOWS = 8
"""Windows of a span whose halves and quarters can be compared."""

ACCELERATES = 3.0
"""Ratio of the mean velocities of the last and the first quarter of the time from which on a motion has no constant
drift: that of a velocity which rises as the time, after the drag has faded, is 4, and as its square 17."""

LARGEST_GROWTH = 1e12
"""Growth of the vibration of a motion that has no drift."""

DIAGONAL_SHIFT = 1e-11
"""What is added to the diagonal of K, as a share of the largest entry, so that free motions do not divide by zero."""

REFINEMENTS = 3
"""Steps of iterative refinement, each of which takes this shift out once more."""

UNBORNE_SHARE = 1e-6
"""Share of the load that may be left over where K bears the load."""

WAY_CHANGES = 60
"""How often the ways that contacts go may be changed: a few times are enough where the solution is unique."""


class NotFollowedError(FaultgougeError):
    """The motion under a load that rises has no constant drift and no vibration about it."""


@dataclass(frozen=True, eq=False)
class Span:
    """Sums over a span of time, of motions from S starts.

    Attributes
    ----------
    time : float
        Its length.
    displacement : ndarray, shape (E, S)
        Mass-weighted displacement.
    paths : ndarray, shape (R, S)
        Paths of the overlaps of contacts with two derivatives: sums of the sizes of their changes.
    squares : ndarray, shape (N, d, S)
        Integral of the squares of the particles' velocities.
    slid : ndarray, shape (B, S)
        Growth of p of contacts at the bound, force.
    """

    time: float
    displacement: Floats
    paths: Floats
    squares: Floats
    slid: Floats

    @classmethod
    def joined(cls, windows: Sequence["Span"]) -> "Span":
        """Of windows that follow each other."""
        names = "displacement", "paths", "squares", "slid"
        sums = (np.sum([getattr(each, name) for each in windows], axis=0) for name in names)
        return cls(sum(each.time for each in windows), *sums)

    def drift_and_vibration(self, system: OneSidedSystem) -> Floats:
        """Root mean squares over particles and axes, shape (2, S)."""
        mean = system.displacement(self.displacement) / self.time
        left = np.maximum(self.squares / self.time - mean**2, 0.0)
        return np.asarray(np.sqrt([np.mean(each, axis=(0, 1)) for each in (mean**2, left)]))


def motion_under_load(
    system: OneSidedSystem,
    direction: Floats,
    time: float | None = None,
    *,
    free: int = 0,
    decays: bool = True,
    residual: float = 0.0,
) -> dict[str, Any]:
    """Drift and vibration under a load that rises at the rate 1: `Stability.rising`.

    Parameters
    ----------
    system : OneSidedSystem
        Of a configuration in which no small motion is known to grow.
    direction : ndarray, shape (coordinates, 1)
        Forces per unit of time.
    time : float, optional
        How long motion is followed; until it is steady by default.
    free : int
        Motions that no force opposes.
    decays : bool
        Whether it is known that no motion grows with sticking contacts.
    residual : float
        Root mean square displacement of the particles by the residual forces, length.

    Raises
    ------
    NotFollowedError
        If the load accelerates a motion that no force opposes, or particles that touch nothing.
    """
    _refuse_flight(system, direction)
    velocity = steady_velocity(system, direction, free) if decays else None
    if velocity is None:
        return follow_load(system, direction, time, residual)
    paths = np.abs(system.rescaled[0] @ velocity)
    still = Span(1.0, velocity, paths, system.displacement(velocity) ** 2, np.zeros((0, 1)))
    drift = float(still.drift_and_vibration(system)[0, 0])
    alone: dict[str, Any] = {"drift": drift, "drift_error": 0.0, "vibration": 0.0, "vibration_error": 0.0}
    return alone | {"steady": True, "time": None, "span": None, "other_start": None} | _range(system, still, residual)


def _refuse_flight(system: OneSidedSystem, direction: Floats) -> None:
    """Refuse a load on particles that touch nothing, which accelerate for ever."""
    motion = system.motion
    loaded = motion.configuration.coordinate_free & (direction[:, 0] != 0)
    loaded[motion.active] = False
    flying = np.unique(np.flatnonzero(loaded) % len(motion.configuration))
    if len(flying):
        raise NotFollowedError(
            f"the load accelerates {counted(len(flying), 'particle')} that nothing touches: give no forces on these"
        )


def steady_velocity(system: OneSidedSystem, direction: Floats, free: int) -> Floats | None:
    """The drift without contacts at the bound, mass-weighted, shape (E, 1); None if motion is to be followed.

    Raises
    ------
    NotFollowedError
        If the load accelerates a motion that no force opposes.
    """
    if system.sliders[1].shape[0]:
        return None
    motion, load = system.motion, system.on_active(direction)
    rates, forces, _ = system.rescaled
    way = np.zeros(rates.shape[0])
    for _ in range(WAY_CHANGES):
        stiffness = motion.stiffness - forces @ diags_array(way) @ rates if len(way) else motion.stiffness
        velocity = _solution(replace(motion, stiffness=stiffness), load, free)
        before, way = way, np.sign(rates @ velocity)[:, 0]
        if np.array_equal(before, way):
            break
    else:
        return None
    if len(way):
        found = rates_of(replace(motion, stiffness=stiffness))
        if found.searched or found.grows.any():
            return None
    return velocity


def _solution(motion: Any, load: Floats, free: int) -> Floats:
    """v of A v = load, without the motions that no force opposes."""
    matrix = motion.stiffness
    shift = DIAGONAL_SHIFT * float(np.abs(matrix.data).max(initial=0.0))
    if free:
        rounding = operator_rounding(motion.configuration, matrix.data)
        shift = max(shift, 10 * zero_uncertainty(motion.configuration, rounding))
    factors = general_lu(csc_array(matrix + shift * eye_array(matrix.shape[0])))
    velocity = np.zeros_like(load)
    for _ in range(1 + REFINEMENTS):
        velocity += factors.solve(load - matrix @ velocity)
    if np.linalg.norm(load - matrix @ velocity) > UNBORNE_SHARE * np.linalg.norm(load):
        moves = f"{counted(free, 'motion')} that no force opposes" if free else "a motion that next to no force opposes"
        raise NotFollowedError(f"the load accelerates {moves}")
    return velocity


def follow_load(
    system: OneSidedSystem, direction: Floats, time: float | None = None, residual: float = 0.0
) -> dict[str, Any]:
    """Drift and vibration of a motion that is followed, as of `motion_under_load`; `residual` as there."""
    length, most = window_and_most(system, 1, time)
    windows: list[Span] = []
    for window in islice(windows_under_load(system, direction, length), most):
        windows.append(window)
        seen = window.drift_and_vibration(system)[1].max()
        report_progress(f"under the rising load: t = {length * len(windows):.4g}, vibration {seen:.3g}")
        if not seen < LARGEST_GROWTH * windows[0].drift_and_vibration(system).max():
            raise NotFollowedError(
                f"the motion grows without end: within t = {length * len(windows):.4g} by {LARGEST_GROWTH:g}"
            )
        if time is None and 2 * len(windows) >= most and _is_known(system, windows):
            break
    _refuse_acceleration(system, windows, length)
    span, found = _of_starts(system, windows)
    first, *others = found
    time = length * len(windows)
    whole = {**first, "time": time, "span": span.time, "other_start": others[0] if others else None}
    return whole | _range(system, span, residual)


def _refuse_acceleration(system: OneSidedSystem, windows: list[Span], length: float) -> None:
    """Refuse a motion whose mean velocity rises on, as that of contacts which slide on and on."""
    quarters, time = _parts(system, windows[FADE_WINDOWS:] or windows)[0, 3:, 0], length * len(windows)
    if time < WINDOWS_OF_TIME * window_and_most(system, 1, None)[0]:
        return  # a slow vibration begins like that
    if np.all(np.diff(quarters) > 0) and quarters[-1] > ACCELERATES * quarters[0]:
        raise NotFollowedError(
            f"no constant drift is seen: the mean velocity over the rate rises from {quarters[0]:.3g} to "
            f"{quarters[-1]:.3g} within t = {time:.4g}, as where the load accelerates particles whose contacts slide on"
        )


def _range(system: OneSidedSystem, span: Span, residual: float) -> dict[str, Any]:
    """Between which increases of the load the motion of a span holds: `least_rise`, `next_change` and `next_event`.

    Parameters
    ----------
    system : OneSidedSystem
        Of the configuration.
    span : Span
        The motion at the rate 1.
    residual : float
        Root mean square displacement of the particles by the residual forces, length.

    Raises
    ------
    NotFollowedError
        If there is none.
    """
    velocity, paths, slid = (each[:, :1] / span.time for each in (span.displacement, span.paths, span.slid))
    reached, change = reaching_scale(system, slid), next_change(system, velocity, paths)
    moves = float(np.sqrt(system.mean_square_displacement(velocity)[0]))
    moved = LEFT_ALONE * residual / moves if moves else 0.0
    least, most = max(reached, moved), change["next_change"]
    if most is not None and least >= most:
        what = "contacts that count as at Coulomb's bound reach it" if reached > moved else "residual forces count less"
        raise NotFollowedError(
            f"{what} once the load has risen by {least:.1g}, and another contact {change['next_event']} before, at "
            f"{most:.1g}: bring the packing to rest more closely"
        )
    return {"least_rise": least, **change}


def windows_under_load(system: OneSidedSystem, direction: Floats, length: float) -> Iterator[Span]:
    """One window after the other under a load that rises.

    Parameters
    ----------
    system : OneSidedSystem
        Of the configuration.
    direction : ndarray, shape (coordinates, 1)
        Forces per unit of time.
    length : float
        Time of a window; the drag fades out in `FADE_WINDOWS` of them.
    """
    drag = _drag_of_starts(system)
    direction = np.repeat(direction, drag.shape[1], axis=1)
    state = system.start(np.zeros_like(direction))
    for number in count():
        place, way, slid = state.z.copy(), state.r.copy(), state.p.copy()
        squares = np.zeros_like(system.displacement(place))
        for sample in range(SAMPLES_OF_WINDOW):
            now = number + (sample + 1) / SAMPLES_OF_WINDOW
            system.advance(state, length * now, direction)
            state.v *= np.exp(-DRAG / SAMPLES_OF_WINDOW * max(0.0, 1 - now / FADE_WINDOWS) ** 2 * drag)
            squares += system.displacement(state.v) ** 2
        squares *= length / SAMPLES_OF_WINDOW
        yield Span(length, state.z - place, state.r - way, squares, state.p - slid)


def _drag_of_starts(system: OneSidedSystem) -> Floats:
    """Which coordinates the drag at the beginning acts on, shape (E, S): on all; and on all but rotations.

    One packing may vibrate in two ways, by its start. Large packings, and bodies, whose
    coordinates are of another kind, have one start.
    """
    configuration = system.motion.configuration
    spins = system.motion.active >= configuration.dimension * len(configuration)
    one = configuration.constraint is not None or configuration.coordinates > ONE_START or not spins.any()
    every = np.ones((len(spins), 1))
    return every if one else np.hstack([every, ~spins[:, None]])


def _is_known(system: OneSidedSystem, windows: list[Span]) -> bool:
    """Whether every start vibrates steadily, with a vibration that is known precisely enough."""
    return all(
        each["steady"]
        and each["vibration"] > VIBRATION_SHARE * each["drift"]
        and each["vibration_error"] <= VIBRATION_ERROR * each["vibration"]
        for each in _of_starts(system, windows)[1]
    )


def _of_starts(system: OneSidedSystem, windows: list[Span]) -> tuple[Span, list[dict[str, Any]]]:
    """The longest span that is steady from every start, or the last half; and what each start does in this span."""
    after = windows[FADE_WINDOWS:] or windows[-1:]
    for span, differs in ((after, TREND), (after[len(after) // 2 :], WINDOWS)):
        found = [_outcome(each, differs) for each in _parts(system, span)]
        if all(each["steady"] for each in found):
            break
    return Span.joined(span), found


def _parts(system: OneSidedSystem, span: list[Span]) -> Floats:
    """Drift and vibration of a span, of its two halves and of its four quarters, shape (S, 7, 2)."""
    edges = [0, len(span) // 4, len(span) // 2, 3 * len(span) // 4, len(span)]
    slices = [(0, 4), (0, 2), (2, 4), *((k, k + 1) for k in range(4))]
    if len(span) < LEAST_WINDOWS:
        known = Span.joined(span).drift_and_vibration(system)
        return np.stack([known, *(np.full_like(known, np.nan) for _ in slices[1:])]).transpose(2, 0, 1)
    parts = [Span.joined(span[edges[a] : edges[b]]).drift_and_vibration(system) for a, b in slices]
    return np.array(parts).transpose(2, 0, 1)


def _outcome(parts: Floats, differs: float) -> dict[str, Any]:
    """What the drift and the vibration of a span and of its parts say, shape (7, 2), whose halves may differ so far."""
    (drift, vibration), before, after = parts[:3]
    alike = abs(after[1] - before[1]) <= differs * after[1] and after[1] > VIBRATION_SHARE * after[0]
    vanishes = (
        after[1] <= VIBRATION_SHARE * after[0]
        and after[1] <= 2 * before[1]
        and vibration <= 2 * VIBRATION_SHARE * drift
    )
    errors: list[float | None] = [None, None]
    if np.all(np.isfinite(parts)):
        # of the mean of four, doubled, since quarters of a slow cycle are not independent
        spread = parts[3:].std(axis=0, ddof=1)
        errors = np.hypot(spread, ERROR_OF_STEPS * parts[0]).tolist()
    return {
        "drift": float(drift),
        "drift_error": errors[0],
        "vibration": float(vibration),
        "vibration_error": errors[1],
        "steady": bool(alike or vanishes),
    }


def vibrate_otherwise(first: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether the motions under a rising load from two starts differ: one is not steady, or vibrates more."""
    least, most = sorted((first["vibration"], other["vibration"]))
    alike = most - least <= WINDOWS * most or most <= VIBRATION_SHARE * first["drift"]
    return first["steady"] is not other["steady"] or not alike
