r"""Does a packing at rest move? The verdict, with its own dissipation and its contacts at Coulomb's bound as they are.

**No contact at Coulomb's bound.** Small motion is linear. The packing is stable if no eigenvalue s of
:math:`s^2 M + s C + K` has Re s > 0 beyond rounding (:mod:`~faultgouge.analysis.motion.motion`), with C of its own
dashpots and drag. Complex pairs of K alone are the answer without loss, and no verdict on a packing with dashpots.

**Contacts at the bound** slide on ahead and stick on the way back, and no eigenvalue decides
(:mod:`~faultgouge.analysis.motion.one_sided`). The one-sided motion is followed from random pushes until it grows, or
rests, and so is the motion under a load that rises (:mod:`~faultgouge.analysis.motion.one_sided_outcome`). If it has
not settled in the time that was followed, the verdict is unknown.

**Laws with two derivatives**, one while a contact closes and one while it parts, let vibration carry particles on,
without a contact at the bound, too (:mod:`~faultgouge.analysis.motion.creep`).

**Large packings.** Where not all eigenvalues are known and the fastest motions do not grow, the motion from a random
state is followed (:mod:`~faultgouge.analysis.motion.decay`). Sticking contacts are stable only if this motion has
decayed so far that a motion that grows, however slowly, would be seen. Otherwise there is no verdict."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, number
from ..configuration import Configuration, HasConfiguration
from ..counted import counted
from ..operators.asymmetry import asymmetry
from ..operators.sliders import with_sticking_contacts
from .creep import Creep, follow_creep
from .decay import Decay, follow_decay
from .motion import Motion, Rates
from .no_verdict import no_verdict
from .one_sided import LEFT_ALONE, ContactReach, OneSidedSystem, forces_on_coordinates
from .one_sided_outcome import PUSHES, STEP_OF_LARGE, VERDICT_STEP, follow_pushes, random_pushes
from .rising_load import NotFollowedError, motion_under_load, vibrate_otherwise
from .spectrum import Spectrum, spectrum

LARGE = 6000
"""Coordinates beyond which the fastest growing motions stand for all eigenvalues, and one push and its opposite for
several, in larger steps."""

UNSETTLED = (
    "its residual forces alone take a contact to Coulomb's bound, or open one: bring the packing to rest more closely"
)
"""Why there is no verdict where the residual forces alone change a contact."""

STILL_CREEPS = 0.01
"""Share of the displacement by vibration that the second half of the time added, from which on it is said to go on."""


@dataclass(frozen=True)
class LinearNeighbour:
    """The linear motion with all contacts at the bound alike.

    Attributes
    ----------
    growth_rate : float
        Largest 2 Re s, 1 / time; zero if none was found in a large packing.
    searched : float
        Growth rate of D, 1 / time, below which growth was not looked for; 0 if all eigenvalues are known.
    """

    growth_rate: float
    searched: float = 0.0

    @classmethod
    def of(cls, rates: Rates) -> "LinearNeighbour":
        """The fastest motion."""
        return cls(rates.growth_rate, rates.searched)

    def __str__(self) -> str:
        if self.searched and self.growth_rate <= 0:
            return f"no growth of D faster than exp({self.searched:.2g} t)"
        return f"D as exp({self.growth_rate:.4g} t)"


@dataclass(frozen=True)
class WithoutDissipation:
    """The motion without dissipation, of sticking contacts: the eigenvalues of K.

    Attributes
    ----------
    growth_rate : float
        Of D, 1 / time.
    pairs, negative : int or None
        Complex pairs, and negative eigenvalues; of large packings these are not counted.
    """

    growth_rate: float
    pairs: int | None
    negative: int | None


@dataclass(frozen=True)
class Stability:
    """Whether a packing moves.

    Attributes
    ----------
    stable : bool or None
        None: unknown, for the `reasons`.
    growth_rate : float
        Of D, 1 / time, with dissipation: largest 2 Re s, negative if every motion decays. Where contacts at the bound
        make the packing grow, the rate of the one-sided motion.
    undamped : WithoutDissipation
        Without dissipation.
    at_bound : int
        Contacts at Coulomb's bound.
    one_sided : dict or None
        grows (True, False, None); growth_rate and its error; searched (growth rate of D below which growth would not
        have been seen; 0 where grows is known); amplification (largest D over the mean square velocity of the push
        along an axis, time^2, while contacts slid: what moves on may take D further); slip_left (how much of their slip
        may be still to come, as a share; 0 if they have stopped); time (how long), pushes (how many); residual_push (as
        below); scales (between which velocities of the push along an axis this holds: with smaller ones contacts that
        count as at the bound do not reach it, or the residual forces move the packing as well, with larger ones others
        do, or open; the first is infinite if the residual forces alone take another contact so far). None without
        contacts that slide on one side.
    creep : Creep or None
        How far a push carries particles if contacts have two derivatives, and none is at the bound.
    largest_push : float or None
        Where motion does not grow, and no contact slides on one side: velocity of a push along an axis up to which
        contacts neither reach the bound nor open. None where K is given.
    residual_push : float
        Velocity of a push along an axis that moves the particles as far as the residual forces do, where `largest_push`
        is known.
    decay : Decay or None
        What became of a random state with sticking contacts; None where eigenvalues decide.
    rising : dict or None
        drift and vibration over the rate of loading, with drift_error and vibration_error; steady; time, None if the
        motion was not followed but solved for; span, the last part of this time, of which drift and vibration are;
        other_start: the first five from another start, or None; least_rise, the increase of the load from which on
        contacts that count as at the bound reach it; next_change, at which the first other contact reaches it or opens,
        to first order, and next_event, which of the two. None unless asked, and where it was `not_followed`.
    sticking, sliding : LinearNeighbour
        If all contacts at the bound stuck, and if all slid on; no bounds of what they do.
    asymmetry : dict
        Shares of what makes K asymmetric: tangential_force, lever_arm, overlap; empty where K is given.
    dissipative : bool
        Whether there are dashpots or drag.
    free : int
        Motions that no force opposes.
    searched : float
        Growth rate of D, 1 / time, below which linear growth may not have been seen; 0 if all eigenvalues are known, or
        if a random state has decayed so far that nothing grows.
    contacts : int
        Number of contacts; where K is given, and walls hand out no contacts, of particles that feel something.
    reasons : tuple of str
        Why the verdict is unknown.
    not_followed : str
        Why the motion under a rising load was not followed, where it was asked for.
    remarks : tuple of str
        Those of the Configuration: what of its origin is left out, or other than it seems.
    """

    stable: bool | None
    growth_rate: float
    undamped: WithoutDissipation
    at_bound: int
    one_sided: dict[str, Any] | None
    creep: Creep | None
    largest_push: float | None
    residual_push: float
    decay: Decay | None
    rising: dict[str, Any] | None
    sticking: LinearNeighbour
    sliding: LinearNeighbour
    asymmetry: dict[str, float]
    dissipative: bool
    free: int
    searched: float
    contacts: int
    reasons: tuple[str, ...] = ()
    not_followed: str = ""
    remarks: tuple[str, ...] = ()

    def __str__(self) -> str:
        """The verdict in sentences, the verdict first."""
        return "\n".join(self.sentences)

    __repr__ = __str__

    @property
    def sentences(self) -> tuple[str, ...]:
        """The verdict, what holds without dissipation, what contacts at the bound do, and remarks on the origin."""
        parts = (
            self._without_loss, self._at_the_bound, self._by_vibration, self._scales, self._under_the_load, self.remarks
        )  # fmt: skip
        return (self._verdict, *chain.from_iterable(parts))

    @property
    def _verdict(self) -> str:
        free = f", except for {counted(self.free, 'motion')} that no force opposes" if self.free else ""
        if not self.contacts:
            return "no particle touches another or a wall: stability is not defined"
        if self.stable is None:
            return f"not known whether the packing is stable: {'; '.join(self.reasons)}"
        if not self.stable:
            how = " in spite of the dissipation" if self.dissipative else ""
            if self.decay is not None and self.decay.grows:
                return f"unstable: small motion grows{how}: {self.decay}"
            return f"unstable: small motion grows{how}, D as exp({self.growth_rate:.6g} t)"
        if self.one_sided is not None:
            names = ("pushes", "amplification", "time", "slip_left")
            pushes, size, time, left = (self.one_sided[name] for name in names)
            until = "until the contacts have stopped sliding" if not left else "while contacts slide"
            on = f", and they slide on by {left:.1%} at most as vibration decays" if left else ""
            sticks = f"; with sticking contacts {self.decay}" if self.decay else ""
            return (
                f"stable: each of {pushes} pushes comes to rest{free}; D reaches {size:.3g} times the mean square "
                f"velocity of the push {until} (followed for t = {time:.4g}{on}){sticks}"
            )
        if self.decay is not None:
            return f"stable: {self.decay}{free}"
        if self.dissipative and self.growth_rate < 0:
            motion = "every vibration" if self.creep else "every motion"
            return f"stable: {motion} decays, the slowest with D as exp({self.growth_rate:.6g} t){free}"
        if self.creep and not self.dissipative:
            return f"stable but for creep: no motion grows exponentially{free}"
        return f"stable: no motion grows{free}"

    @property
    def _without_loss(self) -> Iterator[str]:
        u = self.undamped
        if self.dissipative and u.growth_rate > 0:
            counts = {"complex pair": u.pairs, "negative eigenvalue": u.negative}
            what = " and ".join(counted(count, name) for name, count in counts.items() if count)
            yield f"without dissipation: {what or 'small motion grows'}, D as exp({u.growth_rate:.6g} t)"

    @property
    def _has_two_neighbours(self) -> bool:
        """Whether contacts at the bound slide on ahead and stick on the way back."""
        return self.one_sided is not None or self.sliding != self.sticking

    @property
    def _at_the_bound(self) -> Iterator[str]:
        if self.at_bound == 0:
            return
        yield f"{self.at_bound} of {counted(self.contacts, 'contact')} {_is(self.at_bound)} at Coulomb's bound" + (
            ": each slides on ahead and sticks on the way back"
            if self._has_two_neighbours
            else f" and {'slides' if self.at_bound == 1 else 'slide'}"
        )
        if self._has_two_neighbours:
            yield (
                f"neither of two linear motions decides: if all of them stuck, {self.sticking}; if all slid on, "
                f"{self.sliding}"
            )

    @property
    def _by_vibration(self) -> Iterator[str]:
        creep = self.creep
        if creep is None or not self.stable:
            return
        says = f": D as ({creep.velocity:.2g} t)^2 times the mean square velocity of the push"
        if self.dissipative:
            still = 0.5 * creep.velocity * creep.time > STILL_CREEPS * creep.amplification**0.5
            says = (
                f", and they stay displaced, by D up to {creep.amplification:.2g} times the mean square velocity of "
                f"the push within t = {creep.time:.4g}{', and farther later' if still else ''}"
            )
        yield f"contacts bear less after they have closed and parted, so that vibration carries particles on{says}"

    @property
    def _scales(self) -> Iterator[str]:
        if self.stable and self.largest_push is not None:
            yield (
                f"holds for pushes of {LEFT_ALONE * self.residual_push:.1g} to {self.largest_push:.1g} (velocity along "
                "an axis): below, residual forces count; above, contacts open or slide"
            )
        if self.one_sided is None or self.one_sided["grows"] is not False:
            return
        least, most = self.one_sided["scales"]
        if least < most:
            yield (
                f"this is the motion after pushes of {least:.1g} to {most:.1g} (velocity along an axis): below, "
                "contacts that count as at the bound do not reach it, or residual forces count; above, others reach "
                "it, or open"
            )
        elif self.stable:
            yield (
                f"no push is small enough for this motion (below {most:.1g}, where no other contact reaches the bound "
                f"or opens) and large enough (above {least:.1g}, where residual forces do not count)"
            )

    @property
    def _under_the_load(self) -> Iterator[str]:
        if self.not_followed:
            yield f"under a load that rises: not followed, since {self.not_followed}"
        if self.rising is not None:
            other = self.rising["other_start"]
            starts = [self.rising, other] if other and vibrate_otherwise(self.rising, other) else [self.rising]
            says = ", and from another start ".join(map(_drift_and_vibration, starts))
            least, change, event = (self.rising[name] for name in ("least_rise", "next_change", "next_event"))
            since = f"; from a rise of {least:.1g} on, where all contacts at the bound have reached it" if least else ""
            until = "" if change is None else f"; until the load has risen by {change:.2g} (a contact {event})"
            yield f"under a load that rises at the rate 1: {says}{since}{until}"

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "stable": self.stable,
            "growth_rate": self.growth_rate,
            "undamped": vars(self.undamped),
            "at_bound": self.at_bound,
            "one_sided": None if self.one_sided is None else _finite(self.one_sided),
            "creep": None if self.creep is None else vars(self.creep),
            "largest_push": self.largest_push,
            "residual_push": self.residual_push,
            "decay": None if self.decay is None else self.decay.as_dict(),
            "rising": self.rising,
            "sticking": vars(self.sticking),
            "sliding": vars(self.sliding),
            "asymmetry": self.asymmetry,
            "free": self.free,
            "searched": self.searched,
            "reasons": list(self.reasons),
            "not_followed": self.not_followed,
            "remarks": list(self.remarks),
        }


def stability(
    packing: HasConfiguration,
    rise: str | ArrayLike | None = None,
    time: float | None = None,
    *,
    spectrum_of_stiffness: Spectrum | None = None,
    reasons: Sequence[str] = (),
) -> Stability:
    """Whether a packing moves, with its own dissipation and its contacts at Coulomb's bound as they are.

    Parameters
    ----------
    packing : Configuration or Packing
        The equilibrium.
    rise : "fx" or array_like, shape (N, d), optional
        The direction in which the load rises: the force on the upper layer, or forces per unit of time.
    time : float, optional
        How long one-sided motion is followed; until it has settled by default, or some minutes.
    spectrum_of_stiffness : Spectrum, optional
        That of the packing, where it is known.
    reasons : sequence of str
        What the caller knows that makes a verdict impossible.

    Returns
    -------
    Stability

    Raises
    ------
    ValueError
        If the direction has another shape, or is "fx" of a packing without an upper layer; or if the time is not
        positive.
    """
    limit = None if time is None else _positive_time(time)
    configuration = with_sticking_contacts(packing.configuration)
    if configuration is not packing.configuration:
        spectrum_of_stiffness = None  # of contacts that slide
    direction = None if rise is None else _direction(configuration, rise)
    large = configuration.coordinates > LARGE
    linear = _LinearRates.of(configuration, spectrum_of_stiffness, large)
    doubts = [*reasons, *no_verdict(configuration)]
    outcome = _Outcome.of_linear(linear, doubts)
    if not doubts:
        system = OneSidedSystem.of(configuration, STEP_OF_LARGE if large else VERDICT_STEP)
        outcome = _small_motion(system, linear, limit, 1 if large else PUSHES)
    free = linear.sticking.free if outcome.decay is None else outcome.decay.free
    rising, not_followed = None, ""
    if direction is not None:
        if doubts or outcome.grows:
            not_followed = "no verdict is possible" if doubts else "small motion grows"
        else:
            decays = outcome.grows is False
            try:
                rising = motion_under_load(system, direction, limit, free=free, decays=decays)
            except NotFollowedError as error:
                not_followed = str(error)
    contacts, given = configuration.contacts, configuration.stiffness is not None
    # where K is given, contacts, as far as they are known, have no derivatives
    touching = max(len(contacts), len(configuration) - len(configuration.rattlers)) if given else len(contacts)
    known = outcome.grows is not None and not outcome.reasons and touching > 0
    return Stability(
        stable=not outcome.grows if known else None, growth_rate=outcome.growth_rate, undamped=linear.undamped,
        at_bound=int(contacts.at_bound.sum()), one_sided=outcome.one_sided, creep=outcome.creep,
        largest_push=outcome.largest_push, residual_push=outcome.residual_push, decay=outcome.decay, rising=rising,
        sticking=outcome.sticking, sliding=LinearNeighbour.of(linear.sliding) if linear.one_sided else outcome.sticking,
        asymmetry={} if given else asymmetry(configuration), dissipative=configuration.damped,
        free=free, searched=outcome.sticking.searched, contacts=touching,
        reasons=tuple(outcome.reasons), not_followed=not_followed,
        remarks=configuration.remarks,
    )  # fmt: skip


@dataclass(frozen=True)
class _LinearRates:
    """Eigenvalues of the linear motions.

    Attributes
    ----------
    undamped : WithoutDissipation
        Of sticking contacts, without dissipation.
    sticking, sliding : Rates
        With the dissipation, if all contacts at the bound stick, and if all slide on.
    one_sided : bool
        Whether contacts at the bound slide on ahead and stick on the way back.
    """

    undamped: WithoutDissipation
    sticking: Rates
    sliding: Rates
    one_sided: bool

    @classmethod
    def of(cls, configuration: Configuration, known: Spectrum | None, large: bool) -> "_LinearRates":
        """Compute them; K's spectrum may be known, and that of a large packing is not computed."""
        found = spectrum(configuration) if known is None and not large else known
        undamped, sticking = _without_dissipation(configuration, found)
        if configuration.damped:
            sticking = Motion.of(configuration).rates
        one_sided = bool(configuration.contacts.one_sided.any())
        sliding = Motion.of(configuration, sliding=True).rates if one_sided else sticking
        return cls(undamped, sticking, sliding, one_sided)


