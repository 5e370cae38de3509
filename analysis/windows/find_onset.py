"""The search for the onset of a packing along a ramp: with dissipation or without, all windows or the first."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from ..arrays import Floats
from ..errors import NoEquilibriumError, TurningPointError
from ..has_configuration import HasConfiguration
from ..motion.buckling import negative_eigenvalues, surely_positive
from ..motion.spectrum import Spectrum, spectrum
from ..packing.packing import Packing
from ..progress import Watch, report_progress, show_progress
from .edges import Edge, Increments, Window
from .find_windows import WindowsSoFar, check_increasing, find_windows, windows_up_to
from .limits import LIMITS, Limits
from .onset import RAISE_LOAD, NoGrowthError, Onset, OnsetError
from .ranks import ALONE, Ranks
from .search import Look, SystemOfLoad
from .states import Motions
from .system import System, force_bearing, full_operator

LAPACK_COORDINATES = 5000
"""Coordinates up to which all eigenvalues at the first load are asked for: half a minute, and as their cube."""


def takes_all_modes(packing: HasConfiguration, modes: tuple[int, int] | None = None, limits: Limits = LIMITS) -> bool:
    """Whether a packing is small enough for all of its modes to be searched, and for all windows to be found."""
    return modes is None and packing.coordinates <= 3 * limits.all_windows


def find_onset(
    equilibrium: Callable[[float], HasConfiguration],
    forces: ArrayLike,
    *,
    dissipation: bool = False,
    modes: tuple[int, int] | None = None,
    first: bool = False,
    known: Callable[[Onset, float], None] = lambda onset, fx: None,
    watch: Watch | None = None,
    ranks: Ranks = ALONE,
    folder: Path | None = None,
    limits: Limits = LIMITS,
) -> Onset:
    """Find the windows of growing motion between the smallest and the largest load.

    Without dissipation these are windows of complex eigenvalues. In a packing of up to `Limits.all_windows` disks all
    windows are found, unless only the first is asked for; in a larger packing only the first is found. The search ends
    with the branch of equilibria: a negative eigenvalue at one of the given loads shows a static instability before
    this load.

    Parameters
    ----------
    equilibrium : callable
        fx -> Packing or Configuration in equilibrium. The search calls it with the given loads in increasing order;
        between the calls for two loads a and b it asks for loads between a and b, in any order. At a load in between
        `equilibrium` may raise a NoEquilibriumError, and the search leaves this load out. All other errors reach the
        caller.
    forces : array_like, shape (S,)
        The increasing loads of the ramp, force per top disk.
    dissipation : bool
        Whether the packing's own dashpots and drag count. The onset without dissipation is then also found:
        `Onset.undamped`.
    modes : tuple of (int, int), optional
        Search only these modes, and only for their first window. The two numbers are those of the first mode and of the
        first mode beyond, by frequency from 0, of the symmetric part at the load of the search. Searches of several
        parts, on several machines, together find the first window of all modes.
    first : bool
        Seek only the first window. No equilibrium beyond the increment in which it begins is then asked for. The end of
        the window is None if it lies beyond this increment.
    known : callable, optional
        Of a search with dissipation: called with the onset so far, and the load up to which it is complete, as soon as
        there is a window, and after each increment from there on.
    watch : callable, optional
        Told in words which part of a large packing is being searched.
    ranks : Ranks, optional
        The processes that search a large packing together. Each makes the same call, and gets the same equilibria.
    folder : Path, optional
        Folder in which a search stores its results, slice by slice, if its bases are too large for memory. A search of
        the same loads, operators and modes continues from there, to the bit. All ranks write to the folder.

    Returns
    -------
    Onset

    Raises
    ------
    OnsetError
        If no motion grows at any load; with dissipation a NoGrowthError, which has the onset without dissipation.
    TurningPointError
        If an eigenvalue is negative before any is complex.
    LostPairError, SliceError
        Of a large packing, if a pair cannot be followed, or a part of the spectrum is not found.
    OutputError, DamagedSliceError
        If a file in the folder cannot be written, or read.
    ValueError
        If the loads are not at least two increasing numbers, if the packing has none of the modes, or if it has no
        dissipation although `dissipation` is set.
    """
    loads = check_increasing(forces)
    start = equilibrium(float(loads[0]))
    if dissipation and not start.damped:
        raise ValueError("The packing has no dissipation: call find_onset without dissipation=True.")
    search = _OnsetSearch(equilibrium, start, loads, modes, first, ranks, folder, limits, _kept_undamped())
    with show_progress(watch):
        if not dissipation:
            return search.undamped_onset()
        return search.damped_onset(known) if search.takes_all else search.damped_onset_in_slices(known)


@dataclass(frozen=True, eq=False)
class _OnsetSearch:
    """A search: the parameters of `find_onset`, and the packing at the smallest load."""

    equilibrium: Callable[[float], HasConfiguration]
    start: HasConfiguration
    loads: Floats
    modes: tuple[int, int] | None
    first: bool
    ranks: Ranks
    folder: Path | None
    limits: Limits
    decompose: Callable[[System], Motions]

    @property
    def takes_all(self) -> bool:
        """Whether all modes are searched, and all windows can be found."""
        return takes_all_modes(self.start, self.modes, self.limits)

    def undamped(self, fx: float) -> System:
        """The system at a load, without dissipation."""
        return System.of(self.equilibrium(fx))

    def damped(self, fx: float) -> System:
        """The system at a load, with dissipation."""
        packing = self.start if fx == self.loads[0] else self.equilibrium(fx)
        return System.of(packing, True)

    def windows_of(
        self, system: SystemOfLoad, look: Look = lambda below, above: (), known: WindowsSoFar = lambda windows, fx: None
    ) -> tuple[tuple[Window, ...], Increments]:
        """The windows of a family of systems, and increments in doubt."""
        if self.takes_all:
            found = find_windows(
                system,
                self.loads,
                look=look,
                first=self.first,
                known=known,
                decompose=self.decompose,
            )
            return found[:1] if self.first else found, ()
        from .sliced_search import SlicedSearch  # with libraries that nothing else needs

        search = SlicedSearch(system, self.modes, self.ranks, self.folder, self.limits)
        one, doubtful = search.first_window(self.loads)
        return (one,) if one else (), doubtful

    def undamped_onset(self) -> Onset:
        """The onset without dissipation."""
        windows, doubtful, at_start, ends = self._undamped_windows()
        if not windows:
            raise OnsetError.among(self.modes, float(self.loads[-1]), doubtful)
        opens = windows[0].kind == "start"
        if opens and at_start is None and self.modes is None:
            at_start = spectrum(force_bearing(self.start)) if self.takes_all else _complex_at_start(self.start)
            if at_start is not None and at_start.pairs and not self.takes_all and windows[0].eigenvalue >= 0:
                windows = (_fastest(self.start, at_start),)
        complete = self.takes_all and not self.first and not windows[0].eigenvalue < 0
        return Onset(windows, complete, doubtful, self.modes, at_start if opens else None, ends)

    def undamped_onset_or_none(self) -> Onset | None:
        """The onset without dissipation, beside a search with dissipation; None if there is no such onset."""
        with suppress(OnsetError, NoEquilibriumError):
            return self.undamped_onset()
        return None

    def damped_onset(self, known: Callable[[Onset, float], None]) -> Onset:
        """The onset with dissipation among all modes: growth is looked for inside of the undamped windows, too."""
        report_progress(f"pairs that become complex without dissipation, up to F_x = {self.loads[-1]:.6g}")
        undamped = self.undamped_onset_or_none()
        inside = _Inside(self.undamped, self.loads, undamped)

        def known_windows(windows: tuple[Window, ...], fx: float) -> None:
            if windows and not self.first:
                known(Onset(windows, undamped=undamped), fx)

        windows, doubtful = self.windows_of(self.damped, inside.look, known_windows)
        self._check_growth(windows, undamped)
        return Onset(windows, not self.first, doubtful, self.modes, undamped=undamped)

    def damped_onset_in_slices(self, known: Callable[[Onset, float], None]) -> Onset:
        """The first onset with dissipation of a large packing."""
        with show_progress(what="with dissipation, "):
            windows, doubtful = self.windows_of(self.damped)
        if windows:
            known(Onset(windows, False, doubtful), windows[0].fx_onset)
        with show_progress(what="without dissipation, "):
            undamped = self.undamped_onset_or_none()
        self._check_growth(windows, undamped)
        return Onset(windows, False, doubtful, self.modes, undamped=undamped)

    def _check_growth(self, windows: tuple[Window, ...], undamped: Onset | None) -> None:
        if not windows:
            finding = f"No motion grows up to F_x = {self.loads[-1]:.10g}"
            raise NoGrowthError(finding, RAISE_LOAD, undamped=undamped)

    def _undamped_windows(self) -> tuple[tuple[Window, ...], Increments, Spectrum | None, float | None]:
        """Windows without dissipation, increments in doubt, the spectrum at the smallest load if that is known, and the
        load before which the branch of equilibria ends."""
        start = self.start
        negative = negative_eigenvalues(force_bearing(start))
        if len(negative):
            return (_at_start(start, float(negative[0]), 1.0),), (), None, start.fx
        branch = _Branch(self.equilibrium, start, self.loads)
        # packings of LAMMPS's own laws have complex pairs at rest as a rule, and no further load is then needed
        if self.modes is None and (self.first or not self.takes_all) and not isinstance(start, Packing):
            found = _complex_at_start(start)
            if found is not None:
                return (_fastest(start, found),), (), found, None
        try:
            return *self.windows_of(branch), None, branch.ends
        except NoEquilibriumError:  # beyond the first increment, which the search asks for in any case
            found = _complex_at_start(start) if self.modes is None else None
            if found is None:
                raise
            return (_fastest(start, found),), (), found, branch.ends


def _kept_undamped() -> Callable[[System], Motions]:
    """All motions of a system; those without dissipation are kept for the search with it, which begins with them."""
    known: dict[float, Motions] = {}

    def decompose(system: System) -> Motions:
        found = known.get(system.fx)
        if system.dissipative or found is None:
            found = Motions.of(system)
            if not system.dissipative and 16 * found.right.size * (len(known) + 1) < 2e8:  # bytes
                known[system.fx] = found
        return found

    return decompose


class _Inside:
    """Loads inside the undamped windows of a ramp: growth without dissipation is largest there.

    Where the first window alone is known, the others are sought as far as the ramp is walked.
    """

    def __init__(self, undamped: SystemOfLoad, loads: Floats, known: Onset | None) -> None:
        self._windows: tuple[Window, ...] = () if known is None else known.windows
        self._reached = np.inf
        self._along: Iterator[tuple[float, tuple[Window, ...]]] = iter(())
        if known is not None and not known.complete:
            begin = max(0, int(np.searchsorted(loads, known.fx_c, side="right")) - 1)
            if begin < len(loads) - 1:
                self._reached = float(loads[begin])
                self._along = windows_up_to(undamped, loads[begin:])

    def look(self, below: float, above: float) -> list[float]:
        """Loads between two loads at which to look: the onsets, and the middles of the windows that end in between."""
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
        self, equilibrium: Callable[[float], HasConfiguration], start: HasConfiguration, loads: Floats
    ) -> None:
        self._equilibrium, self._start = equilibrium, start
        self._first, self._given = float(loads[0]), set(loads[1:].tolist())
        self.ends: float | None = None

    def __call__(self, fx: float) -> System:
        packing = self._start if fx == self._first else self._equilibrium(fx)
        system = System.of(packing)
        if fx in self._given and self._buckles(packing, system):
            self.ends = fx if self.ends is None else min(self.ends, fx)
            raise TurningPointError(
                f"no pair of eigenvalues becomes complex before F_x = {fx:.10g}, where one is negative: the branch of "
                "stable equilibria ends before, at a turning point, and the packing leaves it without oscillation"
            )
        return system

    def _buckles(self, packing: HasConfiguration, system: System) -> bool:
        """Whether an eigenvalue is negative."""
        return not surely_positive(system.stiffness) and bool(len(negative_eigenvalues(force_bearing(packing))))


def _complex_at_start(start: HasConfiguration) -> Spectrum | None:
    """The spectrum of a packing at the smallest load, if it has a complex pair.

    None if it has none, or if the packing is too large for all eigenvalues to be asked for. Of a symmetric operator,
    as without tangential forces, nothing is computed.
    """
    if start.coordinates > LAPACK_COORDINATES or _symmetric(full_operator(start)):
        return None
    found = spectrum(force_bearing(start))
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
