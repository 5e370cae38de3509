"""The picture of shares over the scaled load, and of random matrices."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from faultgouge.figures import styled
from faultgouge.studies.modes import LABELS, MediansOverLoad, draw_band


@styled
def collapse(sizes: Mapping[int, MediansOverLoad], power: float, random: Mapping[int, MediansOverLoad]) -> Figure:
    """Shares over the load times a power of the number of disks, and shares of random matrices over the measured ones.

    Parameters
    ----------
    sizes : mapping
        Number of disks -> course.
    power : float
        The load goes as N^power at a given share.
    random : mapping
        Number of disks -> loads, measured, random and formula, lists of [median, low, high].
    """
    figure = Figure((8.5, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    for number, (disks, course) in enumerate(sizes.items()):
        scaled = [load * (disks / 100) ** -power for load in course["loads"]]
        draw_band(left, scaled, np.array(course["share"], dtype=float), f"C{number}", str(disks))
    left.set(xscale="log", xlabel=rf"$F_x/F_y \;(N/100)^{{{-power:.2f}}}$", ylabel=LABELS["share"])
    left.legend(title="disks")
    for number, (disks, course) in enumerate(random.items()):
        measured, drawn, formula = (np.array(course[name])[:, 0] for name in ("measured", "random", "formula"))
        right.plot(measured, drawn, "o", color=f"C{number}", markersize=4, label=f"{disks}")
        right.plot(measured, formula, "x", color=f"C{number}", markersize=4)
    right.plot([0, 0.7], [0, 0.7], "-", color="0.6", linewidth=1, zorder=0)
    right.set(xlabel="share, measured", ylabel="share, random matrices (o), formula (x)", xlim=(0, 0.7), ylim=(0, 0.7))
    if random:
        right.legend(title="disks")
    for axes in (left, right):
        axes.grid(alpha=0.3)
    return figure
