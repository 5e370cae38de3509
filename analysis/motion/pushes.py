r"""Small motion after pushes, contacts at Coulomb's bound as they are: does it grow, or come to rest?

Motions begin with random pushes of all particles, and with the opposites of these pushes, since one-sided motion is not
odd (:mod:`~faultgouge.analysis.motion.one_sided`). Six numbers decide:

- steps of `VERDICT_STEP`, in chunks of `CHUNK` stable steps, some ten periods of a slow mode;
- a motion *grows* if its kinetic energy, a mean over a tenth of a chunk, has grown to `GROWN_ENERGY` times that of the
  first tenth. No motion that no force opposes does: the energy of a particle that sliders have let go grows as the
  square of the time;
- a motion *rests* if sticking contacts do not grow, and the sliders have come to rest: with the slips of the last three
  quarters of the time, and the ratio by which these fall, a share below `STILL_SHARE` of all slip is left to come;
- it *has not settled* otherwise, after `CHUNKS` chunks, or `WORK_OF_MOTION` multiplications.

Growth rate, amplification, the smallest push and the creep of laws with two derivatives are read from the same steps.

**The smallest push.** Contacts from :math:`1 - 10^{-6}` of the bound on count as at the bound. The motion is the motion
to first order once the push goes `PUSH_OVER_RESIDUAL` times as far as the residual forces alone, and as what contacts
lack, which acts as a force on the particles as long as they slide: both motions are followed beside the pushes.

**Creep.** With mindlin_rescale and the standard law of this package the tangential force of a contact falls as it
parts, and does not rise as it closes. Vibration wears tangential forces down: each contact adds
:math:`B_c \int |\dot\delta_c| \mathrm dt` to the forces, and the packing moves on by :math:`K^{-1} B r`. With
dissipation the velocity of creep falls with the vibration, no more slowly than as :math:`e^{\mathrm{Re}\, s\, t}` with
the slowest s, so that a velocity v displaces particles by at most :math:`v / |\mathrm{Re}\, s|` more. Without it the
particles move on at a constant mean velocity.

`benchmarks/verdict_numbers.py` has 109 packings beside LAMMPS, and what each number decides.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats
from ..configuration import Configuration
from ..fields_by_name import FieldsByName
from ..has_configuration import HasConfiguration
from ..progress import report_progress
from .one_sided import (
    VERDICT_STEP,
    WORK_OF_MOTION,
    OneSidedState,
    OneSidedSystem,
    forces_on_coordinates,
    on_all_coordinates,
)
from .rising_load import static_response

PUSHES = 2
"""Random pushes; the opposite of each is followed, too, since one-sided motion is not odd."""

CHUNK = 300
"""Stable time steps between two looks at whether a motion has settled: some ten periods of a slow mode."""

LOOKS_PER_CHUNK = 10
"""Energies that a chunk has."""

CHUNKS = 120
"""Chunks that small packings are followed at the most."""

GROWN_ENERGY = 1e10
"""Growth of the kinetic energy that no packing at rest was seen to reach without growing for ever: transients of
packings at Coulomb's bound went up to 6e5."""

STILL_SHARE = 1e-2
"""Slip that may be left, as a share of all slip: D then changes by 2 %."""

PUSH_OVER_RESIDUAL = 10.0
"""Displacement by a push over that by the residual forces, from which on the push counts: D then is right to a fifth,
and to a hundredth where the two displacements have nothing in common."""

ERROR_OF_RATES = 0.03
"""Relative error of rates by steps of `VERDICT_STEP`."""

CREEP_CHUNKS = 32
"""Chunks for which creep is followed at the most; without dissipation an eighth of these."""

ENERGY_OF_REST = 2.0
"""Kinetic energy at the end over that at the beginning, up to which a motion with creep does not grow: the energy of a
push is all kinetic at first, and half of it is later."""

