"""The verdict on a packing at rest: whether it moves, in numbers and in sentences."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from ..counted import counted
from .contact_reach import PUSH_OVER_RESIDUAL
from .creep import Creep
from .eigenvalues import Linear
from .growth_in_words import exponential
from .one_sided_outcome import OneSidedOutcome
from .rising_load import RisingMotion

WORN = "contacts bear less after they have closed and parted, so that vibration carries particles on"
"""The sentence on contacts with two derivatives."""


@dataclass(frozen=True)
class LinearNeighbour:
    """The linear motion with all contacts at the bound alike.

    Attributes
    ----------
    growth_rate : float
        Largest 2 Re s, 1 / time; zero if none was found in a large packing.
    searched : float
        Growth rate of D, 1 / time, below which growth was not looked for; 0 if all eigenvalues are known.
    at_least : bool
        Whether the growth rate is only known to be no less.
    """

    growth_rate: float
    searched: float = 0.0
    at_least: bool = False

    @classmethod
    def of(cls, rates: Linear) -> "LinearNeighbour":
        """The fastest motion."""
        return cls(rates.growth_rate, rates.searched, rates.at_least)

    def __str__(self) -> str:
        if self.searched and self.growth_rate <= 0:
            return f"no growth of D faster than exp({self.searched:.2g} t)"
        if self.growth_rate == 0:
            return "D neither grows nor decays"
        return exponential(self.growth_rate, 4, self.at_least)


@dataclass(frozen=True)
class WithoutDissipation:
    """The motion without dissipation, of sticking contacts: the eigenvalues of K.

    Attributes
    ----------
    growth_rate : float
        Of D, 1 / time.
    pairs, negative : int or None
        Complex pairs, and negative eigenvalues; of large packings these are not counted.
    at_least : bool
        Whether the growth rate is only known to be no less.
    """

    growth_rate: float
    pairs: int | None
    negative: int | None
    at_least: bool = False


@dataclass(frozen=True)
class Stability:
    """Whether a packing moves.

    Attributes
    ----------
    stable : bool or None
        None: unknown, for the `reasons`.
    growth_rate : float
        Of D, 1 / time, with dissipation: largest 2 Re s, negative if every motion decays, and zero if that is zero but
        for rounding. Where contacts at the bound make the packing grow, the rate of the one-sided motion.
    at_least : bool
        Whether the growth rate is only known to be no less.
    undamped : WithoutDissipation
        Without dissipation.
    at_bound : int
        Contacts at Coulomb's bound.
    one_sided : OneSidedOutcome or None
        What became of motion after pushes; None without contacts that slide on one side. Its fields have two spellings,
        `one_sided.grows` and `one_sided["grows"]`, as JSON has them; those of `rising` have, too.
    creep : Creep or None
        How far a push carries particles if contacts have two derivatives, and none is at the bound.
    largest_push : float or None
        Where motion does not grow, and no contact slides on one side: velocity of a push along an axis up to which
        contacts neither reach the bound nor open, and no others close. None where K is given.
    push_time : float
        Within which time; other motion than that which no force opposes has gone farthest by then.
    residual_push : float
        Velocity of a push along an axis that moves the particles as far as the residual forces do; 0 where no motion
        was followed.
    said : str
        How the verdict on sticking contacts is known, where not all eigenvalues are.
    rising : RisingMotion or None
        Drift and vibration over the rate of loading. None unless asked, and where the motion was `not_followed`.
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
    at_least: bool
    undamped: WithoutDissipation
    at_bound: int
    one_sided: OneSidedOutcome | None
    creep: Creep | None
    largest_push: float | None
    push_time: float
    residual_push: float
    said: str
    rising: RisingMotion | None
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
            return f"unstable: small motion grows{how}, {exponential(self.growth_rate, 6, self.at_least)}"
        if self.one_sided is not None:
            return f"stable: {self._comes_to_rest(self.one_sided, free)}"
        if self.said:
            return f"stable: {self.said}{free}"
        if self.dissipative and self.growth_rate < 0:
            motion = "every vibration" if self.creep else "every motion"
            return f"stable: {motion} decays, the slowest with D as exp({self.growth_rate:.6g} t){free}"
        if self.creep and not self.dissipative:
            return f"stable but for creep: no motion grows exponentially{free}"
        return f"stable: no motion grows{free}"

    def _comes_to_rest(self, outcome: OneSidedOutcome, free: str) -> str:
        left = outcome.slip_left
        until = "until the contacts have stopped sliding" if left == 0 else "while contacts slide"
        on = f", and they slide on by {left:.1%} at most as vibration decays" if left else ""
        sticks = f"; with sticking contacts, {self.said}" if self.said else ""
        ends = "comes to rest" if self.growth_rate < 0 else "ends in vibration that goes on, but does not grow"
        return (
            f"each of {outcome.pushes} pushes {ends}{free}; D reaches {outcome.amplification:.3g} times the "
            f"mean square velocity of the push {until} (followed for t = {outcome.time:.4g}{on}){sticks}"
        )

    @property
    def _without_loss(self) -> Iterator[str]:
        u = self.undamped
        if self.dissipative and u.growth_rate > 0:
            counts = {"complex pair": u.pairs, "negative eigenvalue": u.negative}
            what = " and ".join(counted(count, name) for name, count in counts.items() if count)
            yield f"without dissipation: {what or 'small motion grows'}, {exponential(u.growth_rate, 6, u.at_least)}"

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
        if self.stable and self.one_sided is not None and self.one_sided.wears:
            yield WORN + ": as long as vibration lasts, contacts may slide again, and D may rise further"
        if creep is None or not self.stable:
            return
        says = f": D as ({creep.velocity:.2g} t)^2 times the mean square velocity of the push"
        if self.dissipative:
            says = (
                f", and they stay displaced, by D up to {creep.amplification:.2g} times the mean square velocity of "
                f"the push within t = {creep.time:.4g}{_later(creep)}"
            )
        yield f"{WORN}{says}"

    @property
    def _scales(self) -> Iterator[str]:
        if self.stable and self.one_sided is None:
            yield from self._scales_of_linear_motion
        if self.one_sided is None or self.one_sided.grows is None:
            return
        least, most = self.one_sided.scales
        if self.one_sided.grows:
            yield (
                f"this growth is seen after pushes from {least:.1g} on (velocity along an axis): after smaller "
                "ones contacts that count as at the bound may stay below it, or residual forces count"
                if np.isfinite(least)
                else "from which push on this growth is seen is not known: contacts that count as at the bound may "
                "stay below it, and residual forces count"
            )
            return
        if least < most:
            yield (
                f"this is the motion after pushes of {least:.1g} to {most:.1g} (velocity along an axis): below, "
                "contacts that count as at the bound do not reach it, or residual forces count; above, others reach "
                "it, open or close, or one of these turns"
            )
        elif self.stable:
            yield (
                f"no push is small enough for this motion (below {most:.1g}, where no other contact reaches the bound, "
                f"opens or closes) and large enough (above {least:.1g}, where residual forces do not count)"
            )

    @property
    def _scales_of_linear_motion(self) -> Iterator[str]:
        least, most = PUSH_OVER_RESIDUAL * self.residual_push, self.largest_push
        if most is None and not self.asymmetry:  # K is given
            above = (
                f"above {least:.1g} (velocity along an axis), if small: below, residual forces count; " if least else ""
            )
            yield (
                f"holds for {'pushes ' + above if above else 'small pushes: '}from which push on contacts open, close, "
                "slide or roll, K by differences of forces does not say"
            )
        elif most is None:
            if least:
                yield f"holds for pushes above {least:.1g} (velocity along an axis): below, residual forces count"
        elif least < most:
            within, later = (f", up to t = {self.push_time:.2g}", " or later") if self.free else ("", "")
            yield (
                f"holds for pushes of {least:.1g} to {most:.1g} (velocity along an axis){within}: below, residual "
                f"forces count; above{later}, contacts open, close or slide"
            )
        else:
            yield (
                f"holds for no push (velocity along an axis): below {least:.1g}, residual forces count; above "
                f"{most:.1g}, contacts open, close or slide"
            )

    @property
    def _under_the_load(self) -> Iterator[str]:
        if self.not_followed:
            yield f"under a load that rises: not followed, since {self.not_followed}"
        if self.rising is not None:
            other, least, change = self.rising.other_start, self.rising.least_rise, self.rising.next_change
            differs = other is not None and not self.rising.vibrates_like(other)
            says = f"{self.rising}, and from another start {other}" if differs else str(self.rising)
            slide = "all contacts at the bound have reached it and " if self.one_sided is not None else ""
            since = f"; from a rise of {least:.1g} on, where {slide}residual forces do not count" if least else ""
            until = (
                ""
                if change is None
                else f"; until the load has risen by {change:.2g} (a contact {self.rising.next_event})"
            )
            yield f"under a load that rises at the rate 1: {says}{since}{until}"

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "stable": self.stable,
            "growth_rate": self.growth_rate,
            "at_least": self.at_least,
            "undamped": vars(self.undamped),
            "at_bound": self.at_bound,
            "one_sided": None if self.one_sided is None else self.one_sided.as_dict(),
            "creep": None if self.creep is None else vars(self.creep),
            "largest_push": self.largest_push,
            "push_time": self.push_time,
            "residual_push": self.residual_push,
            "said": self.said,
            "rising": None if self.rising is None else self.rising.as_dict(),
            "sticking": vars(self.sticking),
            "sliding": vars(self.sliding),
            "asymmetry": self.asymmetry,
            "free": self.free,
            "searched": self.searched,
            "reasons": list(self.reasons),
            "not_followed": self.not_followed,
            "remarks": list(self.remarks),
        }


def _later(creep: Creep) -> str:
    """How far vibration may carry particles after the time that was followed."""
    if creep.settled:
        return ""
    if creep.limit is None:
        return ", and farther later"
    return f"; D may reach {creep.limit:.2g} times before the slowest motion has decayed"


def _is(count: int) -> str:
    return "is" if count == 1 else "are"
