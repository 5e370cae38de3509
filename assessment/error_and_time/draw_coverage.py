"""The figure of stated errors over true ones."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib
from matplotlib.figure import Figure

from ...figures.style import INK, STYLE
from .work_precision.coverage import Covered

MARKERS = "osD^"

AROUND = ((-29, -3), (-14, 6), (2, -11), (6, -3))
"""Where the increments of the first arithmetic stand, points, by increasing true error: they lie close together."""


@matplotlib.rc_context(fname=STYLE)
def coverage_figure(cases: Sequence[Covered]) -> Figure:
    """Stated over true errors, doubly logarithmic, a colour an arithmetic; the line is where they are equal.

    A true error of zero stands at the left edge.
    """
    figure = Figure(figsize=(4.6, 3.6), layout="constrained")
    axes = figure.subplots()
    smallest = 0.3 * min(each for case in cases for each in (case.true, case.stated) if each > 0)
    largest = 3 * max(each for case in cases for each in (case.true, case.stated))
    axes.plot([smallest, largest], [smallest, largest], color=INK, linewidth=0.8)
    axes.fill_between([smallest, largest], [smallest, largest], largest, color=INK, alpha=0.06, linewidth=0)
    for number, arithmetic in enumerate(dict.fromkeys(case.arithmetic for case in cases)):
        of_it = sorted((case for case in cases if case.arithmetic == arithmetic), key=lambda case: case.true)
        for place, case in enumerate(of_it):
            at = (max(case.true, smallest), case.stated)
            axes.plot(*at, MARKERS[number], color=f"C{number}", label=arithmetic, clip_on=False)
            aside = AROUND[place % len(AROUND)] if number == 0 else (5, -10)
            axes.annotate(f"{case.increment:g}", at, xytext=aside, textcoords="offset points", fontsize="small")
    axes.text(0.06, 0.94, "covered", transform=axes.transAxes, va="top")
    axes.set(xscale="log", yscale="log", xlim=(smallest, largest), ylim=(smallest, largest))
    axes.set(xlabel="true error of $F_x^c$", ylabel="stated error of $F_x^c$", aspect="equal")
    handles, labels = axes.get_legend_handles_labels()
    once = dict(zip(labels, handles, strict=True))
    axes.legend(once.values(), once.keys(), loc="lower right")
    return figure
