r"""What dissipation does to the onset of packings, and to the transient gain below it.

As :math:`C \to 0` with a fixed ratio :math:`C_N : C_T` the damped onset tends to a load below the undamped one
(:mod:`~research.dissipation.weak_limit`), and as the dashpots get stronger it rises, in the end
beyond. Drag alone raises it from the beginning. Below the onset the transient gain
(:mod:`~faultgouge.analysis.motion.transient`) grows as a power of the distance, and dissipation limits it.

Every function yields its records one by one, so that a long study is kept as it goes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from faultgouge.analysis import OnsetError, Packing, Window
from faultgouge.analysis.damped_onset.windows import damped_windows, without_dissipation
from faultgouge.analysis.motion.transient import NoGainError, transient_gain
from faultgouge.pywrap.onset.damped import RampPath
from research.dissipation.weak_limit import drag_onset, weak_limit

Row = dict[str, Any]

RATIOS = ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.1), (0.1, 1.0))
"""C_N : C_T of the study of weak dashpots."""

WEAK = 1e-4
"""C_N and C_T of dashpots that count as weak, times their shares: the onset differs from its limit by their square."""


def weak_cases(ramp: RampPath, ratios: Iterable[tuple[float, float]] = RATIOS) -> Iterator[Row]:
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
    window = ramp.first_window()
    if window is None:
        return
    for cn, ct in ratios:
        predicted = weak_limit(without_dissipation(ramp.path, cn, ct), ramp.forces, window)
        if predicted is None:
            continue
        weak = without_dissipation(ramp.path, WEAK * cn, WEAK * ct)
        found = damped_windows(weak, _around(ramp.forces, predicted.fx, window))
        onsets = {"undamped": window.fx_onset, "predicted": predicted.fx}
        yield {"cn": cn, "ct": ct, **onsets, "measured": found[0].fx_onset if found else None}


def _around(forces: ArrayLike, predicted: float, window: Window) -> list[float]:
    """Two loads about a prediction and the undamped onset of a pair."""
    loads = np.asarray(forces, dtype=np.float64)
    step = float(loads[1] - loads[0])
    below = loads[loads < predicted - 0.1 * step][-1:]
    width = step if window.fx_end is None else min(step, window.fx_end - window.fx_onset)
    return [*below, window.fx_onset + 1e-3 * width]


def over_strength(ramp: RampPath, kind: str, strengths: Iterable[float], start: float = 0.0) -> Iterator[Row]:
    """The damped onset over the strength of normal dashpots, or of drag.

    Parameters
    ----------
    ramp : RampPath
        The packing along its loads.
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
    window = _first_window(ramp)
    forces = ramp.forces[ramp.forces >= start]
    limit = weak_limit(without_dissipation(ramp.path, cn=1.0), ramp.forces, window) if kind == "cn" else None
    for strength in strengths:
        if kind == "cn":
            path, predicted = without_dissipation(ramp.path, cn=strength), None if limit is None else limit.fx
        else:
            path = without_dissipation(ramp.path, drag_time=1 / strength)
            predicted = drag_onset(without_dissipation(ramp.path), ramp.forces, window, 1 / strength)
        found = damped_windows(path, forces, look=[window.fx_onset], first=True)
        onset, frequency = (found[0].fx_onset, found[0].frequency) if found else (None, None)
        row = {"kind": kind, "strength": strength, "onset": onset, "frequency": frequency}
        yield row | {"predicted": predicted, "undamped": window.fx_onset}


def over_distance(
    ramp: RampPath, distances: Iterable[float], dissipations: Iterable[tuple[float, float]]
) -> Iterator[Row]:
    """The transient gain over the distance from the first undamped onset, for several (C_N, 1/tau).

    Yields
    ------
    dict
        distance : (F_x^c - F_x) / F_x^c of the undamped onset; cn, drag : C_N, and 1/tau; gain : of abs(q)^2 from rest,
        None if some motion grows for ever; time : when; bound : no later time has more.
    """
    onset, kinds = _first_window(ramp).fx_onset, tuple(dissipations)
    for distance in distances:
        packing = ramp.path(onset * (1 - distance))
        for cn, drag in kinds:
            yield {"distance": distance, "cn": cn, "drag": drag} | _gain(packing, cn, drag)


def _gain(packing: Packing, cn: float, drag: float) -> Row:
    damped = without_dissipation(lambda fx: packing, cn=cn, drag_time=1 / drag if drag else None)
    try:
        found = transient_gain(damped(packing.fx))
    except NoGainError:
        return {"gain": None, "time": None, "bound": None}
    return {"gain": found.gain, "time": found.time, "bound": found.bound if np.isfinite(found.bound) else None}


def _first_window(ramp: RampPath) -> Window:
    window = ramp.first_window()
    if window is None:
        raise OnsetError(f"No pair of eigenvalues is complex up to F_x = {ramp.forces[-1]:.10g}: raise ramp.until.")
    return window
