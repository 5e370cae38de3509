"""The figures of a study: error over wall time, error over machine-independent work, and stated over true error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from ...figures.style import INK, styled
from .methods.work_precision_study import Point, StatedError, Study

MARKERS = "osD^vP"
DASHES = ("--", ":", "-.", (0, (5, 1, 1, 1, 1, 1)))
LARGEST_MARKER, SMALLEST_MARKER = 6.5, 3.0
"""Sizes of the markers of the first and of the last method, points."""

ZERO_ABOVE = 0.25
"""Decades above the lower edge at which errors of zero stand."""

SHADE = "#e9e9e9"

LABEL_WIDTH = 44
"""Characters of a line of the label of an axis."""

LABEL_OFFSETS = ((-29, -3), (-14, 6), (2, -11), (6, -3))
"""Where the increments of the first arithmetic stand, points, by increasing true error: they lie close together."""


@styled
def figure_of(study: Study) -> Figure:
    """Two panels that share the errors, doubly logarithmic.

    A method in compensated arithmetic has the colour of the plain one, hollow and broken. Methods with a parameter are
    lines through their points, where the error falls steadily; where the second panel is over the parameter, the
    others are horizontal lines there. Markers become smaller from method to method, so that none hides another. Theory
    is grey. Errors in the shade are below the reference's own error. Errors of zero stand on a line of their own.
    """
    figure = Figure(figsize=(6.8, 3.5), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    bottom, top = _limits(study)
    zero = bottom * 10**ZERO_ABOVE
    families = list(dict.fromkeys(map(_family, study.methods)))
    for method in study.methods:
        points, number = study.of(method), families.index(_family(method))
        size = LARGEST_MARKER - (LARGEST_MARKER - SMALLEST_MARKER) * number / max(1, len(families) - 1)
        style: dict[str, Any] = {"color": f"C{number}", "marker": MARKERS[number], "markersize": size}
        style |= {"clip_on": False, "zorder": 3 + 0.1 * number}
        if method != _family(method):
            style |= {"markerfacecolor": "white", "linestyle": "--"}
        if not _steady(points):
            style["linestyle"] = "none"
        error = [point.error or zero for point in points]
        left.plot([point.seconds for point in points], error, label=method, **style)
        _second(right, points, error, study.abscissa, style)
    _draw_theory(left, right, study)
    _draw_floor(left, right, study, bottom, zero)
    left.set(xscale="log", yscale="log", ylim=(bottom, top), xlabel="wall time, s", ylabel=_label(study.error))
    right.set(xscale="log", xlabel=_label(getattr(study, study.abscissa)))
    handles, labels = left.get_legend_handles_labels()
    more, names = right.get_legend_handles_labels()
    figure.legend(handles + more, labels + names, loc="outside lower center", ncols=3, columnspacing=1.2)
    for axes in (left, right):
        _whole_decades(axes)
        axes.grid(color=INK, alpha=0.12, linewidth=0.4)
    return figure


def _draw_theory(left: Axes, right: Axes, study: Study) -> None:
    """Draw theory as grey lines: over the parameter on the right, or horizontal in both panels."""
    for number, line in enumerate(study.theory):
        grey: dict[str, Any] = {"color": "0.35", "linewidth": 0.9, "linestyle": DASHES[number], "zorder": 4}
        if line.parameter:
            right.plot(line.parameter, line.error, label=line.label, **grey)
        else:
            left.axhline(line.error[0], **grey)
            right.axhline(line.error[0], label=line.label, **grey)


def _draw_floor(left: Axes, right: Axes, study: Study, bottom: float, zero: float) -> None:
    """Draw the shade below the reference's own error, and the line for errors of zero."""
    if study.reference_error > bottom:
        for axes in (left, right):
            axes.axhspan(bottom, study.reference_error, color=SHADE, linewidth=0, zorder=0)
    if any(point.error == 0 for point in study.points):
        for axes in (left, right):
            axes.axhline(zero, color=INK, linewidth=0.5, linestyle=":")
        left.annotate(
            "0", (0.015, zero), xycoords=left.get_yaxis_transform(), xytext=(0, 2), textcoords="offset points"
        )


