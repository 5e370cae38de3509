r"""The first window of complex eigenvalues of a large packing, without a dense decomposition.

A dense decomposition takes a second at 300 disks and grows with the cube. But modes mix with their neighbours only. In
a fixed basis, the eigenvectors of the symmetric part at one load, the operator is nearly diagonal. This basis is found
slice by slice of the spectrum (:mod:`~faultgouge.analysis.slices`), each as a projection of its own
(:mod:`~faultgouge.analysis.projection`). In each,

1. a test names the pairs of modes that may meet (:mod:`~faultgouge.analysis.meetings`), few of thousands;
2. the cluster of neighbouring modes about each of these has its eigenvalues up to the third order of the coupling, and
   its windows of complex eigenvalues say where to look;
3. what appears there is confirmed with the operator itself, whose pair is continued to the edges by inverse iteration
   (:mod:`~faultgouge.analysis.tracking`).

**Where the clusters are wrong.** Between two loads the projected operator is taken to be a straight line, which it is
not where contacts open, close or slide. What the operator has instead shows it: the pair that is announced is not
there, cannot be followed, or turns complex elsewhere. Such an increment is walked again in `PARTS` shorter ones, and
these again, `DEPTH` times. What is in doubt even then is handed out with the result.

**Edges.** A real pair may exchange partners with a third mode within an increment; one that is complex is the only one
of its kind. So it is from inside of its window that a pair is followed to the edge, see `_Search.edge`.
"""

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_array, csr_array, eye_array
from scipy.sparse.linalg import LinearOperator, eigs

from .edges import Edge, LostPairError, State, jump_between, jump_width, locate
from .meetings import meetings
from .modes import Modes, Operator, Pair, span
from .packing import Floats
from .projection import MIXING, Cluster, Levels, Projection
from .sparse_lu import symmetric_lu
from .spectrum import believable, unit_rounding
from .tracking import Block, continued
from .windows import Place, Window, complex_windows, dip_between, increasing, window_between

REACH = 0.1
"""Share of an increment by which the clusters are extrapolated: a pair that they have turn complex a little late is
found in time. Clusters are trusted as long as they are right to twice that."""

FINEST = 1e-3
"""Narrowest windows of clusters that are looked for, in increments: their own error is larger."""

EXCESS = 0.2
"""What is added to the antisymmetric couplings of a cluster, in units of mixing^2 times the spacing of its levels.

Whether two modes turn complex is decided by the difference of their symmetric and their antisymmetric coupling, which
may be far smaller than both. Modes beyond a slice, and the third order, change it by about a tenth of that unit
(360 disks, mixing of 0.17: 0.02 where the unit is 0.37), so pairs are announced from a little before, and the operator
decides."""

LOOKS = 12
"""Loads at which the discriminant of a pair that is announced is looked at before its sign is in doubt. One or two tell
of an avoided crossing."""

PARTS, DEPTH = 4, 2
"""Parts of an increment on which clusters have been wrong, and how often these are divided again: four cost little more
than two while a basis passes by, and the finest are a sixteenth."""

NEAR = 12
"""Modes among which a pair is looked for that the clusters announce where the operator has another one."""

KEPT = 3e8
"""Numbers of a basis that is kept from increment to increment, 3.6 GB of them in double and in single precision; a
larger one never exists as a whole."""

AHEAD = 2
"""Increments that are looked at while a basis that is not kept passes by: each costs a twentieth of it."""

Watch = Callable[[str], None]


@dataclass(frozen=True)
class FirstWindow:
    """What is found of the first window.

    Attributes
    ----------
    window : Window or None
        None if all eigenvalues are real. Its fx_end is None if the pair is complex at the load above the onset, of the
        finest increments that were made.
    doubtful : tuple of (float, float)
        Increments, the finest that were made, on which clusters announce a pair that the operator was not seen to have:
        an earlier window may hide there.
    """

    window: Window | None
    doubtful: tuple[tuple[float, float], ...] = ()


