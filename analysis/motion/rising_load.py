"""Motion under a load that rises at a constant rate: drift, vibration, and how far this motion goes on.

The motion is proportional to the rate. Over a span of time its *drift* is the mean velocity of each particle, and its
*vibration* what is left of the velocities: root mean squares over particles and axes.

**Without contacts at Coulomb's bound** one solution of a sparse system says the drift
(:mod:`~faultgouge.analysis.motion.steady_drift`). The packing does not vibrate unless motion about the drift grows.

**With contacts at the bound** the motion is followed in windows of time. The beginning of the rise alone makes a
packing vibrate until its dashpots have taken the energy. A drag in the first windows takes this vibration away, and
fades out: a vibration that is left sustains itself. Contacts may stick and slide in a cycle of several windows. So
drift and vibration are means over a span of many windows: over all windows after the drag or, if these differ too much,
over the last half of them. The motion is steady if the two halves of this span agree. The error of a number is the
error of the mean of the four quarters of the span, and at least the error of the time steps.

Vibration may grow slowly from almost nothing. A packing is therefore said to follow the load only after the whole time.
One vibration was steady for ten windows and then grew to another one. So at least half of the time is followed, from
two starts: with a drag on all coordinates, and with a drag that leaves rotations alone. A packing may vibrate in two
ways, one from each start.

**Range.** While the load rises the drift takes sticking contacts to Coulomb's bound, and opens or closes others
(:mod:`~faultgouge.analysis.motion.next_change`). From then on the packing is another one. A contact that counts as at
the bound may lack a little force, and slides once the load has risen enough. The residual forces move the packing, too,
and count until the load has moved the packing ten times as far. If another contact reaches the bound or opens before,
there is no motion of this kind.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count, islice

import numpy as np

from ..arrays import Floats
from ..fields_by_name import FieldsByName
from ..progress import report_progress
from .contact_reach import PUSH_OVER_RESIDUAL, reaching_scale
from .next_change import next_change
from .one_sided import OneSidedSystem
from .one_sided_outcome import WINDOWS_OF_TIME, window_and_most
from .steady_drift import NotFollowedError, refuse_flight, steady_velocity

SAMPLES_OF_WINDOW = 400
"""Velocities that a window of a load that rises has."""

HALVES_DIFFERENCE = 0.2
"""Relative difference of the vibrations of two halves of the last half of the time, below which a motion is steady."""

TREND = 0.1
"""Relative difference of the vibrations of two halves of the whole time after the drag, below which all of this time
counts, and not the last half alone: in a packing whose vibration grew slowly for a third of the time it is 0.18."""

ERROR_OF_STEPS = 0.02
"""Relative error of drift and vibration by time steps of a tenth of the stable one."""

VIBRATION_ERROR = 0.1
"""Relative error of the vibration from which on a motion is not followed any longer."""

FADE_WINDOWS = 4
"""Windows in which the drag fades out."""

DRAG = 20.0
"""The drag at first, 1/tau in units of 1/window: it leaves exp(-DRAG FADE_WINDOWS/6) = 2e-6 of a mode's amplitude."""

ONE_START = 6000
"""Coordinates beyond which one start stands for two: each takes a minute or more."""

VIBRATION_SHARE = 1e-2
"""Vibration over drift of a packing that follows the load."""

VIBRATION_ROUNDING = 1e-6
"""Vibration over drift that may be rounding: the root of a difference of squares, whose digits are 1e-13 of these."""

LEAST_WINDOWS = 8
"""Windows of a span whose halves and quarters can be compared."""

ACCELERATION_POWER = 0.5
"""Power of the time, as which the mean velocity rises, from which on a motion has no constant drift. Half of the power
1 of particles whose dashpots alone bear a load that rises; particles that nothing bears have 2."""

LARGEST_GROWTH = 1e12
"""Growth of the vibration of a motion that has no drift."""


