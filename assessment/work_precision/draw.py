"""The figure of a study: error over wall time, and over machine-independent work or the parameter."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from ...figures.style import INK, styled
from .methods.work_precision_study import COMPENSATED_SUFFIX, Study

MARKERS = "osD^vP"
DASHES = ("--", ":", "-.", (0, (5, 1, 1, 1, 1, 1)))
LARGEST_MARKER, SMALLEST_MARKER = 6.5, 3.0
"""Sizes of the markers of the first and of the last method, points: markers that coincide are both seen."""

LABEL_WIDTH = 44
"""Characters of a line of the label of an axis."""


@styled
def figure_of(study: Study) -> Figure:
    """Two panels that share the errors, doubly logarithmic.

    A method in compensated arithmetic has the colour of the plain one, hollow and broken. Methods with a parameter are
    lines through their points, where the error falls steadily; where the second panel is over the parameter, the
    others are horizontal lines there. Theory is grey. Errors in the shade are below the reference's own error. Errors
    of zero stand on a line of their own.
    """
    errors = [point.error for point in study.points if point.error > 0]
    floors = [line.error[0] for line in study.theory if not line.parameter]
    # what lies further below than two decades is of no concern, and would flatten the rest
    low = min([*errors, *(each for each in [*floors, study.reference_error] if each > 0.01 * min(errors))])
    zeros = len(errors) < len(study.points)
    bottom = 10.0 ** (np.floor(np.log10(low)) - (1.0 if zeros else 0.5))
    top, zero = 10.0 ** (np.ceil(np.log10(max(errors + floors))) + 0.3), bottom * 10**0.25
    figure = Figure(figsize=(6.8, 3.5), layout="constrained")
    left, right = panels = figure.subplots(1, 2, sharey=True)
    families = list(dict.fromkeys(method.removesuffix(COMPENSATED_SUFFIX) for method in study.methods))
    for method in study.methods:
        points, number = study.of(method), families.index(method.removesuffix(COMPENSATED_SUFFIX))
        size = LARGEST_MARKER - (LARGEST_MARKER - SMALLEST_MARKER) * number / max(1, len(families) - 1)
        style: dict[str, Any] = {"color": f"C{number}", "marker": MARKERS[number], "markersize": size}
        style |= {"clip_on": False, "zorder": 3 + 0.1 * number}
        if method.endswith(COMPENSATED_SUFFIX):
            style |= {"markerfacecolor": "white", "linestyle": "--"}
        steps = np.diff([point.error for point in points])
        if not (np.all(steps <= 0) or np.all(steps >= 0)):
            style["linestyle"] = "none"
        error = [point.error or zero for point in points]
        left.plot([point.seconds for point in points], error, label=method, **style)
        seen = [(x, e) for p, e in zip(points, error, strict=True) if (x := getattr(p, study.abscissa))]
        if seen:
            right.plot(*np.transpose(seen), **style)
        elif study.abscissa == "parameter":
            right.axhline(error[0], color=style["color"], linewidth=0.9)
    for number, line in enumerate(study.theory):
        grey: dict[str, Any] = {"color": "0.35", "linewidth": 0.9, "linestyle": DASHES[number], "zorder": 4}
        if line.parameter:
            right.plot(line.parameter, line.error, label=line.label, **grey)
        else:
            left.axhline(line.error[0], **grey)
            right.axhline(line.error[0], label=line.label, **grey)
    left.set(xscale="log", yscale="log", ylim=(bottom, top), xlabel="wall time, s", ylabel=_label(study.error))
    right.set(xscale="log", xlabel=_label(getattr(study, study.abscissa)))
    (handles, labels), (more, names) = (axes.get_legend_handles_labels() for axes in panels)
    figure.legend(handles + more, labels + names, loc="outside lower center", ncols=3, columnspacing=1.2)
    for axes in panels:
        if study.reference_error > bottom:
            axes.axhspan(bottom, study.reference_error, color="#e9e9e9", linewidth=0, zorder=0)
        if zeros:
            axes.axhline(zero, color=INK, linewidth=0.5, linestyle=":")
        # from one power of ten to another, so that at least two are labelled
        first, last = np.log10(axes.get_xlim())
        axes.set_xlim(10.0 ** np.floor(first + 0.1), 10.0 ** np.ceil(last - 0.1))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(color=INK, alpha=0.12, linewidth=0.4)
    if zeros:
        left.annotate("0", (0.015, zero), (0, 2), left.get_yaxis_transform(), textcoords="offset points")
    return figure


def _label(text: str) -> str:
    """The label of an axis: in two lines if it is long, with symbols in place of their names."""
    if len(text) > LABEL_WIDTH:
        cut = text.rfind(" ", 0, LABEL_WIDTH)
        text = text[:cut] + "\n" + text[cut + 1 :]
    return text.replace("F_x^c", "$F_x^c$").replace("R theta", r"$R\,\theta$")
