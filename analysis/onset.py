r"""Onset of complex eigenvalues along a ramp of the load: windows, solved for and not scanned.

Two real eigenvalues of a non-symmetric operator A(F) may meet at an exceptional point and leave the axis as a
complex pair. Their difference goes as the square root of the distance, which root finders and scans handle
badly, but on the invariant subspace that the two span, with 2 x 2 block B, the discriminant

.. math::

    D(F) = (\lambda_1 - \lambda_2)^2 = \mathrm{tr}^2 B - 4 \det B = (B_{11} - B_{22})^2 + 4 B_{12} B_{21}

goes through zero linearly and stays smooth and real on both sides. B is the two-sided projection
:math:`(U^T V)^{-1} U^T A V` on orthonormal bases V, U of the right and the left invariant subspace: neither
degrades where the eigenvectors themselves become parallel, and the last form of D does not cancel. A few
secant steps give ten digits.

**Identity.** Modes at neighbouring loads a, b are assigned by :math:`|x_a^H x_b|\,|y_a^H y_b|` over unit
right and left vectors, so modes that cross do not swap names. (:math:`|y_a^H x_b|`, the obvious weight,
vanishes at the very point that is sought.)

**Windows narrower than the increment.** With the sensitivities :math:`\lambda' = y^H A' x / y^H x`, A' the
difference of both ends, a pair has :math:`D' = 2 (\lambda_1 - \lambda_2)(\lambda_1' - \lambda_2')` at either
end. Two modes that pass each other would dip to D = 0 in between; the product of their couplings decides
between an avoided crossing and a window of width proportional to its root. A cubic is drawn through both
values and slopes, and a parabola through either slope and both values; where the lowest, less their
disagreement, is negative, an equilibrium is computed at the predicted minimum and both halves are examined
again, until no window wider than a stated width can hide. The same is done where the assignment is
inconsistent.

**Coalescence or not.** An edge is a coalescence if D passes through zero along a straight line at distances
far below the increment, and there :math:`|y^H x| \to 0`; a mere crossing touches D = 0 without a change of
sign. If D jumps, the equilibrium itself does: a contact opened, closed or slid. The edge is then located by
bisection, and says so.

**Contacts without force.** A disk that nothing presses comes to rest touching its neighbours with an overlap that
is rounding, and a Hertzian contact has the stiffness :math:`\tfrac32 k_n \delta^{1/2}`: a force of 1e-11, the
balance that an equilibrium can have, goes with a stiffness of order 1, which differs from one equilibrium to the
next and would open and shut windows at random. Such contacts are left out, see `loaded`.

**What it costs.** An equilibrium and a dense decomposition at every load that is examined. While an edge is
solved for only its pair is continued (:mod:`~faultgouge.analysis.tracking`). In packings of more than
`ALL_WINDOWS` disks no load is decomposed: `first_window` finds the first pair from clusters of neighbouring modes.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.sparse import csr_array

from .modes import Modes, Operator, Pair, assign, full_operator
from .packing import Floats, Packing
from .spectrum import Complexes
from .stiffness import Form
from .tracking import Block, Cluster, Projection, continued

ALL_WINDOWS = 300
"""Disks up to which all eigenvalues are computed at every load, which takes a second there and grows with the cube."""

ROOT = 1e-7
"""Width to which the root of D is bracketed, in increments: a tenth of the distance at which the five points lie
through which the parabola goes that gives the last digits."""

JUMP = 1e-9
"""Width to which a jump of the equilibrium is bracketed, in increments: the place depends on the path, and with it on
the increment, by far more."""

Kind = Literal["coalescence", "contact change", "start", "scan"]


class OnsetError(RuntimeError):
    """No complex pair appears on the given loads."""


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


@dataclass(frozen=True)
class Onset:
    """The windows of complex eigenvalues along a ramp.

    Attributes
    ----------
    windows : tuple of Window
        By increasing onset; at least one.
    complete : bool
        Whether these are all up to the largest load. Of a large packing only the first is sought.
    """

    windows: tuple[Window, ...]
    complete: bool = True

    @property
    def fx_c(self) -> float:
        """F_x^c, the first onset, force per top disk."""
        return self.windows[0].fx_onset

    @property
    def error(self) -> float:
        """Uncertainty of fx_c."""
        return self.windows[0].error

    def as_dict(self) -> dict[str, Any]:
        """{"fx_c", "error", "windows": [...]} of plain numbers, for JSON."""
        return {
            "fx_c": self.fx_c,
            "error": self.error,
            "windows": [window.as_dict() for window in self.windows],
        }


def find_onset(
    equilibrium: Callable[[float], Packing],
    forces: ArrayLike,
    *,
    form: Form = "consistent",
    narrowest: float | None = None,
) -> Onset:
    """The windows of complex eigenvalues between the smallest and the largest load.

    Of a packing of up to `ALL_WINDOWS` disks these are all, from all eigenvalues at every load. Of a larger one it
    is the first, see :func:`first_window`, and loads beyond it are not asked for.

    Parameters
    ----------
    equilibrium : callable
        fx -> Packing in equilibrium. It is called with the given loads in increasing order, and between calls
        for the loads a and b with loads between a and b, in any order; there it best starts from its
        equilibrium at a. Where there is none in between it may raise a RuntimeError: the search then closes
        in on it from either side, and an edge in what is left is known to half its width.
    forces : array_like, shape (S,)
        The increasing loads of the ramp, force per top disk.
    form : {"consistent", "paper"}
        As in :func:`~faultgouge.analysis.stiffness_matrix`.
    narrowest : float, optional
        Windows narrower than this are not looked for, force; 1e-7 of the largest |load| by default. Such a
        pair would grow more slowly than any run can show.

    Returns
    -------
    Onset

    Raises
    ------
    OnsetError
        If all eigenvalues are real at every load.
    ValueError
        If the loads are not at least two increasing numbers.
    """

    loads = _increasing(forces)
    start = equilibrium(float(loads[0]))
    unbalanced: dict[float, float] = {}

    def operator(fx: float) -> csr_array:
        packing = start if fx == loads[0] else equilibrium(fx)
        unbalanced[fx] = packing.residual / float(np.sqrt(max(1, packing.top.sum())))
        return full_operator(packing, form)

    def balance(fx: float) -> float:
        return unbalanced[min(unbalanced, key=lambda known: abs(known - fx))]

    complete = len(start) <= ALL_WINDOWS
    if complete:
        found = complex_windows(operator, loads, narrowest=narrowest)
    else:
        first = first_window(operator, loads, narrowest=narrowest)
        found = () if first is None else (first,)
    if not found:
        raise OnsetError(f"No pair of eigenvalues becomes complex up to fx = {loads[-1]:.17g}: raise the largest load.")
    windows = tuple(
        replace(
            window,
            error=window.error + balance(window.fx_onset),
            end_error=None if window.fx_end is None else (window.end_error or 0.0) + balance(window.fx_end),
        )
        for window in found
    )
    return Onset(windows, complete)


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
        As in :func:`find_onset`.

    Returns
    -------
    tuple of Window
        By increasing onset; may be empty.

    Raises
    ------
    ValueError
        If the loads are not at least two increasing numbers.
    """
    loads = _increasing(forces)
    here = Modes.of(float(loads[0]), operator(float(loads[0])))
    windows = _Windows(here)
    search = _Search(operator, 1e-7 * np.abs(loads).max() if narrowest is None else narrowest, windows)
    for load in loads[1:]:
        there = Modes.of(float(load), operator(float(load)))
        search.walk(here, there)
        here = there
    return windows.all()


