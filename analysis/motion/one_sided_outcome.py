r"""What becomes of one-sided motion: it grows, rests or has not settled.

Motions begin with random pushes of all particles, and with the opposites of these pushes, since one-sided motion is not
odd. A motion

- *grows* if D has gained `DECADES` and still gains at a steady rate;
- *rests* if the sliders have come to rest and the packing with sticking contacts does not grow: from then on the motion
  is linear and decays. A slow vibration lets contacts slip for as long as it lasts. Such a motion rests, too, if the
  slips in four spans of time fall about as fast as this vibration, and little slip is still to come;
- *has not settled* otherwise.

A motion is followed in chunks of `STEPS_OF_CHUNK` stable time steps, up to `WORK` multiplications; of small packings up
to `MOST_CHUNKS`, or longer if D gains at a steady rate, by which it may gain `DECADES` in the end.

Under a law of two derivatives vibration wears tangential forces down (:mod:`~faultgouge.analysis.motion.creep`), at a
rate that falls with the vibration, so that sliders may slide again after they have come to rest. Such a motion rests as
long as D does not gain at a steady rate afterwards.

**The numbers below.** `benchmarks/verdict_numbers.py` makes the verdict on 40 small packings with contacts at the
bound, within `MOST_CHUNKS`: 24 rest, 12 grow, and 4 have not settled. All 36 do so in LAMMPS. None of these 36 verdicts
turns into its opposite if any of seven numbers is halved or doubled. Half of `DECADES` decides two more packings, which
grow in LAMMPS as well, and are followed for longer; twice `DECADES` leaves two others open.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..configuration import Configuration
from ..fields_by_name import FieldsByName
from ..progress import report_progress
from .contact_reach import ContactReach
from .one_sided import OneSidedState, OneSidedSystem
from .random_state import CHANCE

PUSHES = 2
"""Random pushes; the opposite of each is followed, too, since one-sided motion is not odd."""

VERDICT_STEP = 0.1
"""Time step of one-sided motion as a share of the largest stable one: rates of growth are right to some per cent."""

STEP_OF_LARGE = 0.3
"""Time step for large packings, as a share of the largest stable one. With 0.4 rates of growth of four packings of 50
spheres are 3 to 5 % larger than with steps of a sixteenth."""

STEPS_OF_CHUNK = 300
"""Stable time steps between two looks at whether a motion has settled: some ten periods of a slow mode."""

LOOKS_PER_CHUNK = 10
"""D is looked at so often in a chunk."""

WORK = 2e11
"""Multiplications with entries of the operators that one motion may take: three minutes."""

MOST_CHUNKS, CHUNKS_OF_GROWTH = 40, 120
"""Chunks that small packings are followed at the most, and those in which D gains at a steady rate."""

DECADES = 8.0
"""Growth of D that no packing at rest was seen to reach without growing for ever: transient amplification of packings
at Coulomb's bound went up to 6e5."""

FOLDS_OF_GROWTH = float(DECADES * np.log(10) - 2 * np.log(CHANCE))
"""E-folds of D after which growth is seen, but for the probability `CHANCE` that a push has less of the motion."""

MOST_DECADES = 25.0
"""Growth of D at which a motion has grown enough."""

GAIN_SHARE = 0.3
"""A motion still grows if D gains this share of its mean rate, in each quarter of the second half of the time."""

EXPONENTIAL_RATIO = 0.85
"""Ratio of the growth in the last two quarters of the time from which growth is exponential: of any power of the
time it is 0.71."""

SLIP_CHANGE = 1e-3
"""Change of p in a quarter of the time, as a share of the largest p, below which sliders may be at rest."""

WINDOWS_OF_TIME = 16
"""Parts of a time that is given, at the least."""

CHUNKS_BEFORE_SUM = 12
"""Chunks after which the slip of all contacts together decides. A motion that grows as exp(t) gains 15 decades in a
packing of spheres."""

SLIP_SPANS = 8
"""Spans of the time, over the last four of which slips are to fall with the slowest vibration."""

DECAY_SHARE = 0.5
"""Least rate at which slips fall, as a share of the rate of the slowest vibration: the sums over spans are uneven."""

SLIP_LEFT_SHARE = 0.05
"""Slip that may be left, as a share of all slip; D then changes by less than a tenth."""


