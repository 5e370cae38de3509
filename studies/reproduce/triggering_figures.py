r"""The figures of remote triggering, from the results of `studies.triggering`.

Friction weakens with the velocity v of the upper layer as

.. math:: \mu(v) = \mu_0 \left(B\, e^{-w (v - v_0)/v_{ss}} + \mu_{ss}\right) \quad (v > v_0), \qquad \mu_0
   \quad (v \le v_0),

which passes :math:`v_0` without a jump if :math:`B + \mu_{ss} = 1`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from numpy.typing import ArrayLike

from ...analysis.arrays import Floats
from ...figures.series import draw_series, few_decades, positive
from ...figures.style import INK, styled
from ...pywrap.lammps.dynamics import Weakening
from ..study import Figures
from ..triggering import Triggering

Curve = tuple[Floats, Floats]
"""Times, and D at these, length^2."""


def triggering_figures(found: Triggering) -> Figures:
    """The paper's figures 2 and 5."""
    weak, mu, erupting = found.weakening, found.start.packing.law.mu, found.runs["erupting"]
    runs = {name: (run["time"], run["msd"]) for name, run in found.runs.items()}
    three, speed = (runs["unperturbed"], runs["perturbed"], runs["erupting"]), np.abs(erupting["layer_velocity"])
    return {
        "figure2": partial(friction_law_figure, replace(weak, v0=0.0, v_ss=1.0), mu),
        "figure5a": partial(eruption_figure, *three, runs.get("control"), found.outcome["weakens_at"]),
        "figure5b": partial(weakening_figure, speed, erupting["friction"], weak, mu),
    }


@styled
def eruption_figure(
    unperturbed: Curve, perturbed: Curve, weakening: Curve, control: Curve | None = None, crossing: float | None = None
) -> Figure:
    """D(t) below the onset: left alone, perturbed, and perturbed with weakening friction (the paper's figure 5a).

    The control is the last of the three at a load where the packing is stable with the weakened friction, too; the
    crossing, a dotted line, is when the layer first exceeds v_0. The left panel has a logarithmic axis of time, for the
    jump, and the right one a linear axis, for the growth after it; D that is not positive is not drawn.
    """
    figure = Figure(figsize=(3.4, 2.7), layout="constrained")
    early, late = panels = figure.subplots(1, 2, sharey=True)
    for axes, name in zip(panels, ("(a) the jump", "(b) what follows"), strict=True):
        for run, colour, label in (
            (weakening, "C0", r"perturbed, friction $\mu(v)$"),
            (control, "C3", r"$\mu(v)$ below both onsets"),
            (perturbed, "C2", r"perturbed, $\mu_0$"),
            (unperturbed, "C1", r"left alone, $\mu_0$"),
        ):
            if run is not None:
                draw_series(*run, axes, label=label, color=colour)
        if crossing is not None:
            axes.axvline(crossing, color=INK, linewidth=0.6, linestyle=":")
        axes.set_title(name, loc="left", fontsize=8)
    early.set_xscale("log")
    late.set(ylabel="", xlim=(0, float(weakening[0][-1])))
    few_decades(early, 5)
    # above the axes: curves over thirty decades leave no corner that stays free for every packing
    figure.legend(*early.get_legend_handles_labels(), loc="outside upper center", ncols=2, columnspacing=1.0)
    return figure


def share(law: Weakening, velocity: ArrayLike) -> Floats:
    """mu / mu_0 at some velocities of the upper layer, an array of their shape."""
    v = np.asarray(velocity, dtype=float)
    above = np.maximum(v - law.v0, 0.0) / law.v_ss
    return np.where(v > law.v0, law.B * np.exp(-law.w * above) + law.mu_ss, 1.0)


@styled
def friction_law_figure(law: Weakening, mu_0: float) -> Figure:
    """The law mu(v) over v - v_0 in units of v_ss, which is 1 (the paper's figure 2)."""
    figure, last = Figure(layout="constrained"), 5.5 / law.w
    axes = figure.add_subplot(xlabel="$(v - v_0)/v_{ss}$", ylabel=r"$\mu(v)$", xlim=(-0.1 * last, last))
    velocity = np.array([-0.1 * last, 0.0, np.nextafter(0.0, 1), *np.linspace(0, last, 400)[1:]])
    label = rf"$\mu_{{ss}} = {law.mu_ss:g}$, $B = {law.B:g}$, $w = {law.w:g}$"
    axes.plot(velocity, mu_0 * share(law, velocity), label=label)
    axes.axhline(mu_0 * law.mu_ss, color=INK, linewidth=0.6, linestyle=":")
    axes.legend(loc="upper right", title=rf"$\mu_0 = {mu_0:g}$")
    return figure


@styled
def weakening_figure(velocity: ArrayLike, mu: ArrayLike, law: Weakening, mu_0: float) -> Figure:
    """The friction coefficient that a run has gone through, over the velocity, and its law (the paper's figure 5b).

    Both are of the same times, shape (n,). Where the mean velocity of the upper layer, length / time, is not positive,
    mu is mu_0 and nothing is drawn: the axis is logarithmic.
    """
    velocity, mu = positive(velocity, mu)
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(xscale="log", xlabel="mean velocity of the upper layer, $|v|$", ylabel=r"$\mu(v)$")
    smooth = np.geomspace(velocity.min(), velocity.max(), 500)
    axes.plot(smooth, mu_0 * share(law, smooth), color=INK, linewidth=0.8, label=r"law $\mu(v)$", zorder=1)
    axes.plot(velocity, mu, "o", color="C0", markersize=2.5, alpha=0.5, markeredgewidth=0, label="run")
    axes.xaxis.set_major_locator(LogLocator(numticks=7))
    axes.legend(loc="upper right", bbox_to_anchor=(1, 0.9))
    return figure
