"""The picture of a sweep: onsets, or the sizes of eruptions, over the swept keys.

Scenes with the same values of all swept keys but the seed are one sample. Each sample is a curve, its share with an
onset up to F_x (Kaplan and Meier), and a median with its 95 % interval from resampled packings
(:mod:`~faultgouge.studies.statistics`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ...analysis.arrays import Floats
from ...figures.style import report_failure, save, styled
from ..result_rows import Row
from ..statistics import Bools, course, median_interval

STYLE_COLOURS = 6
"""Colours of the style: more scenes cannot be told apart."""

SAMPLE_DISTANCE, EDGE_MARGIN = 0.035, 0.08
"""Distance of samples at one value, and of the outermost from the edge, in units of the range of values."""

FEWEST_SCENES = 6
"""Scenes of a sample from which a median has an interval of 95 %: with five, all lie on one side of the median once in
16."""

OnsetOrBound = tuple[float, bool]
"""The largest F_x up to which there is no window, and whether that is the onset."""


class SeedSample(NamedTuple):
    """Scenes that differ in their seeds alone.

    Attributes
    ----------
    values : dict
        Swept keys with more than one value, but for the seed, and the values of these scenes.
    reach : ndarray, shape (M,)
        The onset, or the largest F_x up to which there is none.
    onset : ndarray of bool, shape (M,)
        Which of the two.
    """

    values: dict[str, Any]
    reach: Floats
    onset: Bools


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


def reach_of(row: Row) -> OnsetOrBound | None:
    """How far the (first) ramp of a row went without a window; None if the row has no ramp."""
    result = row["result"]
    end = next(iter(_dicts(result.get("ramps"))), result)
    reach = end.get("reach", end.get("fx_c"))
    return (float(reach), end["ends"] == "onset") if isinstance(reach, float) and "ends" in end else None


def _dicts(value: Any) -> list[dict[str, Any]]:
    """The dicts of a list; rows of a user's function may have anything under any name."""
    return [each for each in value if isinstance(each, dict)] if isinstance(value, list) else []


def samples_of(found: Sequence[tuple[Row, OnsetOrBound]]) -> list[SeedSample]:
    """The samples of a sweep, in the order of their first rows."""
    swept = [key for key in found[0][0]["values"] if key != "packing.seed"]
    keys = [key for key in swept if len({str(row["values"][key]) for row, _ in found}) > 1]
    groups: dict[str, list[tuple[Row, OnsetOrBound]]] = {}
    for row, reach in found:
        groups.setdefault(str([row["values"][key] for key in keys]), []).append((row, reach))
    samples = []
    for rows in groups.values():
        reaches, onsets = (np.array(column) for column in zip(*(each for _, each in rows), strict=True))
        samples.append(SeedSample({key: rows[0][0]["values"][key] for key in keys}, reaches, onsets))
    return samples


