"""The onset F_x^c of a scene, for each of its friction coefficients."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ..analysis import Onset, OnsetError, Packing, find_onset
from ..pywrap import Engine, Equilibrium, NoEquilibriumError, Scene, SceneError
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
        The last F_x that had an equilibrium, where the ramp ended before its `until`.
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
    reached: Callable[[Equilibrium], None] = lambda _: None,
    near_onset: NDArray[np.float64] | None = None,
) -> OnsetRun:
    """Ramp a scene for one friction coefficient and find the onset.

    Parameters
    ----------
    scene : Scene
        With a section [ramp].
    mu : float
        Friction coefficient.
    communicator : mpi4py.MPI.Comm, optional
        The ranks that share the packing; all by default.
    reached : callable
        Called with each equilibrium of the ramp.
    near_onset : ndarray, optional
        Distances from F_x^c at which equilibria are wanted besides, force.

    Raises
    ------
    SceneError
        If the scene has no section [ramp].
    OnsetError
        If no pair becomes complex up to the ramp's end.
    NoEquilibriumError
        If the packing flows from the first increment on, or before an onset.
    """
    if scene.ramp is None:
        raise SceneError("the scene has no section [ramp]: add it, with step and until")
    wanted = loads(scene.ramp)
    start = settle(scene, mu, communicator)
    reached(start)
    with Engine(start.packing, communicator) as engine:
        path = EquilibriumPath(engine, start, scene)
        for equilibrium in path.climb(wanted[1:]):
            reached(equilibrium)
        forces = np.array([each.fx for each in path.kept])
        try:
            onset = find_onset(path, forces)
        except OnsetError as error:
            if len(forces) == len(wanted):
                raise
            raise NoEquilibriumError(
                f"no pair of eigenvalues becomes complex up to F_x = {forces[-1]:.10g}, and no equilibrium was found "
                f"beyond: the packing flows before an onset"
            ) from error
        extra = [] if near_onset is None else [fx for fx in onset.fx_c + near_onset if 0 <= fx <= forces[-1]]
        between = {float(fx): path(float(fx)) for fx in extra}
    return OnsetRun(mu, tuple(path.kept), onset, float(forces[-1]) if len(forces) < len(wanted) else None, between)
