r"""Motion under a load that rises at a constant rate: drift, vibration, and how far this motion goes on.

The motion is proportional to the rate. Over a span of time its *drift* is the mean velocity of each particle, and its
*vibration* what is left of the velocities: root mean squares over particles and axes. A packing *vibrates* if its
vibration is steady, and more than `VIBRATION_SHARE` of its drift.

**Without contacts at Coulomb's bound** the drift under the load :math:`t\, \mathbf g` solves :math:`K \dot u = \mathbf
g`. If a law has two derivatives, one while a contact closes and one while it parts, K has for each contact the
derivative of its own way. A force that is left over belongs to a motion that no force opposes, which the load
accelerates for ever: then there is no drift. The packing does not vibrate unless motion about the drift grows.

**With contacts at the bound** the motion is followed in windows of time. The beginning of the rise alone makes a
packing vibrate until its dashpots have taken the energy. A drag in the first windows takes this vibration away, and
fades out: a vibration that is left sustains itself. Contacts may stick and slide in a cycle of several windows. So
drift and vibration are means over all windows after the drag or, if their halves differ too much, over the last half of
them. The error of a number is the spread of the four quarters of this span, and at least the error of the time steps.
Vibration may grow slowly from almost nothing: at least half of the time is followed, from two starts, with a drag on
all coordinates, and with one that leaves rotations alone.

**Range.** While the load rises the drift takes sticking contacts to Coulomb's bound, and opens or closes others. From
then on the packing is another one. A contact that counts as at the bound may lack a little force, and slides once the
load has risen enough. The residual forces move the packing, too, and count until the load has moved the packing ten
times as far. If another contact changes before, there is no motion of this kind. A force at the bound that turns by
:math:`a_c / \mu f_n` lets its contact pass the bound by :math:`a_c^2 / 2 \mu f_n`, and the packing in which it slides
then moves on until other contacts bear this.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import count, islice
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, diags_array, eye_array

from ..arrays import Floats
from ..counted import counted
from ..errors import FaultgougeError
from ..factors.sparse_lu import general_lu
from ..fields_by_name import FieldsByName
from ..progress import report_progress
from .eigenvalues import operator_rounding, zero_uncertainty
from .linear import linear_verdict
from .motion import Motion
from .one_sided import PUSH_OVER_RESIDUAL, WORK_OF_MOTION, OneSidedSystem

Window = tuple[Floats | float, ...]
"""Of a span of time: its length; what changes of mass-weighted displacements, shape (E, S), of the paths of overlaps of
contacts with two derivatives, (R, S), and of p of contacts at the bound, (B, S); and integrals of the particles'
velocities and of their squares, (N, d, S), both by the same samples, so that the vibration, which is the root of a
difference, has their digits. Each is the sum of those of the parts of the span."""

LOAD_STEP = 0.1
"""Time step of motion under a load, as a share of the largest stable one."""

WINDOW, WINDOWS = 300, 40
"""Stable time steps of a window, some ten periods of a slow mode, and how many windows are followed at the most."""

HALVES_DIFFERENCE, TREND = 0.2, 0.1
"""Relative differences of the vibrations of two halves below which a motion is steady: of the last half of the time,
and of all of it, which then counts. In a packing whose vibration grew slowly for a third of the time it is 0.18."""

FADE_WINDOWS = 4
"""Windows in which the drag fades out."""

DRAG = 20.0
"""The drag at first, 1/tau in units of 1/window: it leaves exp(-DRAG FADE_WINDOWS/6) = 2e-6 of a mode's amplitude."""

VIBRATION_SHARE = 0.05
"""Vibration over drift above which a packing vibrates, and below which it follows the load."""

NUMBERS = "drift", "vibration", "drift_error", "vibration_error", "steady"
EVENTS = "reaches Coulomb's bound", "opens", "closes", "at Coulomb's bound turns its force", "slides back"


class NotFollowedError(FaultgougeError):
    """The motion under a load that rises has no constant drift and no vibration about it."""


