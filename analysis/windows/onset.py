"""What a user asks for: the onset along a ramp, and the windows of a family of systems."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from ..configuration import HasConfiguration
from ..counted import counted
from ..errors import FaultgougeError, NoEquilibriumError, TurningPointError
from ..motion.buckling import negative_eigenvalues
from ..motion.spectrum import Spectrum, spectrum
from ..packing.packing import Floats, Packing
from ..progress import Watch, report_progress, show_progress
from ..table_display import TableDisplay
from ..uncertain_digits import with_uncertainty
from .edges import At, Edge, Window
from .limits import LIMITS, Limits
from .screens.growth import GrowthScreen
from .screens.pairs import PairScreen
from .search import Look, windows_along
from .slices.clusters import Increments
from .slices.ranks import ALONE, Ranks
from .system import Operator, System, force_bearing, full_operator, unit_of

Known = Callable[[tuple[Window, ...], float], None]
"""Takes the windows so far, and the load up to which they are all."""


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
        what = f"frequency = {each.frequency:.6g}" if each.dissipative else f"lambda = {each.eigenvalue:.6g}"
        rows[begin] = f"to {end}, {what}, {each.kind}"
    return rows


def instability_in_words(found: Spectrum) -> str:
    """How many complex pairs and negative eigenvalues a spectrum has, and how fast D grows."""
    counts = [(len(found.pairs), "complex pair"), (len(found.negative), "negative eigenvalue")]
    parts = [counted(count, what) for count, what in counts if count]
    return f"{' and '.join(parts)}; in the fastest motion D grows as exp({found.growth_rate():.6g} t)"


@dataclass(frozen=True)
class Onset(TableDisplay):
    """The windows of growing motion along a ramp.

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
    at_start : Spectrum or None
        The eigenvalues of a packing that is unstable at the smallest load already; None if it is stable there, or too
        large for all of its eigenvalues to be counted.
    ends : float or None
        Load before which the branch of equilibria ends, as an eigenvalue is negative there; None if it does not, as far
        as the search went.
    undamped : Onset or None
        Of a search with dissipation, the onset without it; None if there is none on the same loads.
    mu : float
        Friction coefficient of a scene's onset; nan of others.
    equilibria : tuple of Equilibrium
        Of a scene's onset, those of the ramp, by increasing F_x.
    between : dict
        Of a scene's onset, further equilibria that were asked for, packing by F_x.
    flows_beyond : float or None
        Of a scene's onset, the last F_x that had an equilibrium, where the packing was found to flow before the ramp's
        end.
    """

    windows: tuple[Window, ...]
    complete: bool = True
    doubtful: Increments = ()
    modes: tuple[int, int] | None = None
    at_start: Spectrum | None = None
    ends: float | None = None
    undamped: "Onset | None" = None
    mu: float = np.nan
    equilibria: tuple[Any, ...] = ()
    between: dict[float, Packing] = field(default_factory=dict)
    flows_beyond: float | None = None

    def __repr__(self) -> str:
        parts = [self.describe(), f"windows: {self.window_count}"]
        if self.equilibria:
            reached = counted(len(self.equilibria), "equilibrium", "equilibria")
            parts = [f"mu = {self.mu:g}", *parts, f"{reached} up to F_x = {self.equilibria[-1].fx:g}"]
        return f"<Onset: {', '.join(parts)}>"

    def __str__(self) -> str:
        return self.describe()

    def describe(self) -> str:
        """F_x^c with its error, in words; or that, and why, the packing is unstable at the smallest load."""
        first = self.windows[0]
        if first.kind != "start" or first.dissipative:
            return f"F_x^c = {with_uncertainty(self.fx_c, self.error)}"
        negative = f"an eigenvalue is {first.eigenvalue:.6g}"
        known = negative if first.eigenvalue < 0 else f"a pair of eigenvalues is complex about {first.eigenvalue:.6g}"
        shear = "before any shear is added" if self.fx_c == 0 else "the smallest load"
        known = known if self.at_start is None else instability_in_words(self.at_start)
        return f"unstable at F_x = {self.fx_c:g}, {shear}: {known}"

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
        """For JSON: fx_c, error, error_of_path, windows, doubtful, and more with dissipation or without."""
        undamped, start = self.undamped, self.at_start
        known: dict[str, Any] = {
            "fx_c": self.fx_c,
            "error": self.error,
            "error_of_path": self.windows[0].path_error,
            "windows": [window.as_dict() for window in self.windows],
        }
        if self.windows[0].dissipative:
            return known | {
                "undamped": None if undamped is None else {"fx_c": undamped.fx_c, "error": undamped.error},
                "doubtful": [list(increment) for increment in self.doubtful],
                "flows_beyond": self.flows_beyond,
            }
        return known | {
            "complete": self.complete,
            "doubtful": [list(increment) for increment in self.doubtful],
            "modes": None if self.modes is None else list(self.modes),
            "unstable_at_start": None
            if start is None
            else {"pairs": len(start.pairs), "negative": len(start.negative), "growth_rate": start.growth_rate()},
            "branch_ends": self.ends,
        }


def takes_all_modes(packing: HasConfiguration, modes: tuple[int, int] | None = None, limits: Limits = LIMITS) -> bool:
    """Whether a packing is small enough for all of its modes to be searched, and for all windows to be found."""
    return modes is None and packing.coordinates <= 3 * limits.all_windows


def find_windows(
    system: At,
    forces: ArrayLike,
    *,
    narrowest: float | None = None,
    look: Look = lambda below, above: (),
    first: bool = False,
    known: Known = lambda windows, fx: None,
    limits: Limits = LIMITS,
) -> tuple[Window, ...]:
    """All windows of a one-parameter family of systems, by increasing onset; may be none.

    Parameters
    ----------
    system : callable
        fx -> System, in coordinates that do not depend on the load.
    forces : array_like, shape (S,)
        The increasing loads.
    narrowest : float, optional
        As of :func:`find_onset`.
    look : callable, optional
        Two neighbouring loads -> further loads between them that are to be looked at; they may have no equilibrium.
    first : bool
        Go no farther than the increment in which the first window begins.
    known : callable, optional
        Given all windows so far, and the load up to which they are all, after each increment.

    Raises
    ------
    ValueError
        If the loads are not at least two increasing numbers.
    """
    windows: tuple[Window, ...] = ()
    for fx, windows in windows_up_to(system, forces, narrowest=narrowest, look=look, first=first, limits=limits):
        known(windows, fx)
    return windows


def windows_up_to(
    system: At,
    forces: ArrayLike,
    *,
    narrowest: float | None = None,
    look: Look = lambda below, above: (),
    first: bool = False,
    limits: Limits = LIMITS,
) -> Iterator[tuple[float, tuple[Window, ...]]]:
    """Each load but the smallest as it is reached, and all windows up to there; as of `find_windows`."""
    loads = check_increasing(forces)
    start = system(float(loads[0]))
    unit, last = unit_of(start), float(loads[-1])
    narrowest = limits.narrowest * float(np.abs(loads).max()) if narrowest is None else narrowest
    screen = GrowthScreen(limits) if start.dissipative else PairScreen(limits)

    def in_units(fx: float) -> System:
        return (start if fx == start.fx else system(fx)).in_units_of(unit)

    for fx, found in windows_along(in_units, loads, narrowest, screen, look=look, first=first, limits=limits):
        windows = tuple(window.in_units_of(unit) for window in found)
        so_far = (
            f"; {counted(len(windows), 'window')} so far, the first from {windows[0].fx_onset:.8g}" if windows else ""
        )
        report_progress(f"motion that grows up to F_x = {fx:.6g} of {last:.6g}{so_far}")
        yield fx, windows


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
    return find_windows(lambda fx: System(fx, csr_array(operator(fx))), forces, narrowest=narrowest, limits=limits)


def find_onset(
    equilibrium: Callable[[float], HasConfiguration],
    forces: ArrayLike,
    *,
    dissipation: bool = False,
    narrowest: float | None = None,
    modes: tuple[int, int] | None = None,
    first: bool = False,
    known: Callable[["Onset", float], None] = lambda onset, fx: None,
    watch: Watch | None = None,
    ranks: Ranks = ALONE,
    folder: Path | None = None,
    limits: Limits = LIMITS,
) -> Onset:
    """The windows of growing motion between the smallest and the largest load.

    Without dissipation these are windows of complex eigenvalues.

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
    dissipation : bool
        Whether the packing's own dashpots and drag count. The onset without them is found as well, `Onset.undamped`.
    narrowest : float, optional
        Windows narrower than this are not looked for, force; by default as in `Limits`, `narrowest` and `finest`.
    modes : tuple of (int, int), optional
        Search these modes alone, and for their first window: numbers of the first one and of the first one beyond, by
        frequency, the lowest being 0, of the symmetric part at the load where the search stands. Parts that are
        searched apart, on machines of their own, have together the same first window as all.
    first : bool
        Seek the first window alone. No equilibrium beyond the increment in which it begins is then asked for, and its
        end is None where it ends beyond that increment.
    known : callable, optional
        With dissipation, given what is known, and the load up to which that is all, as soon as there is a window, and
        after each increment from there on.
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
        If no motion grows at any load.
    TurningPointError
        If one is negative before any is complex.
    LostPairError, SliceError
        Of a large packing, if a pair cannot be followed, or a part of the spectrum is not found.
    OutputError, DamagedSliceError
        If a file in the folder cannot be written, or read.
    ValueError
        If the loads are not at least two increasing numbers, the packing has none of the modes, or no
        dissipation that could count.
    """
    loads = check_increasing(forces)
    start = equilibrium(float(loads[0]))
    if dissipation and not start.damped:
        raise ValueError("The packing has no dissipation: find_onset without it is what it needs.")
    takes_all = takes_all_modes(start, modes, limits)

    def search(
        system: At, look: Look = lambda below, above: (), so_far: Known = lambda windows, fx: None
    ) -> tuple[tuple[Window, ...], Increments]:
        """The windows of a family, and increments in doubt."""
        if takes_all:
            found = find_windows(
                system, loads, narrowest=narrowest, look=look, first=first, known=so_far, limits=limits
            )
            return found[:1] if first else found, ()
        from .slices.first_window import first_window  # with libraries that nothing else needs

        one, doubtful = first_window(system, loads, modes, ranks, folder, narrowest or 0.0, limits)
        return (one,) if one else (), doubtful

    def undamped() -> Onset:
        windows, doubtful, all_modes, ends = _undamped_windows(equilibrium, start, loads, modes, first, search, limits)
        if not windows:
            raise OnsetError.among(modes, float(loads[-1]), doubtful)
        if windows[0].kind == "start" and takes_all:
            all_modes = all_modes or spectrum(force_bearing(start))
        complete = takes_all and not first and not windows[0].eigenvalue < 0
        return Onset(windows, complete, doubtful, modes, all_modes if windows[0].kind == "start" else None, ends)

    def beside() -> Onset | None:
        with suppress(OnsetError, NoEquilibriumError):
            return undamped()
        return None

    with show_progress(watch):
        if not dissipation:
            return undamped()

        def damped(fx: float) -> System:
            return System.of(start if fx == loads[0] else equilibrium(fx), True, limits)

        if takes_all:
            report_progress(f"pairs that become complex without dissipation, up to F_x = {loads[-1]:.6g}")
            other = beside()
            inside = _Inside(lambda fx: System.of(equilibrium(fx), limits=limits), loads, other, limits)

            def so_far(windows: tuple[Window, ...], fx: float) -> None:
                if windows and not first:
                    known(Onset(windows, undamped=other), fx)

            windows, doubtful = search(damped, inside.look, so_far)
        else:
            with show_progress(what="with dissipation, "):
                windows, doubtful = search(damped)
            if windows:
                known(Onset(windows, False, doubtful), windows[0].fx_onset)
        if not windows:
            raise OnsetError(f"No motion grows up to F_x = {loads[-1]:.10g}: raise the largest load.")
        if not takes_all:
            with show_progress(what="without dissipation, "):
                other = beside()
        return Onset(windows, takes_all and not first, doubtful, modes, undamped=other)


def _undamped_windows(
    equilibrium: Callable[[float], HasConfiguration],
    start: HasConfiguration,
    loads: Floats,
    modes: tuple[int, int] | None,
    first: bool,
    search: Callable[[At], tuple[tuple[Window, ...], Increments]],
    limits: Limits,
) -> tuple[tuple[Window, ...], Increments, Spectrum | None, float | None]:
    """Windows without dissipation, increments in doubt, the spectrum at the smallest load if that is known, and the
    load before which the branch of equilibria ends."""
    takes_all = takes_all_modes(start, modes, limits)
    negative = negative_eigenvalues(force_bearing(start, limits))
    if len(negative):
        return (_at_start(start, float(negative[0]), 1.0),), (), None, start.fx
    branch = _Branch(equilibrium, start, loads, limits)
    # packings of LAMMPS's own laws have complex pairs at rest as a rule, and no further load is then needed
    if modes is None and (not takes_all or (first and not isinstance(start, Packing))):
        found = _complex_at_start(start, limits)
        if found is not None:
            return (_fastest(start, found),), (), found, None
    try:
        return *search(branch), None, branch.ends
    except NoEquilibriumError:  # beyond the first increment, which the search asks for in any case
        found = _complex_at_start(start, limits) if takes_all else None
        if found is None:
            raise
        return (_fastest(start, found),), (), found, branch.ends


class _Inside:
    """Loads inside the undamped windows of a ramp: growth without dissipation is largest there.

    Where the first window alone is known, the others are sought as far as the ramp is walked.
    """

    def __init__(self, undamped: At, loads: Floats, known: Onset | None, limits: Limits) -> None:
        self._windows: tuple[Window, ...] = () if known is None else known.windows
        self._reached = np.inf
        self._along: Iterator[tuple[float, tuple[Window, ...]]] = iter(())
        if known is not None and not known.complete:
            begin = max(0, int(np.searchsorted(loads, known.fx_c, side="right")) - 1)
            if begin < len(loads) - 1:
                self._reached = float(loads[begin])
                self._along = windows_up_to(undamped, loads[begin:], limits=limits)

    def look(self, below: float, above: float) -> list[float]:
        """Onsets between two neighbouring loads, and of windows that end there the middle of what they have there."""
        if not self._windows or above <= self._windows[0].fx_onset:
            return []
        while self._reached < above:
            try:
                self._reached, self._windows = next(self._along)
            except (StopIteration, NoEquilibriumError):
                self._reached = np.inf
        onsets = [each.fx_onset for each in self._windows if below < each.fx_onset < above]
        ends = [(each.fx_onset, each.fx_end) for each in self._windows if each.fx_end is not None]
        return onsets + [0.5 * (max(begin, below) + end) for begin, end in ends if below < end < above]


class _Branch:
    """The systems of a branch of stable equilibria; it ends where one at a given load has a negative eigenvalue."""

    def __init__(
        self, equilibrium: Callable[[float], HasConfiguration], start: HasConfiguration, loads: Floats, limits: Limits
    ) -> None:
        self._equilibrium, self._start, self._limits = equilibrium, start, limits
        self._first, self._given = float(loads[0]), set(loads[1:].tolist())
        self.ends: float | None = None

    def __call__(self, fx: float) -> System:
        packing = self._start if fx == self._first else self._equilibrium(fx)
        if fx in self._given and len(negative_eigenvalues(force_bearing(packing, self._limits))):
            self.ends = fx if self.ends is None else min(self.ends, fx)
            raise TurningPointError(
                f"no pair of eigenvalues becomes complex before F_x = {fx:.10g}, where one is negative: the branch of "
                "stable equilibria ends before, at a turning point, and the packing leaves it without oscillation"
            )
        return System.of(packing, limits=self._limits)


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
    return Window(Edge(start.fx, 0.0, float(eigenvalue), overlap, "start"), None)


def check_increasing(forces: ArrayLike) -> NDArray[np.float64]:
    """Loads as an array; ValueError if they are not at least two finite, increasing numbers."""
    loads = np.array(forces, dtype=np.float64)
    if loads.ndim != 1 or len(loads) < 2 or not np.all(np.isfinite(loads)) or np.any(np.diff(loads) <= 0):
        raise ValueError("The loads of a ramp must be at least two finite, increasing numbers.")
    return loads
