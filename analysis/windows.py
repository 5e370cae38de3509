r"""Windows of complex eigenvalues of a one-parameter family of operators.

**Identity.** Modes at neighbouring loads a, b are assigned by :math:`|x_a^H x_b|\,|y_a^H y_b|` over unit
right and left vectors, so modes that cross do not swap names. (:math:`|y_a^H x_b|`, the obvious weight,
vanishes at the very point that is sought.)

**Windows narrower than the increment.** With the sensitivities :math:`\lambda' = y^H A' x / y^H x`, A' the
difference of both ends, a pair has :math:`D' = 2 (\lambda_1 - \lambda_2)(\lambda_1' - \lambda_2')` at either
end. Two modes that pass each other would dip to D = 0 in between; the product of their couplings decides
between an avoided crossing and a window of width proportional to its root. A cubic is drawn through both
values and slopes, and a parabola through either slope and both values; where the lowest, less their
disagreement, is negative, an operator is computed at the predicted minimum and both halves are examined
again, until no window wider than a stated width can hide. The same is done where the assignment is
inconsistent.

**Increments on which nothing happens** are most of them, and need no decomposition. A projection names the few pairs
that may meet (:mod:`~faultgouge.analysis.meetings`), and each of these is followed by itself
(:mod:`~faultgouge.analysis.tracking`): its D, known to all digits at both loads with its slopes, tells by the same
curves whether it keeps its sign. If all do, windows that are open go on and nothing else happens. If one does not, its
edge is solved for, and its D tells of either side. Where more than one may change, or a pair cannot be followed, all
modes of both loads are computed.

The edges themselves are solved for, see :mod:`~faultgouge.analysis.edges`.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from .edges import Edge, Kind, State, locate
from .meetings import Outlook
from .modes import Modes, Operator, Pair, assign
from .packing import Floats
from .spectrum import Complexes
from .tracking import Block, continued


@dataclass(frozen=True)
class Window:
    """An interval of loads on which one pair of eigenvalues is complex.

    Attributes
    ----------
    fx_onset : float
        Load at which the pair becomes complex, force per top disk.
    fx_end : float or None
        Load at which it is real again; None if it is complex at the largest load that was looked at.
    eigenvalue : float
        The double eigenvalue at the onset (the real part of the pair if it does not coalesce there), 1 /
        time^2.
    error : float
        Uncertainty of fx_onset: twice the scatter of the discriminant over its slope for a coalescence, the
        bracket otherwise; and what the equilibria's residual r amounts to. A packing out of balance by r is
        the exact equilibrium of other loads, and if the discriminant is as sensitive to any force as to those
        of the n top disks, fx is uncertain by r / n^(1/2). How the path of equilibria depends on the
        increments is not in it.
    end_error : float or None
        The same for fx_end.
    overlap : float
        Smallest |y^H x| met at the onset; it vanishes at an exceptional point, to the root of the rounding
        error.
    kind : {"coalescence", "contact change", "start", "scan"}
        What begins the window: two real eigenvalues that meet; a jump of the equilibrium; nothing, as the
        pair is complex at the smallest load; or unknown, in a scan.
    """

    fx_onset: float
    fx_end: float | None
    eigenvalue: float
    error: float
    end_error: float | None
    overlap: float
    kind: Kind

    def as_dict(self) -> dict[str, Any]:
        """The keys of the JSON contract: fx_onset, fx_end, lambda, error, kind."""
        return {
            "fx_onset": self.fx_onset,
            "fx_end": self.fx_end,
            "lambda": self.eigenvalue,
            "error": self.error,
            "kind": self.kind,
        }


def complex_windows(
    operator: Callable[[float], Operator], forces: ArrayLike, *, narrowest: float | None = None
) -> tuple[Window, ...]:
    """Windows of complex eigenvalues of a one-parameter family of matrices.

    Parameters
    ----------
    operator : callable
        fx -> ndarray or sparse array, shape (n, n), in coordinates that do not depend on fx. Zero rows are left
        out.
    forces, narrowest
        As in :func:`~faultgouge.analysis.find_onset`.

    Returns
    -------
    tuple of Window
        By increasing onset; may be empty.

    Raises
    ------
    ValueError
        If the loads are not at least two increasing numbers.
    """
    loads = increasing(forces)
    narrowest = 1e-7 * float(np.abs(loads).max()) if narrowest is None else narrowest
    try:
        return _walked(operator, loads, narrowest, Outlook())
    except _LostTrackError:
        return _walked(operator, loads, narrowest, None)


def _walked(
    operator: Callable[[float], Operator], loads: Floats, narrowest: float, outlook: Outlook | None
) -> tuple[Window, ...]:
    search = _Search(operator, narrowest, outlook)
    here = Place(float(loads[0]), csr_array(operator(float(loads[0]))))
    for load in loads[1:]:
        there = Place(float(load), csr_array(operator(float(load))))
        search.go_on(here, there)
        here = there
    return search.windows.all()


class _LostTrackError(RuntimeError):
    """Pairs that were followed one by one are not those of a decomposition."""


class Step:
    """Two neighbouring loads, the assignment of their modes, and what may happen in between."""

    def __init__(self, here: Modes, there: Modes) -> None:
        self.here, self.there = here, there
        self.forward = assign(here, there)
        self.backward = np.full(len(there.values), -1)
        known = self.forward >= 0
        self.backward[self.forward[known]] = np.flatnonzero(known)
        self.staying: list[tuple[Pair, Pair]] = []
        self.opening: list[tuple[Pair, Pair]] = []
        self.closing: list[tuple[Pair, Pair]] = []
        self.lost: list[Pair] = []
        self.found: list[Pair] = []
        for pair in here.complex_pairs:
            image = (int(self.forward[pair[0]]), int(self.forward[pair[1]]))
            if min(image) < 0 or not here.block(pair).same_plane(there.block(image)):
                self.lost.append(pair)
            elif there.partner[image[0]] == image[1]:
                self.staying.append((pair, image))
            elif there.partner[image[0]] == there.partner[image[1]] == -1:
                self.closing.append((pair, image))
            else:
                self.lost.append(pair)
        arrived = {image for _, image in self.staying}
        for image in there.complex_pairs:
            if image in arrived:
                continue
            pair = (int(self.backward[image[0]]), int(self.backward[image[1]]))
            real = min(pair) >= 0 and here.partner[pair[0]] == here.partner[pair[1]] == -1
            if real and here.block(pair).same_plane(there.block(image)):
                self.opening.append((pair, image))
            else:
                self.found.append(image)

    @property
    def consistent(self) -> bool:
        """Whether every complex pair at one end is recognised at the other."""
        return not self.lost and not self.found

    def states(self, pair: Pair, image: Pair) -> tuple[State, State]:
        """A pair at both ends."""
        here, there = self.here, self.there
        return State(here.fx, here.matrix, here.block(pair)), State(there.fx, there.matrix, there.block(image))

    def halfway(self, block: Block, kind: Kind) -> "Edge":
        """An edge somewhere in this step."""
        half = 0.5 * (self.there.fx - self.here.fx)
        return Edge(self.here.fx + half, half, block.mean, block.overlap, kind)

    def hidden_window(self, narrowest: float) -> float | None:
        """Load where a window wider than `narrowest`, or a gap in one, most likely hides; None if nowhere."""
        here, there = self.here, self.there
        known = np.flatnonzero(self.forward >= 0)
        # Only neighbours can meet: consider those that are so at an end, and those that change order.
        a, b = here.values[known], there.values[self.forward[known]]
        p, q = np.triu_indices(len(known), 1)
        rank = np.empty(len(known), int)
        rank[np.argsort(b.real)] = np.arange(len(known))
        near = (q - p == 1) | (np.abs(rank[q] - rank[p]) == 1) | (rank[q] < rank[p])
        real_a, real_b = here.partner[known] < 0, there.partner[self.forward[known]] < 0
        alone = real_a[p] & real_a[q] & real_b[p] & real_b[q]
        staying = (here.partner[known[p]] == known[q]) & (
            there.partner[self.forward[known[p]]] == self.forward[known[q]]
        )
        kept = (near & alone) | staying
        if not np.any(kept):
            return None
        p, q = p[kept], q[kept]
        change = there.matrix - here.matrix
        drift_a, drift_b = _sensitivity(here, change)[known], _sensitivity(there, change)[self.forward[known]]
        gap_a, gap_b = a[p] - a[q], b[p] - b[q]
        # In a window that stays open it is a gap that may hide: turn D over.
        sign = np.where(here.partner[known[p]] < 0, 1.0, -1.0)
        width, at = deepest_dip(
            sign * (gap_a**2).real,
            sign * (2 * gap_a * (drift_a[p] - drift_a[q])).real,
            sign * (gap_b**2).real,
            sign * (2 * gap_b * (drift_b[p] - drift_b[q])).real,
        )
        span = there.fx - here.fx
        worst = int(np.argmax(width))
        if width[worst] * span <= narrowest:
            return None
        margin = 0.25 * narrowest / span  # never return an end
        return here.fx + span * float(np.clip(at[worst], margin, 1 - margin))


def _sensitivity(modes: Modes, change: csr_array) -> Complexes:
    """First-order change of each eigenvalue, y^H dA x / y^H x."""
    y = modes.left.conj()
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sum(y * (change @ modes.right), axis=0) / np.sum(y * modes.right, axis=0)


def deepest_dip(d0: Floats, s0: Floats, d1: Floats, s1: Floats) -> tuple[Floats, Floats]:
    """The widest stretch of 0 < t < 1 on which functions known at both ends may be negative.

    Parameters
    ----------
    d0, s0, d1, s1 : ndarray, shape (P,)
        Values, positive, and slopes at t = 0 and at t = 1.

    Returns
    -------
    width : ndarray, shape (P,)
        Largest possible width in t, at most 1; zero where a function surely stays positive.
    at : ndarray, shape (P,)
        Where it is deepest.

    Notes
    -----
    The disagreement of cubic and parabolas does not show what the secant A' hides, the curvature of A over
    the interval: it enters as a twentieth of the smaller value, more than enough for loads between which
    modes are recognised at all.
    """
    # Parabolas d0 + s0 t + f t^2 and d1 - s1 r + g r^2, r = 1 - t; cubic d0 + s0 t + h t^2 + k t^3.
    f, g = d1 - d0 - s0, d0 - d1 + s1
    h, k = 3 * (d1 - d0) - 2 * s0 - s1, 2 * (d0 - d1) + s0 + s1
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(np.maximum(h * h - 3 * k * s0, 0.0))
        t = np.array([-s0 / (2 * f), 1 - s1 / (2 * g), (root - h) / (3 * k)])
        t = np.clip(np.nan_to_num(t, nan=0.5), 0.0, 1.0)
        r = 1 - t
        cubic = d0 + t * (s0 + t * (h + t * k))
        spread = np.maximum(np.abs(d0 + t * (s0 + t * f) - cubic), np.abs(d1 - r * (s1 - r * g) - cubic))
        lowest = cubic - spread - 0.05 * np.minimum(d0, d1) * (4 * t * r)
        deepest = np.argmin(lowest, axis=0), np.arange(len(d0))
        depth = np.maximum(-lowest[deepest], 0.0)
        width = np.where(depth > 0, 2 * np.sqrt(depth / np.maximum(np.abs(f), np.abs(g))), 0.0)
    return np.minimum(width, 1.0), t[deepest]


def dip_between(here: State, there: State) -> tuple[float, float]:
    """Where the discriminant of a pair may change its sign and back between two loads at which it has the same one.

    Returns
    -------
    width : float
        Of the widest stretch on which it may have the other sign, force; zero if it surely keeps its own.
    fx : float
        The load at which it is closest to zero, or deepest beyond.
    """
    sign, change, increment = np.sign(here.discriminant), there.matrix - here.matrix, there.fx - here.fx
    ends = ((state.discriminant, state.block.slope(change)) for state in (here, there))
    width, at = deepest_dip(*(sign * np.array([number]) for end in ends for number in end))
    return float(width[0]) * increment, here.fx + float(at[0]) * increment


class OpenWindows:
    """The windows that are open at the load reached so far, by the blocks of their pairs there; and the closed ones."""

    def __init__(self) -> None:
        self.open: list[tuple[Block, Edge]] = []
        self.closed: list[Window] = []

    def start(self, pairs: Iterable[State]) -> None:
        """Begin with the pairs that are complex at the smallest load."""
        self.open = [(each.block, Edge(each.fx, 0.0, each.block.mean, each.block.overlap, "start")) for each in pairs]

    def take(self, block: Block) -> Edge:
        """The onset of the open window of a pair, which is no longer among them."""
        known = block.closest([each for each, _ in self.open])
        if known is None:
            raise _LostTrackError
        (edge,) = (edge for each, edge in self.open if each is known)
        self.open = [(each, edge) for each, edge in self.open if each is not known]
        return edge

    def advance(self, step: Step, edge: Callable[[Step, Pair, Pair], Edge], lost: Kind) -> None:
        """Carry them over a step; pairs that are not recognised end and begin halfway."""
        here, there = step.here, step.there
        now = [(there.block(image), self.take(here.block(pair))) for pair, image in step.staying]
        for pair, image in step.closing:
            self.closed.append(window_between(self.take(here.block(pair)), edge(step, pair, image)))
        for pair, image in step.opening:
            now.append((there.block(image), edge(step, pair, image)))
        for pair in step.lost:
            block = here.block(pair)
            self.closed.append(window_between(self.take(block), step.halfway(block, lost)))
        for image in step.found:
            block = there.block(image)
            now.append((block, step.halfway(block, lost)))
        self.carry(now)

    def carry(self, now: list[tuple[Block, Edge]]) -> None:
        """Go on with these windows; all others must have been taken."""
        if self.open:
            raise _LostTrackError
        self.open = now

    def all(self) -> tuple[Window, ...]:
        """All windows by increasing onset."""
        still = [window_between(edge, None) for _, edge in self.open]
        return tuple(sorted(self.closed + still, key=lambda window: window.fx_onset))


class Place(NamedTuple):
    """A load and the operator there."""

    fx: float
    matrix: csr_array


class Followed(NamedTuple):
    """A pair at both ends of an increment, and whether it surely stays real, or complex, all through."""

    here: State
    there: State
    steady: bool


class _Search:
    """Walks along the loads, with as many loads in between as it takes to be sure."""

    def __init__(self, operator: Callable[[float], Operator], narrowest: float, outlook: Outlook | None) -> None:
        self.operator, self.narrowest, self.outlook = operator, narrowest, outlook
        self.windows = OpenWindows()
        self.begun = False
        self.modes: Modes | None = None  # the last that were computed
        self.known: list[State] = []  # pairs at the load reached so far

    def go_on(self, here: Place, there: Place) -> None:
        """Go to the next load: with the pairs that may meet if they are few and plain, else with all modes."""
        pairs = self.pairs(here, there)
        self.known = [pair.there for pair in pairs or []]
        if pairs is not None and self.follow(pairs):
            return
        before = self.modes if self.modes is not None and self.modes.fx == here.fx else Modes.of(*here)
        self.begin([State(here.fx, here.matrix, before.block(pair)) for pair in before.complex_pairs])
        self.modes = Modes.of(*there)
        self.walk(before, self.modes)

    def begin(self, complex_pairs: list[State]) -> None:
        """At the smallest load, open the windows of the pairs that are complex there."""
        if not self.begun:
            self.windows.start(complex_pairs)
            self.begun = True

    def pairs(self, here: Place, there: Place) -> list[Followed] | None:
        """The pairs that may meet, or are complex, between two neighbouring loads; None if they cannot be told."""
        planes = None if self.outlook is None else self.outlook.meetings(here.matrix, there.matrix)
        if planes is None:
            return None
        pairs: list[Followed] = []
        for plane in planes:
            guess = Block.of(here.matrix, plane, plane)
            a = guess.closest([each.block for each in self.known]) or continued(here.matrix, guess)
            b = None if a is None else continued(there.matrix, a)
            if a is None or b is None or any(each.here.block.same_plane(a) for each in pairs):
                return None
            ends = State(*here, a), State(*there, b)
            if not ends[0].definite or not ends[1].definite:
                return None
            pairs.append(Followed(*ends, self.keeps_sign(*ends)))
        return pairs

    def follow(self, pairs: list[Followed]) -> bool:
        """Carry the windows over an increment by these pairs alone; False if that takes more."""
        changing = [pair for pair in pairs if not pair.steady]
        solved = [self.plain_edge(pair.here, pair.there) for pair in changing[:1]]
        edges = [edge for edge in solved if edge is not None]
        if len(edges) < len(changing):
            return False
        self.begin([pair.here for pair in pairs if pair.here.discriminant < 0])
        now: list[tuple[Block, Edge]] = []
        for here, there, steady in pairs:
            if here.discriminant > 0 and steady:
                continue
            onset = self.windows.take(here.block) if here.discriminant < 0 else edges[0]
            if there.discriminant < 0:
                now.append((there.block, onset))
            else:
                self.windows.closed.append(window_between(onset, edges[0]))
        self.windows.carry(now)
        return True

    def plain_edge(self, here: State, there: State) -> Edge | None:
        """The edge of a pair if it has one and no more between two loads, as far as its D tells."""
        if here.discriminant * there.discriminant > 0:
            return None
        try:
            edge, below, above = locate(self.operator, here, there)
        except RuntimeError:
            return None
        plain = here.fx < below.fx < above.fx < there.fx
        return edge if plain and self.keeps_sign(here, below) and self.keeps_sign(above, there) else None

    def keeps_sign(self, here: State, there: State) -> bool:
        """Whether the discriminant of a pair surely has one sign between two loads."""
        if here.discriminant * there.discriminant <= 0:
            return False
        return dip_between(here, there)[0] <= self.narrowest

    def walk(self, here: Modes, there: Modes) -> None:
        """Go from one load to the next."""
        step = Step(here, there)
        if there.fx - here.fx > self.narrowest:
            halfway = 0.5 * (here.fx + there.fx)
            middle = step.hidden_window(self.narrowest) if step.consistent else halfway
            edges = step.closing + step.opening
            if middle is None and edges:
                solution = self.solve(step, *edges[0])
                if solution is None:
                    middle = halfway
                elif here.fx < solution[1].fx < solution[2].fx < there.fx:
                    # What lies on either side of this edge has yet to be looked at.
                    edge, *sides = solution
                    before, behind = (Modes.of(side.fx, side.matrix) for side in sides)
                    self.walk(here, before)
                    self.windows.advance(Step(before, behind), lambda *_: edge, "contact change")
                    self.walk(behind, there)
                    return
            between = None if middle is None else self.between(here.fx, middle, there.fx)
            if between is not None:
                self.walk(here, between)
                self.walk(between, there)
                return
        self.windows.advance(step, self.edge, "contact change")

    def edge(self, step: "Step", pair: Pair, image: Pair) -> Edge:
        """The edge of a pair, half the step wide if it cannot be solved for."""
        solution = self.solve(step, pair, image)
        return step.halfway(step.there.block(image), "contact change") if solution is None else solution[0]

    def between(self, below: float, middle: float, above: float) -> Modes | None:
        """The modes at a load in between, or at one beside it where that has no equilibrium."""
        for fx in (middle, 0.5 * (below + middle), 0.5 * (middle + above)):
            try:
                return Modes.of(fx, self.operator(fx))
            except RuntimeError:
                continue
        return None

    def solve(self, step: "Step", pair: Pair, image: Pair) -> tuple[Edge, State, State] | None:
        """The edge of a pair that is complex at one end only, and its states close by on either side.

        None if the search for it comes upon a load without equilibrium.
        """
        try:
            return locate(self.operator, *step.states(pair, image))
        except RuntimeError:
            return None


def window_between(onset: Edge, end: Edge | None) -> Window:
    """The window from one edge to another, or to none."""
    return Window(
        fx_onset=onset.fx,
        fx_end=None if end is None else end.fx,
        eigenvalue=onset.eigenvalue,
        error=onset.error,
        end_error=None if end is None else end.error,
        overlap=onset.overlap,
        kind=onset.kind,
    )


def increasing(forces: ArrayLike) -> NDArray[np.float64]:
    """Loads as an array; ValueError if they are not at least two finite, increasing numbers."""
    loads = np.array(forces, dtype=np.float64)
    if loads.ndim != 1 or len(loads) < 2 or not np.all(np.isfinite(loads)) or np.any(np.diff(loads) <= 0):
        raise ValueError("The loads of a ramp must be at least two finite, increasing numbers.")
    return loads