def first_window(
    operator: Callable[[float], Operator], forces: ArrayLike, *, narrowest: float | None = None
) -> Window | None:
    """The first window of complex eigenvalues of a family of large matrices, without all their eigenvalues.

    The clusters of a :class:`~faultgouge.analysis.tracking.Projection` are searched as `complex_windows` does, with
    the projected operators interpolated linearly between two loads; what appears there is confirmed with the operator
    itself, whose pair is continued to the edges. So the window that is returned is as certain, and its edges have the
    same digits, as those of `complex_windows`. That it is the first rests on the clusters, whose onsets were within a
    tenth of an increment of the confirmed ones (packings of 1,000 disks, increments of 1e-3): a pair that is
    complex by less than their error, or for less than `FINEST` of an increment, may be missed before it.

    Parameters
    ----------
    operator, forces
        As in :func:`complex_windows`. Loads beyond the one above the onset are not asked for.
    narrowest
        As in :func:`find_onset`; no less than a thousandth of an increment.

    Returns
    -------
    Window or None
        None if all eigenvalues are real. fx_end is None if the pair is complex at the load above the onset.
    """
    loads = _increasing(forces)
    here = float(loads[0]), csr_array(operator(float(loads[0])))
    search = _LargeSearch(operator, narrowest or 0.0)
    for load in loads[1:]:
        there = float(load), csr_array(operator(float(load)))
        window = search.walk(here, there)
        if window is not None:
            return window
        here = there
    return None


