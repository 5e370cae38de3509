r"""The critical amplitude of a wave that triggers a layer of frictional disks.

Friction weakens as soon as the mean velocity v of the upper layer exceeds v_0. In the linear regime v is proportional
to the amplitude a of the wave :math:`a \cos\omega t`, which begins at t = 0 on a packing at rest. The wave therefore
triggers for amplitudes above

.. math:: a_c(\omega, F_x) = \frac{v_0}{\max_{0 \le t \le T} |v(t)|}, \qquad v(t)\ \text{for}\ a = 1,

where T is the duration of the wave. v(t) follows from K, C and M alone (:mod:`~faultgouge.analysis.responses.forcing`),
transient included: without dissipation the motion excited by the beginning of the wave never decays, and for a slow
wave nearly all of v is such free motion.

In LAMMPS, the same wave triggers or does not; a bisection finds the critical amplitude. These runs use nothing of the
linear theory. The wave is a force on each disk of the upper layer, or an acceleration of the floor.

The user gives v_0. The paper uses the largest velocity of the unperturbed run, which is rounding noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import groupby
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import numpy as np
from mpi4py import MPI
from pydantic import Field
from threadpoolctl import threadpool_limits

from ..analysis import Packing, spectrum
from ..analysis.arrays import Floats
from ..analysis.responses.response import floor_force, impulse_response, layer_force
from ..pywrap import Engine, Scene, SceneError
from ..pywrap.onset import onset_run
from ..pywrap.runs.ramp_loads import ramp_loads
from ..pywrap.runs.undamped import time_step
from ..pywrap.scenes.command_sections import PATH, section_of
from ..pywrap.scenes.units import real_units
from ..pywrap.scenes.validation import FREQUENCY, TIME, Positive, Section, require_section
from ..pywrap.settling.settle import settle
from .eruptions import growth_rate
from .onset import onset_row
from .packing_tools import Start, path_from
from .result_rows import Row, Rows, row_columns
from .study import Figures, Result, Work, study

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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


class Wave(NamedTuple):
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
    return section_of(scene, Trigger) or Trigger()


def equilibria(scene: Scene, fx: Iterable[float]) -> dict[float, Packing]:
    """The packings in equilibrium at some loads, along the ramp of the scene."""
    wanted, start = sorted(fx), settle(scene, communicator=MPI.COMM_SELF)
    with path_from(start, scene) as path:
        for load in ramp_loads(scene):
            if start.fx < load <= wanted[-1]:
                path(float(load))
        return {each: path(each) for each in wanted}


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
    response = impulse_response(packing, layer_force(packing, 1.0) if wanted.on == "layer" else floor_force(packing))
    velocity, when = response.largest(omegas, wanted.time)
    columns = omegas, v0 / velocity, v0 / np.abs(response.transfer(omegas)), when
    names, known = ("omega", "predicted", "stationary", "reached"), {"fx": packing.fx, "distance": distance}
    return [known | dict(zip(names, row, strict=True)) for row in np.column_stack(columns).tolist()]


def map_predictions(
    scene: Scene, packings: Mapping[float, Packing], fx_c: float, distances: Iterable[float]
) -> Iterator[tuple[float, list[Row]]]:
    """The predictions at each distance, the largest first, at the frequencies of the scene; where the scene names none,
    at those of the modes of the packing with the smallest load."""
    omegas = np.array(sorted(settings(scene).omega or ()))
    if packings and not len(omegas):
        modes = np.sqrt(np.abs(spectrum(packings[min(packings)]).eigenvalues))
        slowest = modes[modes > 1e-3 * modes.max()].min()  # one without a restoring force has no frequency
        omegas = np.geomspace(0.1 * slowest, modes.max(), DEFAULT_FREQUENCIES)
    for distance in sorted(distances, reverse=True):
        yield distance, predictions(scene, packings[fx_c * (1 - distance)], distance, omegas)


def spread_over_map(predicted: list[Row], runs: int) -> list[Row]:
    """So many points of the map, spread over distances and frequencies."""
    ordered = sorted(predicted, key=lambda each: (-each["distance"], each["omega"]))
    rows = [list(row) for _, row in groupby(ordered, key=lambda each: each["distance"])]
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
    predicted, runs = wave.expected["predicted"], 0
    dt, given = time_step(wave.packing), settings(wave.scene)
    steps = int(given.time / dt)
    target = None if given.on == "layer" else range(len(wave.packing))

    def triggers(amplitude: float) -> float | None:
        """The time at which the wave brings the layer above v_0; None if there is no such time."""
        nonlocal runs
        runs += 1
        with (
            Engine(wave.packing, MPI.COMM_SELF) as engine,
            engine.undamped(dt, amplitude, wave.expected["omega"], target) as dynamics,
            dynamics.halt_above(threshold(wave.scene)),
        ):
            dynamics.advance(steps)
            return dynamics.steps * dt if dynamics.steps < steps else None

    with threadpool_limits(1):
        below, above = predicted * (1 - FIRST_BRACKET), predicted * (1 + FIRST_BRACKET)
        while (reached := triggers(above)) is None and runs < BISECTION_RUNS:
            below, above = above, above * BRACKET_FACTOR
        if reached is None:
            says = f"no wave up to {above:.3g} triggers at omega = {wave.expected['omega']:g}: lower friction.v0"
            raise SceneError(says)
        while below < predicted and (time := triggers(below)) is not None:
            if runs >= BISECTION_RUNS or triggers(0.0) is not None:
                raise SceneError(
                    f"at F_x = {wave.packing.fx:.6g} the layer exceeds v_0 = {threshold(wave.scene):g} without a wave, "
                    "by rounding noise, so that no amplitude is critical: raise friction.v0"
                )
            below, above, reached = below / BRACKET_FACTOR, below, time
            runs -= 1  # the run without a wave is none of the bisection
        while above / below > 1 + BISECTION_WIDTH and runs < BISECTION_RUNS:
            between = middle(below, above)
            time = triggers(between)
            if time is None:
                below = between
            else:
                above, reached = between, time
    known = {key: wave.expected[key] for key in ("fx", "distance", "omega")}
    return known | {"below": below, "above": above, "runs": runs, "reached": reached}


def _row(scene: Scene, start: Start) -> Row:
    """A row of a sweep: the map of one scene, with the bisections that [trigger] asks for.

    Raises SceneError if the scene has no section [ramp], or no v_0.
    """
    threshold(scene)
    wave, first = settings(scene), onset_row(scene, start)
    row: Row = {"ends": first["ends"], "fx_c": first["fx_c"], "map": [], "measured": []}
    if first["ends"] == "onset":
        packings = equilibria(scene, [first["fx_c"] * (1 - each) for each in wave.distance])
        for _, rows in map_predictions(scene, packings, first["fx_c"], wave.distance):
            row["map"] += rows
        for each in spread_over_map(row["map"], wave.runs):
            found = bisect_amplitude(Wave(scene, packings[each["fx"]], each))
            row["measured"].append(found | {"amplitude": middle(found["below"], found["above"])})
    return row


WAVE = {"layer": "amplitude of the force $a$", "floor": "acceleration of the floor $a$"}


def _map_figure(result: Result) -> Figure:
    """The critical amplitude over frequency and distance from the onset; colours are from K, and there are circles
    where LAMMPS was asked, in the colour of its own answer."""
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    distance, omega, amplitude = _grid(result["map"])
    figure = Figure(figsize=(3.4, 2.6), layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", xlabel=r"frequency $\omega$", ylabel="$1 - F_x/F_x^c$")
    norm = LogNorm(np.nanmin(amplitude), np.nanmax(amplitude))
    colours = axes.pcolormesh(_edges(omega), _edges(distance), amplitude, norm=norm, cmap="viridis_r")
    runs = [row for row in result["map"] if row["measured"] is not None]
    across, up, measured = row_columns(runs, "omega", "distance", "measured")
    axes.scatter(across, up, c=measured, norm=norm, cmap="viridis_r", s=22, edgecolors="white", linewidths=0.9)
    axes.minorticks_off()
    bar = figure.colorbar(colours, ax=axes)
    bar.set_label(rf"{WAVE[result['on']]}$_c$ that triggers")
    return figure


def _threshold_figure(result: Result) -> Figure:
    """The critical amplitude over the frequency, a curve for each distance from the onset.

    Lines are from K with the transient, dotted ones of the stationary motion alone at the smallest distance; triangles
    are runs of LAMMPS that did (upwards) and did not (downwards) trigger.
    """
    from matplotlib.figure import Figure

    from ..figures.style import INK

    distance, omega, amplitude = _grid(result["map"])
    figure = Figure(figsize=(3.4, 2.9), layout="constrained")
    axes: Axes = figure.add_subplot(xscale="log", yscale="log", xlabel=r"frequency $\omega$", ylabel=WAVE[result["on"]])
    for k, (each, curve) in enumerate(zip(distance, amplitude, strict=True)):
        colour, exponent = f"C{k % 6}", np.log10(each)
        power = f"10^{{{round(exponent)}}}" if abs(exponent - round(exponent)) < 1e-9 and each < 0.1 else f"{each:g}"
        axes.plot(omega, curve, color=colour, linewidth=3.2 - 2.4 * k / len(distance), label=f"${power}$")
        runs = [row for row in result["map"] if row["distance"] == each and row["measured"] is not None]
        across, below, above = row_columns(runs, "omega", "below", "above")
        axes.plot(across, 1.12 * above, "^", color=colour, markersize=3.5)  # so far apart that both are seen
        axes.plot(across, below / 1.12, "v", color=colour, markersize=3.5, markerfacecolor="white")
    nearest = [row for row in result["map"] if row["distance"] == distance[0]]
    axes.plot(*row_columns(nearest, "omega", "stationary"), ":", color=INK, linewidth=0.8)
    axes.legend(title="$1 - F_x/F_x^c$", ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return figure


def _grid(rows: list[Row]) -> tuple[Floats, Floats, Floats]:
    """Distances and frequencies, increasing, and a_c of the two."""
    at, of, predicted = row_columns(rows, "distance", "omega", "predicted")
    distance, omega = np.unique(at), np.unique(of)
    amplitude = np.full((len(distance), len(omega)), np.nan)
    amplitude[np.searchsorted(distance, at), np.searchsorted(omega, of)] = predicted
    return distance, omega, amplitude


def _edges(centres: Floats) -> Floats:
    """Borders of the cells about some values, half way on a logarithmic scale."""
    if len(centres) == 1:
        return centres[0] * np.array([0.8, 1.25])
    between = np.sqrt(centres[1:] * centres[:-1])
    return np.concatenate([[centres[0] ** 2 / between[0]], between, [centres[-1] ** 2 / between[-1]]])


def _figures(result: Result, _: Rows) -> Figures:
    return {"map": lambda: _map_figure(result), "thresholds": lambda: _threshold_figure(result)}


def _page(result: Result) -> Result:
    rows, distances = result["map"], []
    for distance, group in groupby(rows, key=lambda row: row["distance"]):
        slowest, *others = group  # by frequency
        distances.append((distance, min([slowest, *others], key=lambda row: row["predicted"]), slowest))
    runs = [row for row in rows if row["measured"] is not None]
    return {"runs": runs, "distances": distances, "damped": bool(result["scene"].get("damping"))}


def _check(scene: Scene) -> None:
    threshold(scene)
    require_section(scene.ramp, "ramp")


@study(
    reads=(*PATH, "friction"),
    needs=("ramp", "friction"),
    section=Trigger,
    check=_check,
    figures=_figures,
    page=_page,
    row=_row,
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
    rows, given = work.rows, settings(scene)
    first = rows.find(kind="onset")
    if first is None:
        work.say("onset")
        found = onset_run(scene, scene.law.mus[0], dissipation=scene.damping is not None)
        work.say(found.describe())
        undamped = None if found.undamped is None else found.undamped.fx_c
        first = rows.append(kind="onset", fx_c=found.fx_c, error=found.error, undamped_fx_c=undamped)
    fx_c, distances = first["fx_c"], sorted(given.distance, reverse=True)
    missing = [d for d in distances if rows.find(kind="predicted", distance=d) is None]
    packings = equilibria(scene, [fx_c * (1 - d) for d in distances]) if missing else {}
    for distance, new in map_predictions(scene, packings, fx_c, missing):
        rows.append(kind="predicted", distance=distance, found=new)
        least = min(new, key=lambda each: each["predicted"])
        work.say(
            f"at 1 - F_x/F_x^c = {distance:g}: a_c is least, {least['predicted']:.3g}, at omega = {least['omega']:.4g}"
        )
    known = [row for row in rows.rows if row["kind"] == "predicted" and row["distance"] in distances]
    predicted: list[Row] = [each for row in known for each in row["found"]]
    wanted = spread_over_map(predicted, given.runs)

    def measured(each: Row) -> Row | None:
        return rows.find(kind="measured", fx=each["fx"], omega=each["omega"])

    to_bisect = [each for each in wanted if measured(each) is None]
    if len(to_bisect) < len(wanted):
        work.say(f"{len(wanted) - len(to_bisect)} of {len(wanted)} bisections are in {rows.path} already")
    if to_bisect:
        packings = equilibria(scene, {each["fx"] for each in wanted})  # all: the path is that of one run of the command
        waves = [Wave(scene, packings[each["fx"]], each) for each in to_bisect]
        for bisected in work.progress(work.map_rows(bisect_amplitude, waves), len(waves)):
            rows.append(kind="measured", **bisected)
            at = f"omega = {bisected['omega']:.4g} at {bisected['distance']:g}"
            work.say(f"{at}: triggers from {middle(bisected['below'], bisected['above']):.4g} on in LAMMPS")
    asked = {(each["fx"], each["omega"]) for each in wanted}
    real, table, off = real_units(scene), list[Row](), list[float]()
    for row in sorted(predicted, key=lambda p: (-p["distance"], p["omega"])):
        row = row | {"measured": None}
        run = measured(row) if (row["fx"], row["omega"]) in asked else None
        if run is not None:
            row |= {"measured": middle(run["below"], run["above"]), "triggers_at": run["reached"]}
            row |= {key: run[key] for key in ("below", "above", "runs")}
            off.append(abs(row["predicted"] / row["measured"] - 1))
        if real is not None:
            velocity = real.ground_velocity(row["predicted"], row["omega"], given.on)
            row |= {"frequency_Hz": real.frequency(row["omega"]), "ground_velocity_m_per_s": velocity}
            row |= {"strain": velocity / real.shear_wave, "stress_ratio": row["fx"] / real.fy}
        table.append(row)
    return {
        **{key: first[key] for key in ("fx_c", "error", "undamped_fx_c")},
        "v0": threshold(scene),
        "time": given.time,
        "on": given.on,
        "largest_deviation": max(off, default=None),
        "map": table,
    }