def motion_under_load(
    system: OneSidedSystem,
    direction: Floats,
    time: float | None = None,
    *,
    free: int = 0,
    decays: bool = True,
    residual: float = 0.0,
) -> FieldsByName:
    """Drift and vibration under a load that rises at the rate 1: `Stability.rising`.

    No small motion is known to grow. `direction` has forces per unit of time, shape (coordinates, 1), `free` motions no
    force opposes, and `residual` is the root mean square displacement of the particles by the residual forces, length.
    The motion is followed for the time, or until it is steady; where it is known that motion with sticking contacts
    `decays` the drift may be solved for.

    Returns
    -------
    FieldsByName
        `drift` and `vibration`: root mean squares over particles and axes of the mean velocity, and of what is left of
        the velocities, over the rate of loading; `drift_error` and `vibration_error`, None if too few windows were
        followed; `steady`: whether the motion goes on as it is. `time`: how long it was followed, None if it was solved
        for, and `span`, the last part of this time, of which drift and vibration are. `other_start`: these five numbers
        of the motion from another start, if one was followed. `least_rise`: increase of the load from which on contacts
        that count as at Coulomb's bound have reached the bound, and the load has moved the packing ten times as far as
        the residual forces do. `next_change` and `next_event`: increase of the load at which the first other contact
        changes, and what it does.

    Raises
    ------
    NotFollowedError
        If the load accelerates a motion that no force opposes, or particles that touch nothing, or if no load is large
        enough.
    """
    c, load = system.configuration, np.asarray(system.weight.T @ direction)
    loaded = c.coordinate_free & (direction[:, 0] != 0)
    loaded[system.motion.active] = False
    if flying := len(np.unique(np.flatnonzero(loaded) % len(c))):
        alone = f"{counted(flying, 'particle')} that nothing touches"
        raise NotFollowedError(f"the load accelerates {alone}: give no forces on these")
    velocity = _steady_velocity(system, load, free) if decays and not len(system.missing) else None
    if velocity is None:
        span, found = _followed(system, load, time)
        velocity, paths, slid = (np.asarray(each)[:, :1] / span[0] for each in span[1:4])
    else:
        paths, slid = np.abs(system.rates @ velocity), np.zeros((0, 1))
        solved = float(np.sqrt(np.mean(system.displacement(velocity) ** 2)))
        found = dict(zip(NUMBERS, (solved, 0.0, 0.0, 0.0, True), strict=True))
        found |= dict.fromkeys(("time", "span", "other_start"))
    counts = slid > 0.1 * slid.max(initial=0.0)
    reached = float((system.missing[counts] / slid[counts]).max(initial=0.0))
    change, event = next_change(system, velocity, slid, paths)
    drift = float(np.sqrt(system.mean_square_displacement(velocity)[0]))
    least = max(reached, PUSH_OVER_RESIDUAL * residual / drift if drift else 0.0)
    if change is not None and least >= change:
        what = "contacts counted as at Coulomb's bound reach it" if reached == least else "residual forces count less"
        before = f"another contact {event} before, at {change:.1g}: bring the packing to rest more closely"
        raise NotFollowedError(f"{what} once the load has risen by {least:.1g}, and {before}")
    return FieldsByName(**found, least_rise=least, next_change=change, next_event=event)


def _steady_velocity(system: OneSidedSystem, load: Floats, free: int) -> Floats | None:
    """The drift, mass-weighted, shape (E, 1); None if the motion is to be followed."""
    motion, way = system.motion, np.zeros(system.rates.shape[0])
    for _ in range(60):  # a few times are enough where the solution is unique
        a = motion.stiffness
        if len(way):
            a = csr_array(a - csr_array(system.wear) @ diags_array(way) @ csr_array(system.rates))
        velocity = static_response(replace(motion, stiffness=a), load, free)
        if np.linalg.norm(load - a @ velocity) > 1e-6 * np.linalg.norm(load):
            moves = f"{counted(free, 'motion')} that no" if free else "a motion that next to no"
            raise NotFollowedError(f"the load accelerates {moves} force opposes")
        before, way = way, np.sign(system.rates @ velocity)[:, 0]
        if np.array_equal(before, way):
            steady = not len(way) or linear_verdict(replace(motion, stiffness=a)).stable is True
            return velocity if steady else None
    return None


def static_response(motion: Motion, load: Floats, free: int = 0) -> Floats:
    """v of A v = load, mass-weighted forces of shape (E, P), without the motions that no force opposes, so many."""
    matrix = motion.stiffness
    shift = 1e-11 * float(np.abs(matrix.data).max(initial=0.0))  # free motions do not divide by zero
    if free:
        rounding = operator_rounding(motion.configuration, matrix.data)
        shift = max(shift, 10 * zero_uncertainty(motion.configuration, rounding))
    factors = general_lu(csc_array(matrix + shift * eye_array(matrix.shape[0])))
    moved = np.zeros_like(load)
    for _ in range(4):  # each but the first takes the shift out once more
        moved += factors.solve(load - matrix @ moved)
    return moved