@dataclass(frozen=True)
class DriftAndVibration(FieldsByName):
    """Motion from one start, over the rate of loading; attributes and items are the same.

    Attributes
    ----------
    drift, vibration : float
        Root mean squares over particles and axes of the mean velocity, and of what is left of the velocities.
    drift_error, vibration_error : float or None
        Their errors; None if too few windows were followed.
    steady : bool
        Whether the motion goes on as it is.
    """

    drift: float
    drift_error: float | None
    vibration: float
    vibration_error: float | None
    steady: bool

    def vibrates_like(self, other: "DriftAndVibration") -> bool:
        """Whether the motion from another start is steady as well, or neither is, and vibrates as much."""
        least, most = sorted((self.vibration, other.vibration))
        alike = most - least <= HALVES_DIFFERENCE * most or most <= VIBRATION_SHARE * self.drift
        return self.steady is other.steady and alike

    def __str__(self) -> str:
        drift, vibration = (
            f"{name} {size:.3g}" + (f" \u00b1 {error:.1g}" if error else "")
            for name, size, error in (
                ("drift", self.drift, self.drift_error),
                ("vibration", self.vibration, self.vibration_error),
            )
        )
        return f"{drift}, {vibration}{'' if self.steady else ', not steady yet'}"


@dataclass(frozen=True)
class RisingMotion(DriftAndVibration):
    """Motion under a load that rises, over the rate of loading; attributes and items are the same.

    Attributes
    ----------
    drift, vibration, drift_error, vibration_error, steady
        As `DriftAndVibration` has them.
    time : float or None
        How long the motion was followed; None if it was solved for.
    span : float or None
        The last part of this time, of which drift and vibration are.
    other_start : DriftAndVibration or None
        The motion from another start, if one was followed.
    least_rise : float
        Increase of the load from which on contacts that count as at Coulomb's bound have reached the bound, and the
        load has moved the packing ten times as far as the residual forces do.
    next_change : float or None
        Increase of the load at which the first other contact changes.
    next_event : str or None
        What this contact does: it reaches the bound, opens, closes, or turns its force at the bound.
    """

    time: float | None = None
    span: float | None = None
    other_start: DriftAndVibration | None = None
    least_rise: float = 0.0
    next_change: float | None = None
    next_event: str | None = None


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
    velocities, squares : ndarray, shape (N, d, S)
        Integrals of the particles' velocities, and of their squares, both by the same samples: so the vibration, which
        is the root of a difference, has their digits, and not half of those of the sampling.
    slid : ndarray, shape (B, S)
        Growth of p of contacts at the bound, force.
    """

    time: float
    displacement: Floats
    paths: Floats
    velocities: Floats
    squares: Floats
    slid: Floats

    @classmethod
    def joined(cls, windows: Sequence["Span"]) -> "Span":
        """Of windows that follow each other."""
        names = "displacement", "paths", "velocities", "squares", "slid"
        sums = (np.sum([getattr(each, name) for each in windows], axis=0) for name in names)
        return cls(sum(each.time for each in windows), *sums)

    def drift_and_vibration(self, system: OneSidedSystem) -> Floats:
        """Root mean squares over particles and axes, shape (2, S)."""
        mean = system.displacement(self.displacement) / self.time
        left = np.maximum(self.squares / self.time - (self.velocities / self.time) ** 2, 0.0)
        return np.asarray(np.sqrt([np.mean(each, axis=(0, 1)) for each in (mean**2, left)]))


def motion_under_load(
    system: OneSidedSystem,
    direction: Floats,
    time: float | None = None,
    *,
    free: int = 0,
    decays: bool = True,
    residual: float = 0.0,
) -> RisingMotion:
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
    refuse_flight(system, direction)
    velocity = steady_velocity(system, direction, free) if decays else None
    if velocity is None:
        return follow_load(system, direction, time, residual)
    paths = np.abs(system.rescaled[0] @ velocity)
    moves = system.displacement(velocity)
    still = Span(1.0, velocity, paths, moves, moves**2, np.zeros((0, 1)))
    drift = float(still.drift_and_vibration(system)[0, 0])
    return _rising_motion(DriftAndVibration(drift, 0.0, 0.0, 0.0, True), system, still, residual)


def follow_load(
    system: OneSidedSystem, direction: Floats, time: float | None = None, residual: float = 0.0
) -> RisingMotion:
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
    span, (first, *others) = _of_starts(system, windows)
    motion = _rising_motion(first, system, span, residual)
    return replace(motion, time=length * len(windows), span=span.time, other_start=others[0] if others else None)


def _refuse_acceleration(system: OneSidedSystem, windows: list[Span], length: float) -> None:
    """Refuse a motion whose mean velocity rises on, as of contacts that slide on and on."""
    span = windows[FADE_WINDOWS:] or windows
    quarters, time = _parts(system, span)[0, 3:, 0], length * len(windows)
    if time < WINDOWS_OF_TIME * window_and_most(system, 1, None)[0]:
        return  # a slow vibration begins like that
    first, last = len(windows) - np.array([0.875, 0.125]) * len(span)  # the middles of two quarters
    if np.all(np.diff(quarters) > 0) and quarters[-1] > (last / first) ** ACCELERATION_POWER * quarters[0]:
        raise NotFollowedError(
            f"no constant drift is seen: the mean velocity over the rate rises from {quarters[0]:.3g} to "
            f"{quarters[-1]:.3g} within t = {time:.4g}, as where the load accelerates particles whose contacts slide "
            "on, or where the packing is slower than that: give more time"
        )


def _rising_motion(moves: DriftAndVibration, system: OneSidedSystem, span: Span, residual: float) -> RisingMotion:
    """A motion with the increases of the load between which the motion of a span holds.

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
        If there are none.
    """
    velocity, paths, slid = (each[:, :1] / span.time for each in (span.displacement, span.paths, span.slid))
    reached, (change, event) = reaching_scale(system, slid), next_change(system, velocity, slid, paths)
    drift = float(np.sqrt(system.mean_square_displacement(velocity)[0]))
    moved = PUSH_OVER_RESIDUAL * residual / drift if drift else 0.0
    least = max(reached, moved)
    if change is not None and least >= change:
        what = "contacts that count as at Coulomb's bound reach it" if reached > moved else "residual forces count less"
        raise NotFollowedError(
            f"{what} once the load has risen by {least:.1g}, and another contact {event} before, at {change:.1g}: "
            "bring the packing to rest more closely"
        )
    return RisingMotion(**moves, least_rise=least, next_change=change, next_event=event)


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
        velocities, squares = np.zeros((2, *system.displacement(place).shape))
        for sample in range(SAMPLES_OF_WINDOW):
            now = number + (sample + 1) / SAMPLES_OF_WINDOW
            system.advance(state, length * now, direction)
            state.v *= np.exp(-DRAG / SAMPLES_OF_WINDOW * max(0.0, 1 - now / FADE_WINDOWS) ** 2 * drag)
            velocity = system.displacement(state.v)
            velocities += velocity
            squares += velocity**2
        share = length / SAMPLES_OF_WINDOW
        yield Span(length, state.z - place, state.r - way, share * velocities, share * squares, state.p - slid)


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
        each.steady
        and each.vibration > VIBRATION_SHARE * each.drift
        and each.vibration_error is not None
        and each.vibration_error <= VIBRATION_ERROR * each.vibration
        for each in _of_starts(system, windows)[1]
    )


def _of_starts(system: OneSidedSystem, windows: list[Span]) -> tuple[Span, list[DriftAndVibration]]:
    """The longest span that is steady from every start, or the last half; and what each start does in this span."""
    after = windows[FADE_WINDOWS:] or windows[-1:]
    for span, differs in ((after, TREND), (after[len(after) // 2 :], HALVES_DIFFERENCE)):
        found = [_of_parts(each, differs) for each in _parts(system, span)]
        if all(each.steady for each in found):
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


def _of_parts(parts: Floats, differs: float) -> DriftAndVibration:
    """The motion of a span, from drift and vibration of the span and of its parts, shape (7, 2); halves that differ by
    no more than `differs` are steady."""
    (drift, vibration), before, after = parts[:3]
    alike = abs(after[1] - before[1]) <= differs * after[1] and after[1] > VIBRATION_SHARE * after[0]
    vanishes = (
        after[1] <= VIBRATION_SHARE * after[0]
        and after[1] <= max(2 * before[1], VIBRATION_ROUNDING * after[0])
        and vibration <= 2 * VIBRATION_SHARE * drift
    )
    errors: list[float | None] = [None, None]
    if np.all(np.isfinite(parts)):
        # of the mean of four, doubled, since quarters of a slow cycle are not independent
        spread = parts[3:].std(axis=0, ddof=1)
        errors = np.hypot(spread, ERROR_OF_STEPS * parts[0]).tolist()
    return DriftAndVibration(float(drift), errors[0], float(vibration), errors[1], bool(alike or vanishes))