def scan_windows(packings: Sequence[Packing], form: Form = "consistent") -> tuple[Window, ...]:
    """Windows that stored equilibria show by themselves, each edge uncertain by half its increment.

    Parameters
    ----------
    packings : sequence of Packing
        Equilibria of increasing fx, at least two.
    form : {"consistent", "paper"}
        As in :func:`~faultgouge.analysis.stiffness_matrix`.

    Returns
    -------
    tuple of Window
        Edges are midpoints between the last equilibrium on one side and the first on the other; kind is
        "scan". Windows between two equilibria are missed, which is what :func:`find_onset` is for.

    Raises
    ------
    ValueError
        If the loads do not increase.
    """
    _increasing([packing.fx for packing in packings])
    states = [Modes.of(packing.fx, full_operator(packing, form)) for packing in packings]
    windows = _Windows(states[0])
    for here, there in pairwise(states):
        windows.advance(
            _Step(here, there), lambda step, _, image: step.halfway(step.there.block(image), "scan"), "scan"
        )
    return windows.all()


def follow(packings: Iterable[Packing], form: Form = "consistent") -> Complexes:
    """Eigenvalues along a ramp, each mode in a column of its own.

    Parameters
    ----------
    packings : iterable of Packing
        Equilibria along a ramp, close enough for modes to be recognised.
    form : {"consistent", "paper"}
        As in :func:`~faultgouge.analysis.stiffness_matrix`.

    Returns
    -------
    ndarray of complex, shape (S, E)
        Column k follows the k-th lowest eigenvalue of the first packing; nan from where a mode is gone.
    """
    rows: list[Complexes] = []
    before: Modes | None = None
    for packing in packings:
        modes = Modes.of(packing.fx, full_operator(packing, form))
        if before is None:
            columns = np.arange(len(modes.values))
        else:
            partner = assign(before, modes)
            columns = np.where(columns >= 0, partner[columns], -1)
        rows.append(np.where(columns >= 0, modes.values[columns], np.nan))
        before = modes
    return np.array(rows)


class _Step:
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

    def halfway(self, block: Block, kind: Kind) -> "_Edge":
        """An edge somewhere in this step."""
        half = 0.5 * (self.there.fx - self.here.fx)
        return _Edge(self.here.fx + half, half, block.mean, block.overlap, kind)

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


@dataclass(frozen=True)
class _Edge:
    """Where a pair enters or leaves the real axis."""

    fx: float
    error: float
    eigenvalue: float
    overlap: float
    kind: Kind


