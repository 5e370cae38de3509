"""The walk along the ramp: announce, confirm, subdivide.

The walker knows loads and nothing of matrices. For each increment it asks an *oracle*

1. which pairs may change between the two loads (`candidates`): cheap, and rather too many than too few;
2. what they do (`confirm`): with the operator itself, edges solved for;
3. where to look in between, should the oracle not be sure of it. The walker then goes through the parts of the
   increment in the same way, and only what is sure is recorded.

The oracles are :mod:`~faultgouge.analysis.onset.all_windows` and :mod:`~faultgouge.analysis.onset.first_window`, and
that of growing motion, :mod:`~faultgouge.analysis.damped_onset.windows`.
"""

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import NoEquilibriumError

At = TypeVar("At")  # what an oracle has of a load: the operator, or all of its modes
Announcement = TypeVar("Announcement")  # what an oracle announces of an increment
Sure = TypeVar("Sure")  # what an oracle is sure of


class Oracle(Protocol[At, Announcement, Sure]):
    """Who can tell what happens between two loads."""

    @property
    def finished(self) -> bool:
        """Whether all that is sought has been found."""

    def candidates(self, places: Sequence[At], depth: int) -> Iterable[Announcement]:
        """What may happen on each of the increments between neighbouring places."""

    def confirm(self, candidates: Announcement, here: At, there: At, depth: int) -> tuple[Sure | None, Sequence[At]]:
        """What does happen on one increment, to be recorded, and where to divide the increment if that is in doubt."""

    def record(self, sure: Sure) -> None:
        """Take down what is sure of an increment; increments come in order."""


def march(oracle: Oracle[At, Announcement, Sure], places: Sequence[At], depth: int = 0) -> None:
    """Go from the first to the last of two or more places at increasing loads, or to where the oracle is finished.

    `depth` is how often the increment has been divided of which these are the parts.
    """
    for (here, there), candidates in zip(pairwise(places), oracle.candidates(places, depth), strict=True):
        sure, between = oracle.confirm(candidates, here, there, depth)
        if between:
            march(oracle, [here, *between, there], depth + 1)
        if sure is not None:
            oracle.record(sure)
        if oracle.finished:
            return


def look_between(look: Callable[[float], At], below: float, middle: float, above: float) -> list[At]:
    """What is at a load in between, or at one beside it where that has no equilibrium; nothing if there is none."""
    for fx in (middle, 0.5 * (below + middle), 0.5 * (middle + above)):
        try:
            return [look(fx)]
        except NoEquilibriumError:
            continue
    return []


def check_increasing(forces: ArrayLike) -> NDArray[np.float64]:
    """Loads as an array; ValueError if they are not at least two finite, increasing numbers."""
    loads = np.array(forces, dtype=np.float64)
    if loads.ndim != 1 or len(loads) < 2 or not np.all(np.isfinite(loads)) or np.any(np.diff(loads) <= 0):
        raise ValueError("The loads of a ramp must be at least two finite, increasing numbers.")
    return loads
