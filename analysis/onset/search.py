"""What a user asks for: the onset along a ramp, and the windows of a family of matrices."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from ..configuration import HasConfiguration
from ..errors import FaultgougeError, NoEquilibriumError, TurningPointError
from ..motion.buckling import negative_eigenvalues
from ..motion.spectrum import Spectrum, spectrum
from ..packing.packing import Floats, Packing
from ..progress import Watch, show_progress
from ..table_display import TableDisplay
from ..uncertain_digits import with_uncertainty
from .all_windows import all_windows
from .first_window import Increments, first_window
from .limits import LIMITS, Limits
from .march import check_increasing
from .modes import Operator, contact_states, force_bearing, full_operator
from .ranks import ALONE, Ranks
from .window_edges import Edge, Family, Window


class OnsetError(FaultgougeError):
    """No complex pair appears on the given loads."""

    @classmethod
    def among(cls, modes: tuple[int, int] | None, last: float, doubtful: Increments) -> "OnsetError":
        """The sentence for some modes, or all, up to the last load."""
        which = "" if modes is None else f" among the modes {modes[0]}:{modes[1]}"
        if not doubtful:
            return cls(f"No pair of eigenvalues{which} is complex up to F_x = {last:.10g}: raise the largest load.")
        below, above = doubtful[0]
        return cls(
            f"No pair of eigenvalues{which} was found to become complex up to F_x = {last:.10g}, but one was expected "
            f"between {below:.10g} and {above:.10g}: take smaller increments, or raise the largest load."
        )


def windows_rows(windows: Sequence[Window]) -> dict[str, str]:
    """Windows of complex eigenvalues in words: where each begins, and what it is."""
    rows = {}
    for each in windows:
        end = "the end" if each.fx_end is None else f"{each.fx_end:.8g}"
        begin = f"from {with_uncertainty(each.fx_onset, each.error)}"
        rows[begin] = f"to {end}, lambda = {each.eigenvalue:.6g}, {each.kind}"
    return rows


@dataclass(frozen=True)
class Instability:
    """What makes a packing unstable.

    Attributes
    ----------
    pairs : int
        Complex pairs.
    negative : int
        Negative eigenvalues.
    growth_rate : float
        Of D in the fastest motion, 1 / time.
    """

    pairs: int
    negative: int
    growth_rate: float

    @classmethod
    def of(cls, packing: HasConfiguration) -> "Instability":
        """Count what all eigenvalues of a packing show, without contacts whose force is unknown."""
        return cls.from_spectrum(spectrum(force_bearing(packing)))

    @classmethod
    def from_spectrum(cls, found: Spectrum) -> "Instability":
        """The same of a spectrum that is known."""
        return cls(len(found.pairs), len(found.negative), found.growth_rate())

    def __str__(self) -> str:
        counts = [(self.pairs, "complex pair"), (self.negative, "negative eigenvalue")]
        parts = [f"{count} {what}{'s' * (count > 1)}" for count, what in counts if count]
        return f"{' and '.join(parts)}; in the fastest motion D grows as exp({self.growth_rate:.6g} t)"


@dataclass(frozen=True)
class Onset(TableDisplay):
    """The windows of complex eigenvalues along a ramp.

    Attributes
    ----------
    windows : tuple of Window
        By increasing onset; at least one.
    complete : bool
        Whether these are all up to the largest load, or to where the branch of equilibria ends; else it is the first.
    doubtful : tuple of (float, float)
        Of a large packing, increments before the onset in which a pair was expected and not found: take smaller ones.
    modes : tuple of (int, int) or None
        Modes among which the onset was sought; None for all.
    at_start : Instability or None
        What makes the packing unstable at the smallest load already; None if it is stable there, or too large for all
        of its eigenvalues to be counted.
    ends : float or None
        Load before which the branch of equilibria ends, as an eigenvalue is negative there; None if it does not, as far
        as the search went.
    """

    windows: tuple[Window, ...]
    complete: bool = True
    doubtful: Increments = ()
    modes: tuple[int, int] | None = None
    at_start: Instability | None = None
    ends: float | None = None

    def __repr__(self) -> str:
        return f"<Onset: {self.describe()}, windows: {self.window_count}>"

    def __str__(self) -> str:
        return self.describe()

    def describe(self) -> str:
        """F_x^c with its error, in words; or that, and why, the packing is unstable at the smallest load."""
        first = self.windows[0]
        if first.kind != "start":
            return f"F_x^c = {with_uncertainty(self.fx_c, self.error)}"
        negative = f"an eigenvalue is {first.eigenvalue:.6g}"
        known = negative if first.eigenvalue < 0 else f"a pair of eigenvalues is complex about {first.eigenvalue:.6g}"
        shear = "before any shear is added" if self.fx_c == 0 else "the smallest load"
        return f"unstable at F_x = {self.fx_c:g}, {shear}: {known if self.at_start is None else self.at_start}"

    def _rows(self) -> dict[str, str]:
        return windows_rows(self.windows)

    @property
    def window_count(self) -> str:
        """The number of windows in words, as far as they were counted."""
        return str(len(self.windows)) if self.complete else "not counted, as the search ended with the first"

    @property
    def fx_c(self) -> float:
        """F_x^c, the first onset, force per top disk."""
        return self.windows[0].fx_onset

    @property
    def error(self) -> float:
        """Uncertainty of fx_c."""
        return self.windows[0].error

    def as_dict(self) -> dict[str, Any]:
        """fx_c, error, error_of_path, windows, complete, doubtful, modes, unstable_at_start, branch_ends, for JSON."""
        return {
            "fx_c": self.fx_c,
            "error": self.error,
            "error_of_path": self.windows[0].path_error,
            "windows": [window.as_dict() for window in self.windows],
            "complete": self.complete,
            "doubtful": [list(increment) for increment in self.doubtful],
            "modes": None if self.modes is None else list(self.modes),
            "unstable_at_start": None if self.at_start is None else asdict(self.at_start),
            "branch_ends": self.ends,
        }


def takes_all_modes(packing: HasConfiguration, modes: tuple[int, int] | None = None, limits: Limits = LIMITS) -> bool:
    """Whether a packing is small enough for all of its modes to be searched, and for all windows to be found."""
    return modes is None and packing.coordinates <= 3 * limits.all_windows


def complex_windows(
    operator: Callable[[float], Operator],
    forces: ArrayLike,
    *,
    narrowest: float | None = None,
    limits: Limits = LIMITS,
) -> tuple[Window, ...]:
    """All windows of complex eigenvalues of a one-parameter family of matrices, by increasing onset.

    The operator is fx -> ndarray or sparse array, shape (n, n), in coordinates that do not depend on fx. Zero rows are
    left out. All else is as in :func:`find_onset`.
    """
    loads = check_increasing(forces)
    unit = unit_of(operator(float(loads[0])))
    narrowest = _narrowest(loads, limits) if narrowest is None else narrowest
    found = all_windows(Family(lambda fx: operator(fx) / unit, narrowest, limits), loads)
    return tuple(_in_units(window, unit) for window in found)


def unit_of(operator: Operator) -> float:
    """A power of two of the size of a matrix's largest element: division by it changes no digit.

    A search divides its operators by it, since what is rough in a search squares them in single precision, which goes
    from 1e-38 to 1e38.
    """
    largest = float(abs(operator).max())
    return 2.0 ** int(np.floor(np.log2(largest))) if largest > 0 else 1.0


def _in_units(window: Window, unit: float) -> Window:
    """A window of operators that were divided by a unit, 1 / time^2."""
    return replace(window, eigenvalue=unit * window.eigenvalue)


def _narrowest(loads: Floats, limits: Limits) -> float:
    return limits.narrowest * float(np.abs(loads).max())


def find_onset(
    equilibrium: Callable[[float], HasConfiguration],
    forces: ArrayLike,
    *,
    narrowest: float | None = None,
    modes: tuple[int, int] | None = None,
    first: bool = False,
    watch: Watch | None = None,
    ranks: Ranks = ALONE,
    folder: Path | None = None,
    limits: Limits = LIMITS,
) -> Onset:
    """The windows of complex eigenvalues between the smallest and the largest load.

    Of a packing of up to `Limits.all_windows` disks these are all, unless the first alone is asked for; of a larger one
    it is the first. They end where the branch of equilibria does: where an equilibrium at one of the given loads has a
    negative eigenvalue, so that a static instability lies before it.

    Parameters
    ----------
    equilibrium : callable
        fx -> Packing or Configuration in equilibrium. It is called with the given loads in increasing order, and
        between calls for the loads a and b with loads between these, in any order. There it may raise a
        NoEquilibriumError, and the search goes around it. All other errors reach the caller.
    forces : array_like, shape (S,)
        The increasing loads of the ramp, force per top disk.
    narrowest : float, optional
        Windows narrower than this are not looked for, force; by default as in `Limits`, `narrowest` and `finest`.
    modes : tuple of (int, int), optional
        Search these modes alone, and for their first window: numbers of the first one and of the first one beyond, by
        frequency, the lowest being 0, of the symmetric part at the load where the search stands. Parts that are
        searched apart, on machines of their own, have together the same first window as all.
    first : bool
        Seek the first window alone. No equilibrium beyond the increment in which it begins is then asked for, and its
        end is None where it ends beyond that increment.
    watch : callable, optional
        Told in words what is being looked at in a large packing.
    ranks : Ranks, optional
        The processes that search a large packing together. Each makes the same call, and is told the same by
        `equilibrium`.
    folder : Path, optional
        Where a search whose bases are too large to be kept in memory leaves what it finds, slice by slice. A search of
        the same loads, operators and modes goes on from there, to the bit. All ranks write to it.

    Raises
    ------
    OnsetError
        If all eigenvalues are real at every load.
    TurningPointError
        If one is negative before any is complex.
    LostPairError, SliceError
        Of a large packing, if a pair cannot be followed, or a part of the spectrum is not found.
    OutputError, DamagedSliceError
        If a file in the folder cannot be written, or read.
    ValueError
        If the loads are not at least two increasing numbers, or the packing has none of the modes.
    """
    loads = check_increasing(forces)
    start = equilibrium(float(loads[0]))
    takes_all = takes_all_modes(start, modes, limits)
    negative = negative_eigenvalues(force_bearing(start, limits))
    if len(negative):
        at_start = Instability.of(start) if takes_all else None
        window = _at_start(start, float(negative[0]), 1.0)
        return Onset((window,), False, (), modes, at_start, start.fx)
    unbalanced: dict[float, float] = {}
    states: dict[float, bytes] = {}
    given, ends, unit = set(loads[1:].tolist()), np.inf, unit_of(full_operator(start, limits))

    def operator(fx: float) -> csr_array:
        nonlocal ends
        packing = start if fx == loads[0] else equilibrium(fx)
        if fx in given and len(negative_eigenvalues(force_bearing(packing, limits))):
            ends = min(ends, fx)
            raise TurningPointError(
                f"no pair of eigenvalues becomes complex before F_x = {fx:.10g}, where one is negative: the branch of "
                "stable equilibria ends before, at a turning point, and the packing leaves it without oscillation"
            )
        unbalanced[fx], states[fx] = packing.load_error, contact_states(packing, limits)
        return full_operator(packing, limits) / unit

    doubtful: Increments = ()
    all_modes: Spectrum | None = None
    # packings of LAMMPS's own laws have complex pairs at rest as a rule, and no further load is then needed
    if modes is None and (not takes_all or (first and not isinstance(start, Packing))):
        all_modes = _complex_at_start(start, limits)
    if all_modes is not None:
        windows: tuple[Window, ...] = (_fastest(start, all_modes),)
    elif takes_all:
        narrowest = _narrowest(loads, limits) if narrowest is None else narrowest
        try:
            found = all_windows(Family(operator, narrowest, limits, states.__getitem__), loads, first=first)
            windows = tuple(_in_units(window, unit) for window in found)
        except NoEquilibriumError:  # beyond the first increment, which the search asks for in any case
            all_modes = _complex_at_start(start, limits)
            if all_modes is None:
                raise
            windows = (_fastest(start, all_modes),)
        windows = windows[:1] if first else windows
    else:
        with show_progress(watch):
            one, doubtful = first_window(Family(operator, narrowest or 0.0, limits), loads, modes, ranks, folder)
        windows = (_in_units(one, unit),) if one else ()
    if not windows:
        raise OnsetError.among(modes, float(loads[-1]), doubtful)
    windows = tuple(_with_imbalance(window, unbalanced) for window in windows)
    unstable = None
    if windows[0].kind == "start" and (all_modes or takes_all):
        unstable = Instability.from_spectrum(all_modes) if all_modes else Instability.of(start)
    complete = takes_all and not first
    return Onset(windows, complete, doubtful, modes, unstable, float(ends) if ends < np.inf else None)


def _complex_at_start(start: HasConfiguration, limits: Limits) -> Spectrum | None:
    """The spectrum of a packing at the smallest load, if it has a complex pair.

    None if it has none, or if the packing is too large for all eigenvalues to be asked for. Of a symmetric operator,
    as without tangential forces, nothing is computed.
    """
    if start.coordinates > limits.lapack or _symmetric(full_operator(start, limits)):
        return None
    found = spectrum(force_bearing(start, limits))
    return found if found.pairs else None


def _symmetric(matrix: csr_array) -> bool:
    """Whether an operator is its transpose, but for the rounding of its entries, which are sums over contacts."""
    return bool(abs(matrix - matrix.T).max() <= 1e-14 * abs(matrix).max())


def _fastest(start: HasConfiguration, found: Spectrum) -> Window:
    """The window of the complex pair that grows fastest at the smallest load."""
    pair = max(found.pairs, key=lambda each: each.growth_rate)
    return _at_start(start, pair.eigenvalue.real, pair.overlap)


def _at_start(start: HasConfiguration, eigenvalue: float, overlap: float) -> Window:
    """A window that is open at the smallest load."""
    return Window.between(Edge(start.fx, 0.0, eigenvalue, overlap, "start"), None)


def _with_imbalance(window: Window, unbalanced: dict[float, float]) -> Window:
    """A window whose errors have the imbalance of the equilibria next to its edges added, as a shift of the load.

    The smallest load, at which a packing is unstable already, is given and has no error.
    """

    def at(edge: float) -> float:
        return unbalanced[min(unbalanced, key=lambda known: abs(known - edge))]

    end = window.fx_end
    return replace(
        window,
        error=0.0 if window.kind == "start" else window.error + at(window.fx_onset),
        end_error=None if end is None else (window.end_error or 0.0) + at(end),
    )