class _Windows:
    """The windows that are open at the load reached so far, and those that are closed."""

    def __init__(self, first: Modes) -> None:
        self.open: dict[Pair, _Edge] = {}
        self.closed: list[Window] = []
        for pair in first.complex_pairs:
            block = first.block(pair)
            self.open[pair] = _Edge(first.fx, 0.0, block.mean, block.overlap, "start")

    def advance(self, step: "_Step", edge: Callable[["_Step", Pair, Pair], _Edge], lost: Kind) -> None:
        """Carry them over a step; pairs that are not recognised end and begin halfway."""
        now = {image: self.open.pop(pair) for pair, image in step.staying}
        for pair, image in step.closing:
            self.closed.append(_window(self.open.pop(pair), edge(step, pair, image)))
        for pair, image in step.opening:
            now[image] = edge(step, pair, image)
        for pair in step.lost:
            self.closed.append(_window(self.open.pop(pair), step.halfway(step.here.block(pair), lost)))
        for image in step.found:
            now[image] = step.halfway(step.there.block(image), lost)
        self.open = now

    def all(self) -> tuple[Window, ...]:
        still = [_window(edge, None) for edge in self.open.values()]
        return tuple(sorted(self.closed + still, key=lambda window: window.fx_onset))


@dataclass(frozen=True)
class _Search:
    """Walks along the loads, with as many loads in between as it takes to be sure."""

    operator: Callable[[float], Operator]
    narrowest: float
    windows: _Windows

    def walk(self, here: Modes, there: Modes) -> None:
        """Go from one load to the next."""
        step = _Step(here, there)
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
                    edge, before, behind = solution
                    self.walk(here, before)
                    self.windows.advance(_Step(before, behind), lambda *_: edge, "contact change")
                    self.walk(behind, there)
                    return
            between = None if middle is None else self.between(here.fx, middle, there.fx)
            if between is not None:
                self.walk(here, between)
                self.walk(between, there)
                return
        self.windows.advance(step, self.edge, "contact change")

    def edge(self, step: "_Step", pair: Pair, image: Pair) -> _Edge:
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

    def solve(self, step: "_Step", pair: Pair, image: Pair) -> tuple[_Edge, Modes, Modes] | None:
        """The edge of a pair that is complex at one end only, and the modes close by on either side.

        None if the search for it comes upon a load without equilibrium.
        """
        here, there = step.here, step.there
        ends = [_State(here.fx, here.matrix, here.block(pair)), _State(there.fx, there.matrix, there.block(image))]
        try:
            edge, below, above = _locate(self.operator, *ends)
        except RuntimeError:
            return None
        return (
            edge,
            here if below.fx == here.fx else Modes.of(below.fx, below.matrix),
            there if above.fx == there.fx else Modes.of(above.fx, above.matrix),
        )


@dataclass(frozen=True, eq=False)
class _State:
    """The operator at one load and the block of a pair in it."""

    fx: float
    matrix: csr_array
    block: Block

    @property
    def discriminant(self) -> float:
        return self.block.discriminant

    def at(self, fx: float, operator: Operator) -> "_State":
        """The same pair at another load: continued, or found among all modes if need be."""
        matrix = csr_array(operator)
        block = continued(matrix, self.block)
        if block is None:
            modes = Modes.of(fx, matrix)
            block = modes.block(modes.nearest(self.block))
        return _State(fx, matrix, block)