def first_window(
    operator: Callable[[float], Operator],
    forces: ArrayLike,
    *,
    narrowest: float | None = None,
    modes: tuple[int, int] | None = None,
    watch: Watch = lambda says: None,
) -> FirstWindow:
    """The first window of complex eigenvalues of a family of large matrices, without all their eigenvalues.

    Clusters of modes are searched as `complex_windows` does, with the projected operators interpolated linearly between
    two loads; what appears there is confirmed with the operator itself, whose pair is continued to the edges. So the
    window that is returned is as certain, and its edges have the same digits, as those of `complex_windows`. That it is
    the first rests on two things. No mode is missing, which the inertia tells. And the clusters are right: their onsets
    were within a tenth of an increment of the confirmed ones (packings of 1,000 disks, increments of 1e-3), and where
    they are seen to be wrong the increment is divided. A pair that is complex by less than their error, or for less
    than `FINEST` of an increment, may be missed before it.

    Parameters
    ----------
    operator, forces
        As in :func:`~faultgouge.analysis.complex_windows`. Loads beyond the one above the onset are not asked for, but
        for those of `AHEAD` increments. A RuntimeError of the operator at one of the loads is raised once no window has
        been found before it.
    narrowest
        As in :func:`~faultgouge.analysis.find_onset`; no less than a thousandth of an increment.
    modes, watch
        As in :func:`~faultgouge.analysis.find_onset`.

    Returns
    -------
    FirstWindow

    Raises
    ------
    LostPairError
        If a pair that is complex cannot be followed to its onset, not even in the shortest increments, and no other is
        found in the same one.
    SliceError
        If a part of the spectrum is not found.
    ValueError
        If the packing has none of these modes.
    """
    loads = increasing(forces)
    here = Place(float(loads[0]), csr_array(operator(float(loads[0]))))
    search = _Search(operator, narrowest or 0.0, modes, watch)
    ahead = 1 if search.keeps(here.matrix) else AHEAD
    done = 1
    while done < len(loads):
        places = [here, *_reached(operator, loads[done : done + ahead])]
        window = search.walk(places)
        if window is not None:
            return FirstWindow(window, tuple(each for each in search.doubtful if each[0] < window.fx_onset))
        here = places[-1]
        done += len(places) - 1
    return FirstWindow(None, tuple(search.doubtful))


def _reached(operator: Callable[[float], Operator], loads: Floats) -> list[Place]:
    """The operator at loads as far as there are equilibria; the error if there is none at the first."""
    places: list[Place] = []
    for load in loads:
        try:
            places.append(Place(float(load), csr_array(operator(float(load)))))
        except RuntimeError:
            if not places:
                raise
            break
    return places


@dataclass(frozen=True, eq=False)
class _Candidate:
    """The planes of a pair that turns complex in its cluster: from where on, and a load at which it still is."""

    onset: float
    inside: float
    right: Floats
    left: Floats


def _nearest_pair(modes: Modes, eigenvalue: float) -> Pair:
    """The complex pair, or failing that the two modes, closest to a real eigenvalue."""
    first, second = np.argsort(np.abs(modes.values.real - eigenvalue))[:2]
    pairs = modes.complex_pairs or [(int(first), int(second))]
    return min(pairs, key=lambda pair: abs(modes.values[pair[0]].real - eigenvalue))


class _DoubtError(RuntimeError):
    """The clusters announce what the operator does not have."""


