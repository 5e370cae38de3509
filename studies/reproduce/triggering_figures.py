r"""The figures of remote triggering, from the results of `studies.triggering`.

Friction weakens with the velocity v of the upper layer as

.. math:: \mu(v) = \mu_0 \left(B\, e^{-w (v - v_0)/v_{ss}} + \mu_{ss}\right) \quad (v > v_0), \qquad \mu_0
   \quad (v \le v_0),

which passes :math:`v_0` without a jump if :math:`B + \mu_{ss} = 1`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from numpy.typing import ArrayLike

from ...analysis.arrays import Floats
from ...analysis.responses.normal_form import NormalForm
from ...analysis.responses.response import Response
from ...analysis.uncertain_digits import with_uncertainty
from ...figures.series import draw_series, few_decades, positive, scientific
from ...figures.style import INK, styled
from ...pywrap.lammps.dynamics import Weakening
from ..study import Figures
from ..triggering import Sensitivity, Triggering

Curve = tuple[Floats, Floats]
"""Times, and D at these, length^2."""

UNPERTURBED, PERTURBED, WEAKENING, CONTROL = "C1", "C2", "C0", "C3"

DAMPING_TIMES = np.geomspace(1e-2, 1e2, 33)
"""Damping times of a curve, in units of tau_d."""


def triggering_figures(found: Triggering, response: Response, sensitive: Sensitivity) -> Figures:
    """The paper's figures 2, 5 and 6, and three of the response: in time, over the distance from the onset, and over
    damping."""
    weak, mu, near, erupting = found.weakening, found.start.packing.law.mu, sensitive.near, found.runs["erupting"]
    runs = {name: (run["time"], run["msd"]) for name, run in found.runs.items()}
    three = runs["unperturbed"], runs["perturbed"], runs["erupting"]
    speed, chosen = np.abs(erupting["layer_velocity"]), np.unique(np.linspace(0, len(near) - 1, 4).astype(int))
    drawn: Figures = {
        "figure2": partial(friction_law_figure, replace(weak, v0=0.0, v_ss=1.0), mu),
        "figure5a": partial(eruption_figure, *three, runs.get("control"), found.outcome.crossing),
        "figure5b": partial(weakening_figure, speed, erupting["friction"], weak, mu),
        "figure6": measured_friction_figure,
        "response": partial(response_figure, runs["strong"], response.msd),
        "amplitude": partial(amplitude_figure, sensitive),
    }
    return {**drawn, "damping": partial(damping_figure, [near[k] for k in chosen])} if near else drawn


@styled
def eruption_figure(
    unperturbed: Curve, perturbed: Curve, weakening: Curve, control: Curve | None = None, crossing: float | None = None
) -> Figure:
    """D(t) below the onset: left alone, perturbed, and perturbed with weakening friction (the paper's figure 5a).

    The control is the last of the three at a load where the packing is stable with the weakened friction, too; the
    crossing is when the layer first exceeds v_0. The left panel has a logarithmic axis of time, for the jump, and the
    right one a linear axis, for the growth after it; D that is not positive is not drawn.
    """
    figure = Figure(figsize=(3.4, 2.7), layout="constrained")
    early, late = figure.subplots(1, 2, sharey=True)
    curves = [
        (weakening, WEAKENING, r"perturbed, friction $\mu(v)$"),
        (perturbed, PERTURBED, r"perturbed, $\mu_0$"),
        (unperturbed, UNPERTURBED, r"left alone, $\mu_0$"),
    ]
    if control is not None:
        curves.insert(1, (control, CONTROL, r"$\mu(v)$ below both onsets"))
    for axes in (early, late):
        for run, colour, name in curves:
            draw_series(*run, axes, label=name, color=colour)
        if crossing is not None:
            axes.axvline(crossing, color=INK, linewidth=0.6, linestyle=":")
    if crossing is not None:  # the name to the left of the line: before the crossing D is small
        place: dict[str, Any] = {"ha": "right", "va": "top", "rotation": 90, "fontsize": 7}
        early.text(0.97 * crossing, 0.97, "$|v| > v_0$", transform=early.get_xaxis_transform(), **place)
    early.set_xscale("log")
    late.set_ylabel("")
    late.set_xlim(0, float(weakening[0][-1]))
    few_decades(early, 5)
    for axes, name in ((early, "(a) the jump"), (late, "(b) what follows")):
        axes.set_title(name, loc="left", fontsize=8)
    # Above the axes: three curves over thirty decades leave no corner that stays free for every packing.
    figure.legend(*early.get_legend_handles_labels(), loc="outside upper center", ncols=2, columnspacing=1.0)
    return figure


def share(law: Weakening, velocity: ArrayLike) -> Floats:
    """mu / mu_0 at some velocities of the upper layer, an array of their shape."""
    v = np.asarray(velocity, dtype=float)
    above = np.maximum(v - law.v0, 0.0) / law.v_ss
    return np.where(v > law.v0, law.B * np.exp(-law.w * above) + law.mu_ss, 1.0)


@styled
def friction_law_figure(law: Weakening, mu_0: float) -> Figure:
    """The law mu(v) over v from v_0 on, in units of v_ss (the paper's figure 2)."""
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(xlabel=r"$(v - v_0)/v_{ss}$", ylabel=r"$\mu(v)$")
    fall = 1 / law.w
    reduced = np.linspace(-1.2 * fall, 5.5 * fall, 400)
    axes.plot(reduced, mu_0 * share(law, law.v0 + law.v_ss * reduced), color=WEAKENING)
    steady = mu_0 * law.mu_ss
    axes.axhline(steady, color=INK, linewidth=0.6, linestyle=":")
    axes.axvline(0, color=INK, linewidth=0.6, linestyle=":")
    span = mu_0 - steady
    axes.set(xlim=(reduced[0], reduced[-1]), ylim=(steady - 0.12 * span, mu_0 + 0.12 * span))
    axes.text(-0.15 * fall, steady + 0.04 * span, r"$\mu_0\,\mu_{ss}$", ha="right", va="bottom")
    axes.text(0.15 * fall, mu_0, "$v = v_0$", va="center")
    equation = rf"$\mu_0 = {mu_0:g}$, $\mu_{{ss}} = {law.mu_ss:g}$, $B = {law.B:g}$, $w = {law.w:g}$"
    axes.text(0.96, 0.82, equation, transform=axes.transAxes, ha="right", va="top")
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
    axes.plot(velocity, mu, "o", color=WEAKENING, markersize=2.5, alpha=0.5, markeredgewidth=0, label="run")
    for value, name in ((law.v0, "$v_0$"), (law.v_ss, "$v_{ss}$")):
        if velocity.min() < value < velocity.max():
            axes.axvline(value, color=INK, linewidth=0.6, linestyle=":")
            axes.text(1.1 * value, 0.03, name, transform=axes.get_xaxis_transform())
    steady = mu_0 * law.mu_ss
    axes.set_ylim(steady - 0.12 * (mu_0 - steady), mu_0 + 0.12 * (mu_0 - steady))
    axes.xaxis.set_major_locator(LogLocator(numticks=7))
    axes.legend(loc="upper right", bbox_to_anchor=(1, 0.9))
    return figure


@styled
def measured_friction_figure() -> Figure:
    """The law with the parameters that the paper fitted to measurements (the paper's figure 6).

    B = 0.22, w = 4, v_0 = 0.05 v_ss, and mu_ss = 0.74 and 0.78 for two driving velocities. The measured points, of
    Nasuno, Kudrolli, Bak and Gollub (1998), are not public and are not drawn, as the picture says. For 0.74 the law is
    not continuous at v_0: B + mu_ss = 0.96.
    """
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(xlabel="$v/v_{ss}$", ylabel=r"$\mu/\mu_0$")
    for mu_ss, colour, style in ((0.78, "C1", "-"), (0.74, "C0", "--")):
        law = Weakening(B=0.22, w=4.0, mu_ss=mu_ss, v0=0.05, v_ss=1.0)
        above = np.linspace(np.nextafter(law.v0, 1), 1, 400)
        velocity = np.concatenate([[0.0, law.v0], above])
        name = rf"$\mu_{{ss}} = {mu_ss:g}$"
        axes.plot(velocity, share(law, velocity), color=colour, linestyle=style, label=name)
    axes.set(xlim=(0, 1), ylim=(0.72, 1.02))
    legend = axes.legend(loc="upper right", title="$B = 0.22$, $w = 4$, $v_0 = 0.05\\,v_{ss}$")
    legend.get_title().set_fontsize(matplotlib.rcParams["legend.fontsize"])
    words = "the paper's fits; the measured points\nare not public and are not drawn"
    at: dict[str, Any] = {"ha": "right", "va": "center", "fontstyle": "italic", "color": INK}
    axes.text(0.96, 0.47, words, transform=axes.transAxes, **at)
    return figure


@styled
def amplitude_figure(found: Sensitivity) -> Figure:
    """Response amplitude over the distance from the onset, with the fitted power law."""
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", ylabel="largest response / start")
    axes.set_xlabel("distance from the onset, $1 - F_x/F_x^c$")
    fit, ends = found.fit, np.array([found.distance.min(), found.distance.max()])
    axes.plot(ends, fit.factor * ends**fit.exponent, color="C0", linewidth=0.6, linestyle=":")
    axes.plot(ends, fit.factor * ends**fit.exponent, color="C0", linewidth=0.8)
    label = f"slope ${with_uncertainty(fit.exponent, fit.error)}$"
    axes.plot(found.distance, [pair.amplitude() for pair in found.pairs], "o", color="C0", label=label)
    few_decades(axes)
    figure.legend(loc="outside upper center", handletextpad=0.2)
    return figure


@styled
def damping_figure(pairs: Sequence[NormalForm]) -> Figure:
    """Response amplitude over the damping time, of a pair at several distances from its coalescence.

    Dotted lines are the undamped amplitudes, dots mark the crossover tau = tau_d, rings the damping that takes half of
    the undamped amplitude. Strong damping leaves an amplitude that is the same for all epsilon.
    """
    figure = Figure(figsize=(3.4, 2.7), layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", ylabel="largest response / start")
    axes.set_xlabel(r"damping time $\tau$")
    last = max(pair.tau_d * DAMPING_TIMES[-1] for pair in pairs)
    for number, pair in enumerate(pairs):
        colour, damping, undamped = f"C{number}", pair.tau_d * DAMPING_TIMES, pair.amplitude()
        amplitude = np.array([pair.amplitude(tau) for tau in damping])
        axes.plot(damping, amplitude, color=colour, linewidth=0.9)
        axes.plot([pair.tau_d, last], [undamped] * 2, color=colour, linewidth=0.6, linestyle=":")
        at = np.exp(np.interp(np.log(pair.tau_d), np.log(damping), np.log(amplitude)))
        axes.plot([pair.tau_d], [at], "o", color=colour)
        axes.plot([pair.half_gain_time()], [0.5 * undamped], "o", color=colour, fillstyle="none")
        words = rf"$\varepsilon = {scientific(pair.epsilon)}$"
        axes.text(0.9 * last, 1.1 * undamped, words, ha="right", va="bottom", color=colour)
    axes.set_xlim(min(pair.tau_d * DAMPING_TIMES[0] for pair in pairs), last)
    axes.set_ylim(top=3 * max(pair.amplitude() for pair in pairs))
    few_decades(axes)
    return figure


@styled
def response_figure(run: Curve, linear: Floats) -> Figure:
    """D of the linear response of a packing, from K, at the times of a run of LAMMPS, over D of the run.

    Panel (a) both, panel (b) the difference in units of the largest D so far: D itself passes close to zero.
    """
    time, msd = run
    figure = Figure(figsize=(3.4, 3.4), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    upper.set_yscale("log")
    # A thin dark line upon a broad pale one: where the two agree both are seen.
    upper.plot(*positive(time, msd), color="C4", linewidth=3.0, alpha=0.6, label="LAMMPS")
    upper.plot(*positive(time, linear), color=INK, linewidth=0.7, label="linear response, from $K$")
    # D is small at the start, and in every dip: five decades show all but the very first moments.
    top = 3 * msd.max()
    upper.set(ylabel="$D(t)$", ylim=(max(1e-5 * top, 0.3 * msd[msd > 0].min()), top))
    figure.legend(loc="outside upper center", ncols=2)
    largest = np.maximum.accumulate(msd)
    lower.set_yscale("log")
    lower.plot(*positive(time, np.abs(linear - msd) / largest), color=INK, linewidth=0.6)
    lower.axhline(0.01, color="C0", linewidth=0.6, linestyle=":")
    lower.annotate(r"1 %", (0.99, 0.01), xycoords=lower.get_yaxis_transform(), ha="right", va="bottom", color="C0")
    lower.set(xlabel="$t$", ylabel=r"$|\Delta D|/\max D$")
    lower.set_ylim(top=1.0)
    few_decades(lower, 5)
    lower.margins(x=0)
    for axes, name in ((upper, "(a)"), (lower, "(b)")):
        axes.set_title(name, loc="left", fontsize=8.5, pad=3)
    return figure
