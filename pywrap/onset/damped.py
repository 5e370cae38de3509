"""The onset with dissipation of a scene, beside the undamped one (:mod:`~faultgouge.analysis.damped_onset.windows`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...analysis import NoEquilibriumError, Onset, OnsetError, Window, find_onset
from ...analysis.damped_onset.windows import DampedOnsetError, DampedWindow, damped_windows, dissipating, dissipative
from ..lammps.engine import Engine
from ..runs.path import EquilibriumPath, loads
from ..scenes.refusals import SceneError
from ..scenes.scene import Scene
from ..settling.bed import settle
from .path_error import with_damped_path_error, with_path_error

MOST_DISKS = 300
"""Disks up to which all damped modes are computed at a load: 15 s there, and it grows with the cube."""


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
    """

    mu: float
    windows: tuple[DampedWindow, ...]
    undamped: Onset | None
    flows_beyond: float | None

    @property
    def fx_c(self) -> float:
        """The damped onset, force per top disk."""
        return self.windows[0].fx_onset

    @property
    def error(self) -> float:
        """Its uncertainty."""
        return self.windows[0].error

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON."""
        undamped = self.undamped
        return {
            "fx_c": self.fx_c,
            "error": self.error,
            "error_of_path": self.windows[0].path_error,
            "windows": [window.as_dict() for window in self.windows],
            "undamped": None if undamped is None else {"fx_c": undamped.fx_c, "error": undamped.error},
            "flows_beyond": self.flows_beyond,
        }


@dataclass(frozen=True, eq=False)
class Ramped:
    """A ramp, and the equilibria between its loads.

    Attributes
    ----------
    engine : Engine
        LAMMPS with the packing.
    scene : Scene
        Of the ramp, without dissipation.
    path : EquilibriumPath
        fx -> Packing.
    forces : ndarray
        The loads of the ramp that have an equilibrium.
    flows : bool
        Whether the packing flows before the ramp's end.
    """

    engine: Engine
    scene: Scene
    path: EquilibriumPath
    forces: NDArray[np.float64]
    flows: bool

    def undamped(self) -> Onset | None:
        """All windows without dissipation; None if there is none."""
        try:
            return find_onset(dissipating(self.path), self.forces)
        except OnsetError:
            return None

    def first_window(self) -> Window | None:
        """The first window without dissipation, as far as a few increments show it; None if there is none."""
        for k in range(0, len(self.forces) - 1, FEW):
            try:
                return find_onset(dissipating(self.path), self.forces[k : k + FEW + 1]).windows[0]
            except OnsetError:
                continue
        return None


@contextmanager
def ramped(
    scene: Scene,
    mu: float | None = None,
    watch: Callable[[str], None] = lambda says: None,
) -> Iterator[Ramped]:
    """Ramp a scene to its end, or to where the packing flows; its equilibria have no dissipation.

    Raises
    ------
    SceneError
        If the scene has no section [ramp], or more disks than `MOST_DISKS`.
    NoEquilibriumError
        If the packing flows from the first increment on.
    """
    if scene.ramp is None:
        raise SceneError("the scene has no section [ramp]: add it, with step and until")
    wanted = loads(scene.ramp)
    scene = scene.model_copy(update={"damping": None})
    start = settle(scene, mu, watch=lambda what: watch(f"settling: {what}"))
    if len(start.packing) > MOST_DISKS:
        raise SceneError(
            f"the onset with dissipation takes all modes at every load, which is too much for {len(start.packing)} "
            f"disks: take {MOST_DISKS} at the most, or leave [damping] out"
        )
    with Engine(start.packing) as engine:
        path = EquilibriumPath(engine, start, scene, onward=True)
        watch(f"ramp up to F_x = {wanted[-1]:g}")
        for _ in path.climb(wanted[1:]):
            pass
        forces = np.array([each.fx for each in path.kept])
        yield Ramped(engine, scene, path, forces, len(forces) < len(wanted))


def damped_onset_run(
    scene: Scene,
    mu: float,
    watch: Callable[[str], None] = lambda says: None,
    known: Callable[[DampedOnset, float], None] = lambda found, fx: None,
) -> DampedOnset:
    """The windows of growing motion of a scene for one friction coefficient, and its undamped onset.

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

    Raises
    ------
    SceneError, NoEquilibriumError
        As of `ramped`; the latter also if the packing flows before an onset.
    DampedOnsetError
        If no motion grows up to the ramp's end.
    """
    if scene.damping is None:
        raise SceneError("the scene has no section [damping]: add it, with cn, ct or tau")
    damping = scene.damping
    with ramped(scene, mu, watch) as ramp:
        watch(f"pairs that become complex without dissipation, up to F_x = {ramp.forces[-1]:.6g}")
        undamped = ramp.undamped()

        def so_far(windows: tuple[DampedWindow, ...], fx: float) -> None:
            if windows:
                known(DampedOnset(mu, windows, undamped, None), fx)

        dissipation = partial(dissipative, cn=damping.cn, ct=damping.ct, drag_time=damping.tau)
        found = damped_windows(
            lambda fx: dissipation(ramp.path(fx)),
            ramp.forces,
            look=() if undamped is None else inside(undamped.windows),
            watch=watch,
            known=so_far,
        )
        last = float(ramp.forces[-1])
        if not found and ramp.flows:
            raise NoEquilibriumError(
                f"no motion grows up to F_x = {last:.10g}, and no equilibrium was found beyond: the packing flows "
                "before an onset"
            )
        if not found:
            raise DampedOnsetError(f"No motion grows up to fx = {last:.10g}: raise ramp.until.")
        watch("the path once more, with other increments")
        again = ramp.engine, ramp.path, ramp.scene
        if undamped is not None:
            undamped = with_path_error(undamped, *again)
        return DampedOnset(
            mu, with_damped_path_error(found, dissipation, *again), undamped, last if ramp.flows else None
        )


def inside(windows: Iterable[Window]) -> list[float]:
    """The onsets of undamped windows, and the middles of those that end: growth is largest there."""
    ends = [0.5 * (each.fx_onset + each.fx_end) for each in windows if each.fx_end is not None]
    return [each.fx_onset for each in windows] + ends
