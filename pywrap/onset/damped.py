"""The onset of a scene with dissipation, and the undamped onset (:mod:`~faultgouge.analysis.damped_onset.windows`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from ...analysis import NoEquilibriumError, Onset, OnsetError, Packing, Window, find_onset
from ...analysis.arrays import Floats
from ...analysis.damped_onset.first_window import first_growing
from ...analysis.damped_onset.modes import Pencil
from ...analysis.damped_onset.windows import (
    DampedOnsetError,
    DampedWindow,
    damped_windows,
    growing_windows,
    with_dissipation,
    without_dissipation,
)
from ...analysis.onset import LIMITS, Family, Increments, full_operator, takes_all_modes
from ...analysis.onset.all_windows import windows_along
from ...analysis.onset.modes import contact_states
from ...analysis.onset.search import unit_of
from ...analysis.progress import Watch, report_progress, show_progress
from ...analysis.uncertain_digits import with_uncertainty
from ..equilibria.quasistatic import Equilibrium
from ..lammps.engine import Engine
from ..runs.equilibrium_path import EquilibriumPath, loads
from ..scenes.scene import Scene
from ..scenes.validation import require_section
from ..settling.settle import settle
from .path_error import with_damped_path_error, with_path_error
from .search_ranks import search_ranks

FEW = 3
"""Increments that are searched at once where the first window alone is asked for."""


@dataclass(frozen=True, eq=False)
class DampedOnset:
    """Windows with dissipation, and the onset without.

    Attributes
    ----------
    mu : float
        Friction coefficient.
    windows : tuple of DampedWindow
        By increasing onset; at least one.
    undamped : Onset or None
        Without dissipation; None if no pair becomes complex on the same loads.
    flows_beyond : float or None
        The last F_x that had an equilibrium, where the packing flows before the ramp's end.
    doubtful : tuple of (float, float)
        Of a large packing, increments before the onset in which motion was expected to grow and was not seen to.
    equilibria : tuple of Equilibrium
        Of the ramp, without dissipation, by increasing F_x; none of a result that is under way.
    """

    mu: float
    windows: tuple[DampedWindow, ...]
    undamped: Onset | None
    flows_beyond: float | None
    doubtful: Increments = ()
    equilibria: tuple[Equilibrium, ...] = ()

    @property
    def fx_c(self) -> float:
        """The damped onset, force per top disk."""
        return self.windows[0].fx_onset

    @property
    def error(self) -> float:
        """Its uncertainty."""
        return self.windows[0].error

    def __str__(self) -> str:
        return f"F_x^c = {with_uncertainty(self.fx_c, self.error)}"

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON."""
        undamped = self.undamped
        return {
            "fx_c": self.fx_c,
            "error": self.error,
            "error_of_path": self.windows[0].path_error,
            "windows": [window.as_dict() for window in self.windows],
            "undamped": None if undamped is None else {"fx_c": undamped.fx_c, "error": undamped.error},
            "doubtful": [list(increment) for increment in self.doubtful],
            "flows_beyond": self.flows_beyond,
        }


@dataclass(frozen=True, eq=False)
class RampPath:
    """A ramp, and the equilibria between its loads.

    Attributes
    ----------
    path : EquilibriumPath
        fx -> Packing, without dissipation.
    forces : ndarray
        The loads of the ramp, of a packing whose windows are all sought those that have an equilibrium.
    all_modes : bool
        Whether all modes can be searched.
    whole : bool
        Whether these are solved for; else they are as they are asked for.
    flows : bool
        Whether the packing flows before the ramp's end, as far as that is known.
    """

    path: EquilibriumPath
    forces: Floats
    all_modes: bool
    whole: bool
    flows: bool

    def undamped(self, folder: Path | None = None) -> Onset | None:
        """All windows without dissipation, or the first one of a ramp that is not whole; None if there is none."""
        path, first = without_dissipation(self.path), not self.whole
        try:
            return find_onset(path, self.forces, first=first, ranks=search_ranks(), folder=folder)
        except (OnsetError, NoEquilibriumError):
            return None

    def first_window(self) -> Window | None:
        """The first window without dissipation, as far as a few increments show it; None if there is none."""
        for k in range(0, len(self.forces) - 1, FEW):
            try:
                return find_onset(without_dissipation(self.path), self.forces[k : k + FEW + 1]).windows[0]
            except OnsetError:
                continue
        return None