def _followed(system: OneSidedSystem, load: Floats, time: float | None) -> tuple[Window, dict[str, Any]]:
    """The last part of a motion that is followed, and its drift and vibration."""
    length = WINDOW * system.stable_step
    entries = system.motion.stiffness.nnz + system.motion.damping.nnz
    most = int(np.clip(WORK_OF_MOTION / (entries * WINDOW / LOAD_STEP), 4, WINDOWS))
    if time is not None:
        most = max(16, int(np.ceil(time / length)))
        length = time / most
    windows: list[Window] = []
    for window in islice(windows_under_load(system, load, length), most):
        windows.append(window)
        seen, now = means_of_windows(system, [window])[1].max(), length * len(windows)
        report_progress(f"under the rising load: t = {now:.4g}, vibration {seen:.3g}")
        if not seen < 1e12 * means_of_windows(system, windows[:1]).max():
            raise NotFollowedError(f"the motion grows without end: within t = {now:.4g} by 1e12")
        if time is None and 2 * len(windows) >= most and all(
            each.steady and each.vibration > VIBRATION_SHARE * each.drift
            and (each.vibration_error or np.inf) <= 0.1 * each.vibration for each in _of_starts(system, windows)[1]
        ):  # fmt: skip
            break
    after = windows[FADE_WINDOWS:] or windows
    quarters = _in_parts(system, after)[0, 3:, 0]
    # the middles of two quarters; of particles whose dashpots alone bear the load the mean velocity rises as the time,
    # and of particles that nothing bears as its square
    first, last = len(windows) - np.array([0.875, 0.125]) * len(after)
    if np.all(np.diff(quarters) > 0) and quarters[-1] > (last / first) ** 0.5 * quarters[0]:
        rises = f"rises from {quarters[0]:.3g} to {quarters[-1]:.3g} within t = {now:.4g}"
        where = "where the load accelerates particles whose contacts slide on, or the packing is slower than that"
        says = f"no constant drift is seen: the mean velocity over the rate {rises}"
        raise NotFollowedError(f"{says}, as {where}: give more time")
    span, (one, *others) = _of_starts(system, windows)
    whole: Window = tuple(sum(each) for each in zip(*span, strict=True))
    return whole, {**one, "time": now, "span": whole[0], "other_start": others[0] if others else None}


def windows_under_load(system: OneSidedSystem, load: Floats, length: float) -> Iterator[Window]:
    """One window after the other, each of a `length` of time, under a load that rises (mass-weighted, shape (E, 1)).

    From two starts: with a drag on all coordinates, and on all but rotations, as one packing may vibrate in two ways.
    Large packings, and bodies, whose coordinates are of another kind, have one start.
    """
    c = system.configuration
    spins = system.motion.active[:, None] >= c.dimension * len(c)
    starts = 1 if c.constraint is not None or c.coordinates > 6000 or not spins.any() else 2
    drag = np.hstack([np.ones(spins.shape), ~spins])[:, :starts]
    state, load = system.start(np.zeros((c.coordinates, starts))), np.repeat(load, starts, axis=1)
    samples, velocities = 400, np.zeros((2, len(c), c.dimension, starts))
    for number in count():
        begin = [each.copy() for each in (state.z, state.r, state.p)]
        velocities[:] = 0.0
        for sample in range(1, samples + 1):
            now = number + sample / samples
            system.advance(state, length * now, LOAD_STEP, load)
            state.v *= np.exp(-DRAG / samples * max(0.0, 1 - now / FADE_WINDOWS) ** 2 * drag)
            velocity = system.displacement(state.v)
            velocities += np.array([velocity, velocity**2])
        moved = [after - before for after, before in zip((state.z, state.r, state.p), begin, strict=True)]
        yield (length, *moved, *(length / samples * velocities))


def means_of_windows(system: OneSidedSystem, windows: list[Window]) -> Floats:
    """Root mean squares over particles and axes, of a span of windows, shape (2, S)."""
    time, moved, _, _, velocities, squares = (sum(each) for each in zip(*windows, strict=True))
    left = np.maximum(squares / time - (velocities / time) ** 2, 0.0)
    return np.sqrt(np.mean([(system.displacement(moved) / time) ** 2, left], axis=(1, 2)))