@dataclass(frozen=True)
class _Outcome:
    """What becomes of small motion under a load that is held: `grows` is None if that is not known."""

    grows: bool | None
    growth_rate: float
    sticking: LinearNeighbour
    reasons: Sequence[str] = ()
    one_sided: dict[str, Any] | None = None
    creep: Creep | None = None
    largest_push: float | None = None
    residual_push: float = 0.0
    decay: Decay | None = None

    @classmethod
    def of_linear(cls, linear: _LinearRates, doubts: Sequence[str] = ()) -> "_Outcome":
        """Of linear motion with sticking contacts."""
        sticking = LinearNeighbour.of(linear.sticking)
        grows = None if doubts else bool(linear.sticking.grows.any())
        return cls(grows, sticking.growth_rate, sticking, doubts)


def _small_motion(system: OneSidedSystem, linear: _LinearRates, time: float | None, pushes: int) -> _Outcome:
    """Follow what eigenvalues do not decide."""
    outcome = _Outcome.of_linear(linear)
    if linear.one_sided:
        outcome = _after_pushes(outcome, follow_pushes(system, outcome.growth_rate, bool(outcome.grows), time, pushes))
    elif outcome.grows is False:
        outcome = _as_contacts_part(outcome, system, time, pushes)
    known = linear.sticking.decay if time is None else None
    if outcome.grows is False and known is None and linear.sticking.searched:
        known = follow_decay(system.motion, time)
    return outcome if known is None or outcome.grows else _after_decay(outcome, known)


