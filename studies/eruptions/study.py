"""The sizes of eruptions over the load, as a study and as a task of a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from ...analysis import NoEquilibriumError
from ...analysis.counted import counted
from ...analysis.motion.growth import NOISE_FACTOR
from ...pywrap import Scene, SceneError
from ...pywrap.runs.ramp_loads import ramp_loads
from ...pywrap.scenes.study_sections import Eruptions
from ...pywrap.scenes.validation import require_section
from ...pywrap.settling.settle import settle
from ..packing_tools import path_from
from ..result_rows import Rows
from ..study import Figures, Result, SceneStudy, Work
from .compute import DECADES_OF_D, LATE_GROWTH_OF_D, QUIET_TIME, Start, erupt
from .draw import WORDS_OF, course_figure, size_figure


def _compute(scene: Scene, work: Work) -> Result:
    """Every load of the scene until it is over; loads may be added."""
    settings, rows = _check_section(scene), work.rows
    wanted, time = sorted(settings.load), settings.time
    kinds = (False,) if scene.damping is None else (False, True)
    missing = [fx for fx in wanted if any(rows.find(fx=fx, longest=time, damped=kind) is None for kind in kinds)]
    flows_beyond = None
    if missing:
        work.say(f"{len(wanted) - len(missing)} of {len(wanted)} loads are known; ramp up to F_x = {missing[-1]:g}")
        # through the known loads as well, so that the path, and with it the last digits, is that of one run
        starts, flows_beyond = _starts(scene, [fx for fx in wanted if fx <= missing[-1]], time)
        starts = [each for each in starts if rows.find(fx=each.packing.fx, longest=time, damped=each.damped) is None]
        if flows_beyond is not None:
            work.say(f"no equilibrium beyond F_x = {flows_beyond:g}: the loads above are left out")
        for found in work.progress(work.map_rows(erupt, starts), len(starts)):
            rows.append(longest=time, **found)
            work.say(
                f"F_x = {found['fx']:g}: D up to {found['msd']:.2g}, the layer slips by {found['slip']:.2g}, "
                f"{counted(found['lost'], 'contact')} open; {found['ends']} after t = {found['time']:.4g}"
            )
    runs = _runs(rows, settings.load, time)
    if not runs:
        raise NoEquilibriumError(f"the packing bears none of the loads: it flows beyond F_x = {flows_beyond:g}")
    leave_out = {"scene", "version", "series", "longest"}
    return {"runs": [{key: value for key, value in row.items() if key not in leave_out} for row in runs]}


def _runs(rows: Rows, wanted: Sequence[float], time: float) -> list[dict[str, Any]]:
    """Runs of the given length at the given loads."""
    runs = [row for row in rows.rows if row["fx"] in wanted and row["longest"] == time]
    return sorted(runs, key=lambda row: (row["fx"], row["damped"]))


def _figures(result: Result, rows: Rows) -> Figures:
    asked = result["scene"]["eruptions"]
    series = {row["fx"]: row["series"] for row in _runs(rows, asked["load"], asked["time"]) if not row["damped"]}
    courses = {"courses": lambda: course_figure(series)} if series else {}
    return {"sizes": lambda: size_figure(result["runs"])} | courses


def _page(result: Result) -> Result:
    runs = result["runs"]
    free = [run for run in runs if not run["damped"]]
    damped = {run["fx"]: run for run in runs if run["damped"]}
    damping = result["scene"].get("damping") or {}
    grown = [run["msd"] for run in free if run["ends"] != "stable" and run["msd"] > NOISE_FACTOR * run["noise"]]
    small = [run for run in runs if run["ends"] != "stable" and run["msd"] <= NOISE_FACTOR * run["noise"]]
    return {
        "runs": runs,
        "fy": result["scene"]["load"]["fy"],
        "words": WORDS_OF,
        "beside": [(run, damped[run["fx"]]) for run in free if run["fx"] in damped],
        "damping": ", ".join(f"{key} = {value:g}" for key, value in damping.items() if value),
        "decades": float(np.log10(max(grown) / min(grown))) if grown else 0.0,
        "small": len(small),
        "noise": (min(run["noise"] for run in runs), max(run["noise"] for run in runs)),
        "balance": max(run["balance"] for run in free),
        "criterion": (LATE_GROWTH_OF_D, DECADES_OF_D, QUIET_TIME),
    }


def eruptions_of(scene: Scene, _: object) -> Result:
    """The task "eruptions" of a sweep: size and end of the eruption at each load of [eruptions], without time series.

    Raises SceneError if the scene has no section [ramp] or [eruptions].
    """
    settings = _check_section(scene)
    starts, flows_beyond = _starts(scene, sorted(settings.load), settings.time)
    runs = [erupt(each) for each in starts]
    return {"runs": [{k: v for k, v in run.items() if k != "series"} for run in runs], "flows_beyond": flows_beyond}


def _check_section(scene: Scene) -> Eruptions:
    """The section [eruptions] of a scene whose ramp reaches its loads."""
    until = require_section(scene.ramp, "ramp").first
    if scene.eruptions is None:
        raise SceneError("the scene has no section [eruptions]: add it, with load, a list of F_x")
    last = max(scene.eruptions.load)
    if last > until:
        raise SceneError(f"eruptions.load goes to {last:g}, and ramp.until = {until:g}: ramp further")
    return scene.eruptions


def _starts(scene: Scene, wanted: list[float], time: float) -> tuple[list[Start], float | None]:
    """The equilibria at the loads that the packing bears, and the last load that it bears if there are more."""
    steps = ramp_loads(scene)
    starts: list[Start] = []
    with path_from(settle(scene, communicator=MPI.COMM_SELF), scene) as path:
        for fx in wanted:
            try:
                for load in steps[(steps > path.equilibria[-1].fx) & (steps < fx)]:
                    path(float(load))
                packing = path(fx)
            except NoEquilibriumError:
                return starts, path.equilibria[-1].fx
            residual = path.equilibria[-1].residual
            free = replace(packing, law=replace(packing.law, cn=0.0, ct=0.0), drag_time=None)
            starts.append(Start(free, residual, time))
            if scene.damping is not None:
                starts.append(Start(packing, residual, time, damped=True))
    return starts, None


eruptions = SceneStudy(
    package=__package__ or "",
    name="eruptions",
    beside="eruptions",
    check=_check_section,
    compute=_compute,
    figures=_figures,
    page=_page,
)
"""Runs every load of a scene with [ramp] and [eruptions] until it is over."""
