"""The figure of an ensemble: distributions of the onset, onsets against each other, and rises of D."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ...figures.style import styled
from ..statistics import course
from ..sweep.draw import draw_pairs
from ..sweep.triggering import Row, grows, rise_in_decades


@styled
def ensemble_figure(found: Sequence[Row]) -> Figure:
    """Results of the task "triggering"; packings without any ramp are not drawn.

    Panel (a) the share of packings with an onset up to F_x, for each friction coefficient, with ticks where packings
    are lost from sight without one; (b) the onset with the weakened friction over that with the first, filled where D
    went on to grow after its jump, triangles where one of the two is only known to lie beyond; (c) how many packings
    rose by how many decades, and how many controls.
    """
    figure = Figure(figsize=(3.4, 6.0), layout="constrained")
    onsets, pairs, rises = figure.subplots(3, 1, height_ratios=(1, 1.5, 1))
    ramped = [ramps for each in found if (ramps := each.get("ramps"))]
    mus = list(dict.fromkeys(end["mu"] for ramps in ramped for end in ramps))
    for number, mu in enumerate(mus):
        ends = [end for ramps in ramped for end in ramps if end["mu"] == mu]
        places, levels = course([end["reach"] for end in ends], [end["ends"] == "onset" for end in ends])
        onsets.step(places, levels, where="post", color=f"C{number}", label=rf"$\mu = {mu:g}$")
        lost = np.array([end["reach"] for end in ends if end["ends"] != "onset"])
        onsets.plot(lost, levels[np.searchsorted(places[1:-1], lost, side="right")], "|", color=f"C{number}")
    onsets.set(xlabel="$F_x^c$", ylabel="share of packings", ylim=(0, 1))
    if mus:
        onsets.legend()
    _draw_pairs(pairs, [each for each in found if len(each.get("ramps", ())) > 1])
    eruptions = [each["eruption"] for each in found if each.get("eruption")]
    if eruptions:
        decades = [[rise_in_decades(each, of) for each in eruptions] for of in ("weakening", "control")]
        edges = np.arange(np.floor(np.min(decades)), np.max(decades) + 0.5, 0.5)
        # outlines over each other: bars side by side would stand off their values
        for values, label, color in zip(decades, ("in the window", "control"), ("C0", "C1"), strict=True):
            rises.hist(values, bins=edges, label=label, color=color, histtype="step")
        rises.legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=2)
        rises.yaxis.set_major_locator(MaxNLocator(integer=True))
    rises.set(xlabel="rise of $D$ in decades", ylabel="packings")
    for axes, name in ((onsets, "(a)"), (pairs, "(b)"), (rises, "(c)")):
        axes.set_title(name, loc="left", fontsize=8.5)
    return figure


def _draw_pairs(axes: Axes, packings: list[Row]) -> None:
    """Onsets with the weakened friction over those with the first; triangles where one is known to lie beyond."""
    filled = [bool(each["eruption"]) and grows(each["eruption"]) for each in packings]
    ramps = [(each["ramps"][0], each["ramps"][-1]) for each in packings]
    draw_pairs(axes, [(*pair, fill) for pair, fill in zip(ramps, filled, strict=True)], markeredgewidth=0.7)
    known = [end["reach"] for pair in ramps for end in pair if "onset" in (pair[0]["ends"], pair[1]["ends"])]
    axes.set(xlim=(0, 1.05 * max(known, default=0) or 1), ylim=(0, 1.05 * max(known, default=0) or 1))
    if packings:
        strong, weak = packings[0]["ramps"][0], packings[0]["ramps"][-1]
        axes.set(xlabel=rf"$F_x^c(\mu = {strong['mu']:g})$", ylabel=rf"$F_x^c(\mu = {weak['mu']:g})$")