def _after_decay(outcome: _Outcome, decay: Decay) -> _Outcome:
    """The outcome where a random state says whether sticking contacts grow."""
    says = f"{'with sticking contacts ' if outcome.one_sided else ''}{decay}"
    return replace(
        outcome,
        grows=decay.grows if outcome.grows is False else outcome.grows,
        growth_rate=decay.growth_rate,
        sticking=LinearNeighbour(decay.growth_rate, decay.searched),
        reasons=[*outcome.reasons, *([says] if decay.grows is None else [])],
        decay=decay,
    )


def _as_contacts_part(linear: _Outcome, system: OneSidedSystem, time: float | None, pushes: int) -> _Outcome:
    """The outcome of linear motion that does not grow: how far it holds, and what laws of two derivatives add."""
    configuration = system.motion.configuration
    if configuration.stiffness is not None or not len(configuration.contacts):
        return linear
    reach = ContactReach(system)
    reach.look_closely(system.start(random_pushes(configuration, 1)))
    if np.isinf(reach.least_scale):
        return replace(linear, reasons=[*linear.reasons, UNSETTLED])
    most = reach.largest_scale
    largest = most if np.isfinite(most) else None
    found = replace(linear, largest_push=largest, residual_push=reach.residual_scale)
    if system.remembers_nothing:
        return found
    creep = follow_creep(system, pushes, time)
    reasons = (
        f"vibration wears contacts down, and adds more to D within t = {creep.time:.4g} than creep, which adds as the "
        "square of the time; whether this goes on was not followed",
    )
    return replace(found, creep=creep, reasons=reasons if creep.grows else ())