def _complex_pair_near(matrix: csr_array, guess: Block) -> Block | None:
    """A complex pair among the modes about a guess that is no good, as where a contact opened; None if all are real.

    By ARPACK with shift and inversion.
    """
    shift = guess.mean + 0.1 * guess.spread
    factors = symmetric_lu(csc_array(matrix - shift * eye_array(matrix.shape[0])))
    found = []
    for trans, operator in (("N", matrix), ("T", matrix.T)):
        inverse = LinearOperator(matrix.shape, matvec=partial(factors.solve, trans=trans), dtype=np.float64)
        start = np.random.default_rng(0).standard_normal(matrix.shape[0])
        found.append(eigs(operator, NEAR, sigma=shift, OPinv=inverse, v0=start))
    (values, right), (others, left) = found
    rounding = unit_rounding(matrix.data)
    for k in np.argsort(np.abs(values - guess.mean)):
        same = int(np.argmin(np.abs(others - values[k].conj())))  # y^H A = lambda y^H is A^T y = conj(lambda) y
        overlap = abs(np.vdot(left[:, same], right[:, k]))
        if values[k].imag > 0 and believable(values[k], overlap, rounding):
            block = continued(matrix, Block.of(matrix, span(right[:, [k]]), span(left[:, [same]])))
            if block is None:
                raise LostPairError(
                    f"the complex pair of eigenvalues about {values[k].real:.6g} cannot be told from its neighbours: "
                    "take smaller increments"
                )
            return block
    return None