def _locate(operator: Callable[[float], Operator], here: _State, there: _State) -> tuple[_Edge, _State, _State]:
    """The root of D of a pair between two loads, and its states close by on either side."""
    span = there.fx - here.fx
    if here.discriminant * there.discriminant >= 0:
        # One end is within rounding of the coalescence: the edge is there, to within D over its slope.
        end = min(here, there, key=lambda state: abs(state.discriminant))
        slope = abs(there.discriminant - here.discriminant) / span
        error = abs(end.discriminant) / slope
        return _Edge(end.fx, error, end.block.mean, end.block.overlap, "coalescence"), here, there
    known = {here.fx: here, there.fx: there}

    def state(fx: float) -> _State:
        if fx not in known:
            known[fx] = known[min(known, key=lambda each: abs(each - fx))].at(fx, operator(fx))
        return known[fx]

    root = float(brentq(lambda fx: state(fx).discriminant, here.fx, there.fx, xtol=ROOT * span))
    room = min(root - here.fx, there.fx - root)
    # As near as the noise allows: D should be straight, and yet stand out of the scatter.
    distance = 1e-3 * min(room, 1e-3 * span)
    while 0 < distance < 0.1 * room:
        points = [state(root + offset * distance) for offset in (-2, -1, 0, 1, 2)]
        edge = _coalescence(points)
        if edge is not None:
            return edge, points[0], points[-1]
        distance *= 30
    # D jumps: nothing but bisection will do.
    order = sorted(known)
    below, above = next((a, b) for a, b in pairwise(order) if known[a].discriminant * known[b].discriminant <= 0)
    while above - below > max(JUMP * span, 4 * float(np.spacing(abs(above)))):
        middle = 0.5 * (below + above)
        if state(middle).discriminant * known[below].discriminant > 0:
            below = middle
        else:
            above = middle
    jump = _Edge(
        fx=0.5 * (below + above),
        error=0.5 * (above - below),
        eigenvalue=known[above].block.mean,
        overlap=min(known[below].block.overlap, known[above].block.overlap),
        kind="contact change",
    )
    return jump, known[below], known[above]


def _coalescence(points: Sequence[_State]) -> _Edge | None:
    """Root and error of D from five equidistant points about it; None if D does not cross zero smoothly.

    A parabola takes care of what curvature there is; two degrees of freedom are left for the scatter.
    """
    middle, distance = points[2].fx, points[3].fx - points[2].fx
    d = np.array([point.discriminant for point in points])
    curve, residuals, *_ = np.polynomial.polynomial.polyfit(np.arange(-2, 3), d, 2, full=True)
    scatter = float(np.sqrt(residuals[0].sum() / 2)) if residuals[0].size else 0.0
    value, slope = float(curve[0]), float(curve[1])
    # A step of height 1 has slope 0.3 and scatter 0.3 here.
    if scatter > 0.1 * abs(slope) or abs(value) > abs(slope) or d[0] * d[-1] >= 0:
        return None
    shift = -value / slope * (1 + float(curve[2]) * value / slope**2)  # the parabola's root, to second order
    return _Edge(
        fx=middle + shift * distance,
        error=2 * scatter / abs(slope) * distance + float(np.spacing(abs(middle))),
        eigenvalue=float(np.mean([point.block.mean for point in points])),
        overlap=min(point.block.overlap for point in points),
        kind="coalescence",
    )


Place = tuple[float, csr_array]
"""A load and the operator there."""

REACH = 0.1
"""Share of an increment by which the clusters are extrapolated: a pair that they have turn complex a little late is
found in time."""

FINEST = 1e-3
"""Narrowest windows of clusters that are looked for, in increments: their own error is larger."""


@dataclass(frozen=True, eq=False)
class _Candidate:
    """The planes of a pair that turns complex in its cluster, and a load at which it may be so in the operator."""

    inside: float
    right: Floats
    left: Floats


def _nearest_pair(modes: Modes, eigenvalue: float) -> Pair:
    """The complex pair, or failing that the two modes, closest to a real eigenvalue."""
    first, second = np.argsort(np.abs(modes.values.real - eigenvalue))[:2]
    pairs = modes.complex_pairs or [(int(first), int(second))]
    return min(pairs, key=lambda pair: abs(modes.values[pair[0]].real - eigenvalue))


