r"""What dissipation does to the onset of packings, and to the transient gain below it.

As :math:`C \to 0` with a fixed ratio :math:`C_N : C_T` the damped onset tends to a load below the undamped one
(:mod:`~research.dissipation.weak_limit`), and as the dashpots get stronger it rises, in the end
beyond. Drag alone raises it from the beginning. Below the onset the transient gain
(:mod:`~faultgouge.analysis.responses.transient`) grows as a power of the distance, and dissipation limits it.

Every function yields its records one by one, so that a long study is kept as it goes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from faultgouge.analysis import Floats, NoGainError, OnsetError, Packing, Window, find_onset, transient_gain
from faultgouge.analysis.windows import System, find_windows
from faultgouge.pywrap import Engine, Equilibrium, LoadPath, Scene, ramp_loads, scene_path, settle
from research.dissipation.weak_limit import drag_onset, weak_limit

Row = dict[str, Any]

RATIOS = ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.1), (0.1, 1.0))
"""C_N : C_T of the study of weak dashpots."""

WEAK = 1e-4
"""C_N and C_T of dashpots that count as weak, times their shares: the onset differs from its limit by their square."""


FEW = 3
"""Increments that are searched at once for the first window."""


@contextmanager
def ramped(scene: Scene) -> Iterator[LoadPath[Equilibrium]]:
    """The path of a scene, climbed to the end of its ramp, or to where the packing flows."""
    wanted = ramp_loads(scene)
    start = settle(scene)
    with Engine(start.packing) as engine:
        path = scene_path(engine, start, scene, onward=True)
        for _ in path.climb(wanted[1:]):
            pass
        yield path


def loads_of(path: LoadPath[Equilibrium]) -> Floats:
    """The loads of the ramp that have an equilibrium, force per top disk."""
    return np.array([each.fx for each in path.equilibria])


def first_undamped_window(path: LoadPath[Equilibrium]) -> Window | None:
    """The first window without dissipation, as far as a few increments show it; None if there is none."""
    forces = loads_of(path)
    for k in range(0, len(forces) - 1, FEW):
        try:
            return find_onset(path, forces[k : k + FEW + 1]).windows[0]
        except OnsetError:
            continue
    return None


def windows_with(
    path: LoadPath[Equilibrium], forces: ArrayLike, look: float | None = None, **dissipation: float | None
) -> tuple[Window, ...]:
    """The first windows with dashpots or drag, as of `Packing.with_dissipation`; `look` is a load to be looked at."""

    def system(fx: float) -> System:
        # numbers by name, of which mypy does not know which may be None
        return System.of(path(fx).with_dissipation(**dissipation), dissipation=True)

    def between(below: float, above: float) -> list[float]:
        return [look] if look is not None and below < look < above else []

    return find_windows(system, forces, look=between, first=look is not None)


def weak_cases(path: LoadPath[Equilibrium], ratios: Iterable[tuple[float, float]] = RATIOS) -> Iterator[Row]:
    """The limit of weak dashpots for the first undamped pair of a ramp, for several ratios C_N : C_T.

    The damped onset is solved for among all modes, from the ramp's last load below the prediction to a little beyond
    the undamped onset. Nothing is yielded for a packing without an undamped window, and for a pair that cannot be
    followed to its limit.

    Yields
    ------
    dict
        cn, ct : shares of the two dashpots; undamped : onset without dissipation, force per top disk; predicted : the
        limit from the undamped pair; measured : damped onset, among all modes, with dashpots of `WEAK` times these
        shares, None if nothing grows up to a little beyond the undamped onset.
    """
    window, forces = first_undamped_window(path), loads_of(path)
    if window is None:
        return
    for cn, ct in ratios:
        predicted = weak_limit(path, forces, window, cn, ct)
        if predicted is None:
            continue
        found = windows_with(path, _around(forces, predicted.fx, window), cn=WEAK * cn, ct=WEAK * ct)
        onsets = {"undamped": window.fx_onset, "predicted": predicted.fx}
        yield {"cn": cn, "ct": ct, **onsets, "measured": found[0].fx_onset if found else None}


def _around(forces: ArrayLike, predicted: float, window: Window) -> list[float]:
    """Two loads about a prediction and the undamped onset of a pair."""
    loads = np.asarray(forces, dtype=np.float64)
    step = float(loads[1] - loads[0])
    below = loads[loads < predicted - 0.1 * step][-1:]
    width = step if window.fx_end is None else min(step, window.fx_end - window.fx_onset)
    return [*below, window.fx_onset + 1e-3 * width]


def over_strength(
    path: LoadPath[Equilibrium], kind: str, strengths: Iterable[float], start: float = 0.0
) -> Iterator[Row]:
    """The damped onset over the strength of normal dashpots, or of drag.

    Parameters
    ----------
    path : LoadPath
        The packing along its loads, climbed.
    kind : {"cn", "drag"}
        Which dissipation.
    strengths : iterable of float
        C_N, mass / time / length^(1/2) for Hertz's law, or 1/tau, 1 / time.
    start : float
        Smallest load to be searched, force.

    Yields
    ------
    dict
        kind, strength : as given; onset : damped onset among all modes, force per top disk, None if nothing grows on
        the loads; frequency : Im s there, radian / time; predicted : from the first undamped pair, the limit of weak
        dashpots, or drag's crossover, None where the drag holds the pair down; undamped : onset without dissipation.
    """
    window, all_forces = _first_window(path), loads_of(path)
    forces = all_forces[all_forces >= start]
    limit = weak_limit(path, all_forces, window, cn=1.0) if kind == "cn" else None
    for strength in strengths:
        dissipation = {"cn": strength} if kind == "cn" else {"drag_time": 1 / strength}
        predicted = None if limit is None else limit.fx
        if kind == "drag":
            predicted = drag_onset(path, all_forces, window, 1 / strength)
        found = windows_with(path, forces, window.fx_onset, **dissipation)
        onset, frequency = (found[0].fx_onset, found[0].frequency) if found else (None, None)
        row = {"kind": kind, "strength": strength, "onset": onset, "frequency": frequency}
        yield row | {"predicted": predicted, "undamped": window.fx_onset}


def over_distance(
    path: LoadPath[Equilibrium], distances: Iterable[float], dissipations: Iterable[tuple[float, float]]
) -> Iterator[Row]:
    """The transient gain over the distance from the first undamped onset, for several (C_N, 1/tau).

    Yields
    ------
    dict
        distance : (F_x^c - F_x) / F_x^c of the undamped onset; cn, drag : C_N, and 1/tau; gain : of abs(q)^2 from rest,
        None if some motion grows for ever; time : when; bound : no later time has more.
    """
    onset, kinds = _first_window(path).fx_onset, tuple(dissipations)
    for distance in distances:
        packing = path(onset * (1 - distance))
        for cn, drag in kinds:
            yield {"distance": distance, "cn": cn, "drag": drag} | _gain(packing, cn, drag)


def _gain(packing: Packing, cn: float, drag: float) -> Row:
    try:
        found = transient_gain(packing.with_dissipation(cn, drag_time=1 / drag if drag else None))
    except NoGainError:
        return {"gain": None, "time": None, "bound": None}
    return {"gain": found.gain, "time": found.time, "bound": found.bound if np.isfinite(found.bound) else None}


def _first_window(path: LoadPath[Equilibrium]) -> Window:
    window = first_undamped_window(path)
    if window is None:
        last = path.equilibria[-1].fx
        raise OnsetError(f"No pair of eigenvalues is complex up to F_x = {last:.10g}", "raise ramp.until")
    return window
