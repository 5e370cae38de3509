"""Force, complex pairs, growth and the lowest eigenvalue over the time of a driven run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...analysis.arrays import Floats
from ...analysis.motion.slips import Slip
from ...figures.drive import draw_slips
from ...figures.style import styled

LINEAR_UP_TO = 1.0
"""Rates and eigenvalues up to which the axes are linear; beyond, they are logarithmic."""


@styled
def draw_cycle_spectrum(
    series: Mapping[str, Floats], slips: Sequence[Slip], states: Sequence[Mapping[str, Any]]
) -> Figure:
    """Draw the force with its slips, and below the numbers of the states.

    Parameters
    ----------
    series : mapping of str to ndarray, shape (S,)
        Columns time and force of a driven run.
    slips : sequence of Slip
        Its slips, each a band from its beginning to its end.
    states : sequence of mapping
        Rows of `cycle_state` with the key time; a state within a slip is a pale dot.
    """
    figure = Figure(figsize=(5.6, 6.2), layout="constrained")
    force, pairs, growth, lowest = panels = figure.subplots(4, 1, sharex=True, height_ratios=(1.3, 1, 1.3, 1))
    draw_slips(panels, slips)
    for axes in panels:
        axes.margins(x=0)
    force.plot(series["time"], series["force"], color="C1", linewidth=0.8)
    force.set_ylabel("force $F$")
    force.margins(y=0.12)
    two = any(state["damped_sticking"] != state["damped_sliding"] for state in states)
    alone, other = ("all sticking", "all sliding") if two else (None, None)
    _draw_states(pairs, states, "pairs_sticking", "C0")
    _draw_states(growth, states, "undamped_sticking", "C0", f"without dissipation{f', {alone}' if two else ''}")
    _draw_states(growth, states, "damped_sticking", "C2", f"with dissipation{f', {alone}' if two else ''}")
    _draw_states(lowest, states, "lowest_sticking", "C0", alone)
    if two:
        _draw_states(pairs, states, "pairs_sliding", "C3")
        _draw_states(growth, states, "damped_sliding", "C3", f"with dissipation, {other}")
        _draw_states(lowest, states, "lowest_sliding", "C3", other)
    pairs.set_ylabel("complex pairs")
    growth.set_ylabel("growth rate of $D$")
    lowest.set_ylabel("lowest eigenvalue")
    for axes in (growth, lowest):
        axes.set_yscale("symlog", linthresh=LINEAR_UP_TO)
        axes.axhline(0, color="0.5", linewidth=0.6)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=6, loc="best")
    lowest.set_xlabel("$t$")
    figure.align_ylabels()
    return figure


def _draw_states(
    axes: Axes, states: Sequence[Mapping[str, Any]], name: str, colour: str, label: str | None = None
) -> None:
    """A number of the states over time; dots of states within slips are pale."""
    time, value = (np.array([state[key] for state in states], dtype=float) for key in ("time", name))
    slipping = np.array([bool(state["slips"]) for state in states])
    axes.plot(time, value, color=colour, linewidth=0.6, alpha=0.6)
    axes.plot(time[~slipping], value[~slipping], ".", color=colour, markersize=3, label=label)
    axes.plot(time[slipping], value[slipping], ".", color=colour, markersize=3, alpha=0.3)
