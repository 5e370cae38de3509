"""A driven run: the force of the spring over time, with the slips of the layer."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.responses.slips import Slip

from .film import Course
from .style import styled


@styled
def draw_drive(series: Mapping[str, Floats], slips: Sequence[Slip]) -> Figure:
    """Draw force, displacement and thickness of the layer, and the contacts at Coulomb's bound, over time.

    Parameters
    ----------
    series : mapping of str to ndarray, shape (S,)
        Columns time, force, displacement, thickness and at_bound of a driven run.
    slips : sequence of Slip
        Its slips, each a band from its beginning to its end.
    """
    figure = Figure(figsize=(5.2, 4.6), layout="constrained")
    panels = figure.subplots(4, 1, sharex=True, height_ratios=(2, 1, 1, 1))
    time = series["time"]
    risen = series["thickness"] - series["thickness"][0]
    rows = (
        (series["force"], "force $F$", "C1"),
        (series["displacement"], "displacement", "C0"),
        (risen, "dilation", "C0"),
        (series["at_bound"], "at the bound", "C0"),
    )
    draw_slips(panels, slips)
    for axes, (values, label, color) in zip(panels, rows, strict=True):
        axes.plot(time, values, color=color, linewidth=0.8)
        axes.set_ylabel(label)
        axes.margins(x=0)
    panels[0].margins(y=0.12)
    panels[-1].set_xlabel("$t$")
    figure.align_ylabels()
    return figure


def draw_slips(panels: Sequence[Axes], slips: Sequence[Slip]) -> None:
    """A band for each slip in panels over time, and its number in the first panel, which shows the force."""
    for axes in panels:
        for slip in slips:
            axes.axvspan(slip.begins, slip.ends, color="0.85", linewidth=0)
    for number, slip in enumerate(slips, 1):
        panels[0].annotate(
            str(number), (slip.begins, slip.force_before), (0, 3), textcoords="offset points", ha="center", fontsize=7
        )


def course_of(
    series: Mapping[str, Floats], slips: Sequence[Slip], times: Sequence[float], first: float, last: float
) -> Course:
    """The force over time between two times, with the places of states at these times on it, for a film."""
    shown = (series["time"] >= first) & (series["time"] <= last)
    time, force = series["time"][shown], series["force"][shown]
    places = np.clip(np.searchsorted(time, times), 0, max(len(time) - 1, 0)).tolist()
    slipping = [any(slip.begins < each <= slip.ends for slip in slips) for each in times]
    words = [f"$t = {each:.1f}$" + ", slip" * now for each, now in zip(times, slipping, strict=True)]
    return Course(time, force, places, ("$t$", "$F$"), words)
