"""The onset F_x^c of a scene, for each of its friction coefficients."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...analysis import NoEquilibriumError, Onset, OnsetError, Packing, find_onset
from ...analysis.arrays import Floats
from ...analysis.counted import counted
from ...analysis.errors import TurningPointError
from ...analysis.motion.eigenvalues import active_coordinates
from ...analysis.onset import full_operator, takes_all_modes
from ...analysis.onset.search import windows_rows
from ...analysis.progress import Watch, report_progress, show_progress
from ...analysis.table_display import TableDisplay
from ..equilibria.quasistatic import Equilibrium
from ..lammps.engine import Engine
from ..runs.equilibrium_path import EquilibriumPath, loads
from ..scenes.scene import Scene
from ..scenes.validation import SceneError, require_section
from ..settling.settle import settle
from .path_error import with_path_error
from .search_ranks import search_ranks


@dataclass(frozen=True, eq=False)
class OnsetRun(TableDisplay):
    """A ramp and what it shows.

    Attributes
    ----------
    mu : float
        Friction coefficient.
    equilibria : tuple of Equilibrium
        Those of the ramp's increments, by increasing F_x.
    onset : Onset
        Windows of complex eigenvalues, their errors those of rounding and of the path together.
    flows_beyond : float or None
        The last F_x that had an equilibrium, where the packing was found to flow before the ramp's `until`.
    between : dict
        Further equilibria that were asked for, packing by F_x.
    """

    mu: float
    equilibria: tuple[Equilibrium, ...]
    onset: Onset
    flows_beyond: float | None
    between: dict[float, Packing]

    def __repr__(self) -> str:
        return (
            f"<OnsetRun: mu = {self.mu:g}, {self.onset.describe()}, {counted(len(self.onset.windows), 'window')}, "
            f"{counted(len(self.equilibria), 'equilibrium', 'equilibria')} up to F_x = {self.equilibria[-1].fx:g}>"
        )

    def _rows(self) -> dict[str, str]:
        return windows_rows(self.onset.windows)


def onset_run(
    scene: Scene,
    mu: float,
    reached: Callable[[Equilibrium], None] | None = None,
    near_onset: Floats | None = None,
    modes: tuple[int, int] | None = None,
    first: bool = False,
    bed: Packing | None = None,
    watch: Watch | None = None,
    folder: Path | None = None,
) -> OnsetRun:
    """Ramp a scene for one friction coefficient and find the onset.

    The error of each onset is the whole one: that of rounding, and that of the path's increments
    (:mod:`~faultgouge.pywrap.onset.path_error`). The ramp goes to its end, or to where the packing flows. Where the
    first window alone is sought, and nobody else wants the equilibria, it ends there.

    Parameters
    ----------
    scene : Scene
        With a section [ramp].
    mu : float
        Friction coefficient.
    reached : callable, optional
        Called with each equilibrium of the ramp.
    near_onset : ndarray, optional
        Distances from F_x^c at which equilibria are wanted besides, force.
    modes : tuple of (int, int), optional
        Search these modes alone, see :func:`~faultgouge.analysis.find_onset`.
    first : bool
        Seek the first window alone, as of a large packing.
    bed : Packing, optional
        As of :func:`~faultgouge.pywrap.settle`.
    watch : callable, optional
        Told in words what is under way in a large packing.
    folder : Path, optional
        Where the search of a large packing leaves what it finds, and goes on from, see
        :func:`~faultgouge.analysis.find_onset`.

    Raises
    ------
    SceneError
        If the scene has no section [ramp], or the packing has none of the modes.
    OnsetError
        If no pair becomes complex up to the ramp's end.
    NoEquilibriumError
        If the packing flows from the first increment on, or before an onset; a TurningPointError if an eigenvalue is
        negative before any is complex.
    """
    wanted = loads(require_section(scene.ramp, "ramp"))
    with show_progress(watch, "settling: "):
        start = settle(scene, mu, bed=bed)
    _check_modes(start.packing, modes)
    whole = reached is not None or (takes_all_modes(start.packing, modes) and not first)
    reached = reached or (lambda _: None)
    reached(start)
    with show_progress(watch), Engine(start.packing) as engine:
        path = EquilibriumPath(engine, start, scene, onward=True)
        forces = wanted
        if whole:
            report_progress(f"ramp up to F_x = {wanted[-1]:g}")
            for equilibrium in path.climb(wanted[1:]):
                reached(equilibrium)
            forces = np.array([each.fx for each in path.equilibria])
        flows = len(forces) < len(wanted)
        try:
            onset = find_onset(path, forces, modes=modes, first=first, ranks=search_ranks(), folder=folder)
        except TurningPointError:
            raise
        except (OnsetError, NoEquilibriumError) as error:
            if not flows and isinstance(error, OnsetError):
                raise
            reached_load = path.equilibria[-1].fx
            raise NoEquilibriumError(
                f"no pair of eigenvalues becomes complex up to F_x = {reached_load:.10g}, and no equilibrium was found "
                "beyond: the packing flows before an onset"
            ) from error
        last = path.equilibria[-1].fx
        extra = [] if near_onset is None else [fx for fx in onset.fx_c + near_onset if 0 <= fx <= last]
        between = {float(fx): path(float(fx)) for fx in extra}
        report_progress("the path once more, with other increments")
        onset = with_path_error(onset, path)
    return OnsetRun(mu, tuple(path.equilibria), onset, last if flows else None, between)


def _check_modes(packing: Packing, modes: tuple[int, int] | None) -> None:
    """Refuse modes that a packing does not have."""
    if modes is None:
        return
    count = len(active_coordinates(full_operator(packing)))
    if modes[0] >= count:
        raise SceneError(f"modes {modes[0]}:{modes[1]} are no part of the {count} modes of the packing, 0:{count}")
