"""The map of waves that trigger, as a study."""

from __future__ import annotations

from ...pywrap import Scene
from ...pywrap.onset import onset_run
from ...pywrap.scenes.units import real_units
from ...pywrap.scenes.validation import require_section
from ..study import Result, SceneStudy, Work
from .compute import (
    Row,
    Wave,
    bisect_amplitude,
    equilibria,
    in_si,
    map_predictions,
    middle,
    settings,
    spread_over_map,
    threshold,
)
from .draw import map_figure, threshold_figure


def _check(scene: Scene) -> None:
    threshold(scene)
    require_section(scene.ramp, "ramp")


def _compute(scene: Scene, work: Work) -> Result:
    """The onset, the whole map, and the bisections."""
    onset = _onset(scene, work)
    predicted = _predict_map(scene, onset["fx_c"], work)
    return _summary(scene, onset, predicted, _bisect_map(scene, predicted, work))


def _summary(scene: Scene, onset: Row, predicted: list[Row], measured: list[Row]) -> Result:
    """The contents of trigger.json besides the scene."""
    runs = {(each["fx"], each["omega"]): each for each in measured}
    real = real_units(scene)
    rows: list[Row] = []
    off = []
    for each in sorted(predicted, key=lambda p: (-p["distance"], p["omega"])):
        run, row = runs.get((each["fx"], each["omega"])), each | {"measured": None}
        if run is not None:
            row["measured"] = middle(run["below"], run["above"])
            row |= {key: run[key] for key in ("below", "above", "runs")} | {"triggers_at": run["reached"]}
            off.append(abs(each["predicted"] / row["measured"] - 1))
        rows.append(row if real is None else row | in_si(real, each, settings(scene).on))
    return {
        **{key: onset[key] for key in ("fx_c", "error", "undamped_fx_c")},
        "v0": threshold(scene),
        "time": settings(scene).time,
        "on": settings(scene).on,
        "largest_deviation": max(off, default=None),
        "map": rows,
    }


def _page(result: Result) -> Result:
    rows = result["map"]
    distances = sorted({row["distance"] for row in rows}, reverse=True)
    weakest = [min((r for r in rows if r["distance"] == d), key=lambda r: r["predicted"]) for d in distances]
    slowest = [min((r for r in rows if r["distance"] == d), key=lambda r: r["omega"]) for d in distances]
    return {
        "runs": [row for row in rows if row["measured"] is not None],
        "distances": list(zip(distances, weakest, slowest, strict=True)),
        "damped": bool(result["scene"].get("damping")),
    }


def _onset(scene: Scene, work: Work) -> Row:
    """The onset from which distances count, with the scene's dissipation if it has any, and the undamped one."""
    known = work.rows.find(kind="onset")
    if known is not None:
        return known
    work.say("onset")
    found = onset_run(scene, scene.law.mus[0], dissipation=scene.damping is not None)
    work.say(found.describe())
    undamped = None if found.undamped is None else found.undamped.fx_c
    return work.rows.append(kind="onset", fx_c=found.fx_c, error=found.error, undamped_fx_c=undamped)


def _predict_map(scene: Scene, fx_c: float, work: Work) -> list[Row]:
    """The whole map, a distance at a time."""
    distances = sorted(settings(scene).distance, reverse=True)
    missing = [d for d in distances if work.rows.find(kind="predicted", distance=d) is None]
    packings = equilibria(scene, [fx_c * (1 - d) for d in distances]) if missing else {}
    for distance, found in map_predictions(scene, packings, fx_c, missing):
        work.rows.append(kind="predicted", distance=distance, found=found)
        least = min(found, key=lambda each: each["predicted"])
        work.say(
            f"at 1 - F_x/F_x^c = {distance:g}: a_c is least, {least['predicted']:.3g}, at omega = {least['omega']:.4g}"
        )
    known = [row for row in work.rows.rows if row["kind"] == "predicted" and row["distance"] in distances]
    return [each for row in known for each in row["found"]]


def _bisect_map(scene: Scene, predicted: list[Row], work: Work) -> list[Row]:
    """All bisections: from the file, or else computed."""
    wanted = spread_over_map(predicted, settings(scene).runs)

    def row_of(each: Row) -> Row | None:
        return work.rows.find(kind="measured", fx=each["fx"], omega=each["omega"])

    missing = [each for each in wanted if row_of(each) is None]
    if len(missing) < len(wanted):
        work.say(f"{len(wanted) - len(missing)} of {len(wanted)} bisections are in {work.rows.path} already")
    if missing:
        packings = equilibria(scene, {each["fx"] for each in wanted})  # all: the path is that of one run of the command
        waves = [Wave(scene, packings[each["fx"]], each) for each in missing]
        for found in work.progress(work.map_rows(bisect_amplitude, waves), len(waves)):
            work.rows.append(kind="measured", **found)
            at = f"omega = {found['omega']:.4g} at {found['distance']:g}"
            work.say(f"{at}: triggers from {middle(found['below'], found['above']):.4g} on in LAMMPS")
    return [row for each in wanted if (row := row_of(each)) is not None]


trigger_map = SceneStudy(
    package=__package__ or "",
    name="trigger",
    beside="output",
    check=_check,
    compute=_compute,
    figures=lambda result, _: {"map": lambda: map_figure(result), "thresholds": lambda: threshold_figure(result)},
    page=_page,
)
"""Predicts and measures critical amplitudes; of a scene with [ramp], and [friction] with a number v0."""
