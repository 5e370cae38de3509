"""The onset F_x^c of a scene, for each of its friction coefficients."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ..analysis import Onset, OnsetError, Packing, find_onset
from ..analysis.modes import full_operator
from ..analysis.onset import seeks_all
from ..pywrap import Engine, Equilibrium, NoEquilibriumError, Scene, SceneError
from ..pywrap.settling import Watch
from ..pywrap.stages import EquilibriumPath, loads, settle


@dataclass(frozen=True, eq=False)
class OnsetRun:
    """A ramp and what it shows.

    Attributes
    ----------
    mu : float
        Friction coefficient.
    equilibria : tuple of Equilibrium
        Those of the ramp's increments, by increasing F_x.
    onset : Onset
        Windows of complex eigenvalues.
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


def onset_run(
    scene: Scene,
    mu: float,
    communicator: MPI.Comm | None = None,
    reached: Callable[[Equilibrium], None] | None = None,
    near_onset: NDArray[np.float64] | None = None,
    modes: tuple[int, int] | None = None,
    watch: Watch = lambda says: None,
) -> OnsetRun:
    """Ramp a scene for one friction coefficient and find the onset.

    The ramp goes to its end, or to where the packing flows. Where the first onset alone is sought, and nobody else
    wants the equilibria, it ends there.

    Parameters
    ----------
    scene : Scene
        With a section [ramp].
    mu : float
        Friction coefficient.
    communicator : mpi4py.MPI.Comm, optional
        The ranks that share the packing; all by default.
    reached : callable, optional
        Called with each equilibrium of the ramp.
    near_onset : ndarray, optional
        Distances from F_x^c at which equilibria are wanted besides, force.
    modes : tuple of (int, int), optional
        Search these modes alone, see :func:`~faultgouge.analysis.find_onset`.
    watch : callable, optional
        Told in words what is under way in a large packing.

    Raises
    ------
    SceneError
        If the scene has no section [ramp], or the packing has none of the modes.
    OnsetError
        If no pair becomes complex up to the ramp's end.
    NoEquilibriumError
        If the packing flows from the first increment on, or before an onset.
    """
    if scene.ramp is None:
        raise SceneError("the scene has no section [ramp]: add it, with step and until")
    wanted = loads(scene.ramp)
    start = settle(scene, mu, communicator, watch=lambda what: watch(f"settling: {what}"))
    if modes is not None:
        count = np.count_nonzero(np.diff(full_operator(start.packing).indptr))
        if modes[0] >= count:
            raise SceneError(f"modes {modes[0]}:{modes[1]} are no part of the {count} modes of the packing, 0:{count}")
    whole = reached is not None or seeks_all(start.packing, modes)
    reached = reached or (lambda _: None)
    reached(start)
    with Engine(start.packing, communicator) as engine:
        path = EquilibriumPath(engine, start, scene)
        forces = wanted
        if whole:
            watch(f"ramp up to F_x = {wanted[-1]:g}")
            for equilibrium in path.climb(wanted[1:]):
                reached(equilibrium)
            forces = np.array([each.fx for each in path.kept])
        flows = len(forces) < len(wanted)
        try:
            onset = find_onset(path, forces, modes=modes, watch=watch)
        except (OnsetError, NoEquilibriumError) as error:
            if not flows and isinstance(error, OnsetError):
                raise
            raise NoEquilibriumError(
                f"no pair of eigenvalues becomes complex up to F_x = {path.kept[-1].fx:.10g}, and no equilibrium was "
                "found beyond: the packing flows before an onset"
            ) from error
        last = path.kept[-1].fx
        extra = [] if near_onset is None else [fx for fx in onset.fx_c + near_onset if 0 <= fx <= last]
        between = {float(fx): path(float(fx)) for fx in extra}
    return OnsetRun(mu, tuple(path.kept), onset, last if flows else None, between)