class _LargeSearch:
    """The first window of large operators, from load to load."""

    def __init__(self, operator: Callable[[float], Operator], narrowest: float) -> None:
        self.operator, self.narrowest = operator, narrowest
        self.passed: list[Place] = []
        self.projection: Projection | None = None
        self.blocks: list[Floats] = []

    def walk(self, here: Place, there: Place) -> Window | None:
        """The first window that begins between two loads."""
        self.passed.append(here)
        if self.projection is None or not self.projection.fits(here[1], self.blocks):
            self.projection = Projection.of(here[1])
            self.blocks = self.projection.onto(here[1])
        before, self.blocks = self.blocks, self.projection.onto(there[1])
        candidates = [
            candidate
            for cluster, a, b in zip(self.projection.clusters, before, self.blocks, strict=True)
            for candidate in self.candidates(self.projection, cluster, (here[0], a), (there[0], b))
        ]
        first: Window | None = None
        for candidate in candidates:
            window = self.confirmed(candidate, there)
            if window is not None and (first is None or window.fx_onset < first.fx_onset):
                first = window
        return first

    def candidates(
        self, projection: Projection, cluster: Cluster, here: tuple[float, Floats], there: tuple[float, Floats]
    ) -> Iterator[_Candidate]:
        """The windows of one cluster, with its blocks interpolated between two loads."""
        span = there[0] - here[0]

        def block(fx: float) -> Floats:
            share = (fx - here[0]) / span
            return (1 - share) * here[1] + share * there[1]

        reach = there[0] + REACH * span
        for window in complex_windows(block, [here[0], reach], narrowest=max(self.narrowest, FINEST * span)):
            end = reach if window.fx_end is None else window.fx_end
            inside = there[0] if window.fx_onset < there[0] <= end else 0.5 * (window.fx_onset + end)
            modes = Modes.of(inside, block(inside))
            plane = modes.block(_nearest_pair(modes, window.eigenvalue))
            if cluster.owns(plane.right):
                right, left = projection.lifted(cluster, plane.right), projection.lifted(cluster, plane.left)
                yield _Candidate(min(inside, there[0]), right, left)

    def confirmed(self, candidate: _Candidate, there: Place) -> Window | None:
        """The window of the operator itself in place of that of a cluster; None if the pair stays real."""
        inside = self.complex_state(candidate, there)
        if inside is None:
            return None
        above = inside if inside.fx == there[0] else inside.at(*there)
        end = _locate(self.operator, inside, above)[0] if above.discriminant > 0 else None
        for place in reversed(self.passed):
            below = inside if inside.fx == place[0] else inside.at(*place)
            if below.discriminant > 0:
                return _window(_locate(self.operator, below, inside)[0], end)
            inside = below
        return _window(_Edge(inside.fx, 0.0, inside.block.mean, inside.block.overlap, "start"), end)

    def complex_state(self, candidate: _Candidate, there: Place) -> _State | None:
        """The pair at a load where it is complex, if there is one near the candidate's window."""
        fx = candidate.inside
        matrix = there[1] if fx == there[0] else csr_array(self.operator(fx))
        start = _State(fx, matrix, Block.of(matrix, candidate.right, candidate.left)).at(fx, matrix)
        if start.discriminant < 0:
            return start
        # A parabola through D at the ends of the increment and here has its minimum where D is least.
        places = [self.passed[-1], there] if fx < there[0] else [self.passed[-1]]
        others = [start.at(*place) for place in places]
        for other in others:
            if other.discriminant < 0:
                return other
        if len(others) < 2:
            return None
        states = sorted([start, *others], key=lambda state: state.fx)
        curve = np.polyfit([state.fx for state in states], [state.discriminant for state in states], 2)
        lowest = float(-0.5 * curve[1] / curve[0])
        if curve[0] <= 0 or not states[0].fx < lowest < states[-1].fx:
            return None
        state = start.at(lowest, self.operator(lowest))
        return state if state.discriminant < 0 else None


def _window(onset: _Edge, end: _Edge | None) -> Window:
    return Window(
        fx_onset=onset.fx,
        fx_end=None if end is None else end.fx,
        eigenvalue=onset.eigenvalue,
        error=onset.error,
        end_error=None if end is None else end.error,
        overlap=onset.overlap,
        kind=onset.kind,
    )


def _increasing(forces: ArrayLike) -> NDArray[np.float64]:
    loads = np.array(forces, dtype=np.float64)
    if loads.ndim != 1 or len(loads) < 2 or not np.all(np.isfinite(loads)) or np.any(np.diff(loads) <= 0):
        raise ValueError("The loads of a ramp must be at least two finite, increasing numbers.")
    return loads
