r"""The walk along a ramp: all windows of a family of systems, with dissipation or without.

**From load to load.** A motion that grows at the upper load of an increment is followed back to the lower load. If the
motion grows there, too, its window stays open. Otherwise its window begins in between, at an edge that is solved for
(:mod:`~faultgouge.analysis.windows.edges`). A motion that grows at the lower load alone is followed ahead to the end of
its window. Modes that grow at neither load may grow in between, and modes that grow at both may rest in between. Where
the bounds of :mod:`~faultgouge.analysis.windows.between` allow for this, the modes are computed at a load in between.
An increment with another number of growing motions there, or in doubt for another reason, is divided and walked in
parts, until no part in doubt is wider than `Search.narrowest`.

**Few motions.** On most increments nothing happens, and to know that takes no decomposition. A screen
(:mod:`~faultgouge.analysis.windows.screens`) names the few motions that may change, or the few modes that may meet.
Where too many are named, or the increment stays in doubt when it is short, all modes of both loads are computed.

**Modes of both loads.** Pairs of real modes without dissipation might meet a third mode on the way, and levels bend
where contacts open or close: such increments are divided as well (`LoadStep.apart`, `LoadStep.hiding`).
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Protocol

from ..arrays import Floats
from ..errors import NoEquilibriumError, TurningPointError
from .between import Few, LoadStep, ModeAtEnds, ModesAtEnds, ModesOfLoads, stretch
from .edges import DoubtError, Edge, LostPairError, LostTrackError, SystemOfLoad, Window, locate_edge
from .limits import LIMITS, Limits
from .space import Space
from .system import System
from .system_modes import SystemModes

Look = Callable[[float, float], Iterable[float]]
"""Two neighbouring loads of a ramp -> further loads between them that are to be looked at."""

Open = list[tuple[Space, Edge]]
"""Motions that grow at a load, and where each has begun to."""

Changes = Sequence[tuple[Space, Space]]
"""Motions that begin or end to grow on an increment, at its lower and at its upper load."""

Sure = Callable[[Changes], bool]
"""Whether no motion begins or ceases to grow beside these, and each of them does so once."""


class Screen(Protocol):
    """Who names the few motions that may change between two loads."""

    def __call__(self, here: System, there: System, growing: Sequence[Space], depth: int) -> Few | ModesOfLoads | None:
        """The few motions or modes that may change; None if they are too many.

        `growing` grow at the lower load, and the increment has been divided `depth` times. A DoubtError says where
        another motion grows in between.
        """


class Search:
    """The windows of a family of systems.

    Parameters
    ----------
    system : callable
        Load -> System.
    narrowest : float
        Windows narrower than this are not looked for, force.
    screen : Screen, optional
        Without one all modes of all loads are computed.
    first : bool
        Whether the walk ends with the first window.
    """

    def __init__(
        self,
        system: SystemOfLoad,
        narrowest: float,
        screen: Screen | None = None,
        first: bool = False,
        limits: Limits = LIMITS,
    ) -> None:
        self.at, self.narrowest, self.screen, self.limits = system, narrowest, screen, limits
        self._first = first
        self.open: Open | None = None  # at the load reached so far
        self.closed: list[Window] = []
        self._modes: dict[float, SystemModes] = {}
        self._before: System | None = None

    @property
    def finished(self) -> bool:
        """Whether the first window has been found, and is all that is sought."""
        return self._first and bool(self.open or self.closed)

    @property
    def windows(self) -> tuple[Window, ...]:
        """All windows up to the load reached so far, by increasing onset."""
        still = [Window(onset, None) for _, onset in self.open or []]
        return tuple(sorted(self.closed + still, key=lambda window: window.fx_onset))

    def along(self, loads: Floats, look: Look = lambda below, above: ()) -> Iterator[tuple[float, tuple[Window, ...]]]:
        """Yield each load but the smallest, with all windows up to this load.

        If an eigenvalue is negative at a load, the branch of equilibria has ended before this load. The walk then ends
        if there is a window, and otherwise raises the TurningPointError.
        """
        here = self.at(float(loads[0]))
        for below, above in pairwise(map(float, loads)):
            for load in [*sorted(look(below, above)), above]:
                try:
                    there = self.at(load)
                except TurningPointError:
                    if not self.windows:
                        raise
                    return
                except NoEquilibriumError:
                    if load == above:
                        raise
                    continue
                for step in self._steps(here, there):
                    self._advance(here, step, 0)
                    here = step
                    if self.finished:
                        break
                yield here.fx, self.windows
                if self.finished:
                    return

    def _steps(self, here: System, there: System) -> list[System]:
        """The steps that lead to a load; where contacts change on the way, a short step about each change."""
        shortest = self.limits.bend_length * (there.fx - here.fx)

        def divide(below: System, above: System) -> list[System]:
            if above.fx - below.fx <= shortest or below.states == above.states:
                return [above]
            middle = look_between(self.at, below.fx, 0.5 * (below.fx + above.fx), above.fx)
            return [*divide(below, middle[0]), *divide(middle[0], above)] if middle else [above]

        places = [here, *divide(here, there)]
        same = [one.states == other.states for one, other in pairwise(places)]
        smooth = [before and after for before, after in pairwise(same)]
        return [place for place, inside in zip(places[1:], [*smooth, False], strict=True) if not inside]

    def _advance(self, here: System, there: System, depth: int) -> None:
        """Carry the windows over an increment, divided while it is in doubt."""
        try:
            self.open, ended = self._carry(here, there, depth)
            self.closed += ended
            self._before = here
            self._modes = {fx: each for fx, each in self._modes.items() if fx >= there.fx}
            return
        except DoubtError as doubt:
            share = self.limits.division_share
            fx = (1 - share) * here.fx + share * there.fx if doubt.fx is None else doubt.fx
        middle = []
        if there.fx - here.fx > self.narrowest:
            middle = look_between(self.at, here.fx, fx, there.fx)
        if middle and here.fx < middle[0].fx < there.fx:
            self._advance(here, middle[0], depth + 1)
            if not self.finished:
                self._advance(middle[0], there, depth + 1)
        else:
            self.open, ended = self._carry_undivided(here, there)
            self.closed += ended

    def _carry(self, here: System, there: System, depth: int) -> tuple[Open, list[Window]]:
        """The motions that grow at the upper load, and the windows that end before; DoubtError if that is not sure."""
        if self.screen is None or depth > self.limits.screen_divisions:
            return self._by_all_modes(here, there, depth)
        growing = [space for space, _ in self.open or []]
        try:
            few = self.screen(here, there, growing, depth)
            if isinstance(few, Few):
                if self.open is None:
                    self.open = _begin([] if few.named == 0 else self.modes(here).growing)
                return self._settle(here, there, few.courses, [], lambda changes: True)
            if few is not None and (self.open is None or len(few[0].grows) == len(growing)):
                return self._by_modes(few, depth)
        except DoubtError:
            if depth < self.limits.screen_divisions:
                raise
        return self._by_all_modes(here, there, depth)

    def _by_all_modes(self, here: System, there: System, depth: int) -> tuple[Open, list[Window]]:
        """As `_carry`, by all modes of both loads."""
        lower, upper = self.modes(here), self.modes(there)
        if self.screen and self.open is not None and len(lower.grows) != len(self.open):
            raise LostTrackError
        return self._by_modes((lower, upper), depth)

    def _by_modes(self, modes: ModesOfLoads, depth: int) -> tuple[Open, list[Window]]:
        """As `_carry`, by the modes that may change."""
        here, there = (each.system for each in modes)
        if self.open is None:
            self.open = _begin(modes[0].growing)
        before = self._before if self._before is not None and self._before.fx < here.fx else None
        step = LoadStep(*modes, before, self.limits)
        hiding = step.hiding(self.narrowest)
        if hiding is None:
            raise DoubtError

        def sure(changes: Changes) -> bool:
            if here.dissipative:
                return True
            parts = self.limits.bend_divisions if step.bent else self.limits.change_divisions
            return not ((changes or hiding) and depth < parts) and step.apart(changes, self.narrowest)

        return self._settle(here, there, step.courses, hiding, sure)

    def _settle(
        self, here: System, there: System, courses: Sequence[ModeAtEnds], hiding: Sequence[ModesAtEnds], sure: Sure
    ) -> tuple[Open, list[Window]]:
        """The motions that grow at the upper load, and the windows that end before.

        Motions that begin or end to grow are handed to `sure`, then edges are solved for and modes `hiding` looked at.
        """
        left, now, watched = list(self.open or []), [], list(hiding)
        begun: list[tuple[Space, Space]] = []
        ending: list[tuple[Space, Space, Edge]] = []
        for below, above in courses:
            below = (
                _require(above.follow(here, self.limits)) if below is None and above is not None else _require(below)
            )
            above = _require(below.follow(there, self.limits)) if above is None else above
            earlier = next((each for each in left if each[0].equals(below)), None)
            if earlier is not None:
                left.remove(earlier)
            if (earlier is None) == below.grows:
                raise DoubtError
            if earlier is None and above.grows:
                begun.append((below, above))
            elif earlier is not None and not above.grows:
                ending.append((below, above, earlier[1]))
            elif earlier is not None:
                now.append((above, earlier[1]))
            if below.grows == above.grows:
                watched.append(([below], [above]))
        for space, onset in left:
            ahead = _require(space.follow(there, self.limits))
            if ahead.grows:
                raise DoubtError
            ending.append((space, ahead, onset))
        if not sure([*begun, *(each[:2] for each in ending)]):
            raise DoubtError
        for modes in watched:
            inside = other_growth(self.at, modes, self.narrowest, dipping=True, limits=self.limits)
            if inside is not None:
                raise DoubtError(inside[0].fx)
        ended = [Window(onset, self._edge(below, above)) for below, above, onset in ending]
        now += [(above, self._edge(below, above)) for below, above in begun]
        return now, ended

    def _edge(self, below: Space, above: Space) -> Edge:
        """Edge between two loads, at one of which a motion grows; in doubt unless growth begins or ends once."""
        try:
            edge, left, right = locate_edge(self.at, below, above, self.limits)
        except (LostPairError, NoEquilibriumError):
            raise DoubtError from None
        if not below.system.dissipative and below.fx < left.fx < right.fx < above.fx:
            for ends in ((below, left), (right, above)):
                if ends[0].growth * ends[1].growth <= 0 or stretch(ends[:1], ends[1:], self.limits)[0] > self.narrowest:
                    raise DoubtError
        return edge

    def _carry_undivided(self, here: System, there: System) -> tuple[Open, list[Window]]:
        """Carry the windows over an increment that is not divided; an unsolved edge is uncertain by half of it."""
        left, now = list(self.open or []), []
        for space in self.modes(there).growing:
            origin = space.follow(here, self.limits)
            earlier = None if origin is None else next((each for each in left if each[0].equals(origin)), None)
            if earlier is None and len(left) >= len(self.modes(there).grows):
                earlier = min(left, key=lambda each: abs(each[0].mean - space.mean))
            if earlier is not None:
                left.remove(earlier)
                now.append((space, earlier[1]))
            else:
                now.append((space, self._edge_or_half(origin, space, here, there)))
        return now, [
            Window(onset, self._edge_or_half(space, space.follow(there, self.limits), here, there))
            for space, onset in left
        ]

    def _edge_or_half(self, below: Space | None, above: Space | None, here: System, there: System) -> Edge:
        last = above or below
        assert last is not None
        if below is not None and above is not None and below.growth * above.growth < 0:
            try:
                return locate_edge(self.at, below, above, self.limits)[0]
            except (LostPairError, NoEquilibriumError):
                pass
        return Edge.between(here.fx, there.fx, last)

    def modes_at(self, fx: float) -> SystemModes:
        """All modes at a load."""
        return self._modes[fx] if fx in self._modes else self.modes(self.at(fx))

    def modes(self, system: System) -> SystemModes:
        """All modes of a system, kept as long as its load is not passed."""
        found = self._modes.get(system.fx)
        if found is None or found.system is not system:
            found = self._modes[system.fx] = SystemModes.of(system)
        return found


def _begin(growing: Sequence[Space]) -> Open:
    """The motions that grow at the smallest load."""
    return [(each, Edge.start(each)) for each in growing]


def _require(space: Space | None) -> Space:
    if space is None:
        raise DoubtError
    return space


def _growing_of(modes: Sequence[Space]) -> list[bool]:
    """Whether each mode grows, those that do not first."""
    return sorted(mode.grows for mode in modes)


def other_growth(
    at: SystemOfLoad,
    seen: Sequence[list[Space]],
    narrowest: float,
    *,
    dipping: bool = False,
    limits: Limits = LIMITS,
) -> list[Space] | None:
    """Modes that nearly meet, at a load where another number of them grows than at each load of `seen`.

    None if there surely is no such load, but on stretches narrower than `narrowest`. A DoubtError is raised if that is
    open after `Limits.dips` looks, or if the modes cannot be followed. For a pair that has to be `dipping` it is also
    raised if the discriminant does not dip where its slopes say so: the loads are then too far apart.
    """
    places, ends = sorted(seen, key=lambda each: each[0].fx), [_growing_of(each) for each in seen]
    for _ in range(limits.dips):
        dips = ((*stretch(*both, limits), both) for both in pairwise(places))
        width, fx, (lower, upper) = max(dips, key=lambda dip: dip[0])
        if width <= narrowest:
            return None
        found = look_between(at, lower[0].fx, fx, upper[0].fx)
        if not found or not lower[0].fx < found[0].fx < upper[0].fx:
            break
        (place,) = found
        nearer = lower if place.fx - lower[0].fx < upper[0].fx - place.fx else upper
        modes = [mode for mode in (each.follow(place, limits) for each in nearer) if mode is not None]
        if len(modes) < len(nearer) or (len(modes) == 2 and modes[0].equals(modes[1])):
            raise DoubtError(place.fx)
        if _growing_of(modes) not in ends:
            return modes
        least = min(abs(each[0].growth) for each in (lower, upper))
        if dipping and not place.dissipative and abs(modes[0].growth) > least:
            raise DoubtError(place.fx)
        places = sorted([*places, modes], key=lambda each: each[0].fx)
    raise DoubtError


def windows_along(
    system: SystemOfLoad,
    loads: Floats,
    narrowest: float,
    screen: Screen | None = None,
    *,
    look: Look = lambda below, above: (),
    first: bool = False,
    limits: Limits = LIMITS,
) -> Iterator[tuple[float, tuple[Window, ...]]]:
    """Yield each load but the smallest, with all windows up to this load, see `Search.along`.

    A screen is of finite order: if all modes contradict the screen, the ramp is walked again without a screen.
    """
    reached = float(loads[0])
    for way in [screen, None] if screen else [None]:
        try:
            for load, windows in Search(system, narrowest, way, first, limits).along(loads, look):
                if load > reached or (first and windows):  # the second walk may find what the first one missed
                    reached = max(reached, load)
                    yield load, windows
            return
        except LostTrackError:
            if way is None:
                raise


def look_between(look: SystemOfLoad, below: float, middle: float, above: float) -> list[System]:
    """The system at the middle load, or at a load beside it; empty if none of these has an equilibrium."""
    for fx in (middle, 0.5 * (below + middle), 0.5 * (middle + above)):
        try:
            return [look(fx)]
        except NoEquilibriumError:
            continue
    return []
