r"""What becomes of one-sided motion: it grows, rests or has not settled; or drifts and vibrates under a rising load.

Motions begin with random pushes of all particles alike, and with their opposites, since one-sided motion is not odd. A
motion *grows* if D has gained `DECADES` and still gains at a steady rate; it *rests* if the sliders have come to rest
and the packing with sticking contacts does not grow, since then the motion is linear and decays for ever. Otherwise the
motion has not settled. The time is `STEPS_OF_CHUNK` stable time steps as often as needed, up to `WORK` multiplications.

Under a load that rises at a constant rate the motion is proportional to the rate. Its *drift* is the mean velocity of
each particle over a window, its *vibration* what is left: root mean squares over particles and axes. A load that begins
to rise makes a packing vibrate that would follow a load which always rose, for as long as its dashpots need. So a drag
takes this vibration away at first, and fades out; what vibrates later sustains itself. Vibration may grow slowly from
next to nothing, so that no packing is said to follow the load before the whole time is over. A vibration was seen to be
steady for ten chunks and then to grow to another one; so half of the time at least is followed, and from two starts,
which differ in whether the drag acts on rotations. One packing may vibrate in two ways, by its start.
"""

from collections.abc import Callable, Iterator, Mapping
from itertools import count, islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..configuration import Configuration
from ..progress import report_progress
from .one_sided import ContactReach, OneSidedState, OneSidedSystem

PUSHES = 2
"""Random pushes; the opposite of each is followed, too, since one-sided motion is not odd."""

VERDICT_STEP = 0.1
"""Time step of one-sided motion as a share of the largest stable one: rates of growth are right to some per cent."""

STEP_OF_LARGE = 0.3
"""The same of large packings. With 0.4, beside steps of a sixteenth, rates of growth of four packings of 50 spheres are
3 to 5 % too large."""

STEPS_OF_CHUNK = 300
"""Stable time steps between two looks at whether a motion has settled: some ten periods of a slow mode."""

LOOKS_PER_CHUNK = 10
"""D is looked at so often in a chunk."""

WORK = 2e11
"""Multiplications with entries of the operators that one motion may take: three minutes."""

DECADES = 8.0
"""Growth of D that no packing at rest was seen to reach without growing for ever: transient amplification of packings
at Coulomb's bound went up to 6e5."""

MOST_DECADES = 25.0
"""Growth of D at which a motion has grown enough."""

STEADY = 0.3
"""A motion still grows if D gains this share of its mean rate, in each quarter of the second half of the time."""

EXPONENTIAL = 0.85
"""Ratio of the growth in the last two quarters of the time from which growth is exponential: of any power of the
time it is 0.71."""

SETTLED = 1e-3
"""Change of p in a quarter of the time, as a share of the largest p, below which sliders may be at rest."""

LATE = 12
"""Chunks after which the slip of all contacts together decides. A motion that grows as exp(t) gains 15 decades in a
packing of spheres."""

SAMPLES_OF_WINDOW = 400
"""Velocities that a window of a load that rises has."""

WINDOWS = 0.2
"""Relative difference of the vibrations of two windows below which a motion under a rising load is steady."""

FADE = 4
"""Chunks in which the drag under a load that rises fades out."""

DRAG = 20.0
"""That drag at first, 1/tau in units of 1/chunk: it takes exp(-DRAG FADE/6) = 2e-6 of the amplitude of a mode."""

ONE_START = 6000
"""Coordinates beyond which one start under a rising load stands for two: each takes a minute or more."""

VANISHES = 1e-2
"""Vibration over drift of a packing that follows the load."""


def _chunks(system: OneSidedSystem, columns: int, time: float | None) -> tuple[float, int]:
    """Time of a chunk, and how many there are at most."""
    chunk = STEPS_OF_CHUNK * system.step / system.share
    if time is not None:
        return time / 16, 16
    entries = (system.motion.stiffness.nnz + system.motion.damping.nnz) * columns
    return chunk, int(np.clip(WORK / (entries * chunk / system.step), 4, 40))


