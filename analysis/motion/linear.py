"""The linear motion of a packing: whether it grows, in one small record."""

from dataclasses import dataclass

from .decay import follow_decay
from .motion import Motion
from .rates import rates_of


@dataclass(frozen=True)
class Linear:
    """Whether linear motion grows.

    Attributes
    ----------
    stable : bool or None
        None: not known, for the `reasons`.
    growth_rate, error : float
        Of D, largest 2 Re s, 1 / time, and its error.
    free : int
        Motions that no force opposes.
    s : complex
        Of the fastest motion, 1 / time.
    said : str
        How it is known, where not by all eigenvalues.
    at_least : bool
        Whether the growth rate is only known to be no less.
    reasons : tuple of str
        Why it is not known.
    searched : float
        Growth rate of D below which growth may not have been seen.
    """

    stable: bool | None
    growth_rate: float
    error: float = 0.0
    free: int = 0
    s: complex = 0j
    said: str = ""
    at_least: bool = False
    reasons: tuple[str, ...] = ()
    searched: float = 0.0


def linear_verdict(motion: Motion, *, decides: bool = True, time: float | None = None) -> Linear:
    """Whether a linear motion grows."""
    found = rates_of(motion, decides=decides)
    grows, decay, free, searched = bool(found.grows.any()), found.decay, found.free, found.searched
    s = complex(found.values[0]) if len(found.values) else 0j
    if not grows and searched and decides and (decay is None or time is not None):
        decay = follow_decay(motion, time)
    if grows or decay is None:
        return Linear(not grows, found.growth_rate, 0.0, free, s, "", found.at_least, (), searched)
    stable = None if decay.grows is None else not decay.grows
    reasons = () if stable is not None else (str(decay),)
    return Linear(stable, decay.growth_rate, 0.0, decay.free, s, str(decay), False, reasons, decay.searched)
