"""The response of the pair that is about to coalesce: over the distance from the onset, over damping, and in LAMMPS."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from ...analysis.digits import with_uncertainty
from ...analysis.onset.pair_form import PairForm
from ...analysis.packing.packing import Floats
from ...figures.series import few_decades, positive, scientific
from ...figures.style import INK, styled
from .compute import Sensitivity

Course = tuple[Floats, Floats]
"""Times, and D at these, length^2."""

DAMPING = np.geomspace(1e-2, 1e2, 33)
"""Damping times of a curve, in units of tau_d."""


@styled
def amplitude_figure(found: Sensitivity) -> Figure:
    """Response amplitude over the distance from the onset, with its exponent.

    Parameters
    ----------
    found : Sensitivity
        Amplitudes and their power law.

    Returns
    -------
    Figure
        Both axes logarithmic; points, and the fitted power law.
    """
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", ylabel="largest response / start")
    axes.set_xlabel("distance from the onset, $1 - F_x/F_x^c$")
    fit, ends = found.fit, np.array([found.distance.min(), found.distance.max()])
    axes.plot(ends, fit.factor * ends**fit.exponent, color="C0", linewidth=0.6, linestyle=":")
    axes.plot(ends, fit.factor * ends**fit.exponent, color="C0", linewidth=0.8)
    label = f"slope ${with_uncertainty(fit.exponent, fit.error)}$"
    axes.plot(found.distance, found.amplitude, "o", color="C0", label=label)
    few_decades(axes)
    figure.legend(loc="outside upper center", handletextpad=0.2)
    return figure


@styled
def damping_figure(pairs: Sequence[PairForm]) -> Figure:
    r"""Response amplitude over the damping time: the crossover where tau_d = tau.

    Parameters
    ----------
    pairs : sequence of PairForm
        The pair at several distances from the coalescence.

    Returns
    -------
    Figure
        Both axes logarithmic. Dotted lines are the undamped amplitudes, dots mark tau = tau_d, rings the damping
        that takes half of the undamped amplitude. Strong damping leaves an amplitude that is the same for all epsilon.
    """
    figure = Figure(figsize=(3.4, 2.7), layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", ylabel="largest response / start")
    axes.set_xlabel(r"damping time $\tau$")
    last = max(pair.tau_d * DAMPING[-1] for pair in pairs)
    for number, pair in enumerate(pairs):
        colour, damping, undamped = f"C{number}", pair.tau_d * DAMPING, pair.amplitude()
        amplitude = np.array([pair.amplitude(tau) for tau in damping])
        axes.plot(damping, amplitude, color=colour, linewidth=0.9)
        axes.plot([pair.tau_d, last], [undamped] * 2, color=colour, linewidth=0.6, linestyle=":")
        at = np.exp(np.interp(np.log(pair.tau_d), np.log(damping), np.log(amplitude)))
        axes.plot([pair.tau_d], [at], "o", color=colour, label=r"$\tau = \tau_d$")
        axes.plot([pair.half_gain_time()], [0.5 * undamped], "o", color=colour, fillstyle="none", label="half")
        axes.annotate(
            rf"$\varepsilon = {scientific(pair.form.epsilon)}$",
            (last, undamped),
            xytext=(-2, 2),
            textcoords="offset points",
            ha="right",
            va="bottom",
            color=colour,
        )
    axes.set_xlim(min(pair.tau_d * DAMPING[0] for pair in pairs), last)
    axes.set_ylim(top=3 * max(pair.amplitude() for pair in pairs))
    few_decades(axes)
    handles = axes.get_legend_handles_labels()[0][:2]
    names = [r"$\tau = \tau_d = 1/(\delta\sqrt{\varepsilon})$", r"half of the undamped amplitude"]
    title = r"the pair at $\varepsilon = 1 - \eta/\delta$ from its coalescence"
    key = figure.legend(handles, names, title=title, loc="outside upper center", ncols=2, columnspacing=1.0)
    key.get_title().set_fontsize(7.5)
    for handle in key.legend_handles:
        handle.set_color(INK)  # type: ignore[union-attr]  # matplotlib types it as any artist; these are lines
    return figure


@styled
def response_figure(run: Course, linear: Floats) -> Figure:
    """The linear response of a packing, from K, over the run of LAMMPS.

    Parameters
    ----------
    run : Course
        D(t) of the run.
    linear : ndarray, shape (T,)
        D of the linear response at the same times.

    Returns
    -------
    Figure
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
    lower.yaxis.set_major_locator(LogLocator(numticks=5))
    lower.yaxis.set_minor_locator(NullLocator())
    lower.margins(x=0)
    for axes, name in ((upper, "(a)"), (lower, "(b)")):
        axes.set_title(name, loc="left", fontsize=8.5, pad=3)
    return figure
