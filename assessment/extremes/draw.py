"""A picture of all cases: the figure of each over its bound."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ...figures.style import INK, styled
from .cases.case import Case, Outcome

PICTURE_WIDTH, ROW = 5.4, 0.135
"""Width of the picture and height of a row, inch: names of seven points can be read at the width of a page."""

STATUS_COLOURS = {"holds": "C1", "refused": "C2", "fails": "C0"}

LOWEST = 1e-6
"""Left end of the picture, in units of the bound; what is smaller, such as an exact zero, is drawn there."""


@styled
def extremes_figure(done: Sequence[tuple[Case, Outcome]]) -> Figure:
    """Every case, and how far within its bound it is.

    Parameters
    ----------
    done : sequence of (Case, Outcome)
        Cases of one group stand together.

    Returns
    -------
    Figure
        A row for each case; a dot at its figure over its bound, a square beyond the bound's line for a refusal.
    """
    groups = [list(members) for _, members in groupby(done, lambda each: each[0].group)]
    rows = sum(len(group) + 1.5 for group in groups)
    figure = Figure(figsize=(PICTURE_WIDTH, ROW * rows + 0.9), layout="constrained")
    axes = figure.add_subplot()
    names: dict[float, str] = {}
    place = 0.0
    for group in groups:
        axes.text(0.42 * LOWEST, place, group[0][0].group, fontsize=8, style="italic", va="center")
        place += 1
        for case, outcome in group:
            names[place] = case.name
            _draw(axes, place, outcome)
            place += 1
        place += 0.5
    axes.axvline(1, color=INK, linewidth=0.8)
    axes.set(xscale="log", xlim=(0.4 * LOWEST, 30), ylim=(rows - 0.5, -1), xlabel="figure / bound")
    axes.set_yticks(list(names), [_typeset(name) for name in names.values()], fontsize=7)
    axes.set_xticks([LOWEST, 1e-4, 1e-2, 1], ["0", "$10^{-4}$", "$10^{-2}$", "1"])
    axes.tick_params(axis="x", labeltop=True)  # the picture is longer than a screen
    axes.tick_params(axis="y", length=0, which="both")
    axes.minorticks_off()
    marks = [
        Line2D([], [], color=STATUS_COLOURS[status], marker="s" if status == "refused" else "o", linestyle="")
        for status in STATUS_COLOURS
    ]
    count = {status: sum(outcome.status == status for _, outcome in done) for status in STATUS_COLOURS}
    legend = [f"{count['holds']} hold", f"{count['refused']} refused, as they should be", f"{count['fails']} fail"]
    figure.legend(marks, legend, loc="outside upper center", ncols=3)
    return figure


def _typeset(name: str) -> str:
    return (
        re.sub(r"([kFf])_([a-z]+)(\^c)?", r"$\1_{\2}\3$", name)
        .replace("mu =", r"$\mu$ =")
        .replace("eps =", r"$\epsilon$ =")
    )


def _draw(axes: Any, place: float, outcome: Outcome) -> None:
    colour = STATUS_COLOURS[outcome.status]
    if outcome.figure is None or outcome.bound is None:
        axes.plot(8, place, "s" if outcome.status == "refused" else "X", color=colour)
        return
    ratio = outcome.figure / outcome.bound if outcome.bound > 0 else (0.0 if outcome.figure == 0 else np.inf)
    ratio = float(np.clip(ratio, LOWEST, 8))
    axes.plot([LOWEST, ratio], [place, place], color=colour, linewidth=0.6, alpha=0.5)
    axes.plot(ratio, place, "o", color=colour)