def follow_pushes(
    system: OneSidedSystem, sticking: float, sticking_grows: bool, time: float | None = None, pushes: int = PUSHES
) -> dict[str, Any]:
    """Whether one-sided motion grows from some pushes: `Stability.one_sided`.

    Parameters
    ----------
    system : OneSidedSystem
        Of the configuration.
    sticking, sticking_grows : float, bool
        Growth rate with sticking contacts, 1 / time, and whether they are known to grow.
    time : float, optional
        How long; until the motion has settled by default.
    pushes : int
        How many; the opposite of each is followed, too.
    """
    state = system.start(random_pushes(system.motion.configuration, pushes))
    chunk, most = _chunks(system, 2 * pushes, time)
    times, sizes, slid, reach = [], [], [state.p.copy()], ContactReach(system)
    grows: bool | None = None
    for number in range(most):
        for look in range(LOOKS_PER_CHUNK):
            system.advance(state, chunk * (number + (look + 1) / LOOKS_PER_CHUNK))
            times.append(state.time)
            sizes.append(_mean_square(system, state))
            slid.append(state.p.copy())
            reach.look(state)
        seen = np.array(times), np.array(sizes)
        report_progress(f"one-sided motion: t = {state.time:.4g}, D = {seen[1][-1].max():.3g} push^2")
        grows = _outcome(*seen, slid, sticking_grows)
        if time is None and grows is not None:
            break
        if not np.all(np.isfinite(seen[1][-1])):
            break
    t, d = seen
    rate, error = _rate(t, d)
    return {
        "grows": grows,
        "growth_rate": rate if grows else sticking if grows is False else None,
        "error": error if grows else None,
        "amplification": float(d.max()),
        "time": float(t[-1]),
        "pushes": 2 * pushes,
        "scales": reach.scales,
    }


def random_pushes(configuration: Configuration, pushes: int) -> Floats:
    """Velocities of all coordinates, normal random numbers without rotations, and their opposites, shape (.., 2 P)."""
    rng = np.random.Generator(np.random.PCG64(0))
    push = np.zeros((configuration.coordinates, pushes))
    moving = configuration.dimension * len(configuration)
    push[:moving] = rng.standard_normal((moving, pushes))
    return np.hstack([push, -push])


def _mean_square(system: OneSidedSystem, state: OneSidedState) -> Floats:
    """D of each push, shape (P,)."""
    return np.asarray(np.sum(system.displacement(state.z) ** 2, axis=1).mean(axis=0))


