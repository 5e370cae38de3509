r"""Onset of complex eigenvalues along a ramp of the load: windows, solved for and not scanned.

Two real eigenvalues of a non-symmetric operator A(F) may meet at an exceptional point and leave the axis as a
complex pair. Their difference goes as the square root of the distance, which root finders and scans handle
badly, but on the invariant subspace that the two span, with 2 x 2 block B, the discriminant

.. math::

    D(F) = (\lambda_1 - \lambda_2)^2 = \mathrm{tr}^2 B - 4 \det B = (B_{11} - B_{22})^2 + 4 B_{12} B_{21}

goes through zero linearly and stays smooth and real on both sides. B is the two-sided projection
:math:`(U^T V)^{-1} U^T A V` on orthonormal bases V, U of the right and the left invariant subspace: neither
degrades where the eigenvectors themselves become parallel, and the last form of D does not cancel. A few
secant steps give ten digits (:mod:`~faultgouge.analysis.edges`). How windows narrower than the increment are found
is told in :mod:`~faultgouge.analysis.windows`.

**Contacts without force.** A disk that nothing presses comes to rest touching its neighbours with an overlap that
is rounding, and a Hertzian contact has the stiffness :math:`\tfrac32 k_n \delta^{1/2}`: a force of 1e-11, the
balance that an equilibrium can have, goes with a stiffness of order 1, which differs from one equilibrium to the
next and would open and shut windows at random. Such contacts are left out, see `loaded`.

**What it costs.** An equilibrium at every load that is examined, and two dense decompositions for an increment on which
something happens; on the others two products of matrices tell that nothing does. While an edge is solved for only its
pair is continued (:mod:`~faultgouge.analysis.tracking`). In packings of more than `ALL_WINDOWS` disks no load is
decomposed: :func:`~faultgouge.analysis.large.first_window` finds the first pair from
clusters of neighbouring modes.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from .edges import State
from .large import Watch, first_window
from .modes import Modes, assign, full_operator
from .packing import Packing
from .spectrum import Complexes
from .stiffness import Form
from .windows import OpenWindows, Step, Window, complex_windows, increasing

ALL_WINDOWS = 300
"""Disks up to which all eigenvalues are computed at every load, which takes a second there and grows with the cube."""


class OnsetError(RuntimeError):
    """No complex pair appears on the given loads."""


@dataclass(frozen=True)
class Onset:
    """The windows of complex eigenvalues along a ramp.

    Attributes
    ----------
    windows : tuple of Window
        By increasing onset; at least one.
    complete : bool
        Whether these are all up to the largest load. Of a large packing only the first is sought.
    doubtful : tuple of (float, float)
        Of a large packing, increments before the onset in which a pair was expected and not found: an earlier window
        may hide there, which smaller increments would tell.
    modes : tuple of (int, int) or None
        Modes among which the onset was sought; None for all.
    """

    windows: tuple[Window, ...]
    complete: bool = True
    doubtful: tuple[tuple[float, float], ...] = ()
    modes: tuple[int, int] | None = None

    @property
    def fx_c(self) -> float:
        """F_x^c, the first onset, force per top disk."""
        return self.windows[0].fx_onset

    @property
    def error(self) -> float:
        """Uncertainty of fx_c."""
        return self.windows[0].error

    def as_dict(self) -> dict[str, Any]:
        """{"fx_c", "error", "windows": [...], "doubtful": [[from, to], ...], "modes"} of plain numbers, for JSON."""
        return {
            "fx_c": self.fx_c,
            "error": self.error,
            "windows": [window.as_dict() for window in self.windows],
            "doubtful": [list(increment) for increment in self.doubtful],
            "modes": None if self.modes is None else list(self.modes),
        }


def seeks_all(packing: Packing, modes: tuple[int, int] | None = None) -> bool:
    """Whether `find_onset` seeks all windows, at all loads; else it asks for loads up to the first window."""
    return modes is None and len(packing) <= ALL_WINDOWS


def find_onset(
    equilibrium: Callable[[float], Packing],
    forces: ArrayLike,
    *,
    form: Form = "consistent",
    narrowest: float | None = None,
    modes: tuple[int, int] | None = None,
    watch: Watch = lambda says: None,
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
    modes : tuple of (int, int), optional
        Search these modes alone, and for their first window: numbers of the first one and of the first one beyond, by
        frequency, the lowest being 0. The modes of the symmetric part are counted, at the load where the search
        stands. Parts of a spectrum that are searched apart, on machines of their own, have together the same first
        window as all of it.
    watch : callable, optional
        Told in words what is being looked at in a large packing.

    Returns
    -------
    Onset

    Raises
    ------
    OnsetError
        If all eigenvalues are real at every load.
    LostPairError, SliceError
        Of a large packing, see :func:`first_window`.
    ValueError
        If the loads are not at least two increasing numbers, or the packing has none of the modes.
    """
    loads = increasing(forces)
    start = equilibrium(float(loads[0]))
    unbalanced: dict[float, float] = {}

    def operator(fx: float) -> csr_array:
        packing = start if fx == loads[0] else equilibrium(fx)
        unbalanced[fx] = packing.residual / float(np.sqrt(max(1, packing.top.sum())))
        return full_operator(packing, form)

    def balance(fx: float) -> float:
        return unbalanced[min(unbalanced, key=lambda known: abs(known - fx))]

    complete = seeks_all(start, modes)
    doubtful: tuple[tuple[float, float], ...] = ()
    if complete:
        found = complex_windows(operator, loads, narrowest=narrowest)
    else:
        first = first_window(operator, loads, narrowest=narrowest, modes=modes, watch=watch)
        found = () if first.window is None else (first.window,)
        doubtful = first.doubtful
    among = "" if modes is None else f" among the modes {modes[0]}:{modes[1]}"
    if doubtful and not found:
        below, above = doubtful[0]
        raise OnsetError(
            f"No pair of eigenvalues{among} was found to become complex up to fx = {loads[-1]:.17g}, but one was "
            f"expected between {below:.10g} and {above:.10g}: take smaller increments, or raise the largest load."
        )
    if not found:
        raise OnsetError(
            f"No pair of eigenvalues{among} becomes complex up to fx = {loads[-1]:.17g}: raise the largest load."
        )
    windows = tuple(
        replace(
            window,
            error=window.error + balance(window.fx_onset),
            end_error=None if window.fx_end is None else (window.end_error or 0.0) + balance(window.fx_end),
        )
        for window in found
    )
    return Onset(windows, complete, doubtful, modes)


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
    increasing([packing.fx for packing in packings])
    states = [Modes.of(packing.fx, full_operator(packing, form)) for packing in packings]
    windows = OpenWindows()
    first = states[0]
    windows.start(State(first.fx, first.matrix, first.block(pair)) for pair in first.complex_pairs)
    for here, there in pairwise(states):
        windows.advance(Step(here, there), lambda step, _, image: step.halfway(step.there.block(image), "scan"), "scan")
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