@dataclass(frozen=True)
class OneSidedOutcome(FieldsByName):
    """What became of one-sided motion after some pushes.

    Attributes and items are the same: `outcome.grows` is `outcome["grows"]`.

    Attributes
    ----------
    grows : bool or None
        None if the motion has not settled.
    growth_rate : float or None
        Of D, 1 / time: of the motion that grows, or with sticking contacts if it rests; None if it has not settled.
    error : float or None
        Error of the growth rate of a motion that grows.
    searched : float
        Growth rate of D, 1 / time, below which growth may not have been seen; 0 where `grows` is known.
    needed : float or None
        After which time `grows` may be known: as D gains at its rate, or at that with sticking contacts; or as contacts
        slide while the slowest vibration decays. None where `grows` is known, or this time is over.
    amplification : float
        Largest D, while contacts slid, over the mean square velocity of the push along an axis, time^2: motion that
        goes on may take D further.
    slip_left : float or None
        How much of their slip contacts may have still to come, as a share; 0 if they have stopped, None if that is not
        known.
    wears : bool
        Whether vibration wears contacts down, so that they may slide again.
    time : float
        How long the motion was followed.
    pushes : int
        How many pushes, the opposite of each among them.
    scales : tuple of float
        Between which velocities of the push along an axis this holds. Below, contacts that count as at the bound do not
        reach it, or the residual forces move the packing as well; above, other contacts reach the bound, open or
        close, or the force of one at the bound turns. The
        first is infinite if no such push was found, or if the residual forces alone take another contact so far.
    """

    grows: bool | None
    growth_rate: float | None
    error: float | None
    searched: float
    needed: float | None
    amplification: float
    slip_left: float | None
    wears: bool
    time: float
    pushes: int
    scales: tuple[float, float]


@dataclass(frozen=True)
class Looks:
    """Looks at P motions: times; D, shape (P,) each; and p of sliders, shape (B, P) each, from the start on."""

    times: list[float]
    sizes: list[Floats]
    slid: list[Floats]
    wears: bool

    def look(self, system: OneSidedSystem, state: OneSidedState) -> None:
        """Look at the motions once more."""
        self.times.append(state.time)
        self.sizes.append(system.mean_square_displacement(state.z))
        self.slid.append(state.p.copy())

    @property
    def time(self) -> Floats:
        """Times, shape (T,)."""
        return np.array(self.times)

    @property
    def size(self) -> Floats:
        """D, shape (T, P)."""
        return np.array(self.sizes)


def window_and_most(
    system: OneSidedSystem, columns: int, time: float | None, chunks: int = MOST_CHUNKS
) -> tuple[float, int]:
    """Time of a window, and how many there are at most; up to so many chunks if no time is given."""
    chunk = STEPS_OF_CHUNK * system.time_step / system.step_share
    if time is not None:
        return time / WINDOWS_OF_TIME, WINDOWS_OF_TIME
    entries = (system.motion.stiffness.nnz + system.motion.damping.nnz) * columns
    return chunk, int(np.clip(WORK / (entries * chunk / system.time_step), 4, chunks))