class _Search:
    """The first window of large operators, from load to load."""

    def __init__(
        self,
        operator: Callable[[float], Operator],
        narrowest: float,
        modes: tuple[int, int] | None = None,
        watch: Watch = lambda says: None,
    ) -> None:
        self.operator, self.narrowest, self.modes, self.watch = operator, narrowest, modes, watch
        self.passed: list[Place] = []
        self.kept: list[Projection] = []
        self.doubtful: list[tuple[float, float]] = []

    def walk(self, places: list[Place], depth: int = DEPTH) -> Window | None:
        """The first window that begins between the first and the last of several loads."""
        found: list[list[_Candidate]] = [[] for _ in places[1:]]
        first, stop = self.range(places[0].matrix)
        done = 0
        for part, before in self.projected(places[0].matrix):
            done += part.own.stop - part.own.start
            self.watch(f"F_x from {places[0].fx:.6g} to {places[-1].fx:.6g}: {done} of {stop - first} modes")
            for candidates, (here, there) in zip(found, pairwise(places), strict=True):
                after = part.change(before, there.matrix - here.matrix)
                candidates.extend(self.candidates(part, (here.fx, before), (there.fx, after)))
                before = after
        for candidates, (here, there) in zip(found, pairwise(places), strict=True):
            self.passed.append(here)
            window, doubt = self.earliest(candidates, there, finest=depth == 0)
            if doubt and depth > 0:
                window = self.divided(here, there, window, depth - 1)
            elif doubt:
                self.doubtful.append((here.fx, there.fx))
            if window is not None:
                return window
        return None

    def divided(self, here: Place, there: Place, known: Window | None, depth: int) -> Window | None:
        """The first window of an increment, from shorter ones; the one that is known already if none is before it."""
        loads = here.fx + (there.fx - here.fx) * np.arange(1, PARTS) / PARTS
        try:
            between = [Place(float(load), csr_array(self.operator(float(load)))) for load in loads]
        except RuntimeError:  # there is no equilibrium
            self.doubtful.append((here.fx, there.fx))
            return known
        self.passed.pop()
        window = self.walk([here, *between, there], depth)
        return min((each for each in (window, known) if each), key=lambda each: each.fx_onset, default=None)

    def earliest(self, candidates: list[_Candidate], there: Place, finest: bool) -> tuple[Window | None, bool]:
        """The first window of the operator itself that one of the candidates has become, and whether that is in doubt.

        At the first doubt the search ends, but for the finest increments. There an error, of a complex pair that cannot
        be followed or a load without equilibrium, is raised if no window has been found beside it.
        """
        here = self.passed[-1]
        increment = there.fx - here.fx
        first: Window | None = None
        lost: RuntimeError | None = None
        doubt = False
        for candidate in sorted(candidates, key=lambda candidate: candidate.onset):
            # Clusters are off by a share of the way from here: one that is far beyond cannot be first.
            if first is not None and candidate.onset - here.fx > (1 + 2 * REACH) * (first.fx_onset - here.fx):
                break
            try:
                window = self.confirmed(candidate, there, first)
            except RuntimeError as error:
                window, doubt = None, True
                lost = lost if isinstance(error, _DoubtError) else error
            if window is not None:
                late = abs(window.fx_onset - candidate.onset) > 2 * REACH * increment
                doubt = doubt or (late and window.fx_onset > here.fx)
                if first is None or window.fx_onset < first.fx_onset:
                    first = window
            if doubt and not finest:
                break
        if finest and first is None and lost is not None:
            raise lost
        return first, doubt

    def range(self, matrix: csr_array) -> tuple[int, int]:
        """Numbers of the first mode that is looked at and of the first that is not."""
        count = int(np.count_nonzero(np.diff(matrix.indptr)))
        first, stop = self.modes or (0, count)
        if not 0 <= first < min(stop, count):
            raise ValueError(f"modes {first}:{stop} is no part of the {count} modes of this packing, 0:{count}")
        return first, min(stop, count)

    def keeps(self, matrix: csr_array) -> bool:
        """Whether the basis is kept."""
        first, stop = self.range(matrix)
        return Projection.width(stop - first) * matrix.shape[0] <= KEPT

    def projected(self, matrix: csr_array) -> Iterable[tuple[Projection, Levels]]:
        """Projections of all modes, those of an earlier load as long as they serve, and the operator in them."""
        known = self.known(matrix)
        if known:
            return known
        parts: Iterable[Projection] = Projection.parts(matrix, _cores(), self.range(matrix))
        if self.keeps(matrix):
            self.kept = []  # its memory is free before that for the next ones is taken
            parts = self.kept = list(parts)
        return ((part, part.levels(matrix)) for part in parts)

    def known(self, matrix: csr_array) -> list[tuple[Projection, Levels]]:
        """The projections that are kept and the operator in them; none if they do not serve."""
        if not all(part.covers(matrix) for part in self.kept):
            return []
        known = [(part, part.levels(matrix)) for part in self.kept]
        mixing = [each for part, levels in known for each in part.mixing(part.blocks(levels))]
        return known if known and np.median(mixing) < MIXING else []

    def candidates(
        self, part: Projection, here: tuple[float, Levels], there: tuple[float, Levels]
    ) -> Iterator[_Candidate]:
        """The pairs of a projection that turn complex in their clusters."""
        named = meetings(here[1], here[1].beyond(there[1], 1 + REACH))
        for cluster in part.clusters:
            first, last = (cluster.modes.start + end for end in cluster.core)
            if np.any((named >= first) & (named <= last)):
                yield from self.searched(part, cluster, here, there)

    def searched(
        self, part: Projection, cluster: Cluster, here: tuple[float, Levels], there: tuple[float, Levels]
    ) -> Iterator[_Candidate]:
        """The windows of one cluster, with its blocks interpolated between two loads."""
        increment = there[0] - here[0]
        before, after = (levels.block(cluster) for _, levels in (here, there))
        if len(before) < len(part.active):
            before, after = _exceeding(before), _exceeding(after)

        def block(fx: float) -> Floats:
            share = (fx - here[0]) / increment
            return (1 - share) * before + share * after

        reach = there[0] + REACH * increment
        for window in complex_windows(block, [here[0], reach], narrowest=max(self.narrowest, FINEST * increment)):
            end = reach if window.fx_end is None else window.fx_end
            inside = there[0] if window.fx_onset < there[0] <= end else 0.5 * (window.fx_onset + end)
            modes = Modes.of(inside, block(inside))
            plane = modes.block(_nearest_pair(modes, window.eigenvalue))
            if cluster.owns(plane.right):
                right, left = part.lifted(cluster, plane.right), part.lifted(cluster, plane.left)
                yield _Candidate(window.fx_onset, min(inside, there[0]), right, left)

    def confirmed(self, candidate: _Candidate, there: Place, first: Window | None) -> Window | None:
        """The window of the operator itself in place of that of a cluster; None if it is none, or not the first."""
        self.watch(f"a pair that turns complex about F_x = {candidate.onset:.6g}: its onset")
        inside = self.complex_state(candidate, there)
        if inside is None or (first is not None and self.later(inside, first)):
            return None
        above = inside if inside.fx == there.fx else inside.at(*there)
        end = self.edge(above, inside) if above.discriminant > 0 else None
        for place in reversed(self.passed):
            below = inside if inside.fx == place.fx else inside.at(*place)
            if below.discriminant > 0:
                return window_between(self.edge(below, inside), end)
            inside = below
        return window_between(Edge(inside.fx, 0.0, inside.block.mean, inside.block.overlap, "start"), end)

    def edge(self, outside: State, inside: State) -> Edge:
        """Where a pair turns complex between a load where it is real and one where it is not.

        A real pair may have changed partners with a third mode on the way; one that is complex is the only one of its
        kind. So it is from inside that the pair is followed, in halves of the way, until it leads from outside to
        inside as well. If it never does, the equilibrium jumps.
        """
        width = jump_width(outside, inside)
        while abs(inside.fx - outside.fx) > width:
            if _leads_back(outside, inside):
                try:
                    return locate(self.operator, *sorted((outside, inside), key=lambda state: state.fx))[0]
                except LostPairError:
                    pass
            fx = 0.5 * (outside.fx + inside.fx)
            middle = inside.at(fx, self.operator(fx))
            outside, inside = (middle, inside) if middle.discriminant > 0 else (outside, middle)
        return jump_between(outside, inside)

    def later(self, inside: State, first: Window) -> bool:
        """Whether a pair is still real where the first one so far turns complex."""
        onset = first.fx_onset
        if inside.fx <= onset:
            return False
        below = inside.at(onset, self.operator(onset))
        return below.discriminant > 0 and _leads_back(below, inside)

    def complex_state(self, candidate: _Candidate, there: Place) -> State | None:
        """The pair at a load where it is complex; None if it is surely real, or not before these loads are passed."""
        fx = candidate.inside
        matrix = there.matrix if fx == there.fx else csr_array(self.operator(fx))
        guess = Block.of(matrix, candidate.right, candidate.left)
        block = continued(matrix, guess) or _complex_pair_near(matrix, guess)
        if block is not None and block.discriminant < 0:
            return State(fx, matrix, block)
        if candidate.onset > there.fx:
            return None  # it is looked for on the next increment
        if block is None:
            raise _DoubtError
        try:
            return self.dipping(State(fx, matrix, block), there)
        except LostPairError as error:
            raise _DoubtError from error

    def dipping(self, start: State, there: Place) -> State | None:
        """A pair where it is complex, from a load where it is real; None if it surely is so on all of the increment."""
        here = self.passed[-1]
        narrowest = max(self.narrowest, FINEST * (there.fx - here.fx))
        states = [start, *(start.at(*place) for place in (here, there) if place.fx != start.fx)]
        for _ in range(LOOKS):
            complex_ones = [state for state in states if state.discriminant < 0]
            if complex_ones:
                return complex_ones[0]
            states.sort(key=lambda state: state.fx)
            width, fx = max(dip_between(below, above) for below, above in pairwise(states))
            if width <= narrowest:
                return None
            nearest = min(states, key=lambda state: abs(state.fx - fx))
            states.append(nearest.at(fx, self.operator(fx)))
        raise _DoubtError


def _leads_back(outside: State, inside: State) -> bool:
    """Whether a real pair becomes the complex one from which it was followed."""
    returned = continued(inside.matrix, outside.block)
    return returned is not None and returned.discriminant < 0 and returned.same_plane(inside.block)


def _exceeding(block: Floats) -> Floats:
    """The operator in a cluster with its antisymmetric couplings enlarged by what they may be in error."""
    levels = np.diag(block)
    width = max(float(np.ptp(levels)), np.finfo(np.float64).tiny)
    mixing = float(np.linalg.norm(block - np.diag(levels))) / width
    return block + EXCESS * mixing**2 * width / len(levels) * np.sign(block - block.T)


def _cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