def _after_pushes(sticks: _Outcome, found: dict[str, Any]) -> _Outcome:
    """The outcome of one-sided motion; unknown, too, if it is the motion after no push of any size."""
    reasons, (least, most) = [], found["scales"]
    if found["grows"] is None:
        reasons.append(
            f"the motion of contacts at Coulomb's bound has not settled within t = {found['time']:.4g}, where D is "
            f"{found['amplification']:.3g} times the mean square velocity of the push, and D that grows more slowly "
            f"than exp({found['searched']:.2g} t) would not have been seen"
        )
    elif not found["grows"] and np.isinf(least):
        reasons.append(UNSETTLED)
    elif not found["grows"] and least >= most and least > LEFT_ALONE * found["residual_push"]:
        reasons.append(
            f"contacts that count as at Coulomb's bound reach it after pushes above {least:.1g} (velocity along an "
            f"axis) alone, and others reach it, or open, after pushes above {most:.1g}: bring the packing to rest more "
            "closely"
        )
    return replace(
        sticks,
        grows=found["grows"],
        growth_rate=found["growth_rate"] if found["grows"] else sticks.growth_rate,
        reasons=reasons,
        one_sided=found,
    )


def _finite(numbers: dict[str, Any]) -> dict[str, Any]:
    """With None in place of numbers that JSON does not have, as of a scale without a bound."""

    def plain(value: Any) -> Any:
        if isinstance(value, tuple):
            return [plain(each) for each in value]
        return None if isinstance(value, float) and not np.isfinite(value) else value

    return {name: plain(value) for name, value in numbers.items()}


