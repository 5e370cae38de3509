"""The sizes of eruptions over the load, computed, drawn and written into a folder."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from ...analysis import NoEquilibriumError
from ...figures.pages import render
from ...pywrap import Engine, Equilibrium, Scene, SceneError
from ...pywrap.onset.sharing import Progress, Say, shared_out
from ...pywrap.runs.path import EquilibriumPath, loads
from ...pywrap.scenes.refusals import needed
from ...pywrap.scenes.study_sections import Eruptions
from ...pywrap.scenes.units import real_units
from ...pywrap.settling.bed import settle
from ..rows import Rows
from . import draw
from .compute import DECADES, OVER, QUIET, Start, erupt


def eruptions(
    scene: Scene, output: Path, say: Say = print, progress: Progress = lambda results, _: results
) -> dict[str, Any]:
    """Run every load of the scene until it is over, and leave eruptions.json, pictures and a page in a folder.

    A run is a line of eruptions.jsonl as soon as it is over, and lines of the same scene are not computed again; loads
    may be added. Under `mpiexec -n K` all K ranks call this; one hands out the loads, the others take them.

    Parameters
    ----------
    scene : Scene
        With [ramp] and [eruptions].
    output : Path
        The folder, made if need be.
    say : callable
        Takes a line of progress.
    progress : callable
        Takes the runs that end and their number, and hands them on.

    Returns
    -------
    dict
        What eruptions.json holds; empty on ranks other than 0.

    Raises
    ------
    SceneError
        If the scene has no section [ramp] or [eruptions].
    NoEquilibriumError
        If the packing bears none of the loads.
    """
    settings = _checked(scene)
    wanted = sorted(settings.load)
    with shared_out() as share:
        if share is None:
            return {}
        output.mkdir(parents=True, exist_ok=True)
        rows = Rows(output / "eruptions.jsonl", scene, beside="eruptions")
        time = settings.time
        kinds = (False,) if scene.damping is None else (False, True)
        missing = [fx for fx in wanted if any(rows.find(fx=fx, longest=time, damped=kind) is None for kind in kinds)]
        flows_beyond = None
        if missing:
            say(f"{len(wanted) - len(missing)} of {len(wanted)} loads are known; ramp up to F_x = {missing[-1]:g}")
            # through the known loads as well: the path, and with it the last digits, is that of one run of the command
            starts, flows_beyond = _starts(scene, [fx for fx in wanted if fx <= missing[-1]], time)
            starts = [
                each for each in starts if rows.find(fx=each.packing.fx, longest=time, damped=each.damped) is None
            ]
            if flows_beyond is not None:
                say(f"no equilibrium beyond F_x = {flows_beyond:g}: the loads above are left out")
            for found in progress(share(erupt, starts), len(starts)):
                rows.append(longest=time, **found.as_dict())
                say(
                    f"F_x = {found.fx:g}: D up to {found.msd:.2g}, the layer slips by {found.slip:.2g}, {found.lost} "
                    f"contacts open; {found.ends} after t = {found.time:.4g}"
                )
        runs = [row for row in rows.rows if row["fx"] in wanted and row["longest"] == time]
    if not runs:
        raise NoEquilibriumError(f"the packing bears none of the loads: it flows beyond F_x = {flows_beyond:g}")
    result = summary(scene, runs)
    (output / "eruptions.json").write_text(json.dumps(result, indent=1) + "\n")
    draw.figures(result, {row["fx"]: row["series"] for row in runs if not row["damped"]}, output)
    (output / "eruptions.md").write_text(_page(result))
    return result


def summary(scene: Scene, runs: list[dict[str, Any]]) -> dict[str, Any]:
    """What eruptions.json holds: everything but the series."""
    leave_out = {"scene", "version", "series", "longest"}
    ordered = sorted(runs, key=lambda row: (row["fx"], row["damped"]))
    real = real_units(scene)
    return {
        "scene": scene.resolved(),
        "units": None if real is None else real.as_dict(),
        "runs": [{key: value for key, value in row.items() if key not in leave_out} for row in ordered],
    }


def _page(result: dict[str, Any]) -> str:
    """eruptions.md, from what eruptions.json holds."""
    runs = result["runs"]
    damped = {run["fx"]: run for run in runs if run["damped"]}
    damping = result["scene"].get("damping") or {}
    grown = [run["msd"] for run in runs if run["ends"] != "stable" and not run["damped"]]
    return render(
        __package__ or "",
        "eruptions.md.j2",
        runs=runs,
        units=result["units"],
        fy=result["scene"]["load"]["fy"],
        words=draw.WORDS,
        beside=[(run, damped[run["fx"]]) for run in runs if not run["damped"] and run["fx"] in damped],
        damping=", ".join(f"{key} = {value:g}" for key, value in damping.items() if value),
        decades=float(np.log10(max(grown) / min(grown))) if grown else 0.0,
        noise=(min(run["noise"] for run in runs), max(run["noise"] for run in runs)),
        balance=max(run["balance"] for run in runs if not run["damped"]),
        criterion=(OVER, DECADES, QUIET),
    )


def starts_of(scene: Scene) -> tuple[list[Start], float | None]:
    """Where the runs of a scene begin, and the last load that the packing bears if it does not bear them all.

    Raises
    ------
    SceneError
        If the scene has no section [ramp] or [eruptions].
    """
    settings = _checked(scene)
    return _starts(scene, sorted(settings.load), settings.time)


def _checked(scene: Scene) -> Eruptions:
    """The section [eruptions] of a scene whose ramp reaches its loads."""
    until = needed(scene.ramp, "ramp").until
    if scene.eruptions is None:
        raise SceneError("the scene has no section [eruptions]: add it, with load, a list of F_x")
    last = max(scene.eruptions.load)
    if last > until:
        raise SceneError(f"eruptions.load goes to {last:g}, and ramp.until = {until:g}: ramp further")
    return scene.eruptions


def _starts(scene: Scene, wanted: list[float], time: float) -> tuple[list[Start], float | None]:
    """The equilibria at the loads that the packing bears, and the last load that it bears if there are more."""
    assert scene.ramp is not None
    first = settle(scene, communicator=MPI.COMM_SELF)
    starts: list[Start] = []
    steps = loads(scene.ramp)
    with Engine(first.packing, MPI.COMM_SELF) as engine:
        path = EquilibriumPath(engine, first, scene)
        for fx in wanted:
            try:
                for load in steps[(steps > path.kept[-1].fx) & (steps < fx)]:
                    path(float(load))
                packing = path(fx)
            except NoEquilibriumError:
                return starts, path.kept[-1].fx
            here: Equilibrium = path.kept[-1]
            free = replace(packing, law=replace(packing.law, cn=0.0, ct=0.0), drag_time=None)
            starts.append(Start(free, here.residual, time))
            if scene.damping is not None:
                starts.append(Start(packing, here.residual, time, damped=True))
    return starts, None
