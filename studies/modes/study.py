"""Complex modes of a scene or of a sweep: computed, drawn and written to a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...analysis.files.atomic_write import check_own, write_json
from ...figures.style import report_failure, save
from ...figures.writers import write_film
from ...pywrap import Scene, SceneError
from ...pywrap.scenes.validation import read_toml
from ..executors import Progress, Say
from ..sweep.run_sweep import run_sweep
from ..sweep.sweep_plan import Sweep
from ..sweep.table import Row, write_csv
from ..sweep.tasks import TASKS
from .draw import PlaneFilm, over_load, plane
from .table import Table, medians_over_load

MODES_COLUMNS = (
    "disks",
    "seed",
    "fx",
    "fx_over_fy",
    "pairs",
    "share",
    "growth_rate",
    "omega",
    "least_q",
)

PACKING_KEYS = ("ends", "reach", "contacts")
"""Keys of a packing in modes.json besides its loads."""

PANELS = 4
"""Loads whose frequencies are drawn side by side."""

FRAMES_A_SECOND = 2.0
"""Frames of the film a second."""


def read_modes_sweep(path: Path) -> Sweep:
    """The sweep of a file that has a sweep of the task "modes", or a scene, which is a sweep of one point.

    Raises SceneError if the file has neither.
    """
    try:
        has_task = "task" in read_toml(path, "sweep")
    except SceneError:
        has_task = False  # the reader of scenes says what is wrong
    if has_task:
        return Sweep.from_toml(path, {"modes": TASKS["modes"]})
    return Sweep.from_mapping({"task": "modes", "scene": Scene.from_toml(path, command="modes").resolved()}, TASKS)


def modes(
    sweep: Sweep,
    output: Path,
    part: tuple[int, int] = (1, 1),
    say: Say = print,
    progress: Progress = lambda rows, _: rows,
    workers: int | None = 1,
) -> dict[str, Any]:
    """Count the complex pairs of every scene of a sweep at the loads of [modes].

    Parameters
    ----------
    sweep : Sweep
        Of the task "modes".
    output : Path
        The folder: results.jsonl as of any sweep, modes.json, modes.csv, pictures and a film.
    part, say, progress, workers
        As of :func:`~faultgouge.studies.sweep.run_sweep.run_sweep`.

    Returns
    -------
    dict
        What modes.json holds; empty on ranks other than 0.
    """
    check_own(output / "modes.json")
    check_own(output / "modes.csv", ",".join(MODES_COLUMNS))
    rows = run_sweep(sweep, output, part, say, progress, workers)
    if not rows:
        return {}
    by_key = {point.key: point for point in sweep.points}
    lines = [line for row in rows for line in _lines(row, by_key[row["key"]].scene)]
    ends = [
        {"values": row["values"], "says": row["says"]} | {key: row["result"].get(key) for key in PACKING_KEYS}
        for row in rows
    ]
    result = {"asked": sweep.as_dict(), "rows": lines, "packings": ends}
    write_json(output / "modes.json", result)
    write_csv(output / "modes.csv", MODES_COLUMNS, lines)
    with report_failure("a picture of the modes", say):
        _draw(rows, lines, output, say)
    return result


def _lines(row: Row, scene: Scene | None) -> list[dict[str, Any]]:
    """A line for each load of a packing."""
    if scene is None or row["says"] is not None:
        return []
    packing = scene.packing.model_dump()
    known = {"disks": packing.get("disks"), "seed": packing.get("seed")}
    return [known | {k: v for k, v in load.items() if k != "frequencies"} for load in row["result"]["loads"]]


def _draw(rows: list[Row], lines: list[dict[str, Any]], output: Path, say: Say) -> None:
    """Pictures of all packings over the load, and of the first packing in the plane of frequencies."""
    good = [row for row in rows if row["says"] is None]
    if not lines:
        say("no packing bears any of the loads: there is nothing to draw")
        return
    sizes = sorted({line["disks"] for line in lines if line["disks"] is not None})
    groups = {"all": good}
    if len(sizes) > 1:
        groups = {str(n): [row for row in good if row["values"].get("packing.disks") == n] for n in sizes}
    courses = {
        name: medians_over_load(Table(name, tuple(row["result"] for row in group))) for name, group in groups.items()
    }
    save(over_load(courses), output / "modes")
    complex_loads = [load for load in good[0]["result"]["loads"] if load["pairs"]]
    if not complex_loads:
        say("the first packing has no complex pair at these loads: its plane of frequencies is not drawn")
        return
    step = max(1, -(-len(complex_loads) // PANELS))
    save(plane(complex_loads[::-1][::step][::-1]), output / "plane")
    write_film(PlaneFilm(complex_loads), output / "plane.gif", FRAMES_A_SECOND)