def _steady(points: list[Point]) -> bool:
    """Whether the error falls with every step from coarse to fine, or from fine to coarse."""
    steps = np.diff([point.error for point in points])
    return bool(np.all(steps <= 0) or np.all(steps >= 0))


def _family(method: str) -> str:
    """The method without its arithmetic."""
    return method.removesuffix(", compensated")


def _second(axes: Axes, points: list[Point], error: list[float], abscissa: str, style: dict[str, Any]) -> None:
    x = [getattr(point, abscissa) for point in points]
    seen = [(a, e) for a, e in zip(x, error, strict=True) if a]
    if seen:
        axes.plot(*np.transpose(seen), **style)
    elif abscissa == "parameter":
        axes.axhline(error[0], color=style["color"], linewidth=0.9)


def _whole_decades(axes: Axes) -> None:
    """From one power of ten to another, so that at least two are labelled."""
    low, high = np.log10(axes.get_xlim())
    axes.set_xlim(10.0 ** np.floor(low + 0.1), 10.0 ** np.ceil(high - 0.1))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _limits(study: Study) -> tuple[float, float]:
    """Decades that hold every error, and the reference's if it is not far below."""
    errors = [point.error for point in study.points if point.error > 0]
    floors = [line.error[0] for line in study.theory if not line.parameter]
    low, high = min(errors), max(errors + floors)
    # what lies further below than two decades is of no concern, and would flatten the rest
    low = min([low, *(each for each in [*floors, study.reference_error] if each > 0.01 * low)])
    zeros = any(point.error == 0 for point in study.points)
    return 10.0 ** (np.floor(np.log10(low)) - (1.0 if zeros else 0.5)), 10.0 ** (np.ceil(np.log10(high)) + 0.3)


def _label(text: str) -> str:
    """The label of an axis: in two lines if it is long, with symbols in place of their names."""
    if len(text) > LABEL_WIDTH:
        cut = text.rfind(" ", 0, LABEL_WIDTH)
        text = text[:cut] + "\n" + text[cut + 1 :]
    for name, symbol in (("F_x^c", "$F_x^c$"), ("R theta", r"$R\,\theta$")):
        text = text.replace(name, symbol)
    return text


@styled
def coverage_figure(cases: Sequence[StatedError]) -> Figure:
    """Stated over true errors, doubly logarithmic, with a colour for each arithmetic and a line where both are equal.

    A true error of zero stands at the left edge.
    """
    figure = Figure(figsize=(4.6, 3.6), layout="constrained")
    axes = figure.subplots()
    errors = [each for case in cases for each in (case.true, case.stated)]
    smallest, largest = 0.3 * min(each for each in errors if each > 0), 3 * max(errors)
    axes.plot([smallest, largest], [smallest, largest], color=INK, linewidth=0.8)
    axes.fill_between([smallest, largest], [smallest, largest], largest, color=INK, alpha=0.06, linewidth=0)
    axes.text(0.06, 0.94, "covered", transform=axes.transAxes, va="top")
    axes.set(xscale="log", yscale="log", xlim=(smallest, largest), ylim=(smallest, largest))
    axes.set(xlabel="true error of $F_x^c$", ylabel="stated error of $F_x^c$", aspect="equal")
    for number, arithmetic in enumerate(dict.fromkeys(case.arithmetic for case in cases)):
        of_it = sorted((case for case in cases if case.arithmetic == arithmetic), key=lambda case: case.true)
        for place, case in enumerate(of_it):
            at = (max(case.true, smallest), case.stated)
            label = None if place else arithmetic  # once in the key
            axes.plot(*at, MARKERS[number], color=f"C{number}", label=label, clip_on=False)
            aside = LABEL_OFFSETS[place % len(LABEL_OFFSETS)] if number == 0 else (5, -10)
            axes.annotate(f"{case.increment:g}", at, xytext=aside, textcoords="offset points", fontsize="small")
    axes.legend(loc="lower right")
    return figure
