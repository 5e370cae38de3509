"""Whether the error that an onset states covers the one that it has, over arithmetics and increments."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from ....analysis import Onset

INCREMENTS = (2e-3, 1e-3, 5e-4, 2.5e-4)
"""Of the ramps whose stated errors are compared with the true ones."""


@dataclass(frozen=True)
class Covered:
    """The error that an onset states, and the one that it has.

    Attributes
    ----------
    arithmetic : str
        Which.
    increment : float
        Of the ramp, force.
    true, stated : float
        Force.
    """

    arithmetic: str
    increment: float
    true: float
    stated: float

    @property
    def holds(self) -> bool:
        """Whether the stated error covers the true one."""
        return self.true <= self.stated


def coverage(onsets: Mapping[str, Callable[[float], Onset]], increments: Sequence[float]) -> tuple[Covered, ...]:
    """Stated and true errors of an onset over arithmetics and increments.

    Parameters
    ----------
    onsets : mapping
        Arithmetic to a function from an increment to the onset with its whole error. The last arithmetic, with half of
        the last increment, is the truth; its own error counts as covered.
    increments : sequence of float
        Of the ramps, force.

    Returns
    -------
    tuple of Covered
        By arithmetic, then by increment.
    """
    *_, finest = onsets.values()
    truth = finest(0.5 * increments[-1])
    cases = []
    for arithmetic, onset in onsets.items():
        for increment in increments:
            found = onset(increment)
            cases.append(Covered(arithmetic, increment, abs(found.fx_c - truth.fx_c), found.error + truth.error))
    return tuple(cases)