CREEP_LEFT = 0.1
"""Displacement by creep still to come, as a share of that so far, below which motion is not followed any longer."""


class Look(NamedTuple):
    """Motions in a span of time: when it ends; mean kinetic energies and largest D of the motions, shape (P,); p and r
    at the end; and the smallest multiples of the motions that take a contact to another state, shape (P,), with the D
    that these have there."""

    time: float
    energy: Floats
    size: Floats
    slid: Floats
    paths: Floats
    first: Floats
    size_at_first: Floats


def looks(
    system: OneSidedSystem, state: OneSidedState, span: float, rise: Floats | None = None, beside: bool = False
) -> Iterator[Look]:
    """One look after the other, each at a span of motions that go on; every stable step is looked at.

    Parameters
    ----------
    system : OneSidedSystem
        The equations.
    state : OneSidedState
        Changes in place.
    span : float
        Time of a look.
    rise : ndarray, shape (E, P), optional
        Mass-weighted forces that rise, per time.
    beside : bool
        Whether the residual forces act on the last of the motions, and what contacts lack to the bound on the one
        before.
    """
    count = max(int(np.ceil(span / system.time_step - 1e-9)), 1)
    every, seen, taken = max(round(1 / system.step_share), 1), list[OneSidedState](), 0
    constant = np.zeros_like(state.z)
    if beside:
        constant[:, -2:-1] = -(system.sliders[0] @ system.missing_forces)
        constant[:, -1:] = system.residual_force

    def look(now: OneSidedState) -> None:
        nonlocal taken
        taken += 1
        if taken % every == 0 or taken == count:
            seen.append(OneSidedState(now.time, now.z.copy(), now.v.copy(), now.p.copy(), now.r.copy()))

    while True:
        seen.clear()
        taken = 0
        system.take_steps(state, span / count, count, rise=rise, constant=constant, look=look)
        together = [np.hstack([getattr(each, name) for each in seen]) for name in ("z", "v", "p", "r")]
        sizes = system.mean_square_displacement(together[0]).reshape(len(seen), -1)
        first = system.contact_changes.first(*together).reshape(len(seen), -1)
        energy = np.sum(together[1] ** 2, axis=0).reshape(len(seen), -1).mean(axis=0)
        at, columns = first.argmin(axis=0), np.arange(sizes.shape[1])
        yield Look(
            state.time,
            energy,
            sizes.max(axis=0),
            state.p.copy(),
            state.r.copy(),
            first[at, columns],
            sizes[at, columns],
        )


def random_pushes(configuration: Configuration, pushes: int) -> Floats:
    """Velocities of all coordinates, normal random numbers without rotations, and their opposites, shape (.., 2 P)."""
    rng = np.random.Generator(np.random.PCG64(0))
    push = np.zeros((configuration.coordinates, pushes))
    moving = configuration.dimension * len(configuration)
    push[:moving] = rng.standard_normal((moving, pushes))
    return np.hstack([push, -push])