@contextmanager
def ramp_scene(
    scene: Scene,
    mu: float | None = None,
    first: bool = False,
    bed: Packing | None = None,
) -> Iterator[RampPath]:
    """Ramp a scene to its end, or to where the packing flows; its equilibria have no dissipation.

    The ramp of a packing of which the `first` window alone is sought goes as far as somebody asks for equilibria; so
    does that of every packing of more than `Limits.all_windows` disks. `bed` is as of `settle`.

    Raises
    ------
    SceneError
        If the scene has no section [ramp].
    NoEquilibriumError
        If the packing flows from the first increment on.
    """
    wanted = loads(require_section(scene.ramp, "ramp"))
    scene = scene.model_copy(update={"damping": None})
    with show_progress(what="settling: "):
        start = settle(scene, mu, bed=bed)
    with Engine(start.packing) as engine:
        path = EquilibriumPath(engine, start, scene, onward=True)
        forces, all_modes = wanted, takes_all_modes(start.packing)
        whole = all_modes and not first
        if whole:
            report_progress(f"ramp up to F_x = {wanted[-1]:g}")
            for _ in path.climb(wanted[1:]):
                pass
            forces = np.array([each.fx for each in path.equilibria])
        yield RampPath(path, forces, all_modes, whole, len(forces) < len(wanted))


Dissipation = Callable[[Packing], Packing]
"""A packing -> the same with its dashpots and drag."""

Known = Callable[[DampedOnset, float], None]
"""As of `damped_onset_run`."""


def damped_onset_run(
    scene: Scene,
    mu: float,
    watch: Watch | None = None,
    known: Known = lambda found, fx: None,
    folder: Path | None = None,
    first: bool = False,
    bed: Packing | None = None,
) -> DampedOnset:
    """The windows of growing motion of a scene for one friction coefficient, and its undamped onset.

    Of a packing of more than `Limits.all_windows` disks these are the first window of either kind, as of every packing
    if the `first` alone is asked for.

    Parameters
    ----------
    scene : Scene
        With sections [ramp] and [damping].
    mu : float
        Friction coefficient.
    watch : callable, optional
        Told in words what is under way.
    known : callable, optional
        Given what is known, without the errors of the path, and the load up to which that is all, as soon as there is a
        window and after each increment from there on.
    folder : Path, optional
        Where the search of a large packing leaves what it finds, and goes on from, see
        :func:`~faultgouge.analysis.find_onset`.
    first : bool
        Seek the first window of either kind alone; equilibria beyond both are not solved for.
    bed : Packing, optional
        As of :func:`~faultgouge.pywrap.settle`.

    Raises
    ------
    SceneError, NoEquilibriumError
        As of `ramp_scene`; the latter also if the packing flows before an onset.
    DampedOnsetError
        If no motion grows up to the ramp's end.
    """
    damping = require_section(scene.damping, "damping")
    dissipation = partial(with_dissipation, cn=damping.cn, ct=damping.ct, drag_time=damping.tau)
    with show_progress(watch), ramp_scene(scene, mu, first, bed) as ramp:
        if ramp.whole:
            found = _all_windows(ramp, mu, dissipation, known)
        elif ramp.all_modes:
            found = _first_of_all_modes(ramp, mu, dissipation)
        else:
            found = _first_in_slices(ramp, mu, dissipation, known, folder)
        equilibria = tuple(ramp.path.equilibria)
        report_progress("the path once more, with other increments")
        undamped = None if found.undamped is None else with_path_error(found.undamped, ramp.path)
        windows = with_damped_path_error(found.windows, dissipation, ramp.path)
        return replace(found, windows=windows, undamped=undamped, equilibria=equilibria)


def _all_windows(ramp: RampPath, mu: float, dissipation: Dissipation, known: Known) -> DampedOnset:
    """All windows of a ramp that is solved for, without the errors of the path."""
    report_progress(f"pairs that become complex without dissipation, up to F_x = {ramp.forces[-1]:.6g}")
    undamped = ramp.undamped()

    def so_far(windows: tuple[DampedWindow, ...], fx: float) -> None:
        if windows:
            known(DampedOnset(mu, windows, undamped, None), fx)

    look = () if undamped is None else loads_inside(undamped.windows)
    found = damped_windows(lambda fx: dissipation(ramp.path(fx)), ramp.forces, look=look, known=so_far)
    last = float(ramp.forces[-1])
    if not found:
        raise _nothing_grows(last, ramp.flows)
    return DampedOnset(mu, found, undamped, last if ramp.flows else None)


