r"""Dissipation: the onset over the strength of dashpots and of drag, and the transient gain below it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from faultgouge.figures import INK, styled
from faultgouge.studies.result_rows import row_columns
from research.dissipation.compute import Row

REACH = 4
"""How far beyond the undamped onset onsets are shown, in units of what weak dashpots lower it by."""


@styled
def dissipation_figure(dashpots: Sequence[Row], drag: Sequence[Row], gains: Mapping[str, Sequence[Row]]) -> Figure:
    """The three panels: dashpots above, drag and gain below.

    Parameters
    ----------
    dashpots, drag : sequence of dict
        Rows of `over_strength`, by increasing strength.
    gains : dict
        Rows of `over_distance` by increasing distance, by the name of the dissipation.
    """
    figure = Figure(figsize=(5.2, 4.4), layout="constrained")
    axes = figure.subplot_mosaic("aa;bc")
    _draw_dashpot_onset(dashpots, axes["a"])
    _draw_drag_shift(drag, axes["b"])
    _draw_gain(gains, axes["c"])
    for name, title in (("a", "dashpots lower the onset"), ("b", "drag raises it"), ("c", "transient gain below it")):
        axes[name].set_title(f"({name}) {title}", loc="left", fontsize=8.5)
    return figure


def _draw_dashpot_onset(found: Sequence[Row], axes: Axes) -> None:
    """Onsets among all modes as dots, the predicted limit as a line, dotted the undamped onset.

    Onsets far above both are written at the upper edge.
    """
    strengths, onsets, predicted = row_columns(found, "strength", "onset", "predicted")
    undamped = found[0]["undamped"]
    axes.axhline(undamped, color=INK, linewidth=0.8, linestyle=":", label="without dissipation")
    axes.plot(strengths, predicted, color="C1", label="limit, from the undamped pair")
    axes.plot(strengths, onsets, "o", color="C0", markersize=4, label="damped onset")
    gap = undamped - float(np.nanmin(predicted))
    top = undamped + REACH * gap
    for strength, onset in zip(strengths, onsets, strict=True):
        if onset > top:
            axes.annotate(
                f"{onset:.4g}",
                (strength, top),
                xytext=(strength, top - 0.6 * gap),
                ha="right",
                va="center",
                fontsize=8,
                arrowprops={"arrowstyle": "->", "color": "C0"},
            )
    axes.set(xscale="log", xlabel="$C_N$", ylabel="$F_x$ of the onset", ylim=(undamped - 2 * gap, top))
    axes.legend(loc="upper left", bbox_to_anchor=(0, 0.85))  # below what lies beyond the axes


def _draw_drag_shift(found: Sequence[Row], axes: Axes) -> None:
    """How far drag raises the onset, over 1/tau; the line is where 2 |Im omega| of the undamped pair is 1/tau."""
    strengths, onsets, predicted = row_columns(found, "strength", "onset", "predicted")
    undamped = found[0]["undamped"]
    axes.plot(strengths, predicted - undamped, color="C1", label=r"$2\,|\mathrm{Im}\,\omega| = 1/\tau$")
    axes.plot(strengths, onsets - undamped, "o", color="C0", markersize=4, label="damped onset")
    axes.set(xscale="log", yscale="log", xlabel=r"$1/\tau$", ylabel="onset $-$ undamped onset")
    axes.legend(loc="upper left")


def _draw_gain(curves: Mapping[str, Sequence[Row]], axes: Axes) -> None:
    """The transient gain over the distance from the undamped onset; a gap where some motion grows for ever."""
    for number, (label, found) in enumerate(curves.items()):
        axes.plot(*row_columns(found, "distance", "gain"), "o-", color=f"C{number}", markersize=3.5, label=label)
    axes.set(xscale="log", yscale="log", xlabel="$(F_x^c - F_x)\\,/\\,F_x^c$", ylabel=r"gain of $|q|^2$")
    highest = max(each["gain"] or 0.0 for found in curves.values() for each in found)
    axes.set_ylim(top=30 * highest)  # room for the legend
    axes.legend(loc="upper right")
