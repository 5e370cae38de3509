r"""The critical amplitude of a wave that triggers a layer of frictional disks.

Friction weakens as soon as the mean velocity v of the upper layer exceeds v_0. In the linear regime v is proportional
to the amplitude a of the wave :math:`a \cos\omega t`, which begins at t = 0 on a packing at rest. The wave therefore
triggers for amplitudes above

.. math:: a_c(\omega, F_x) = \frac{v_0}{\max_{0 \le t \le T} |v(t)|}, \qquad v(t)\ \text{for}\ a = 1,

where T is the duration of the wave. v(t) follows from K, C and M alone
(:mod:`~faultgouge.analysis.responses.response`), transient included: without dissipation the motion excited by the
beginning of the wave never decays, and for a slow wave nearly all of v is such free motion.

In LAMMPS, the same wave triggers or does not; a bisection finds the critical amplitude. These runs use nothing of the
linear theory. The wave is a force on each disk of the upper layer, or an acceleration of the floor.

The user gives v_0. The paper uses the largest velocity of the unperturbed run, which is rounding noise.
"""

from __future__ import annotations

from itertools import groupby
from math import sqrt
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from mpi4py import MPI
from pydantic import Field
from threadpoolctl import threadpool_limits

from ..analysis import Packing, find_onset, spectrum
from ..analysis.arrays import Floats
from ..analysis.responses.response import floor_force, impulse_response, layer_force
from ..pywrap import Engine, Scene, SceneError
from ..pywrap.runs.path_error import with_path_error
from ..pywrap.runs.ramp_loads import ramp_loads
from ..pywrap.runs.undamped import time_step
from ..pywrap.scenes.command_sections import PATH, section_of
from ..pywrap.scenes.units import real_units
from ..pywrap.scenes.validation import FREQUENCY, TIME, Positive, Section, require_section
from .eruptions import growth_rate
from .packing_tools import path_from
from .result_rows import Row, row_columns
from .study import Result, Work, study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DEFAULT_FREQUENCIES = 24
"""Frequencies of a map whose scene names none."""

FIRST_BRACKET, BRACKET_FACTOR = 0.05, 1.5
"""Relative distance from the prediction at which the bisection begins, and the factor by which a bracket that does not
hold is widened on the wrong side."""

BISECTION_RUNS, BISECTION_WIDTH = 24, 1e-2
"""Runs of a bisection at the most, for brackets over six decades; and the relative width at which it ends: its middle
is then within half a percent."""

Share = Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False)]


class Trigger(Section):
    """[trigger] which waves trigger how critical a layer.

    Attributes
    ----------
    distance : tuple of float
        Distances 1 - F_x/F_x^c from the onset.
    omega : tuple of float or None
        Angular frequencies of the wave, 1 / time. None: `DEFAULT_FREQUENCIES` of them, evenly over the logarithm, from
        a tenth of the slowest mode's to the fastest mode's.
    time : float
        How long the wave lasts, time.
    runs : int
        How many pairs of a distance and a frequency are bisected in LAMMPS.
    on : {"layer", "floor"}
        What the wave is: a force a cos(omega t) on each disk of the upper layer, or an acceleration of the floor.
    """

    distance: Annotated[tuple[Share, ...], Field(min_length=1, strict=False)] = (0.3, 0.1, 0.03, 0.01, 1e-3, 1e-4)
    omega: Annotated[Annotated[tuple[Positive, ...], Field(min_length=1, strict=False)] | None, FREQUENCY] = None
    time: Annotated[Positive, TIME] = 20.0
    runs: Annotated[int, Field(ge=0)] = 12
    on: Literal["layer", "floor"] = "layer"


Wave = tuple[Scene, Packing, Row]
"""A wave of a scene, of any amplitude, on a packing in equilibrium, with the linear response by K."""


def threshold(scene: Scene) -> float:
    """v_0 of a scene with a ramp. Raises SceneError if the scene does not say it."""
    require_section(scene.ramp, "ramp")
    v0 = require_section(scene.friction, "friction").v0
    if isinstance(v0, str) or v0 == 0:
        why = "since the velocity of a run that nobody perturbs is rounding noise: give a velocity above 0"
        raise SceneError(f"friction.v0 = {v0!r} gives no threshold to exceed, {why}")
    return v0


def settings(scene: Scene) -> Trigger:
    """The section [trigger], or its defaults."""
    return section_of(scene, Trigger) or Trigger()


