"""The processes that search together: each has the operator, and looks at its own slices of the spectrum.

The eigenvectors of slices take most of the time, and one slice needs nothing of another. So each rank finds the
eigenvectors of its own slices, and hands the pairs that may turn complex to the other ranks. All ranks do the rest
alike and in step. No rank has the vectors of another, and the result is that of one process to the bit.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from ..errors import FaultgougeError

Mine = TypeVar("Mine")


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class Ranks:
    """This process among those that search together; one by itself by default.

    Attributes
    ----------
    rank, size : int
        Number of this process, and how many there are.
    gather : callable
        Anything that pickles -> the list of what all ranks have given, by rank, on each of them.
    workers : int
        Threads of this process.
    """

    rank: int = 0
    size: int = 1
    gather: Callable[[Any], list[Any]] = lambda mine: [mine]
    workers: int = field(default_factory=cores)

    def part(self, count: int) -> slice:
        """Range of neighbouring items that this rank has."""
        return slice(self.rank * count // self.size, (self.rank + 1) * count // self.size)

    def together(self, work: Callable[[], Mine]) -> list[Mine]:
        """The results of the work of all ranks, by rank.

        Raises
        ------
        FaultgougeError
            The first one that a rank has met, on all ranks; at once one of those that end all ranks (`one_rank`).
        """
        try:
            mine: tuple[Mine | None, FaultgougeError | None] = work(), None
        except FaultgougeError as error:
            if error.one_rank:
                raise
            mine = None, error
        everyone: Sequence[Any] = self.gather(mine)
        for _, met in everyone:
            if met is not None:
                raise met
        return [each for each, _ in everyone]


ALONE = Ranks()
"""One process."""