def follow_pushes(
    system: OneSidedSystem, sticking: float, sticking_grows: bool, time: float | None = None, pushes: int = PUSHES
) -> tuple[OneSidedOutcome, ContactReach]:
    """Whether one-sided motion grows from some pushes: `Stability.one_sided`, and how far the motion took contacts.

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
    chunk, most = window_and_most(system, 2 * pushes, None)
    longest = window_and_most(system, 2 * pushes, None, CHUNKS_OF_GROWTH)[1]
    if time is not None:  # whoever gives more time sees what a shorter run sees, too
        most = max(WINDOWS_OF_TIME, int(np.ceil(time / chunk)))
        chunk, longest = time / most, most
    reach = ContactReach(system)
    reach.look_closely(state)
    seen = Looks([], [], [state.p.copy()], wears=bool(len(state.r)))
    grows, left = None, np.inf
    for number in range(longest):
        for look in range(LOOKS_PER_CHUNK):
            system.advance(state, chunk * (number + (look + 1) / LOOKS_PER_CHUNK))
            seen.look(system, state)
            reach.look(state)
        report_progress(f"one-sided motion: t = {state.time:.4g}, D = {seen.size[-1].max():.3g} push^2")
        grows, left = outcome_and_slip_left(seen, sticking, sticking_grows, rested=grows is False)
        if (time is None and grows is not None) or not np.all(np.isfinite(seen.size[-1])):
            break
        if number + 1 >= most and not _gains(seen, DECADES * most / longest):
            break
    rate, error = _rate(seen.time, seen.size) if grows else (sticking if grows is False else None, None)
    found = OneSidedOutcome(
        grows=grows,
        growth_rate=rate,
        error=error,
        searched=float(FOLDS_OF_GROWTH / seen.time[-1]) if grows is None else 0.0,
        needed=_needed(seen, sticking) if grows is None else None,
        amplification=float(seen.size.max()),
        slip_left=left if grows is False and np.isfinite(left) else None,
        wears=seen.wears,
        time=float(seen.time[-1]),
        pushes=2 * pushes,
        scales=(reach.least_scale, reach.largest_scale),
    )
    return found, reach


def _needed(seen: Looks, sticking: float) -> float | None:
    """After which time it may be known whether the motion grows; None if this time is over, or no number is known."""
    now, gained = float(seen.time[-1]), _gained(seen.size)
    if _gains(seen, 0.0) and (rate := _rate(seen.time, seen.size)[0]) > 0:
        return now + float((DECADES - gained[-1]) * np.log(10) / rate)
    folds = FOLDS_OF_GROWTH if sticking > 0 else 2 * np.log(SLIP_LEFT_SHARE)
    wanted = folds / sticking if sticking else 0.0
    return float(wanted) if wanted > now else None


def random_pushes(configuration: Configuration, pushes: int) -> Floats:
    """Velocities of all coordinates, normal random numbers without rotations, and their opposites, shape (.., 2 P)."""
    rng = np.random.Generator(np.random.PCG64(0))
    push = np.zeros((configuration.coordinates, pushes))
    moving = configuration.dimension * len(configuration)
    push[:moving] = rng.standard_normal((moving, pushes))
    return np.hstack([push, -push])


def outcome_and_slip_left(
    seen: Looks, sticking: float, sticking_grows: bool, rested: bool
) -> tuple[bool | None, float]:
    """Whether the motion grows, rests (False) or has not settled; and the share of slip that is still to come.

    Parameters
    ----------
    seen : Looks
        All looks at the motion.
    sticking, sticking_grows : float, bool
        Growth rate with sticking contacts, 1 / time, and whether they are known to grow.
    rested : bool
        Whether the motion was at rest one chunk before.
    """
    grows = _outcome(seen, sticking_grows)
    if grows is not None or sticking >= 0 or sticking_grows:
        return grows, 0.0
    left = _slip_left(seen.slid, float(np.exp(0.5 * sticking * seen.time[-1] / SLIP_SPANS)))
    creeps = rested and seen.wears and not _still_grows(seen.time, _gained(seen.size))
    return (False if left < SLIP_LEFT_SHARE or creeps else None), left


def _outcome(seen: Looks, sticking_grows: bool) -> bool | None:
    """Whether the motion grows, rests (False), or has not settled.

    Sliders rest if they moved little in the third quarter of the time, and less by half, or not at all, in the fourth:
    each of them, or late all of them together, as of thousands one or the other slips a last time.
    """
    gained, slid = _gained(seen.size), seen.slid
    if gained[-1] > MOST_DECADES or _gains(seen, DECADES):
        return True
    if sticking_grows or len(slid) <= 2 * LOOKS_PER_CHUNK:
        return None
    half, three = len(slid) // 2, 3 * len(slid) // 4
    of_any = _slip_dies(slid[half], slid[three], slid[-1], np.max)
    of_all = _slip_dies(slid[half], slid[three], slid[-1], np.sum) & (len(slid) > CHUNKS_BEFORE_SUM * LOOKS_PER_CHUNK)
    return False if np.all(of_any | of_all) else None


def _gained(size: Floats) -> Floats:
    """Decades that the largest D has gained, shape (T,)."""
    largest = size.max(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.log10(largest / largest[0]))


def _slip_dies(half: Floats, three: Floats, end: Floats, over: Callable[..., Floats]) -> NDArray[np.bool_]:
    """Whether the largest slip of a contact, or the sum of all slips, dies away, for each push; p at three times."""
    whole, before, after = (over(np.abs(slip), axis=0) for slip in (end, three - half, end - three))
    falls = (after <= 0.5 * before) | (after <= np.finfo(float).eps * whole)
    return np.asarray(falls & (before <= SLIP_CHANGE * whole))


def _slip_left(slid: list[Floats], decay: float) -> float:
    """Bound of the slip that is still to come, as a share of all slip; infinite if slips do not fall with vibration.

    Parameters
    ----------
    slid : list of ndarray, shape (B, P)
        p at equal times.
    decay : float
        Factor by which the slowest vibration falls in one of `SLIP_SPANS` spans.
    """
    if len(slid) <= 2 * LOOKS_PER_CHUNK:
        return np.inf
    places = np.linspace(0, len(slid) - 1, SLIP_SPANS + 1).round().astype(int)
    whole = np.array([slid[place].sum(axis=0) for place in places])
    steps = np.diff(whole, axis=0)[SLIP_SPANS // 2 :]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.nan_to_num(steps[1:] / steps[:-1], nan=0.0)
    if np.any(ratios > decay**DECAY_SHARE):
        return np.inf
    slowest = np.maximum(ratios.max(axis=0), decay)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.nan_to_num(steps[-1] * slowest / (1 - slowest) / whole[-1], nan=0.0).max())


def _gains(seen: Looks, decades: float) -> bool:
    """Whether D has gained some decades, and gains at a steady rate."""
    gained = _gained(seen.size)
    return bool(gained[-1] > decades and _still_grows(seen.time, gained))


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
    return bool(steps.min() > GAIN_SHARE * mean and steps[2:].sum() > EXPONENTIAL_RATIO * steps[:2].sum())


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