def predictions(scene: Scene, packing: Packing, distance: float, omegas: Floats) -> list[Row]:
    """a_c at one distance from K, C and M; SceneError if the packing is unstable there.

    Rows of fx, distance, omega : F_x, 1 - F_x/F_x^c, and the angular frequency, 1 / time; predicted : a_c, a force, or
    an acceleration of the floor; stationary : a_c without the transient, v_0/abs(H(omega)); reached : when the layer is
    fastest, time.
    """
    if growth_rate(packing) > 0:
        where = f"at F_x = {packing.fx:.10g}, below the onset," if packing.fx > 0 else "before any shear is added"
        raise SceneError(
            f"{where} the packing is unstable already: nothing is at rest there to be triggered; take other distances "
            "or another seed"
        )
    wanted, v0 = settings(scene), threshold(scene)
    response = impulse_response(packing, layer_force(packing, 1.0) if wanted.on == "layer" else floor_force(packing))
    velocity, when = response.largest(omegas, wanted.time)
    columns = omegas, v0 / velocity, v0 / np.abs(response.transfer(omegas)), when
    names, known = ("omega", "predicted", "stationary", "reached"), {"fx": packing.fx, "distance": distance}
    return [known | dict(zip(names, row, strict=True)) for row in np.column_stack(columns).tolist()]


def bisect_amplitude(wave: Wave) -> Row:
    """a_c in LAMMPS, on this process alone.

    The row has fx, distance, omega : of the wave; below, above : the strongest wave that did not trigger, and the
    weakest that did; runs : of the bisection; reached : when the weakest one triggered, time.
    """
    scene, packing, expected = wave
    omega, v0, given, dt, runs = expected["omega"], threshold(scene), settings(scene), time_step(packing), 0
    steps, target = int(given.time / dt), None if given.on == "layer" else range(len(packing))

    def triggers(amplitude: float) -> float | None:
        """The time at which the wave brings the layer above v_0; None if there is no such time."""
        with Engine(packing, MPI.COMM_SELF) as engine, engine.undamped(dt, amplitude, omega, target) as dynamics:
            dynamics.halt_above(v0)
            dynamics.advance(steps)
            return engine.steps * dt if engine.steps < steps else None

    below, above = expected["predicted"] * (1 - FIRST_BRACKET), expected["predicted"] * (1 + FIRST_BRACKET)
    reached, holds = None, False  # whether the wave `below` is known not to trigger
    with threadpool_limits(1):
        while runs < BISECTION_RUNS and (reached is None or not holds or above / below > 1 + BISECTION_WIDTH):
            amplitude = above if reached is None else below if not holds else sqrt(below * above)
            time, runs = triggers(amplitude), runs + 1
            if time is None:
                below, holds = amplitude, True
                above = amplitude * BRACKET_FACTOR if reached is None else above
            elif reached is None:
                reached = time
            else:
                if not holds and triggers(0.0) is not None:
                    break
                below = below if holds else amplitude / BRACKET_FACTOR
                above, reached = amplitude, time
    if reached is None:
        raise SceneError(f"no wave up to {above:.3g} triggers at omega = {omega:g}: lower friction.v0")
    if not holds:
        noise = "without a wave, by rounding noise, so that no amplitude is critical: raise friction.v0"
        raise SceneError(f"at F_x = {packing.fx:.6g} the layer exceeds v_0 = {v0:g} {noise}")
    known = {key: expected[key] for key in ("fx", "distance", "omega")}
    return known | {"below": below, "above": above, "runs": runs, "reached": reached}


