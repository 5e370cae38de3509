"""Whether small motion of a packing grows, in sentences for a page: with the packing's own dashpots, and without."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eig

from faultgouge.analysis import Configuration, Packing, growth_rate
from faultgouge.analysis.motion.eigenvalues import SAFETY, is_negative, unit_rounding, zero_uncertainty
from faultgouge.analysis.motion.state_space import StateSpace
from faultgouge.analysis.onset import Modes, force_bearing


@dataclass(frozen=True)
class Verdict:
    """What linear theory says about one packing.

    Attributes
    ----------
    pairs, negative : int
        Numbers of complex pairs and of negative eigenvalues, both without dissipation.
    undamped_rate : float
        Growth rate of D without dissipation, 1 / time; zero if nothing grows.
    damped_rate : float or None
        The largest 2 Re s with the packing's dashpots and drag, 1 / time; None for a packing without dissipation.
    grows : bool
        Whether a motion grows, with the dissipation that the packing has.
    at_bound : int
        Contacts at Coulomb's bound whose sliding linear theory leaves out.
    """

    pairs: int
    negative: int
    undamped_rate: float
    damped_rate: float | None
    grows: bool
    at_bound: int

    @classmethod
    def of(cls, packing: Packing | Configuration, modes: Modes) -> "Verdict":
        """The verdict on a packing, of which all modes without dissipation are given."""
        overlap = np.abs(np.sum(modes.left.conj() * modes.right, axis=0))
        uncertainty = zero_uncertainty(packing, unit_rounding(modes.matrix.data))
        negative = np.flatnonzero(is_negative(modes.values, overlap, uncertainty))
        growing = [*(up for up, _ in modes.complex_pairs), *negative]
        damped, grows = _with_dissipation(packing) if packing.damped else (None, bool(growing))
        return cls(
            pairs=len(modes.complex_pairs),
            negative=len(negative),
            undamped_rate=max((growth_rate(modes.values[each]) for each in growing), default=0.0),
            damped_rate=damped,
            grows=grows,
            at_bound=_at_bound(packing),
        )

    @property
    def rate(self) -> float:
        """Growth rate of D with the dissipation that the packing has, 1 / time."""
        return self.undamped_rate if self.damped_rate is None else self.damped_rate

    @property
    def sentences(self) -> list[str]:
        """The verdict, and then what it rests on and what it leaves out."""
        return [self._verdict, *self._undamped, *self._left_out]

    @property
    def _verdict(self) -> str:
        dissipation = "" if self.damped_rate is None else " with its dashpots and drag"
        if self.grows:
            return f"Unstable{dissipation}: D, the mean square displacement, grows as exp({self.rate:.3g} t)."
        if self.at_bound:
            return f"Not known: no motion grows{dissipation}, unless contacts slide on."
        if self.damped_rate is None:
            return "Stable: no motion grows."
        slowest = f"; D of the slowest motion decays as exp({self.rate:.3g} t)" if self.rate < 0 else ""
        return f"Stable{dissipation}: no motion grows{slowest}."

    @property
    def _undamped(self) -> list[str]:
        counts = ((self.pairs, "pair", "complex"), (self.negative, "single eigenvalue", "negative"))
        found = [f"{count_of(n, what)} {'is' if n == 1 else 'are'} {kind}" for n, what, kind in counts if n]
        what = " and ".join(found) or "all eigenvalues are real and none is negative"
        if self.damped_rate is None:
            return [f"{what[0].upper()}{what[1:]}."]
        rate = f", and D would grow as exp({self.undamped_rate:.3g} t)" if found else ", and nothing would grow"
        return [f"Without dissipation {what}{rate}."]

    @property
    def _left_out(self) -> list[str]:
        if not self.at_bound:
            return []
        are = "contact is" if self.at_bound == 1 else "contacts are"
        return [f"{self.at_bound} {are} at Coulomb's bound and stick here. Sliding on may make motion grow."]


def _with_dissipation(packing: Packing | Configuration) -> tuple[float, bool]:
    """The largest 2 Re s of s^2 M + s C + K, and whether any Re s is positive beyond its rounding uncertainty."""
    z = StateSpace.of(force_bearing(packing)).matrix
    rates, left, right = eig(z, left=True, check_finite=False)
    overlap = np.abs(np.sum(left.conj() * right, axis=0))
    grows = rates.real * overlap > SAFETY * unit_rounding(z)
    return 2 * float(rates.real.max(initial=-np.inf)), bool(np.any(grows))


def count_of(number: int, noun: str) -> str:
    """1 pair, 2 pairs."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _at_bound(packing: Packing | Configuration) -> int:
    """Contacts that slide on ahead and stick on the way back; those of a smoothed law do neither."""
    if isinstance(packing, Configuration):
        return int(packing.contacts.one_sided.sum())
    return int(packing.sliding.sum()) if packing.law.coulomb else 0
