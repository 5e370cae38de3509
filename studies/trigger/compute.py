r"""The critical amplitude of a wave that triggers a layer of frictional disks.

Friction weakens as soon as the mean velocity v of the upper layer exceeds v_0. In the linear regime v is proportional
to the amplitude a of the wave :math:`a \cos\omega t`, which begins at t = 0 on a packing at rest. The wave therefore
triggers for amplitudes above

.. math:: a_c(\omega, F_x) = \frac{v_0}{\max_{0 \le t \le T} |v(t)|}, \qquad v(t)\ \text{for}\ a = 1,

where T is the duration of the wave. v(t) follows from K, C and M alone (:mod:`~faultgouge.analysis.motion.forcing`),
transient included: without dissipation the motion excited by the beginning of the wave never decays, and for a slow
wave nearly all of v is such free motion.

In LAMMPS, the same wave triggers or does not; a bisection finds the critical amplitude. These runs use nothing of the
linear theory. The wave is a force on each disk of the upper layer, or an acceleration of the floor.

The user gives v_0. The paper uses the largest velocity of the unperturbed run, which is rounding noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from threadpoolctl import threadpool_limits

from ...analysis import Packing, spectrum
from ...analysis.arrays import Floats
from ...analysis.motion.forcing import floor_force, impulse_response
from ...analysis.motion.response import layer_force
from ...pywrap import Engine, Scene, SceneError
from ...pywrap.runs.ramp_loads import ramp_loads
from ...pywrap.runs.undamped import time_step
from ...pywrap.scenes.study_sections import Trigger
from ...pywrap.scenes.units import RealUnits
from ...pywrap.settling.settle import settle
from ..eruptions.compute import growth_rate
from ..packing_tools import path_from

Row = dict[str, Any]

DEFAULT_FREQUENCIES = 24
"""Frequencies of a map whose scene names none."""

FIRST_BRACKET = 0.05
"""Relative distance from the prediction at which the bisection begins."""

BRACKET_FACTOR = 1.5
"""Factor by which a bracket that does not hold is widened on the wrong side."""

BISECTION_RUNS = 24
"""Runs of a bisection at the most: brackets over six decades."""

BISECTION_WIDTH = 1e-2
"""Relative width at which the bisection ends: its middle is then within half a percent."""


@dataclass(frozen=True, eq=False)
class Wave:
    """A wave of a scene, of any amplitude, on a packing in equilibrium, with the linear response by K."""

    scene: Scene
    packing: Packing
    expected: Row


def middle(below: float, above: float) -> float:
    """Half way between two amplitudes, on a logarithmic scale."""
    return float(np.sqrt(below * above))


def threshold(scene: Scene) -> float:
    """v_0 of the scene. Raises SceneError if the scene does not say it."""
    if scene.friction is None:
        raise SceneError("the scene has no section [friction]: add it, with v0, the velocity at which friction weakens")
    v0 = scene.friction.v0
    if isinstance(v0, str) or v0 == 0:
        raise SceneError(
            f"friction.v0 = {v0!r} gives no threshold to exceed, since the velocity of a run that nobody perturbs is "
            "rounding noise: give a velocity above 0"
        )
    return v0


def settings(scene: Scene) -> Trigger:
    """The section [trigger], or its defaults."""
    return scene.trigger if scene.trigger is not None else Trigger.model_validate({})


def equilibria(scene: Scene, fx: Iterable[float]) -> dict[float, Packing]:
    """The packings in equilibrium at some loads, along the ramp of the scene."""
    assert scene.ramp is not None
    wanted = sorted(fx)
    start = settle(scene, communicator=MPI.COMM_SELF)
    with path_from(start, scene) as path:
        for load in ramp_loads(scene):
            if start.fx < load <= wanted[-1]:
                path(float(load))
        return {each: path(each) for each in wanted}


def frequencies(packing: Packing, wanted: Trigger) -> Floats:
    """The angular frequencies of the map, 1 / time; of a scene that names none, from the modes of a packing."""
    if wanted.omega is not None:
        return np.array(sorted(wanted.omega))
    modes = np.sqrt(np.abs(spectrum(packing).eigenvalues))
    slowest = modes[modes > 1e-3 * modes.max()].min()  # one without a restoring force has no frequency
    return np.geomspace(0.1 * slowest, modes.max(), DEFAULT_FREQUENCIES)


def predictions(scene: Scene, packing: Packing, distance: float, omegas: Floats) -> list[Row]:
    """a_c at one distance from K, C and M.

    Raises
    ------
    SceneError
        If the packing is unstable there.

    Returns
    -------
    list of dict
        fx, distance, omega : F_x, 1 - F_x/F_x^c, and the angular frequency, 1 / time; predicted : a_c, a force, or an
        acceleration of the floor; stationary : a_c without the transient, v_0/abs(H(omega)); reached : when the layer
        is fastest, time.
    """
    if growth_rate(packing) > 0:
        where = f"at F_x = {packing.fx:.10g}, below the onset," if packing.fx > 0 else "before any shear is added"
        raise SceneError(
            f"{where} the packing is unstable already: nothing is at rest there to be triggered; take other distances "
            "or another seed"
        )
    wanted, v0 = settings(scene), threshold(scene)
    force = layer_force(packing, 1.0) if wanted.on == "layer" else floor_force(packing)
    response = impulse_response(packing, force)
    velocity, when = response.largest(omegas, wanted.time)
    stationary = np.abs(response.transfer(omegas))
    columns = {"omega": omegas, "predicted": v0 / velocity, "stationary": v0 / stationary, "reached": when}
    rows = (dict(zip(columns, row, strict=True)) for row in np.column_stack([*columns.values()]).tolist())
    return [{"fx": packing.fx, "distance": distance} | row for row in rows]


def map_predictions(
    scene: Scene, packings: Mapping[float, Packing], fx_c: float, distances: Iterable[float]
) -> Iterator[tuple[float, list[Row]]]:
    """The predictions at each distance, the largest first, at the frequencies of the packing with the smallest load."""
    if packings:
        omegas = frequencies(packings[min(packings)], settings(scene))
        for distance in sorted(distances, reverse=True):
            yield distance, predictions(scene, packings[fx_c * (1 - distance)], distance, omegas)


def spread_over_map(predicted: list[Row], runs: int) -> list[Row]:
    """So many points of the map, spread over distances and frequencies."""
    distances = sorted({each["distance"] for each in predicted}, reverse=True)
    rows = [sorted((p for p in predicted if p["distance"] == d), key=lambda p: p["omega"]) for d in distances]
    share = [runs // len(rows) + (k < runs % len(rows)) for k in range(len(rows))]
    picked = []
    for k, (row, count) in enumerate(zip(rows, share, strict=True)):
        # from row to row the places move on by a part of their own distance, so that all frequencies have their turn
        places = (np.arange(count) + (k + 0.5) / len(rows)) * len(row) / max(1, count)
        picked += [row[place] for place in sorted({min(int(p), len(row) - 1) for p in places})]
    return picked


def bisect_amplitude(wave: Wave) -> Row:
    """a_c in LAMMPS, on this process alone.

    Returns
    -------
    dict
        fx, distance, omega : of the wave; below, above : the strongest wave that did not trigger, and the weakest that
        did; runs : of the bisection; reached : when the weakest one triggered, time.
    """
    with threadpool_limits(1):
        below, above, runs, reached = _bracket(wave)
        while above / below > 1 + BISECTION_WIDTH and runs < BISECTION_RUNS:
            between = middle(below, above)
            time = _triggers(wave, between)
            runs += 1
            if time is None:
                below = between
            else:
                above, reached = between, time
    known = {key: wave.expected[key] for key in ("fx", "distance", "omega")}
    return known | {"below": below, "above": above, "runs": runs, "reached": reached}


def _bracket(wave: Wave) -> tuple[float, float, int, float]:
    """An amplitude that does not trigger, one that triggers, the number of runs, and the time of the triggering."""
    predicted = wave.expected["predicted"]
    below, above = predicted * (1 - FIRST_BRACKET), predicted * (1 + FIRST_BRACKET)
    runs = 1
    while (reached := _triggers(wave, above)) is None and runs < BISECTION_RUNS:
        below, above, runs = above, above * BRACKET_FACTOR, runs + 1
    if reached is None:
        raise SceneError(f"no wave up to {above:.3g} triggers at omega = {wave.expected['omega']:g}: lower friction.v0")
    if below < predicted:
        runs += 1
        while (time := _triggers(wave, below)) is not None:
            if runs >= BISECTION_RUNS or _triggers(wave, 0.0) is not None:
                raise SceneError(
                    f"at F_x = {wave.packing.fx:.6g} the layer exceeds v_0 = {threshold(wave.scene):g} without a wave, "
                    "by rounding noise, so that no amplitude is critical: raise friction.v0"
                )
            below, above, reached, runs = below / BRACKET_FACTOR, below, time, runs + 1
    return below, above, runs, reached


def _triggers(wave: Wave, amplitude: float) -> float | None:
    """The time at which a wave brings the layer above v_0; None if there is no such time."""
    dt, given = time_step(wave.packing), settings(wave.scene)
    steps = int(given.time / dt)
    target = None if given.on == "layer" else range(len(wave.packing))
    with (
        Engine(wave.packing, MPI.COMM_SELF) as engine,
        engine.undamped(dt, amplitude, wave.expected["omega"], target) as dynamics,
        dynamics.halt_above(threshold(wave.scene)),
    ):
        dynamics.advance(steps)
        return dynamics.steps * dt if dynamics.steps < steps else None


def in_si(real: RealUnits, found: Row, on: str) -> dict[str, float]:
    """A prediction in real units: frequency, ground velocity and strain of the wave, and the ratio of stresses."""
    velocity = real.ground_velocity(found["predicted"], found["omega"], on)
    return {
        "frequency_Hz": real.frequency(found["omega"]),
        "ground_velocity_m_per_s": velocity,
        "strain": velocity / real.shear_wave,
        "stress_ratio": found["fx"] / real.fy,
    }