def _threshold_figure(result: Result) -> Figure:
    """The critical amplitude over the frequency, a curve for each distance from the onset.

    Lines are from K with the transient, dotted ones of the stationary motion alone at the smallest distance; triangles
    are runs of LAMMPS that did (upwards) and did not (downwards) trigger.
    """
    from matplotlib.figure import Figure

    from ..figures.style import INK

    figure = Figure(figsize=(3.4, 2.9), layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", xlabel=r"frequency $\omega$", ylabel="amplitude $a_c$")
    curves = [list(rows) for _, rows in groupby(result["map"], key=lambda row: row["distance"])][::-1]
    for k, rows in enumerate(curves):
        colour, width = f"C{k % 6}", 3.2 - 2.4 * k / len(curves)
        axes.plot(*row_columns(rows, "omega", "predicted"), color=colour, lw=width, label=f"{rows[0]['distance']:g}")
        across, below, above = row_columns([row for row in rows if row["measured"]], "omega", "below", "above")
        axes.plot(across, 1.12 * above, "^", color=colour, markersize=3.5)  # so far apart that both are seen
        axes.plot(across, below / 1.12, "v", color=colour, markersize=3.5, markerfacecolor="white")
    axes.plot(*row_columns(curves[0], "omega", "stationary"), ":", color=INK, linewidth=0.8)
    axes.legend(title="$1 - F_x/F_x^c$", ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return figure


def _page(result: Result) -> Result:
    curves = [list(rows) for _, rows in groupby(result["map"], key=lambda row: row["distance"])]  # by frequency
    weakest = [min(rows, key=lambda row: row["predicted"]) for rows in curves]
    distances = [(rows[0]["distance"], least, rows[0]) for rows, least in zip(curves, weakest, strict=True)]
    return {"runs": [row for row in result["map"] if row["measured"] is not None], "distances": distances}


@study(
    reads=(*PATH, "friction"),
    needs=("ramp", "friction"),
    section=Trigger,
    check=threshold,
    figures=lambda result, rows: {"thresholds": lambda: _threshold_figure(result)},
    page=_page,
    row=True,
    counts="bisections",
    example="faultgouge examples trigger && echo 'runs = 1' >> trigger.toml && faultgouge trigger trigger.toml",
)
def trigger(scene: Scene, work: Work) -> Result:
    """Compute the critical amplitude of a wave over its frequency and the distance of the layer from the onset.

    The amplitude is predicted from the stiffness, the damping and the masses, and
    for some pairs measured by bisection in LAMMPS. The scene must give friction.v0,
    the velocity above which friction weakens. With several ranks, one rank
    distributes the runs.
    """
    rows, given, rest, loads = work.rows, settings(scene), work.start(scene.law.mus[0]), ramp_loads(scene)
    first = rows.find(kind="onset")
    if first is None:
        work.say("onset")
        with path_from(rest, scene) as path:
            found = with_path_error(find_onset(path, loads, first=True, dissipation=scene.damping is not None), path)
        first = rows.append(kind="onset", fx_c=found.fx_c, error=found.error)
    # of all distances, along the ramp from the settled packing on: the path is that of one run of the command
    wanted = {distance: first["fx_c"] * (1 - distance) for distance in sorted(given.distance, reverse=True)}
    with path_from(rest, scene) as path:
        for load in loads[(loads > rest.fx) & (loads <= max(wanted.values()))]:
            path(float(load))
        packings = {distance: path(fx) for distance, fx in wanted.items()}
    omegas = np.array(sorted(given.omega or ()))
    if not len(omegas):
        modes = np.sqrt(np.abs(spectrum(packings[max(packings)]).eigenvalues))
        slowest = modes[modes > 1e-3 * modes.max()].min()  # one without a restoring force has no frequency
        omegas = np.geomspace(0.1 * slowest, modes.max(), DEFAULT_FREQUENCIES)
    waves, table = list[Wave](), list[Row]()
    for k, (distance, packing) in enumerate(packings.items()):
        known = rows.find(kind="predicted", distance=distance)
        row = known["found"] if known else predictions(scene, packing, distance, omegas)
        if known is None:
            rows.append(kind="predicted", distance=distance, found=row)
        table += row
        least = min(row, key=lambda each: each["predicted"])
        place = f"a_c is least, {least['predicted']:.3g}, at omega = {least['omega']:.4g}"
        work.say(f"at 1 - F_x/F_x^c = {distance:g}: {place}")
        # the runs are spread evenly; from row to row the places move on by a part of their own distance, so that all
        # frequencies have their turn
        count = given.runs // len(packings) + (k < given.runs % len(packings))
        places = (np.arange(count) + (k + 0.5) / len(packings)) * len(row) / max(1, count)
        picked = sorted({min(int(place), len(row) - 1) for place in places})
        waves += [(scene, packing, row[place]) for place in picked]

    def measured(each: Row) -> Row | None:
        return rows.find(kind="measured", fx=each["fx"], omega=each["omega"])

    missing = [wave for wave in waves if measured(wave[2]) is None]
    for bisected in work.progress(work.map_rows(bisect_amplitude, missing), len(missing)):
        rows.append(kind="measured", **bisected)
        at = f"omega = {bisected['omega']:.4g} at {bisected['distance']:g}"
        work.say(f"{at}: triggers from {sqrt(bisected['below'] * bisected['above']):.4g} on in LAMMPS")
    real, off, chosen = real_units(scene), list[float](), [row for *_, row in waves]
    for k, row in enumerate(table):
        run = measured(row) if row in chosen else None
        row = row | {"measured": None}
        if run is not None:
            row |= {"measured": sqrt(run["below"] * run["above"]), "triggers_at": run["reached"]}
            row |= {key: run[key] for key in ("below", "above", "runs")}
            off.append(abs(row["predicted"] / row["measured"] - 1))
        if real is not None:
            velocity = real.ground_velocity(row["predicted"], row["omega"], given.on)
            row |= {"frequency_Hz": real.frequency(row["omega"]), "ground_velocity_m_per_s": velocity}
            row |= {"strain": velocity / real.shear_wave, "stress_ratio": row["fx"] / real.fy}
        table[k] = row
    result = {"fx_c": first["fx_c"], "error": first["error"], "v0": threshold(scene), "time": given.time}
    return result | {"on": given.on, "largest_deviation": max(off, default=None), "map": table}