def _outcome(time: Floats, size: Floats, slid: list[Floats], sticking_grows: bool) -> bool | None:
    """Whether the motion grows, rests (False), or has not settled.

    Sliders rest if they moved little in the third quarter of the time, and less by half, or not at all, in the fourth:
    each of them, or late all of them together, as of thousands one or the other slips a last time.
    """
    largest = size.max(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        gained = np.log10(largest / largest[0])
    if gained[-1] > MOST_DECADES or (gained[-1] > DECADES and _still_grows(time, gained)):
        return True
    if sticking_grows or len(slid) <= 2 * LOOKS_PER_CHUNK:
        return None
    half, three = len(slid) // 2, 3 * len(slid) // 4
    of_any = _slip_dies(slid[half], slid[three], slid[-1], np.max)
    of_all = _slip_dies(slid[half], slid[three], slid[-1], np.sum) & (len(slid) > LATE * LOOKS_PER_CHUNK)
    return False if np.all(of_any | of_all) else None


def _slip_dies(half: Floats, three: Floats, end: Floats, over: Callable[..., Floats]) -> NDArray[np.bool_]:
    """Whether the largest slip of a contact, or that of all contacts, dies away, of each push; p at three times."""
    whole, before, after = (over(np.abs(slip), axis=0) for slip in (end, three - half, end - three))
    falls = (after <= 0.5 * before) | (after <= np.finfo(float).eps * whole)
    return np.asarray(falls & (before <= SETTLED * whole))


def _still_grows(time: Floats, gained: Floats) -> bool:
    """Whether D gains at a steady rate in the second half of the time.

    D that saturates does not, nor D that grows as a power of the time: motion that no force opposes drifts, and is
    accelerated by what sliders have let go.
    """
    parts = np.array_split(np.arange(len(time) // 2, len(time)), 4)
    mean = gained[-1] / time[-1]
    steps = np.array(
        [(gained[part[-1]] - gained[part[0] - 1]) / (time[part[-1]] - time[part[0] - 1]) for part in parts]
    )
    return bool(steps.min() > STEADY * mean and steps[2:].sum() > EXPONENTIAL * steps[:2].sum())


def _rate(time: Floats, size: Floats) -> tuple[float, float]:
    """Growth rate of D over the second half of the time, and its error: what its two quarters differ by."""
    fastest = int(np.argmax(size[-1]))
    with np.errstate(divide="ignore"):
        logs = np.log(size[:, fastest])
    quarters = [slice(len(time) // 2, 3 * len(time) // 4), slice(3 * len(time) // 4, len(time))]
    slopes = [np.polyfit(time[part], logs[part], 1)[0] for part in quarters if len(time[part]) > 1]
    if len(slopes) < 2 or not np.all(np.isfinite(slopes)):
        return float("nan"), float("nan")
    return float(np.mean(slopes)), float(abs(slopes[1] - slopes[0]) / 2)


def follow_load(system: OneSidedSystem, direction: Floats, time: float | None = None) -> dict[str, Any]:
    """Drift and vibration under a load that rises at the rate 1: `Stability.rising`.

    Parameters
    ----------
    system : OneSidedSystem
        Of the configuration.
    direction : ndarray, shape (coordinates, 1)
        Forces per unit of time.
    time : float, optional
        How long; the vibration of the two last quarters is compared.
    """
    chunk, most = _chunks(system, 1, time)
    windows: list[Floats] = []
    for window in islice(windows_under_load(system, direction, chunk), most):
        windows.append(window)
        report_progress(f"under the rising load: t = {chunk * len(windows):.4g}, vibration {window[1].max():.3g}")
        if time is None and 2 * len(windows) >= most and all(map(_vibrates, _of_starts(windows))):
            break
    found = []
    for after in _of_starts(windows):
        last = np.array(after[-(len(after) // 4 or 1) :])
        drift, vibration = np.sqrt(np.mean(last**2, axis=0)).tolist()
        found.append({"drift": drift, "vibration": vibration, "steady": _vibrates(after) or _vanishes(after)})
    first, *others = found
    return {**first, "time": chunk * len(windows), "other_start": others[0] if others else None}


def windows_under_load(system: OneSidedSystem, direction: Floats, chunk: float) -> Iterator[Floats]:
    """Drift and vibration in one window after the other under a load that rises, shape (2, S) of S starts.

    Parameters
    ----------
    system : OneSidedSystem
        Of the configuration.
    direction : ndarray, shape (coordinates, 1)
        Forces per unit of time.
    chunk : float
        Time of a window; the drag fades out in `FADE` of them.
    """
    drag = _drag_of_starts(system)
    direction = np.repeat(direction, drag.shape[1], axis=1)
    state = system.start(np.zeros_like(direction))
    for number in count():
        start = system.displacement(state.z)
        squares: NDArray[np.float64] = np.zeros_like(start)
        for sample in range(SAMPLES_OF_WINDOW):
            now = number + (sample + 1) / SAMPLES_OF_WINDOW
            system.advance(state, chunk * now, direction)
            state.v *= np.exp(-DRAG / SAMPLES_OF_WINDOW * max(0.0, 1 - now / FADE) ** 2 * drag)
            squares += system.displacement(state.v) ** 2 / SAMPLES_OF_WINDOW
        mean = (system.displacement(state.z) - start) / chunk
        yield np.array([_root_mean(mean**2), _root_mean(np.maximum(squares - mean**2, 0.0))])


def _drag_of_starts(system: OneSidedSystem) -> Floats:
    """Which coordinates the drag at the beginning acts on, shape (E, S): on all; and on all but rotations.

    Large packings, and bodies, whose coordinates are of another kind, have one start.
    """
    configuration = system.motion.configuration
    spins = system.motion.active >= configuration.dimension * len(configuration)
    one = configuration.constraint is not None or configuration.coordinates > ONE_START or not spins.any()
    every = np.ones((len(spins), 1))
    return every if one else np.hstack([every, ~spins[:, None]])


def _of_starts(windows: list[Floats]) -> list[list[Floats]]:
    """Drift and vibration of each window once the drag has faded, each of shape (2,), of each start."""
    after = windows[FADE:] or windows[-1:]
    return [[window[:, start] for window in after] for start in range(after[0].shape[1])]


def _vibrates(windows: list[Floats]) -> bool:
    """Whether the vibrations of the third and of the last quarter agree, and are more than what a start leaves."""
    before, after = _last_quarters(windows)
    return bool(abs(after[1] - before[1]) <= WINDOWS * after[1] and after[1] > VANISHES * after[0])


def vibrate_otherwise(first: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether the motions under a rising load from two starts differ: one is not steady, or vibrates more."""
    least, most = sorted((first["vibration"], other["vibration"]))
    alike = most - least <= WINDOWS * most or most <= VANISHES * first["drift"]
    return first["steady"] is not other["steady"] or not alike


def _vanishes(windows: list[Floats]) -> bool:
    """Whether there is next to no vibration, and none that grows: windows of so little are uneven."""
    before, after = _last_quarters(windows)
    return bool(after[1] <= VANISHES * after[0] and after[1] <= 2 * before[1])


def _last_quarters(windows: list[Floats]) -> tuple[Floats, Floats]:
    """Mean drift and vibration of the third and of the last quarter, of two windows at least; otherwise not numbers."""
    quarter = len(windows) // 4
    if quarter < 2:
        return np.full(2, np.nan), np.full(2, np.nan)
    third, fourth = windows[-2 * quarter : -quarter], windows[-quarter:]
    return np.mean(third, axis=0), np.mean(fourth, axis=0)


def _root_mean(squares: Floats) -> Floats:
    """Over particles and axes, shape (S,), of shape (N, d, S)."""
    return np.asarray(np.sqrt(np.mean(squares, axis=(0, 1))))