def chunk_and_most(system: OneSidedSystem, columns: int, chunks: int | None = None) -> tuple[float, int]:
    """Time of a chunk, and how many of them may be followed."""
    chunk = CHUNK * system.time_step / system.step_share
    entries = (system.motion.stiffness.nnz + system.motion.damping.nnz) * columns
    return chunk, int(np.clip(WORK_OF_MOTION / (entries * CHUNK / system.step_share), 4, chunks or CHUNKS))


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
        After which time `grows` may be known: as D gains at its rate, or as the slowest vibration decays. None where
        `grows` is known, or this time is over.
    amplification, least_amplification : float
        Largest D over the mean square velocity of the push along an axis, time^2: the largest and the smallest of the
        pushes. Motion that goes on may take D further.
    slip_left : float or None
        How much of their slip contacts may have still to come, as a share; None if that is not known.
    slides_on : int
        Where the motion has not settled: contacts that slide on at a constant velocity or faster.
    wears : bool
        Whether vibration wears contacts down, so that they may slide again.
    time : float
        How long the motion was followed.
    pushes : int
        How many pushes, the opposite of each among them.
    scales : tuple of float
        Between which velocities of the push along an axis this holds for each of these pushes. Below, contacts that
        count as at the bound do not reach it, or the residual forces move the packing as well; above, other contacts
        reach the bound, open or close, or the force of one at the bound turns. The first is infinite if the residual
        forces alone do so.
    first_change : tuple of float
        The smallest and the largest of the pushes that take another contact so far.
    changes_at : float or None
        Where the motion grows: D at which the first contact changes.
    """

    grows: bool | None
    growth_rate: float | None
    error: float | None
    searched: float
    needed: float | None
    amplification: float
    least_amplification: float
    slip_left: float | None
    slides_on: int
    wears: bool
    time: float
    pushes: int
    scales: tuple[float, float]
    first_change: tuple[float, float]
    changes_at: float | None


def follow_pushes(
    system: OneSidedSystem, sticking: float, may_rest: bool, time: float | None = None, pushes: int = PUSHES
) -> OneSidedOutcome:
    """Whether one-sided motion grows from some pushes: `Stability.one_sided`.

    Parameters
    ----------
    system : OneSidedSystem
        Of the configuration.
    sticking, may_rest : float, bool
        Growth rate with sticking contacts, 1 / time, and whether these are not known to grow.
    time : float, optional
        How long; until the motion has settled by default.
    pushes : int
        How many; the opposite of each is followed, too.
    """
    push = random_pushes(system.motion.configuration, pushes)
    state = system.start(np.hstack([push, np.zeros((len(push), 2))]))
    usual, most = chunk_and_most(system, 2 * pushes + 2)
    chunk = usual
    if time is not None:  # whoever gives more time sees what a shorter run sees, too
        most = max(4, int(np.ceil(time / usual)))
        chunk = time / most
    seen: list[Look] = []
    grows, left = None, np.inf
    for each in looks(system, state, chunk / LOOKS_PER_CHUNK, beside=True):
        seen.append(each)
        if len(seen) % LOOKS_PER_CHUNK or len(seen) < 2 * LOOKS_PER_CHUNK:
            continue
        report_progress(f"one-sided motion: t = {each.time:.4g}, D = {each.size[:-2].max():.3g} push^2")
        gained = each.energy[:-2] / seen[0].energy[:-2]
        if not np.all(gained <= GROWN_ENERGY):
            grows = True
        elif (
            may_rest
            and each.time > 1.99 * usual
            and (now := _slip_left([look.slid[:, :-2] for look in seen])) <= STILL_SHARE
        ):
            grows, left = False, now
        if grows or (time is None and grows is False) or len(seen) >= most * LOOKS_PER_CHUNK:
            break
    return _outcome(system, seen, grows, left, sticking)


def _slip_left(slid: list[Floats]) -> float:
    """Slip still to come as a share of all slip, the largest of the pushes, of p at equal times; infinite if not known.

    Slips of all contacts in the last three of four quarters of the time fall by at most a ratio, and go on to.
    """
    places = [0, len(slid) // 4, len(slid) // 2, 3 * len(slid) // 4, len(slid) - 1]
    whole = np.array([slid[place].sum(axis=0) for place in places])
    steps = np.diff(whole, axis=0)[1:]
    small = np.finfo(float).eps * len(slid[0]) * whole[-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.max(np.where(steps[1:] <= small, 0.0, steps[1:] / steps[:-1]), axis=0)
        left = np.where(ratio < 1, steps[-1] * ratio / (1 - ratio), np.inf)
        left = np.where(steps[-1] <= small, 0.0, left) / whole[-1]
    return float(np.nan_to_num(left, nan=0.0, posinf=np.inf).max())


def _outcome(
    system: OneSidedSystem, seen: list[Look], grows: bool | None, left: float, sticking: float
) -> OneSidedOutcome:
    """What the looks say."""
    times, energy = np.array([look.time for look in seen]), np.array([look.energy[:-2] for look in seen])
    size, first = np.array([look.size for look in seen]), np.array([look.first for look in seen])
    rate, error = _rate(times, energy)
    least, of_pushes = least_scale(seen[:LOOKS_PER_CHUNK]), first[:, :-2].min(axis=0)
    now, needed = float(times[-1]), None
    long_enough = 1.99 * chunk_and_most(system, 1)[0]
    if grows is None:
        gained = float(np.log(energy[-1] / energy[0]).max())
        wanted = (
            now + (np.log(GROWN_ENERGY) - gained) / rate
            if rate > 0
            else 2 * np.log(STILL_SHARE) / sticking
            if sticking
            else 0
        )
        needed = float(wanted) if now < wanted < np.inf else None
    late = [seen[len(seen) // 2].slid[:, :-2], seen[3 * len(seen) // 4].slid[:, :-2], seen[-1].slid[:, :-2]]
    steps = np.diff(late, axis=0) + np.finfo(float).tiny
    goes_on = (0.9 * steps[0] < steps[1]) & (steps[1] < 1.5 * steps[0])  # faster, it may grow
    biggest = size[:, :-2].max(axis=0)
    last = seen[-LOOKS_PER_CHUNK:]
    changes = [(look.first[:-2] ** 2 * look.size_at_first[:-2]).min() for look in last]
    return OneSidedOutcome(
        grows=grows,
        growth_rate=rate if grows else (sticking if grows is False else None),
        error=error if grows else None,
        searched=float(np.log(GROWN_ENERGY) / now) if grows is None else 0.0,
        needed=needed,
        amplification=float(biggest.max()),
        least_amplification=float(biggest.min()),
        slip_left=left if grows is False and np.isfinite(left) else None,
        slides_on=int(goes_on.any(axis=1).sum()) if grows is None and now > long_enough else 0,
        wears=bool(len(seen[0].paths)),
        time=now,
        pushes=len(of_pushes),
        scales=(least, float(of_pushes.min())),
        first_change=(float(of_pushes.min()), float(of_pushes.max())),
        changes_at=float(min(changes)) if grows and np.isfinite(min(changes)) else None,
    )


def least_scale(seen: list[Look]) -> float:
    """The multiple of some motions from which on neither what contacts lack to the bound nor residual forces count, by
    the looks of the first chunk, whose last two motions are those of these; infinite if residual forces alone take a
    contact to another state."""
    if min(look.first[-1] for look in seen) < 1:
        return np.inf
    size = np.max([look.size for look in seen], axis=0)
    return PUSH_OVER_RESIDUAL * float(np.sqrt(size[-2:].max() / size[:-2].min())) if size[-2:].any() else 0.0


def _rate(times: Floats, energy: Floats) -> tuple[float, float]:
    """Growth rate of the energy over the second half of the time, and its error: what its two quarters differ by, and
    that of the steps."""
    with np.errstate(divide="ignore"):
        logs = np.log(energy[:, int(np.argmax(energy[-1]))])
    half, three = len(times) // 2, 3 * len(times) // 4
    slopes = [np.polyfit(times[a:b], logs[a:b], 1)[0] for a, b in ((half, three), (three, None))]
    mean = float(np.mean(slopes))
    return mean, float(np.hypot(abs(slopes[1] - slopes[0]) / 2, ERROR_OF_RATES * mean))


@dataclass(frozen=True)
class Creep(FieldsByName):
    """How far vibration carries particles whose contacts have two derivatives.

    Attributes
    ----------
    amplification : float
        Largest D of this displacement over the mean square velocity of the push along an axis, time^2.
    time : float
        How long motion was followed.
    velocity, least_velocity : float
        Root mean square over the particles of its mean velocity in the last quarter of this time, over the root mean
        square velocity of the push along an axis: the largest and the smallest of the pushes.
    limit : float or None
        `amplification` that vibration may reach later, while the slowest motion decays; None if that is not known, as
        without dissipation.
    grows : bool or None
        Whether the motion grew, in spite of linear motion that does not; None if its energy has risen, and less.
    growth_rate : float
        Of D, 1 / time, of a motion that grows.
    first_change : tuple of float
        Velocities along an axis of the smallest and of the largest push that take a contact to another state.
    """

    amplification: float
    time: float
    velocity: float
    least_velocity: float
    limit: float | None
    grows: bool | None
    growth_rate: float
    first_change: tuple[float, float]

    @property
    def settled(self) -> bool:
        """Whether little is left to come."""
        return self.limit is not None and self.limit <= (1 + CREEP_LEFT) ** 2 * self.amplification


def follow_creep(
    system: OneSidedSystem, pushes: int = PUSHES, time: float | None = None, decay: float = 0.0, free: int = 0
) -> Creep:
    """Follow the motion after random pushes and their opposites until little creep is left to come.

    Parameters
    ----------
    system : OneSidedSystem
        Of a configuration without contacts at Coulomb's bound.
    pushes : int
        How many.
    time : float, optional
        How long.
    decay : float
        -Re s of the slowest motion, 1 / time; 0 if that is not known, or nothing decays.
    free : int
        Motions that no force opposes.
    """
    state = system.start(random_pushes(system.motion.configuration, pushes))
    chunk, most = chunk_and_most(system, 2 * pushes, CREEP_CHUNKS if decay else CREEP_CHUNKS // 8)
    if time is not None:
        most = max(4, int(np.ceil(time / chunk)))
        chunk = time / most
    seen: list[Look] = []
    for each in looks(system, state, chunk / LOOKS_PER_CHUNK):
        seen.append(each)
        if len(seen) % LOOKS_PER_CHUNK or len(seen) < 4 * LOOKS_PER_CHUNK:
            continue
        found = _creep(system, seen, decay, free)
        report_progress(f"creep: followed for t = {each.time:.4g}, D up to {found.amplification:.3g} push^2")
        if found.grows or (found.settled and time is None) or len(seen) >= most * LOOKS_PER_CHUNK:
            break
    return found


def _creep(system: OneSidedSystem, seen: list[Look], decay: float, free: int) -> Creep:
    """Creep, of the paths that overlaps have gone at three quarters and at the end of the time."""
    before, after = seen[3 * len(seen) // 4 - 1], seen[-1]
    moved = static_response(system.motion, system.rescaled[1] @ np.hstack([before.paths, after.paths]), free)
    early, late = np.split(moved, 2, axis=1)
    sizes = system.mean_square_displacement(late)
    velocity = np.sqrt(system.mean_square_displacement(late - early)) / (after.time - before.time)
    limit = float(((np.sqrt(sizes) + velocity / decay) ** 2).max()) if decay > 0 else None
    first = np.min([look.first for look in seen], axis=0)
    energy = np.array([look.energy for look in seen])
    gained = float(np.max(energy[-1] / energy[0]))
    grows = True if not gained <= GROWN_ENERGY else None if gained > ENERGY_OF_REST else False
    return Creep(
        amplification=float(sizes.max()), time=after.time, velocity=float(velocity.max()),
        least_velocity=float(velocity.min()), limit=limit, grows=grows,
        growth_rate=_rate(np.array([look.time for look in seen]), energy)[0] if grows else 0.0,
        first_change=(float(first.min()), float(first.max())),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class OneSidedMotion:
    """Displacements of the particles from the equilibrium, for the push or the rate of loading as it was given.

    Attributes
    ----------
    times : ndarray, shape (T,)
        Times.
    displacement, velocity : ndarray, shape (T, N, d)
        Length, and length / time.
    slid : ndarray, shape (T, B)
        p of each contact at the bound: the tangential force that its slider has taken away, force.
    scales : tuple of float
        Between which multiples of the push, or of the rate, the motion holds, as it was seen in the first `CHUNK`
        stable steps and at these times: with smaller ones contacts that count as at the bound do not reach it, or the
        residual forces move the packing as well, and with larger ones other contacts reach the bound, open or close, or
        the force of one at the bound turns.
    """

    times: Floats
    displacement: Floats
    velocity: Floats
    slid: Floats
    scales: tuple[float, float]

    @property
    def mean_square_displacement(self) -> Floats:
        """D: mean over the particles of |displacement|^2, length^2, shape (T,)."""
        return np.asarray(np.sum(self.displacement**2, axis=2).mean(axis=1))


def one_sided_motion(
    packing: HasConfiguration,
    velocity: ArrayLike | None = None,
    rise: str | ArrayLike | None = None,
    times: ArrayLike = (0.0,),
) -> OneSidedMotion:
    """Small motion of a configuration after a push, or under a load that rises, contacts at the bound as they are.

    Parameters
    ----------
    packing : Configuration or Packing
        The equilibrium, with its dashpots and drag.
    velocity : array_like, shape (N, d), optional
        Velocities at t = 0, length / time; none by default. The motion is homogeneous, so that numbers of order one do.
    rise : "fx" or array_like, shape (N, d), optional
        Forces per unit of time that are added to the load, or a unit force on each particle of the upper layer along x;
        none by default.
    times : array_like, shape (T,)
        When to look, increasing, not negative.

    Returns
    -------
    OneSidedMotion
        Particles that touch nothing fly on, with their drag.

    Raises
    ------
    ValueError
        If a shape does not fit, times are not finite and increasing, or rise is "fx" without an upper layer.
    """
    configuration = packing.configuration
    time = np.atleast_1d(np.asarray(times, dtype=np.float64))
    if time.ndim != 1 or not np.all(np.isfinite(time)) or np.any(np.diff(time, prepend=0.0) < 0):
        raise ValueError("The times of a motion are finite, not negative, and in increasing order.")
    system = OneSidedSystem.of(configuration)
    push = on_all_coordinates(configuration, "velocity", velocity)
    load = None if rise is None else forces_on_coordinates(configuration, rise)
    scales = _scales(system, push, load, float(time[-1]))
    state, seen = system.start(push), []
    advance = system.advance_exactly if system.remembers_nothing else system.advance
    for each in time:
        advance(state, float(each), load)
        first = float(system.contact_changes.first(state.z, state.v, state.p, state.r)[0])
        scales = scales[0], min(scales[1], first)
        flight = system.free_flight(push, load, float(each))
        moved, speed = (
            system.displacement(z, free)[..., 0] for z, free in zip((state.z, state.v), flight, strict=True)
        )
        seen.append((moved, speed, state.p[:, 0].copy()))
    displacement, speed, slid = (np.array(each) for each in zip(*seen, strict=True))
    return OneSidedMotion(time, displacement, speed, slid, scales)


def _scales(system: OneSidedSystem, push: Floats, load: Floats | None, end: float) -> tuple[float, float]:
    """The multiples between which a motion holds, as it is seen at its beginning."""
    chunk, _ = chunk_and_most(system, 2)
    if not end:
        return 0.0, np.inf
    coarse = OneSidedSystem(system.motion, VERDICT_STEP)
    both = coarse.start(np.hstack([push, np.zeros((len(push), 2))]))
    rise = None if load is None else coarse.on_active(np.hstack([load, np.zeros((len(load), 2))]))
    span = min(chunk, end) / LOOKS_PER_CHUNK
    seen = [look for look, _ in zip(looks(coarse, both, span, rise, beside=True), range(LOOKS_PER_CHUNK), strict=False)]
    return least_scale(seen), float(min(look.first[0] for look in seen))
