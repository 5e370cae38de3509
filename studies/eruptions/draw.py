"""Pictures of the sizes of eruptions."""

from __future__ import annotations

from typing import Any

from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ...figures.series import few_decades, positive
from ...figures.style import INK, styled
from ..result_rows import row_columns

MARKER_OF = {"opens": "o", "slides": "s", "law": "D", "flows": "^", "cut off": "X", "rises": "v", "stable": "."}
WORDS_OF = {
    "opens": "a contact opens",
    "slides": "a contact slides",
    "law": "curvature of the law",
    "flows": "the layer flows",
    "cut off": "not over yet",
    "rises": "D rises, though linearly stable",
    "stable": "stable: no growth",
}


@styled
def size_figure(runs: list[dict[str, Any]]) -> Figure:
    """Sizes over the load, of the runs of eruptions.json.

    The largest D, the largest displacement of the layer squared, and contacts that are open or slide at the most, over
    F_x. The markers of D say what ended the growth; open ones are damped runs.
    """
    figure = Figure(figsize=(3.4, 4.2), layout="constrained")
    sizes, contacts = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for ends, marker in MARKER_OF.items():
        for damped in (False, True):
            rows = [row for row in runs if row["ends"] == ends and row["damped"] == damped]
            if rows:
                face, label = ("white", f"{WORDS_OF[ends]} (damped)") if damped else ("C0", WORDS_OF[ends])
                places = row_columns(rows, "fx", "msd")
                sizes.plot(*places, marker, color="C0", markersize=4, markerfacecolor=face, label=label)
    free = [row for row in runs if not row["damped"]]
    fx, slip, noise = row_columns(free, "fx", "slip", "noise")
    sizes.plot(fx, slip**2, "_", color="C1", label="(slip of the layer)$^2$")
    sizes.plot(fx, noise, ":", color=INK, linewidth=0.7, label="noise of doubles")
    sizes.set(yscale="log", ylabel="largest $D$")
    few_decades(sizes, 8)
    sizes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    for key, colour, name in (("lost", "C0", "open"), ("sliding", "C2", "slide"), ("gained", "C3", "new")):
        contacts.plot(*row_columns(free, "fx", key), ".-", color=colour, linewidth=0.6, label=name)
    contacts.set(xlabel="$F_x$", ylabel="contacts", xscale="log", ylim=(-0.5, max(5, 1.1 * contacts.dataLim.y1)))
    contacts.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    contacts.legend()
    return figure


@styled
def course_figure(series: dict[float, dict[str, list[float]]]) -> Figure:
    """D(t) of the undamped runs, coloured by their load."""
    figure = Figure(figsize=(4.4, 2.7), layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", xlabel="$t$", ylabel="$D(t)$")
    order = sorted(series)
    for k, fx in enumerate(order):
        time, msd = positive(series[fx]["time"], series[fx]["msd"])
        colour = colormaps["viridis"](0.9 * k / max(1, len(order) - 1))
        axes.plot(time, msd, color=colour, linewidth=0.7, label=f"{fx:g}")
    few_decades(axes, 8)
    axes.legend(title="$F_x$", ncols=1 + len(order) // 12, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure
