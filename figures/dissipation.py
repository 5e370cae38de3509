r"""Dissipation: the onset over the strength of dashpots and of drag, and the transient gain below it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .style import INK, figure_of, panel, styled

Floats = NDArray[np.float64]


REACH = 4
"""How far beyond the undamped onset onsets are shown, in units of what weak dashpots lower it by."""


@dataclass(frozen=True, eq=False)
class OnsetCurve:
    """The damped onset over the strength of one kind of dissipation.

    Attributes
    ----------
    strength : ndarray, shape (n,)
        C_N, or 1/tau; increasing.
    onset : ndarray, shape (n,)
        Damped onset, force per top disk; nan where nothing grows.
    predicted : ndarray, shape (n,)
        From the undamped pair; nan where it says nothing.
    undamped : float
        Onset without dissipation.
    """

    strength: Floats
    onset: Floats
    predicted: Floats
    undamped: float


@dataclass(frozen=True, eq=False)
class GainCurve:
    """The transient gain over the distance from the onset.

    Attributes
    ----------
    label : str
        The dissipation.
    distance : ndarray, shape (n,)
        In units of the undamped onset.
    gain : ndarray, shape (n,)
        Of the squared displacement; nan where some motion grows for ever.
    """

    label: str
    distance: Floats
    gain: Floats


@styled
def draw_dashpot_onset(curve: OnsetCurve, axes: Axes | None = None) -> Figure:
    """The damped onset over C_N, from the limit of weak dashpots on.

    Parameters
    ----------
    curve : OnsetCurve
        Of normal dashpots.
    axes : Axes, optional
        Where to draw; a figure of its own by default.

    Returns
    -------
    Figure
        Dots are onsets among all modes, the line is the predicted limit, dotted the undamped onset. Onsets far above
        both are written at the upper edge.
    """
    axes = panel(axes)
    axes.axhline(curve.undamped, color=INK, linewidth=0.8, linestyle=":", label="without dissipation")
    axes.plot(curve.strength, curve.predicted, color="C1", label="limit, from the undamped pair")
    axes.plot(curve.strength, curve.onset, "o", color="C0", markersize=4, label="damped onset")
    gap = curve.undamped - float(np.nanmin(curve.predicted))
    top = curve.undamped + REACH * gap
    for strength, onset in zip(curve.strength, curve.onset, strict=True):
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
    axes.set(xscale="log", xlabel="$C_N$", ylabel="$F_x$ of the onset", ylim=(curve.undamped - 2 * gap, top))
    axes.legend(loc="upper left", bbox_to_anchor=(0, 0.85))  # below what lies beyond the axes
    return figure_of(axes)


@styled
def draw_drag_shift(curve: OnsetCurve, axes: Axes | None = None) -> Figure:
    """How far drag raises the onset, over 1/tau.

    Parameters
    ----------
    curve : OnsetCurve
        Of drag.
    axes : Axes, optional
        Where to draw; a figure of its own by default.

    Returns
    -------
    Figure
        Dots are onsets among all modes, the line is where 2 |Im omega| of the undamped pair is 1/tau.
    """
    axes = panel(axes)
    axes.plot(
        curve.strength, curve.predicted - curve.undamped, color="C1", label=r"$2\,|\mathrm{Im}\,\omega| = 1/\tau$"
    )
    axes.plot(curve.strength, curve.onset - curve.undamped, "o", color="C0", markersize=4, label="damped onset")
    axes.set(xscale="log", yscale="log", xlabel=r"$1/\tau$", ylabel="onset $-$ undamped onset")
    axes.legend(loc="upper left")
    return figure_of(axes)


@styled
def draw_gain(curves: Sequence[GainCurve], axes: Axes | None = None) -> Figure:
    """The transient gain over the distance from the undamped onset, for several kinds of dissipation.

    Parameters
    ----------
    curves : sequence of GainCurve
        The first one without dissipation.
    axes : Axes, optional
        Where to draw; a figure of its own by default.

    Returns
    -------
    Figure
        Both axes logarithmic; the onset is to the left.
    """
    axes = panel(axes)
    for number, curve in enumerate(curves):
        axes.plot(curve.distance, curve.gain, "o-", color=f"C{number}", markersize=3.5, label=curve.label)
    axes.set(xscale="log", yscale="log", xlabel="$(F_x^c - F_x)\\,/\\,F_x^c$", ylabel=r"gain of $|q|^2$")
    axes.set_ylim(top=30 * max(float(np.nanmax(curve.gain)) for curve in curves))  # room for the legend
    axes.legend(loc="upper right")
    return figure_of(axes)


@styled
def dissipation_figure(dashpots: OnsetCurve, drag: OnsetCurve, gains: Sequence[GainCurve]) -> Figure:
    """The three panels: dashpots above, drag and gain below.

    Parameters
    ----------
    dashpots, drag : OnsetCurve
        As of `draw_dashpot_onset` and `draw_drag_shift`.
    gains : sequence of GainCurve
        As of `draw_gain`.
    """
    figure = Figure(figsize=(5.2, 4.4), layout="constrained")
    axes = figure.subplot_mosaic("aa;bc")
    draw_dashpot_onset(dashpots, axes["a"])
    draw_drag_shift(drag, axes["b"])
    draw_gain(gains, axes["c"])
    for name, title in (("a", "dashpots lower the onset"), ("b", "drag raises it"), ("c", "transient gain below it")):
        axes[name].set_title(f"({name}) {title}", loc="left", fontsize=8.5)
    return figure
