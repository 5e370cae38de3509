"""The picture of a sweep: onsets, or the sizes of eruptions, over the swept keys."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...figures.style import report_failure, save, styled
from ..statistics import course
from .table import Row

SEED = "packing.seed"

COLOURS = 6
"""Colours of the style: more scenes cannot be told apart."""

Reach = tuple[float, bool]
"""The largest F_x up to which there is no window, and whether that is the onset."""


def draw_sweep(rows: Sequence[Row], folder: Path, say: Callable[[str], None]) -> str:
    """Save results.png and results.svg, and return words for that; none where rows have no onsets and no runs."""
    reaches = [(row, reach) for row in rows if (reach := reach_of(row)) is not None]
    runs = [(row, run) for row in rows for run in _dicts(row["result"].get("runs")) if {"fx", "msd"} <= run.keys()]
    if not reaches and not runs:
        return ""
    with report_failure(f"{folder}/results.png", say):
        save(onsets_figure(reaches) if reaches else eruptions_figure(runs), folder / "results")
        return f" and {folder}/results.png"
    return ""


def reach_of(row: Row) -> Reach | None:
    """How far the (first) ramp of a row went without a window; None if the row has no ramp."""
    result = row["result"]
    end = next(iter(_dicts(result.get("ramps"))), result)
    reach = end.get("reach", end.get("fx_c"))
    return (float(reach), end["ends"] == "onset") if isinstance(reach, float) and "ends" in end else None


def _dicts(value: Any) -> list[dict[str, Any]]:
    """The dicts of a list; rows of a user's function may have anything under any name."""
    return [each for each in value if isinstance(each, dict)] if isinstance(value, list) else []


@styled
def onsets_figure(found: Sequence[tuple[Row, Reach]]) -> Figure:
    """The share of scenes with an onset up to F_x, and the onsets over each swept key.

    Forces are per disk of the upper layer; triangles stand where there is no onset up to there. Above stands how many
    scenes have an onset, and how many have none.
    """
    keys = _varied_keys([row for row, _ in found])
    figure = Figure(figsize=(3.4, 2.2 * (1 + len(keys))), layout="constrained")
    share, *panels = figure.subplots(1 + len(keys), 1, squeeze=False)[:, 0]
    reach = np.array([each for _, (each, _) in found])
    onset = np.array([each for _, (_, each) in found])
    share.step(*course(reach, onset), where="post")
    share.set(xlabel="$F_x$", ylabel="share with an onset", xlim=(0, None), ylim=(0, 1))
    without = int(np.count_nonzero(~onset))
    share.set_title(f"{len(onset)} scenes: {len(onset) - without} with an onset, {without} without", fontsize=8)
    for axes, key in zip(panels, keys, strict=True):
        place = _places(axes, key, [row for row, _ in found])
        axes.plot(place[onset], reach[onset], "o", color="C0", markersize=3, label="onset")
        axes.plot(place[~onset], reach[~onset], "^", color="C0", mfc="none", markersize=3, label="none up to here")
        axes.set(ylabel="$F_x^c$", ylim=(0, None))
    if panels:
        panels[0].legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return figure


@styled
def eruptions_figure(found: Sequence[tuple[Row, dict[str, float]]]) -> Figure:
    """The largest mean square displacement D of every run over its load, one colour a scene.

    A run has "fx", force per disk of the upper layer, and "msd", length^2.
    """
    figure = Figure(figsize=(3.4, 2.6), layout="constrained")
    axes = figure.add_subplot(xlabel="$F_x$", ylabel="largest $D$", yscale="log")
    numbers: dict[str, int] = {}
    for row, run in found:
        new = row["key"] not in numbers
        number = numbers.setdefault(row["key"], len(numbers))
        label = ", ".join(f"{key} = {value}" for key, value in row["values"].items()) if new else None
        axes.plot(run["fx"], run["msd"], "o", color=f"C{number % COLOURS}", markersize=3, label=label)
    if 1 < len(numbers) <= COLOURS:
        axes.legend()
    return figure


def _varied_keys(rows: Sequence[Row]) -> list[str]:
    """The swept keys with more than one value, but for the seed, which is a sample and no axis."""
    keys = [key for key in rows[0]["values"] if key != SEED]
    return [key for key in keys if len({str(row["values"][key]) for row in rows}) > 1]


def _places(axes: Axes, key: str, rows: Sequence[Row]) -> np.ndarray:
    """Where rows stand on the axis of a key: at its number, or at the number of a value that is none."""
    axes.set_xlabel(key)
    values = [row["values"][key] for row in rows]
    if all(isinstance(value, int | float) for value in values):
        if min(values) > 0 and max(values) > 20 * min(values):
            axes.set_xscale("log")
        return np.array(values, float)
    names = list(dict.fromkeys(map(str, values)))
    axes.set_xticks(range(len(names)), names)
    return np.array([names.index(str(value)) for value in values], float)