@styled
def onsets_figure(found: Sequence[tuple[Row, OnsetOrBound]]) -> Figure:
    """The share of scenes with an onset up to F_x, a curve a sample, and the onsets over each swept key.

    Forces are per disk of the upper layer. Small symbols are scenes; triangles stand where there is no onset up to
    there. A large symbol with a bar is the median of a sample with its 95 % interval; a bar with an arrow has no upper
    end within what the ramps reached. Above stands how many scenes have an onset, and how many have none.
    """
    samples = samples_of(found)
    keys = list(samples[0].values)
    # colours mean samples, or, of too many for colours, the values of the key that has most of them
    shown, counts = keys, {key: len({str(sample.values[key]) for sample in samples}) for key in keys}
    if len(samples) > STYLE_COLOURS:
        few = [key for key in keys if counts[key] <= STYLE_COLOURS]
        shown = sorted(few, key=lambda key: -counts[key])[:1]
    labels = [", ".join(f"{key} = {sample.values[key]}" for key in shown) for sample in samples]
    names = list(dict.fromkeys(labels))
    colours = [f"C{names.index(label)}" for label in labels]
    figure = Figure(figsize=(3.4, 2.2 * (1 + len(keys)) + 0.15 * len(names)), layout="constrained")
    share, *panels = figure.subplots(1 + len(keys), 1, squeeze=False)[:, 0]
    for sample, colour in zip(samples, colours, strict=True):
        share.step(*course(sample.reach, sample.onset), where="post", color=colour)
    share.set(xlabel="$F_x$", ylabel="share with an onset", xlim=(0, None), ylim=(0, 1))
    count = sum(int(np.count_nonzero(sample.onset)) for sample in samples)
    share.set_title(f"{len(found)} scenes: {count} with an onset, {len(found) - count} without", fontsize=8)
    if len(names) > 1:
        handles = [Line2D([], [], color=f"C{number}", label=name) for number, name in enumerate(names)]
        share.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.25))
    for axes, key in zip(panels, keys, strict=True):
        _draw_onsets(axes, key, samples, colours)
    if panels:
        small: dict[str, Any] = {"linestyle": "none", "mfc": "none", "ms": 2.5, "color": "0.4"}
        symbols = [
            Line2D([], [], marker="o", label="onset", **small),
            Line2D([], [], marker="^", label="none up to here", **small),
            Line2D([], [], marker="D", ms=4.5, color="0.4", linewidth=1.6, label="median, 95 %"),
        ]
        panels[0].legend(handles=symbols, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return figure


def _draw_onsets(axes: Axes, key: str, samples: Sequence[SeedSample], colours: Sequence[str]) -> None:
    """The onsets of each sample over a key, and its median with its interval; samples of one value side by side."""
    highest = max(float(sample.reach.max()) for sample in samples)
    places = _places(axes, key, [sample.values[key] for sample in samples])
    for place, sample, colour in zip(places, samples, colours, strict=True):
        for shown, marker in ((sample.onset, "o"), (~sample.onset, "^")):
            x, y = np.full(shown.sum(), place), sample.reach[shown]
            axes.plot(x, y, marker, color=colour, mfc="none", ms=2.5, alpha=0.5)
        middle, low, high = median_interval(sample.reach, sample.onset)
        if len(sample.onset) < FEWEST_SCENES or low is None:  # no draw has a median within the ramps
            continue
        end = highest if high is None else high
        axes.plot([place, place], [low, end], "-", color=colour, linewidth=1.6, zorder=3)
        if high is None:
            axes.plot(place, 1.03 * end, marker=r"$\uparrow$", color=colour, markersize=6, zorder=3)
        if middle is not None:
            axes.plot(place, middle, "D", color=colour, markersize=4.5, zorder=4)
    axes.set(ylabel="$F_x^c$", ylim=(0, 1.1 * highest))


def _places(axes: Axes, key: str, values: Sequence[Any]) -> Floats:
    """Where samples stand on the axis of a key, which becomes wide enough: at a number, or at the number of a value
    that is none; samples of one value next to each other."""
    axes.set_xlabel(key)
    if all(isinstance(value, int | float) for value in values):
        places = np.array(values, float)
        if min(values) > 0 and max(values) > 20 * min(values):
            axes.set_xscale("log")
        elif len(set(values)) <= STYLE_COLOURS:
            axes.set_xticks(sorted(set(values)))
    else:
        names = list(dict.fromkeys(map(str, values)))
        axes.set_xticks(range(len(names)), names)
        places = np.array([names.index(str(value)) for value in values], float)
    there, back = (np.log, np.exp) if axes.get_xscale() == "log" else (np.array, np.array)
    along = there(places)
    span = float(np.ptp(along)) or 1.0
    same = along[:, None] == along
    aside = along + SAMPLE_DISTANCE * span * (np.tril(same, -1).sum(axis=1) - 0.5 * (same.sum(axis=1) - 1))
    axes.set_xlim(*back([aside.min() - EDGE_MARGIN * span, aside.max() + EDGE_MARGIN * span]))
    return np.asarray(back(aside))


@styled
def eruptions_figure(found: Sequence[tuple[Row, dict[str, float]]]) -> Figure:
    """The largest mean square displacement D of every run over its load, one colour a scene.

    A run has "fx", force per disk of the upper layer, and "msd", length^2.
    """
    figure = Figure(figsize=(3.4, 2.6), layout="constrained")
    axes = figure.add_subplot(xlabel="$F_x$", ylabel="largest $D$", yscale="log")
    scenes = {row["key"]: row["values"] for row, _ in found}
    for number, (key, values) in enumerate(scenes.items()):
        runs = [run for row, run in found if row["key"] == key]
        label = ", ".join(f"{name} = {value}" for name, value in values.items())
        fx, msd = [run["fx"] for run in runs], [run["msd"] for run in runs]
        axes.plot(fx, msd, "o", color=f"C{number % STYLE_COLOURS}", markersize=3, label=label)
    if 1 < len(scenes) <= STYLE_COLOURS:
        axes.legend()
    return figure