def _of_starts(system: OneSidedSystem, windows: list[Window]) -> tuple[list[Window], list[FieldsByName]]:
    """The longest span that is steady from every start, or the last half; and what each start does in this span."""
    after = windows[FADE_WINDOWS:] or windows[-1:]
    for span, differs in ((after, TREND), (after[len(after) // 2 :], HALVES_DIFFERENCE)):
        found = []
        for parts in _in_parts(system, span):
            (drift, vibration), (_, before), (later, late) = parts[:3]
            follows = late <= VIBRATION_SHARE * later
            vanishes = late <= max(2 * before, 1e-6 * later)  # rounding of the root
            vanishes &= vibration <= 2 * VIBRATION_SHARE * drift
            steady = bool(vanishes if follows else abs(late - before) <= differs * late)
            # of the mean of four, doubled, since quarters of a slow cycle are not independent
            spread = np.hypot(parts[3:].std(axis=0, ddof=1), 0.02 * parts[0])  # and of time steps
            errors = spread.tolist() if np.all(np.isfinite(parts)) else [None, None]
            found.append(FieldsByName(zip(NUMBERS, [*parts[0].tolist(), *errors, steady], strict=True)))
        if all(each.steady for each in found):
            break
    return span, found


def _in_parts(system: OneSidedSystem, span: list[Window]) -> Floats:
    """Drift and vibration of a span, its two halves and its four quarters, shape (S, 7, 2); nan of too few windows."""
    edges = [k * len(span) // 4 for k in range(5)]
    slices = [(0, 4), (0, 2), (2, 4), *((k, k + 1) for k in range(4))][: 7 if len(span) >= 8 else 1]
    parts = np.array([means_of_windows(system, span[edges[a] : edges[b]]) for a, b in slices])
    return np.pad(parts, ((0, 7 - len(parts)), (0, 0), (0, 0)), constant_values=np.nan).transpose(2, 0, 1)


def next_change(
    system: OneSidedSystem, velocity: Floats, slid: Floats, paths: Floats
) -> tuple[float | None, str | None]:
    """At which increase of the load a contact changes first, and what it does; None twice if none is known.

    By the mean mass-weighted velocity at the rate 1, shape (E, 1), and the mean rates at which contacts at the bound
    slide, force, (B, 1), and of the paths of the overlaps of contacts with two derivatives, (R, 1).
    """
    if system.configuration.stiffness is not None:
        return None, None
    changes, slowly = system.changes, np.zeros_like(velocity)  # dashpots do not count
    multiples = changes.multiples(velocity, slowly, slid, paths)
    back = multiples.reaches[changes.slides].min(initial=np.inf)
    multiples.reaches[changes.slides] = np.inf
    found = [float(each.min(initial=np.inf)) for each in multiples] + [float(back)]
    first, event = min(zip(found, EVENTS, strict=True))
    if event == EVENTS[3]:
        first = min(first, _change_by_turning(system, velocity, np.isfinite(multiples.turns[:, 0])))
    return (first, event) if first < np.inf else (None, None)


def _change_by_turning(system: OneSidedSystem, velocity: Floats, turns: NDArray[np.bool_]) -> float:
    """Increase of the load at which contacts that slide on, as their forces have turned, change the drift by a tenth;
    NotFollowedError if nothing holds the particles then."""
    grip, excess, changes = csr_array(system.grip), csr_array(system.excess), system.changes
    sideways = csr_array(changes.rows)[len(changes.bound) + changes.slides] @ velocity
    load = grip @ np.where(turns[:, None], sideways**2 / (2 * changes.bound[changes.slides]), 0.0)
    a = csr_array(system.motion.stiffness + grip[:, turns] @ excess[turns])
    moves = static_response(replace(system.motion, stiffness=a), load, 1)
    if np.linalg.norm(load - a @ moves) > 1e-6 * np.linalg.norm(load):
        turned = "the load turns the forces of contacts at Coulomb's bound"
        raise NotFollowedError(f"{turned}, and nothing holds the particles that slide then")
    size, change = (system.mean_square_displacement(each)[0] for each in (velocity, moves))
    return float(0.1 * np.sqrt(size / change)) if change else np.inf
