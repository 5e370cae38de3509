"""A loading path: equilibria as a function of a load, computed when they are asked for.

Equilibria with friction depend on how they were reached. An equilibrium beyond the largest load so far follows from
the last one, and is kept. An equilibrium at a smaller load follows from the kept one just below, and is not kept, so
that it does not change the path.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Generic, TypeVar

from ..analysis import NoEquilibriumError

E = TypeVar("E")
"""An equilibrium: its load `fx`, and its `packing`."""


class LoadPath(Generic[E]):
    """Equilibria as a function of a load; the end of a `with` block, or `close`, closes the solver.

    Parameters
    ----------
    solver : object
        `solve(load, below, beside, ahead)` finds the equilibrium at a load, reached from the equilibrium `below`, which
        is None where the path begins; `beside` is another one near it, for an initial guess, or None; `ahead` says
        whether the path goes on from the result, at a load larger than all so far. It raises NoEquilibriumError if the
        packing flows. `close()` ends the processes and files of the solver.
    equilibria : sequence
        Equilibria of the path that are known already, by increasing load.
    onward : bool
        Whether the solver may go on by other ways where the branch of equilibria ends.
    """

    def __init__(self, solver: Any, equilibria: Sequence[E] = (), onward: bool = True) -> None:
        self.solver, self._onward = solver, onward
        self.equilibria: list[Any] = list(equilibria)
        self._between: tuple[Any, Any] | None = None  # a kept one, and the last one found above it

    def __call__(self, load: float) -> Any:
        """The packing in equilibrium at a load."""
        load, kept = float(load), self.equilibria
        below = next((each for each in reversed(kept) if each.fx <= load), None)
        if below is not None and below.fx == load:
            return below.packing
        if not kept or load > kept[-1].fx:
            # from kept equilibria alone, so that the result does not depend on other loads that were asked for
            found = self.solver.solve(load, below, kept[-2] if len(kept) > 1 else None, ahead=self._onward)
            kept.append(found)
            return found.packing
        beside = self._between[1] if self._between and self._between[0] is below else None
        found = self.solver.solve(load, below, beside, ahead=False)
        self._between = below, found
        return found.packing

    def climb(self, loads: Iterable[float]) -> Iterator[E]:
        """The equilibria at increasing loads, up to the last one that the packing bears."""
        for load in loads:
            try:
                self(load)
            except NoEquilibriumError:
                if len(self.equilibria) < 2:
                    raise
                return
            yield self.equilibria[-1]

    def close(self) -> None:
        """Close the solver."""
        self.solver.close()

    def __enter__(self) -> LoadPath[E]:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
