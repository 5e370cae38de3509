"""The verdict on a packing at rest: whether it moves, in numbers and in sentences."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..counted import counted
from ..fields_by_name import FieldsByName
from .eigenvalues import Linear, exponential
from .one_sided import PUSH_OVER_RESIDUAL
from .rising_load import HALVES_DIFFERENCE, VIBRATION_SHARE

WORN = "contacts bear less after they have closed and parted, so that vibration carries particles on"
"""The sentence on contacts with two derivatives."""

ENDS = {"vibrates": "vibrates at", "creeps": "creeps on, at", "flows": "flows, at"}


class NoVerdictError(ValueError):
    """Truth was asked of a verdict that is not known."""


@dataclass(frozen=True)
class Stability:
    """Whether a packing moves. `bool()` of it is the verdict, or a NoVerdictError.

    Attributes
    ----------
    stable : bool or None
        None: unknown, for the `reasons`.
    growth_rate, error : float
        Of D, 1 / time, with dissipation: largest 2 Re s, negative if every motion decays, and zero if that is zero but
        for rounding. Where contacts at the bound make the packing grow, the rate of the one-sided motion.
    at_least : bool
        Whether the growth rate is only known to be no less.
    undamped : FieldsByName
        Without dissipation, of sticking contacts: `growth_rate` of D, 1 / time, `at_least` that or known; and how many
        complex `pairs` and `negative` eigenvalues K has, None where these are not counted.
    at_bound : int
        Contacts at Coulomb's bound.
    rolling_at_bound : int
        Contacts whose rolling friction is at its bound.
    sticking, sliding : Linear
        If all contacts at the bound stuck, and if all slid on; no bounds of what they do.
    asymmetry : dict
        Shares of what makes K asymmetric: tangential_force, lever_arm, overlap; empty where K is given.
    dissipative : bool
        Whether there are dashpots or drag.
    free : int
        Motions that no force opposes.
    contacts : int
        Number of contacts; where K is given, and walls hand out no contacts, of particles that feel something.
    one_sided : FieldsByName or None
        What became of motion after pushes (:func:`~faultgouge.analysis.motion.pushes.follow_pushes`); None without
        contacts that slide on one side. Its numbers have two spellings, `one_sided.grows` and `one_sided["grows"]`.
    creep : FieldsByName or None
        How far a push carries particles if contacts have two derivatives, and none is at the bound
        (:func:`~faultgouge.analysis.motion.pushes.follow_creep`).
    largest_energy, largest_push : float or None
        Where linear motion does not grow, and no contact slides on one side: energy of a push below which no contact
        changes, whatever the push; and the velocity of one particle, whichever it is, with that energy: that of the
        largest mass. None where K is given, if the energy of K is not positive, or if nothing can change.
    push_time : float or None
        Up to which time; None if for ever.
    residual_push : float
        Velocity of one particle, that of the smallest mass, with the energy of the displacement by the residual forces.
    first_change : float or None
        Where motion grows: D at which it takes the first contact to another state.
    follow : dict or None
        Where motion grows, and LAMMPS went on: "displacement", the root of D where it ends, and "ends", "vibrates",
        "creeps" or "flows".
    rising : FieldsByName or None
        Drift and vibration over the rate of loading
        (:func:`~faultgouge.analysis.motion.rising_load.motion_under_load`). None unless asked, and where the motion was
        `not_followed`.
    reasons : tuple of str
        Why the verdict is unknown.
    not_followed : str
        Why the motion under a rising load was not followed, where it was asked for.
    remarks : tuple of str
        Those of the Configuration, what of its origin is left out, or other than it seems; and others.
    """

    stable: bool | None
    growth_rate: float
    error: float
    at_least: bool
    undamped: FieldsByName
    at_bound: int
    sticking: Linear
    sliding: Linear
    asymmetry: dict[str, float]
    dissipative: bool
    free: int
    contacts: int
    one_sided: FieldsByName | None = None
    creep: FieldsByName | None = None
    rolling_at_bound: int = 0
    largest_energy: float | None = None
    largest_push: float | None = None
    push_time: float | None = None
    residual_push: float = 0.0
    first_change: float | None = None
    follow: dict[str, Any] | None = None
    rising: FieldsByName | None = None
    reasons: tuple[str, ...] = ()
    not_followed: str = ""
    remarks: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        if self.stable is None:
            raise NoVerdictError(f"{self.sentences[0]}: ask for .stable, which is None here.")
        return self.stable

    def __str__(self) -> str:
        """The verdict in sentences, the verdict first."""
        return "\n".join(self.sentences)

    __repr__ = __str__

    @property
    def sentences(self) -> tuple[str, ...]:
        """The verdict, what holds without dissipation, what contacts at the bound do, and remarks on the origin."""
        return (self._verdict(), *self._at_rest(), *self._range(), *self._beyond(), *self.remarks)

    def _verdict(self) -> str:
        outcome, said = self.one_sided, self.sticking.said
        free = f", except for {counted(self.free, 'motion')} that no force opposes" if self.free else ""
        rate = exponential(self.growth_rate, _digits(self.growth_rate, self.error), self.at_least)
        if not self.contacts:
            return "no particle touches another or a wall: stability is not defined"
        if self.stable is None:
            return f"not known whether the packing is stable: {'; '.join(self.reasons)}"
        if not self.stable:
            return f"unstable: small motion grows{' in spite of the dissipation' * self.dissipative}, {rate}"
        if outcome is not None:
            left = f", where {outcome.slip_left:.1%} of their slip is left" if outcome.slip_left else ""
            ends = "comes to rest" if self.growth_rate < 0 else "ends in vibration that goes on, but does not grow"
            size = as_known(outcome.least_amplification, outcome.amplification)
            stuck = f"; with sticking contacts, {said}" if said else ""
            reaches = f"D reaches {size} times the mean square velocity of the push while contacts slide"
            followed = f"(followed for t = {outcome.time:.4g}{left})"
            return f"stable: each of {outcome.pushes} pushes {ends}{free}; {reaches} {followed}{stuck}"
        if said:
            return f"stable: {said}{free}"
        if self.dissipative and self.growth_rate < 0:
            return f"stable: every {'vibration' if self.creep else 'motion'} decays, the slowest with {rate}{free}"
        if self.creep and not self.dissipative:
            return f"stable but for creep: no motion grows exponentially{free}"
        return f"stable: no motion grows{free}"

    def _at_rest(self) -> Iterator[str]:
        """Without dissipation, with contacts at the bound, and with those that vibration wears down."""
        u, creep, sided = self.undamped, self.creep, self.one_sided is not None or self.sliding != self.sticking
        if self.dissipative and u.growth_rate > 0:
            counts = {"complex pair": u.pairs, "negative eigenvalue": u.negative}
            what = " and ".join(counted(count, name) for name, count in counts.items() if count)
            yield f"without dissipation: {what or 'small motion grows'}, {exponential(u.growth_rate, 6, u.at_least)}"
        if self.at_bound or self.rolling_at_bound:
            rolls = f", and the rolling friction of {self.rolling_at_bound} at its own" if self.rolling_at_bound else ""
            slide = f" and slide{'s' * (self.at_bound + self.rolling_at_bound == 1)}"
            slide = ": each slides on ahead and sticks on the way back" if sided else slide
            count = f"{self.at_bound} of {counted(self.contacts, 'contact')} {'is' if self.at_bound == 1 else 'are'}"
            yield f"{count} at Coulomb's bound{rolls}{slide}"
            if sided:
                on = max(self.sliding.free - self.sticking.free, 0)
                ever = f"{counted(on, 'motion')} would go on for ever, and " if on else ""
                slid = f"if all slid on, {ever}{_neighbour(self.sliding)}"
                stuck = f"if all of them stuck, {_neighbour(self.sticking)}"
                yield f"neither of two linear motions decides: {stuck}; {slid}"
        if self.stable and self.one_sided is not None and self.one_sided.wears:
            yield WORN + ": as long as vibration lasts, contacts may slide again, and D may rise further"
        if self.stable and creep is not None and self.dissipative:
            later = "" if creep.settled else ", and farther later"
            if not creep.settled and creep.limit is not None:
                later = f"; D may reach {creep.limit:.2g} times before the slowest motion has decayed"
            times = f"{creep.amplification:.2g} times the mean square velocity of the push within t = {creep.time:.4g}"
            yield f"{WORN}, and they stay displaced, by D up to {times}{later}"
        elif self.stable and creep is not None:
            known = as_known(creep.least_velocity, creep.velocity)
            yield f"{WORN}: D as ({known} t)^2 times the mean square velocity of the push"

    def _range(self) -> Iterator[str]:
        """Between which pushes this holds."""
        least, most, outcome = PUSH_OVER_RESIDUAL * self.residual_push, self.largest_push, self.one_sided
        if outcome is not None:
            least, most = outcome.scales
            if outcome.grows and np.isfinite(least):
                smaller = "contacts that count as at the bound may stay below it, or residual forces count"
                after = f"pushes from {least:.1g} on (velocity along an axis)"
                yield f"this growth is seen after {after}: after smaller ones {smaller}"
            elif self.stable and least < most:
                yield (
                    f"this is the motion after these pushes from {least:.1g} on (velocity along an axis), where "
                    "contacts that count as at the bound reach it and residual forces do not count, up to "
                    f"{most:.1g}, where another contact changes or one of these turns; other pushes may differ"
                )
        elif self.stable and most is not None and least >= most:
            above = f"above {most:.1g} a contact may open, close or slide"
            yield f"holds for no push: below {least:.1g} (velocity of one particle) residual forces count, and {above}"
        elif self.stable and most is not None:
            below = f"; below a velocity of {least:.1g} residual forces count" if least else ""
            worn = ", but for what vibration wears down" if self.creep else ""
            within = f", until t = {self.push_time:.3g}" if self.push_time else ""
            pushes = f"every push of an energy up to {self.largest_energy:.2g}, as of one particle at {most:.2g}"
            yield f"holds for {pushes}{within}: no contact opens, closes or slides{worn}{below}"
        elif self.stable and not self.asymmetry:
            above = f" from {least:.1g} on (velocity of one particle), below which residual forces count"
            says = "which push changes a contact, K by differences of forces does not say"
            yield f"holds for small pushes{above if least else ''}: {says}"
        elif self.stable and not least:
            yield "which push changes a contact is not known, since K's symmetric part is not positive"

    def _beyond(self) -> Iterator[str]:
        """Where a motion that grows ends, and under a load that rises."""
        rising = self.rising
        if self.stable is False and self.first_change is not None:
            size = self.first_change**0.5
            yield f"as it grows, the first contact changes at a displacement of {size:.2g} (root of D)"
        if self.stable is False and self.follow is not None:
            ends, size = ENDS[self.follow["ends"]], self.follow["displacement"]
            yield f"LAMMPS goes on from there, and {ends} a displacement of {size:.2g}"
        if self.not_followed:
            yield f"under a load that rises: not followed, since {self.not_followed}"
        if rising is not None:
            other, least, says = rising.other_start, rising.least_rise, _drift(rising)
            if other is not None:
                less, more = sorted((rising.vibration, other.vibration))
                alike = more - less <= HALVES_DIFFERENCE * more or more <= VIBRATION_SHARE * rising.drift
                if not alike or rising.steady is not other.steady:
                    says += f", and from another start {_drift(other)}"
            if least:
                slide = "all contacts at the bound have reached it and " if self.one_sided is not None else ""
                says += f"; from a rise of {least:.1g} on, where {slide}residual forces do not count"
            if rising.next_change:
                says += f"; until the load has risen by {rising.next_change:.2g} (a contact {rising.next_event})"
            yield f"under a load that rises at the rate 1: {says}"

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        found: dict[str, Any] = {}
        for name, value in vars(self).items():
            if isinstance(value, Linear):
                found[name] = {key: each for key, each in asdict(value).items() if key != "s"}
            elif name not in ("dissipative", "contacts"):
                found[name] = value.as_dict() if isinstance(value, FieldsByName) else value
        lists = {name: list(found[name]) for name in ("reasons", "remarks")}
        return found | lists | {"searched": self.sticking.searched}


def _neighbour(linear: Linear) -> str:
    """What a linear motion does."""
    if linear.searched and linear.growth_rate <= 0:
        return f"no growth of D faster than exp({linear.searched:.2g} t)"
    if linear.growth_rate == 0:
        return "D neither grows nor decays"
    return exponential(linear.growth_rate, 4, linear.at_least)


def _drift(found: FieldsByName) -> str:
    """Drift and vibration of one start."""
    errors = [f" \u00b1 {error:.1g}" if error else "" for error in (found.drift_error, found.vibration_error)]
    known = f"drift {found.drift:.3g}{errors[0]}, vibration {found.vibration:.3g}{errors[1]}"
    return known + ("" if found.steady else ", not steady yet")


def as_known(least: float, most: float) -> str:
    """The larger of two numbers, with as many digits as these agree in."""
    return f"{most:.{_digits(most, most - least)}g}"


def _digits(number: float, error: float) -> int:
    """How many digits of a number are larger than its error, one to six."""
    share = abs(error / number) if number else 0.0
    return 6 if share < 1e-6 else int(np.clip(np.ceil(-np.log10(share)), 1, 6))