def _first_of_all_modes(ramp: RampPath, mu: float, dissipation: Dissipation) -> DampedOnset:
    """The first window of either kind of a packing whose modes are all searched, without the errors of the path."""
    report_progress("the first pair that becomes complex without dissipation")
    undamped = ramp.undamped()
    beneath = Undamped(ramp, np.inf if undamped is None else undamped.fx_c)

    def pencil(fx: float) -> Pencil:
        return Pencil.of(dissipation(ramp.path(fx)))

    try:
        found = growing_windows(pencil, ramp.forces, beneath.look, first=True)
    except NoEquilibriumError as error:
        raise _nothing_grows(ramp.path.equilibria[-1].fx, True) from error
    if not found:
        raise _nothing_grows(float(ramp.forces[-1]), False)
    return DampedOnset(mu, found[:1], undamped, None)


class Undamped:
    """The undamped windows of a ramp as far as it has been walked: where growth without dissipation is largest.

    Parameters
    ----------
    ramp : RampPath
        Of a packing whose modes are all searched.
    first : float
        The first undamped onset, force; infinite if there is none.
    """

    def __init__(self, ramp: RampPath, first: float) -> None:
        loads = ramp.forces
        begin = int(np.searchsorted(loads, first, side="right")) - 1
        narrowest = LIMITS.narrowest * float(np.abs(loads).max())
        states: dict[float, bytes] = {}
        unit = unit_of(full_operator(ramp.path(float(loads[max(begin, 0)]))))

        def operator(fx: float) -> csr_array:
            packing = ramp.path(fx)
            states[fx] = contact_states(packing)
            return full_operator(packing) / unit

        family = Family(operator, narrowest, states=states.__getitem__)
        self._along = iter(windows_along(family, loads[begin:])) if first < loads[-1] else iter(())
        self._first, self._reached = first, float(loads[max(begin, 0)])
        self._windows: tuple[Window, ...] = ()

    def look(self, below: float, above: float) -> list[float]:
        """Onsets between two neighbouring loads, and of windows that end there the middle of what they have there."""
        if above <= self._first:
            return []
        while self._reached < above:
            try:
                self._reached, self._windows = next(self._along)
            except (StopIteration, NoEquilibriumError):
                self._reached = np.inf
        onsets = [each.fx_onset for each in self._windows if below < each.fx_onset < above]
        ends = [each for each in self._windows if each.fx_end is not None and below < each.fx_end < above]
        return onsets + [0.5 * (max(each.fx_onset, below) + each.fx_end) for each in ends if each.fx_end is not None]


def _first_in_slices(
    ramp: RampPath, mu: float, dissipation: Dissipation, known: Known, folder: Path | None
) -> DampedOnset:
    """The first window of either kind of a large packing, without the errors of the path; all ranks search."""

    def pencil(fx: float) -> Pencil:
        return Pencil.of(dissipation(ramp.path(fx)))

    try:
        with show_progress(what="with dissipation, "):
            first, doubtful = first_growing(pencil, ramp.forces, search_ranks(), folder)
    except NoEquilibriumError as error:
        raise _nothing_grows(ramp.path.equilibria[-1].fx, True) from error
    if first is None:
        raise _nothing_grows(float(ramp.forces[-1]), False)
    found = DampedOnset(mu, (first,), None, None, doubtful)
    known(found, first.fx_onset)
    with show_progress(what="without dissipation, "):
        return replace(found, undamped=ramp.undamped(folder))


def _nothing_grows(last: float, flows: bool) -> DampedOnsetError | NoEquilibriumError:
    """What is said of a ramp on which no motion grows."""
    if flows:
        return NoEquilibriumError(
            f"no motion grows up to F_x = {last:.10g}, and no equilibrium was found beyond: the packing flows before "
            "an onset"
        )
    return DampedOnsetError(f"No motion grows up to F_x = {last:.10g}: raise ramp.until.")


def loads_inside(windows: Iterable[Window]) -> list[float]:
    """The onsets of undamped windows, and the middles of those that end: growth is largest there."""
    ends = [0.5 * (each.fx_onset + each.fx_end) for each in windows if each.fx_end is not None]
    return [each.fx_onset for each in windows] + ends
