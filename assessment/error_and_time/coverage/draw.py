"""Figures of stated errors over true ones."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ....figures.style import INK, STYLE
from .changing import Case
from .covered import Covered

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
    smallest = _framed(axes, [(case.true, case.stated) for case in cases])
    for number, arithmetic in enumerate(dict.fromkeys(case.arithmetic for case in cases)):
        of_it = sorted((case for case in cases if case.arithmetic == arithmetic), key=lambda case: case.true)
        for place, case in enumerate(of_it):
            at = (max(case.true, smallest), case.stated)
            axes.plot(*at, MARKERS[number], color=f"C{number}", label=arithmetic, clip_on=False)
            aside = AROUND[place % len(AROUND)] if number == 0 else (5, -10)
            axes.annotate(f"{case.increment:g}", at, xytext=aside, textcoords="offset points", fontsize="small")
    handles, labels = axes.get_legend_handles_labels()
    once = dict(zip(labels, handles, strict=True))
    axes.legend(once.values(), once.keys(), loc="lower right")
    return figure


@matplotlib.rc_context(fname=STYLE)
def changing_figure(cases: Sequence[Case]) -> Figure:
    """The same of scenes in which contacts change before the onset, a colour a kind of onset.

    Scenes that were drawn after the rule of the stated errors was made are open markers.
    """
    figure = Figure(figsize=(4.6, 3.6), layout="constrained")
    axes = figure.subplots()
    smallest = _framed(axes, [(case.true, case.stated or 0.0) for case in cases])
    for number, kind in enumerate(dict.fromkeys(case.kind for case in cases)):
        for fresh in (False, True):
            of_it = [case for case in cases if case.kind == kind and case.fresh == fresh]
            at = [(max(case.true, smallest), case.stated or smallest) for case in of_it]
            x, y = zip(*at, strict=True) if at else ((), ())
            fill = "none" if fresh else "full"
            label = f"{kind}, {'drawn later' if fresh else 'first draws'}"
            axes.plot(
                x, y, MARKERS[number], fillstyle=fill, color=f"C{number}", label=label, markersize=4, clip_on=False
            )
    axes.legend(loc="lower right")
    return figure


def _framed(axes: Axes, errors: Sequence[tuple[float, float]]) -> float:
    """The line of equal errors, what is covered in shade, and axes that hold all; the smallest value on them."""
    smallest = 0.3 * min(each for pair in errors for each in pair if each > 0)
    largest = 3 * max(each for pair in errors for each in pair)
    axes.plot([smallest, largest], [smallest, largest], color=INK, linewidth=0.8)
    axes.fill_between([smallest, largest], [smallest, largest], largest, color=INK, alpha=0.06, linewidth=0)
    axes.text(0.06, 0.94, "covered", transform=axes.transAxes, va="top")
    axes.set(xscale="log", yscale="log", xlim=(smallest, largest), ylim=(smallest, largest))
    axes.set(xlabel="true error of $F_x^c$", ylabel="stated error of $F_x^c$", aspect="equal")
    return smallest
