"""The map of waves that trigger, computed, drawn and written into a folder."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ...analysis.digits import with_uncertainty
from ...figures.pages import render
from ...pywrap import Scene, SceneError
from ...pywrap.onset.sharing import Progress, Say, Share, shared_out
from ...pywrap.scenes.units import real_units
from ..rows import Rows
from . import draw
from .compute import (
    Measured,
    Prediction,
    Wave,
    as_row,
    bisected,
    chosen,
    equilibria,
    frequencies,
    in_si,
    predictions,
    settings,
    threshold,
)


def trigger_map(
    scene: Scene, output: Path, say: Say = print, progress: Progress = lambda results, _: results
) -> dict[str, Any]:
    """Predict and measure critical amplitudes, and leave trigger.json, pictures and a page in a folder.

    Every result is a line of trigger.jsonl as soon as it is there, and lines of the same scene are not computed again.
    Under `mpiexec -n K` all K ranks call this; one hands out the bisections, the others take them.

    Parameters
    ----------
    scene : Scene
        With [ramp], and [friction] with a number v0; [trigger] has the map.
    output : Path
        The folder, made if need be.
    say : callable
        Takes a line of progress.
    progress : callable
        Takes the bisections that end and their number, and hands them on.

    Returns
    -------
    dict
        What trigger.json holds; empty on ranks other than 0.

    Raises
    ------
    SceneError
        If the scene has no section [ramp], or no v_0.
    OnsetError, NoEquilibriumError
        If the packing has no onset.
    """
    threshold(scene)
    if scene.ramp is None:
        raise SceneError("the scene has no section [ramp]: add it, with step and until")
    with shared_out() as share:
        if share is None:
            return {}
        output.mkdir(parents=True, exist_ok=True)
        rows = Rows(output / "trigger.jsonl", scene, beside="output")
        onset = _onset(scene, rows, say)
        fx_c = onset["fx_c"]
        predicted = _predicted(scene, rows, fx_c, say)
        measured = _measured(scene, rows, predicted, share, say, progress)
    result = summary(scene, onset, predicted, measured)
    (output / "trigger.json").write_text(json.dumps(result, indent=1) + "\n")
    draw.figures(result, output)
    (output / "trigger.md").write_text(_page(scene, result))
    return result


def summary(
    scene: Scene, onset: dict[str, Any], predicted: list[Prediction], measured: list[Measured]
) -> dict[str, Any]:
    """What trigger.json holds."""
    runs = {(each.fx, each.omega): each for each in measured}
    real = real_units(scene)
    rows: list[dict[str, Any]] = []
    off = []
    for each in sorted(predicted, key=lambda p: (-p.distance, p.omega)):
        run = runs.get((each.fx, each.omega))
        row: dict[str, Any] = {**as_row(each), "measured": None}
        if run is not None:
            more = {"below": run.below, "above": run.above, "runs": run.runs, "triggers_at": run.reached}
            row |= {"measured": run.amplitude, **more}
            off.append(abs(each.predicted / run.amplitude - 1))
        rows.append(row if real is None else row | in_si(real, each, settings(scene).on))
    return {
        "scene": scene.resolved(),
        "units": None if real is None else real.as_dict(),
        **{key: onset[key] for key in ("fx_c", "error", "undamped_fx_c")},
        "v0": threshold(scene),
        "time": settings(scene).time,
        "on": settings(scene).on,
        "largest_deviation": max(off, default=None),
        "map": rows,
    }


def _page(scene: Scene, result: dict[str, Any]) -> str:
    """trigger.md, from what trigger.json holds."""
    rows = result["map"]
    distances = sorted({row["distance"] for row in rows}, reverse=True)
    weakest = [min((r for r in rows if r["distance"] == d), key=lambda r: r["predicted"]) for d in distances]
    slowest = [min((r for r in rows if r["distance"] == d), key=lambda r: r["omega"]) for d in distances]
    return render(
        __package__ or "",
        "trigger.md.j2",
        result=result,
        runs=[row for row in rows if row["measured"] is not None],
        distances=list(zip(distances, weakest, slowest, strict=True)),
        wave="a force a cos(omega t) along x on each disk of the upper layer"
        if result["on"] == "layer"
        else "an acceleration a cos(omega t) of the floor along x",
        units=result["units"],
        damped=scene.damping is not None,
    )


def _onset(scene: Scene, rows: Rows, say: Say) -> dict[str, Any]:
    """The onset from which distances count, with the scene's dissipation if it has any, and the undamped one."""
    known = rows.find(kind="onset")
    if known is not None:
        return known
    say("onset")
    mu, undamped = scene.law.mus[0], None
    if scene.damping is None:
        from ...pywrap.onset.undamped import onset_run

        onset = onset_run(scene, mu).onset
        fx_c, error = onset.fx_c, onset.error
    else:
        from ...pywrap.onset.damped import damped_onset_run

        run = damped_onset_run(scene, mu)
        fx_c, error, undamped = run.fx_c, run.error, None if run.undamped is None else run.undamped.fx_c
    say(f"F_x^c = {with_uncertainty(fx_c, error)}")
    return rows.append(kind="onset", fx_c=fx_c, error=error, undamped_fx_c=undamped)


def _predicted(scene: Scene, rows: Rows, fx_c: float, say: Say) -> list[Prediction]:
    """The whole map, a distance at a time."""
    distances = sorted(settings(scene).distance, reverse=True)
    missing = [d for d in distances if rows.find(kind="predicted", distance=d) is None]
    packings = equilibria(scene, [fx_c * (1 - d) for d in distances]) if missing else {}
    omegas = frequencies(packings[fx_c * (1 - distances[0])], settings(scene)) if missing else None
    for distance in missing:
        assert omegas is not None
        found = predictions(scene, packings[fx_c * (1 - distance)], distance, omegas)
        rows.append(kind="predicted", distance=distance, found=[as_row(each) for each in found])
        weakest = min(found, key=lambda each: each.predicted)
        say(f"at 1 - F_x/F_x^c = {distance:g}: a_c is least, {weakest.predicted:.3g}, at omega = {weakest.omega:.4g}")
    return [
        Prediction(**each)
        for row in rows.rows
        if row["kind"] == "predicted" and row["distance"] in distances
        for each in row["found"]
    ]


def _measured(
    scene: Scene, rows: Rows, predicted: list[Prediction], share: Share, say: Say, progress: Progress
) -> list[Measured]:
    """The bisections, those that are in the file already and those that are not."""
    wanted = chosen(predicted, settings(scene).runs)
    known = [rows.find(kind="measured", fx=each.fx, omega=each.omega) for each in wanted]
    missing = [each for each, row in zip(wanted, known, strict=True) if row is None]
    if len(missing) < len(wanted):
        say(f"{len(wanted) - len(missing)} of {len(wanted)} bisections are in {rows.path} already")
    if missing:
        packings = equilibria(scene, {each.fx for each in wanted})  # all: the path is that of one run of the command
        wave, v0 = settings(scene), threshold(scene)
        waves = [
            Wave(packings[each.fx], each.distance, each.omega, wave.time, wave.on, v0, each.predicted)
            for each in missing
        ]
        for found in progress(share(bisected, waves), len(waves)):
            rows.append(kind="measured", **as_row(found))
            say(f"omega = {found.omega:.4g} at {found.distance:g}: triggers from {found.amplitude:.4g} on in LAMMPS")
    names = Measured.__dataclass_fields__
    return [
        Measured(**{key: row[key] for key in names})
        for each in wanted
        if (row := rows.find(kind="measured", fx=each.fx, omega=each.omega)) is not None
    ]