def _positive_time(time: float) -> float:
    """The time as a number."""
    try:
        return number("time", time, positive=True)
    except (TypeError, ValueError):
        raise ValueError(f"The time that motion is followed is a positive number, not {time!r}.") from None


def _without_dissipation(configuration: Configuration, found: Spectrum | None) -> tuple[WithoutDissipation, Rates]:
    """Of sticking contacts: what grows without dissipation, and its eigenvalues s."""
    if found is None:
        rates = Motion.of(configuration, dissipation=False).rates
        return WithoutDissipation(rates.growth_rate, None, None), rates
    unstable = 1j * np.sqrt(found.unstable)
    grows = np.ones(len(unstable), bool)
    rates = Rates(np.where(unstable.real < 0, -unstable, unstable), grows, found.free)
    return WithoutDissipation(found.growth_rate(), len(found.pairs), len(found.negative)), rates


def _direction(configuration: Configuration, rise: str | ArrayLike) -> Floats:
    """Forces per unit of time on all coordinates, shape (coordinates, 1)."""
    if not isinstance(rise, str):
        forces = forces_on_coordinates(configuration, rise)
        if not forces.any():
            raise ValueError("rise is a force on no particle: give the forces by which the load rises, not all zero.")
        return forces
    if rise != "fx" or not configuration.top.any():
        raise ValueError('rise is "fx" of a packing with an upper layer, or an array of forces, shape (N, d).')
    forces = np.zeros((len(configuration), configuration.dimension))
    forces[:, 0] = configuration.top
    return forces_on_coordinates(configuration, forces)


def _drift_and_vibration(rising: dict[str, Any]) -> str:
    steady = "" if rising["steady"] else ", not steady yet"
    numbers = (
        f"{name} {rising[name]:.3g}" + (f" \u00b1 {error:.1g}" if (error := rising[f"{name}_error"]) else "")
        for name in ("drift", "vibration")
    )
    return ", ".join(numbers) + steady


def _is(count: int) -> str:
    return "is" if count == 1 else "are"
