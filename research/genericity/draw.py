"""The pictures of the study."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from faultgouge.analysis import Floats
from faultgouge.figures import INK, styled
from faultgouge.studies.result_rows import row_columns
from faultgouge.studies.statistics import course
from research.genericity.numbers import STEPS
from research.genericity.sets import FRICTION
from research.genericity.table import Table


@styled
def onsets_figure(onsets: Table, predicted: Floats) -> Figure:
    """Packings of the first set without an onset up to F_x, by friction coefficient, and onsets at two of them.

    Beside them what follows from F_0 of packings of 100 disks, `predicted`, force per disk of the layer.
    """
    figure = Figure(figsize=(6.8, 3.1), layout="constrained")
    left, right = figure.subplots(1, 2)
    for number, mu in enumerate(FRICTION):
        part = onsets.where(law_mu=mu).at_rest
        _survival(left, part.reach, part.found, rf"$\mu = {mu:g}$", f"C{number}")
    if len(predicted):
        fx = np.linspace(0, 0.03, 100)
        share = np.mean(np.exp(-((fx[:, None] / predicted) ** 2)), axis=1)
        left.plot(fx, share, ":", color=INK, label="two levels")
    left.set(xlabel="$F_x$", ylabel="share without an onset", xlim=(0, 0.03), ylim=(0, 1))
    if left.lines:
        left.legend(fontsize=7)
    strong, weak = STEPS[0]
    pairs = onsets.where(law_mu=strong).at_rest.beside(onsets.where(law_mu=weak).at_rest, "packing.seed")
    _draw_pairs(right, [(a, b, bool(b["ancestors"]) and a["ancestors"] == b["ancestors"]) for a, b in pairs])
    for marker, face, label in (
        ("o", "C0", "the same two modes"),
        ("o", "none", "other modes"),
        ("^", "none", "one beyond"),
    ):
        right.plot([], [], marker, color="C0", mfc=face, ms=3.5, label=label)
    right.legend(fontsize=7, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, columnspacing=1, handletextpad=0.2)
    right.set(xlabel=rf"$F_x^c(\mu = {strong:g})$", ylabel=rf"$F_x^c(\mu = {weak:g})$")
    right.set(xlim=(0, 0.0315), ylim=(0, 0.0315))
    return figure


@styled
def modes_figure(onsets: Table) -> Figure:
    """Which modes meet: participation over place in the spectrum, coloured by the share of rotation (mu = 1)."""
    figure = Figure(figsize=(3.4, 2.6), layout="constrained")
    axes = figure.add_subplot()
    found = onsets.where(law_mu=1.0).where_known("rank")
    drawn = axes.scatter(
        found.numbers("rank") / found.numbers("modes"),
        found.numbers("participation"),
        c=found.numbers("rotation"),
        s=12,
        vmin=0,
        vmax=1,
        cmap="viridis",
    )
    figure.colorbar(drawn, label="share of rotation")
    axes.set(xlabel="share of modes below the pair", ylabel="disks that move", xlim=(0, 1), ylim=(0, None))
    return figure


@styled
def size_figure(numbers: dict[str, Any]) -> Figure:
    """The onset over the number of disks beside the prediction, and the largest growth rate over the load."""
    figure = Figure(figsize=(6.8, 3.0), layout=ConstrainedLayoutEngine(wspace=0.06))
    left, right = figure.subplots(1, 2)
    for marker, (name, found) in zip("os", numbers["sizes"].items(), strict=True):
        rows = [row for row in found["rows"] if row["median"][0] is not None]
        if not rows:
            continue
        disks = row_columns(rows, "disks")[0] * (1.0 if marker == "o" else 1.04)
        middle, low, high = np.array([row["median"] for row in rows], dtype=float).T
        left.errorbar(disks, middle, [middle - low, np.nan_to_num(high - middle)], fmt=marker, ms=3.5, label=name)
    levels = numbers["levels"]["rows"]
    if levels:
        medians = [row["median"]["value"] for row in levels]
        left.plot(*row_columns(levels, "disks"), medians, ":", color=INK, label="two levels")
    left.set(xscale="log", yscale="log", xlabel="disks", ylabel="median of $F_x^c / F_y$")
    if levels or left.containers:
        left.legend()
    for number, each in enumerate(numbers["growth"]):
        points = [point for point in each["points"] if point["median"] > 0]
        loads, middle, low, high = row_columns(points, "load", "median", "low", "high")
        right.plot(loads, middle, "o-", ms=2.5, color=f"C{number}", label=f"{each['disks']}")
        right.fill_between(loads, low, high, color=f"C{number}", alpha=0.2, linewidth=0)
    right.set(xlabel="$F_x / F_y$", ylabel="largest growth rate of $D$")
    if right.lines:
        right.legend(title="disks")
    return figure


@styled
def mechanism_figure(found: dict[str, Any]) -> Figure:
    """Packings without an onset beside their surrogates."""
    figure = Figure(figsize=(3.4, 2.6), layout="constrained")
    axes = figure.add_subplot()
    names = {
        "own": "the packings",
        "linear": "straight line",
        "random": "random matrices",
        "shuffled": "shuffled contacts",
    }
    for number, (name, label) in enumerate(names.items()):
        part = found[name]
        _survival(axes, np.array(part["reach"]), np.array(part["is_onset"], dtype=bool), label, f"C{number}")
    axes.set(xlabel="$F_x$", ylabel="share without an onset", xlim=(0, 0.03), ylim=(0, 1))
    if axes.lines:
        axes.legend(fontsize=7)
    return figure


def _survival(axes: Axes, reach: Floats, found: Any, label: str, color: str) -> None:
    """The share of packings without an onset up to F_x, of Kaplan and Meier."""
    if not len(reach):
        return
    places, levels = course(reach, found)
    axes.step(places, 1 - levels, where="post", color=color, label=label)


def _draw_pairs(axes: Axes, packings: Iterable[tuple[dict[str, Any], dict[str, Any], bool]]) -> None:
    """Onsets with a smaller friction coefficient over those with a larger one; triangles where one lies beyond.

    Of each packing: how the ramps with the larger and the smaller one end, "ends" and "reach", and whether its marker
    is filled.
    """
    for strong, weak, filled in packings:
        known = [end["ends"] == "onset" for end in (strong, weak)]
        if any(known):
            marker, face = "o" if all(known) else "^" if known[0] else ">", "C0" if filled else "none"
            axes.plot(strong["reach"], weak["reach"], marker, color="C0", markerfacecolor=face, ms=3.5)
    axes.axline((0, 0), slope=1, color=INK, linewidth=0.6, linestyle=":")
    axes.set_aspect("equal")
