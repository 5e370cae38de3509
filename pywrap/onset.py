"""The onset F_x^c of a scene, with dissipation or without, and the error that its path of equilibria adds."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from ..analysis import NoEquilibriumError, Onset, OnsetError, Packing, find_onset
from ..analysis.arrays import Floats
from ..analysis.errors import TurningPointError
from ..analysis.progress import Watch, report_progress, show_progress
from ..analysis.windows import NoGrowthError, Ranks, takes_all_modes
from .equilibria.quasistatic import Equilibrium
from .lammps.engine import Engine
from .runs.path_error import with_path_error
from .runs.ramp_loads import ramp_loads
from .runs.scene_path import scene_path
from .scenes.scene import Scene, scene_of
from .scenes.validation import SceneError, require_section
from .settling.settle import settle

_BELOW = -np.geomspace(3e-2, 1e-3, 7)[:-1], -np.geomspace(1e-3, 1e-7, 13), [0.0]
ONSET_DISTANCES = np.concatenate([*_BELOW, np.geomspace(1e-6, 1e-3, 9), np.linspace(0.0, 0.3, 76)[1:]])
"""Distances from an onset at which the pair that merges there shows its curve, in units of the ramp's last F_x. Beyond
the onset the pair turns sharply within one increment."""


def onset(scene: Scene | str | Path, mu: float | None = None, *, every: bool = False) -> Onset:
    """Find the onset of a scene; the ramp and the search end there.

    Parameters
    ----------
    scene : Scene, str or Path
        With a section [ramp], or its file; with a section [damping] the onset is that of growth in spite of the
        dissipation.
    mu : float, optional
        One of its friction coefficients; the first by default.
    every : bool
        Whether all windows up to the end of the ramp are wanted.

    Returns
    -------
    Onset
        `fx_c`, `error`, `windows`; it prints as a line.

    Raises
    ------
    OnsetError
        If the ramp shows no onset.
    NoEquilibriumError
        If the packing does not settle, or flows at the first load.

    Examples
    --------

    >>> found = faultgouge.onset("three_disks.toml")
    >>> print(f"{found.fx_c:.9f}, {found.windows[0].kind}, lambda = {found.windows[0].eigenvalue:.6f}")
    1.935965487, coalescence, lambda = 1536.577122
    >>> found.error < 1e-10
    True
    >>> print(f"{faultgouge.onset('three_disks.toml', mu=0.8).fx_c:.9f}")
    1.672050885
    """
    scene = scene_of(scene, "onset")
    friction = scene.law.mus[0] if mu is None else mu
    return onset_run(scene, friction, dissipation=scene.damping is not None, first=not every)


def onset_run(
    scene: Scene,
    mu: float,
    *,
    dissipation: bool = False,
    first: bool = False,
    reached: Callable[[Equilibrium], None] | None = None,
    near_onset: Floats | None = None,
    bed: Packing | None = None,
    watch: Watch | None = None,
    folder: Path | None = None,
) -> Onset:
    """Ramp a scene for one friction coefficient and find the onset.

    The error of each onset includes the rounding and the increments of the path
    (:mod:`~faultgouge.pywrap.runs.path_error`). The ramp goes to its end, or to the load at which the packing flows. If
    only the first window is sought, and `reached` is not given, the ramp ends with the first window.

    Parameters
    ----------
    scene : Scene
        With a section [ramp].
    mu : float
        Friction coefficient.
    dissipation : bool
        Whether the dashpots and the drag of the section [damping] count; the onset without them is found as well.
    first : bool
        Seek the first window alone, as of a large packing.
    reached : callable, optional
        Called with each equilibrium of the ramp.
    near_onset : ndarray, optional
        Distances from F_x^c, force, at which equilibria are also computed: `between` of the result.
    bed : Packing, optional
        As in :func:`~faultgouge.pywrap.settle`.
    watch : callable, optional
        Told in words what is under way.
    folder : Path, optional
        Folder in which the search of a large packing stores its slices, and from which the search continues, see
        :func:`~faultgouge.analysis.find_onset`.

    Raises
    ------
    SceneError
        If the scene has no section [ramp].
    OnsetError
        If no motion grows up to the ramp's end; a NoGrowthError, if there is an onset without dissipation.
    NoEquilibriumError
        If the packing flows from the first increment on, or before an onset; a TurningPointError if an eigenvalue is
        negative before any is complex.
    """
    wanted, damping = ramp_loads(scene), require_section(scene.damping, "damping") if dissipation else None
    scene = scene.model_copy(update={"damping": None})
    with show_progress(watch, "settling: "):
        start = settle(scene, mu, bed=bed)
    if reached is not None:
        reached(start)

    def with_dashpots(packing: Packing) -> Packing:
        return packing.with_dissipation(damping.cn, damping.ct, damping.tau) if damping else packing

    with show_progress(watch), Engine(start.packing) as engine:
        path, forces = scene_path(engine, start, scene, onward=True), wanted
        if reached is not None or (takes_all_modes(start.packing) and not first):
            report_progress(f"ramp up to F_x = {wanted[-1]:g}")
            for equilibrium in path.climb(wanted[1:]):
                if reached is not None:
                    reached(equilibrium)
            forces = np.array([each.fx for each in path.equilibria])
        flows = len(forces) < len(wanted)
        options: dict[str, Any] = {"dissipation": dissipation, "first": first, "folder": folder}
        try:
            found = find_onset(lambda fx: with_dashpots(path(fx)), forces, ranks=search_ranks(), **options)
        except TurningPointError:
            raise
        except (OnsetError, NoEquilibriumError) as error:  # as the user of a scene reads it
            undamped = getattr(error, "undamped", None)
            damped_alone: dict[str, Any] = {"undamped": with_path_error(undamped, path)} if undamped else {}
            if isinstance(error, OnsetError) and not flows:
                failure: Any = NoGrowthError if undamped else OnsetError
                raise failure(error.finding, "raise ramp.until", error.finer, **damped_alone) from error
            what = "no motion grows" if dissipation else "no pair of eigenvalues becomes complex"
            finding = f"{what} up to F_x = {path.equilibria[-1].fx:.10g}, and no equilibrium was found beyond"
            finding += ": the packing flows before an onset"
            raise (NoGrowthError if undamped else NoEquilibriumError)(finding, **damped_alone) from error
        equilibria, near = tuple(path.equilibria), [] if near_onset is None else (found.fx_c + near_onset).tolist()
        between = {fx: path(fx) for fx in near if 0 <= fx <= equilibria[-1].fx}
        report_progress("the path once more, with other increments")
        found = with_path_error(found, path, with_dashpots)
    beyond = equilibria[-1].fx if flows else None
    return replace(found, mu=mu, equilibria=equilibria, between=between, flows_beyond=beyond)


def search_ranks() -> Ranks:
    """All ranks take part in one search; the ranks of a machine share its cores evenly. Collective."""
    world = MPI.COMM_WORLD
    own = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else list(range(os.cpu_count() or 1))
    mine = MPI.Get_processor_name(), own
    beside = world.allgather(mine).count(mine)  # a launcher that binds ranks to cores leaves each its own
    return Ranks(world.rank, world.size, world.allgather, max(1, len(own) // beside)) if world.size > 1 else Ranks()


def load_at_onset(scene: Scene, known: dict[float, Onset] | None = None) -> float:
    """F_x for the undamped run of a scene without perturb.fx, force.

    A run that shows growth begins a little beyond the onset: one increment of the ramp, or in the middle of a window
    that is narrower. With friction that weakens, a run shows triggering between two onsets: the packing is stable with
    the static friction, and unstable with the weakened one. The run then begins in the middle between the two.

    `known` has onsets of the scene that have been found already, by friction coefficient. Raises SceneError if the
    scene has no section [ramp], or the weakened friction has no earlier onset, and OnsetError if no pair becomes
    complex up to the ramp's end.
    """
    ramp, mu = require_section(scene.ramp, "ramp"), scene.law.mus[0]

    def onset_for(wanted: float) -> Onset:
        near = [found for each, found in (known or {}).items() if abs(each - wanted) < 1e-12 * wanted]  # of a product
        return near[0] if near else onset_run(scene, wanted, first=True)

    first = onset_for(mu).windows[0]
    if scene.friction is None:
        end = ramp.first if first.fx_end is None else first.fx_end
        return min(first.fx_onset + ramp.step, 0.5 * (first.fx_onset + end))
    weakened = onset_for(mu * scene.friction.mu_ss).fx_c
    if weakened < first.fx_onset:
        return 0.5 * (weakened + first.fx_onset)
    two = f"F_x^c = {weakened:.6g} with the weakened friction does not lie below F_x^c = {first.fx_onset:.6g}"
    raise SceneError(f"perturb.fx is missing, and there is no load between two onsets: {two}. Give perturb.fx")
