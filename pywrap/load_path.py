"""A loading path: equilibria as a function of a load, computed when they are asked for.

Equilibria with friction depend on how they were reached. An equilibrium beyond the largest load so far follows from
the last one, and is kept. An equilibrium at a smaller load follows from the kept one just below, and is not kept, so
that it does not change the path.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Generic, Protocol, TypeVar

from ..analysis import NoEquilibriumError

P = TypeVar("P", covariant=True)


class AtLoad(Protocol[P]):
    """An equilibrium: its load and its packing."""

    @property
    def fx(self) -> float: ...

    @property
    def packing(self) -> P: ...


E = TypeVar("E", bound=AtLoad[object], covariant=True)
S = TypeVar("S", bound=AtLoad[object])


class EquilibriumSolver(Protocol[S]):
    """Finds the equilibrium at one load after the other."""

    def solve(self, load: float, below: S | None, beside: S | None, ahead: bool) -> S:
        """The equilibrium at a load, reached from the equilibrium `below`; `below` is None where the path begins.

        Parameters
        ----------
        load : float
            The load, in the unit of the path.
        below, beside : equilibrium, optional
            The equilibrium from which the new one is reached, and another one near it, for an initial guess.
        ahead : bool
            Whether the path goes on from the result, at a load larger than all so far.

        Raises
        ------
        NoEquilibriumError
            If the packing flows.
        """

    def close(self) -> None:
        """End the processes and files of the solver."""


class LoadPath(Generic[E]):
    """Equilibria as a function of a load; the end of a `with` block, or `close`, closes the solver.

    Parameters
    ----------
    solver : EquilibriumSolver
        Finds each equilibrium.
    equilibria : sequence
        Equilibria of the path that are known already, by increasing load.
    onward : bool
        Whether the solver may go on by other ways where the branch of equilibria ends.
    """

    def __init__(self, solver: EquilibriumSolver[E], equilibria: Sequence[E] = (), onward: bool = True) -> None:
        self.solver, self._onward = solver, onward
        self.equilibria = list(equilibria)
        self._between: tuple[E | None, E] | None = None  # a kept one, and the last one found above it

    def __call__(self: LoadPath[AtLoad[P]], load: float) -> P:
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
