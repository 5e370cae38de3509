"""The response of the pair that is about to coalesce: over the distance from the onset, over damping, and in LAMMPS."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator
from numpy.typing import NDArray

from ...analysis.digits import with_uncertainty
from ...analysis.motion.power_law import PowerLaw
from ...figures.series import few_decades, positive, scientific
from ...figures.style import INK, styled

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Displacements:
    """D(t) of one run.

    Attributes
    ----------
    time : ndarray, shape (T,)
        Times.
    msd : ndarray, shape (T,)
        D, length^2.
    """

    time: Floats
    msd: Floats


@dataclass(frozen=True, eq=False)
class AmplitudeCurve:
    """Response amplitudes over a distance from the coalescence.

    Attributes
    ----------
    name : str
        What the amplitudes are of, before their slope in the legend; may be empty.
    distance : ndarray, shape (n,)
        The distance, positive.
    amplitude : ndarray, shape (n,)
        Largest displacement in units of the start.
    fit : PowerLaw
        The exponent and where it lies.
    fitted : tuple of float
        Smallest and largest distance that the fit was made of.
    """

    name: str
    distance: Floats
    amplitude: Floats
    fit: PowerLaw
    fitted: tuple[float, float]


@dataclass(frozen=True, eq=False)
class DampingCurve:
    """Response amplitude over the damping time, for one distance from the coalescence.

    Attributes
    ----------
    epsilon : float
        Distance 1 - eta/delta of the pair.
    damping_time : ndarray, shape (n,)
        tau, increasing, time.
    amplitude : ndarray, shape (n,)
        Largest displacement in units of the start.
    undamped : float
        The same without damping.
    tau_d : float
        1/(delta epsilon^(1/2)), time.
    half_time : float
        tau at which half of the undamped amplitude is left.
    """

    epsilon: float
    damping_time: Floats
    amplitude: Floats
    undamped: float
    tau_d: float
    half_time: float


@styled
def amplitude_figure(curves: Sequence[AmplitudeCurve]) -> Figure:
    """Response amplitude over the distance from the coalescence, with its exponent.

    Parameters
    ----------
    curves : sequence of AmplitudeCurve
        The same amplitudes may be shown over several measures of the distance.

    Returns
    -------
    Figure
        Both axes logarithmic; points, and the fitted power laws, full where they were fitted.
    """
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", ylabel="largest response / start")
    axes.set_xlabel("distance from the onset, $1 - F_x/F_x^c$")
    for number, curve in enumerate(curves):
        colour = f"C{number}"
        fit, ends = curve.fit, np.array([curve.distance.min(), curve.distance.max()])
        inside = np.array(curve.fitted)
        axes.plot(ends, fit.factor * ends**fit.exponent, color=colour, linewidth=0.6, linestyle=":")
        axes.plot(inside, fit.factor * inside**fit.exponent, color=colour, linewidth=0.8)
        name = f"{curve.name}slope ${with_uncertainty(fit.exponent, fit.error)}$"
        axes.plot(curve.distance, curve.amplitude, "o", color=colour, label=name)
    few_decades(axes)
    figure.legend(loc="outside upper center", handletextpad=0.2)
    return figure


@styled
def damping_figure(curves: Sequence[DampingCurve]) -> Figure:
    r"""Response amplitude over the damping time: the crossover where tau_d = tau.

    Parameters
    ----------
    curves : sequence of DampingCurve
        One for each distance from the coalescence.

    Returns
    -------
    Figure
        Both axes logarithmic. Dotted lines are the undamped amplitudes, dots mark tau = tau_d, rings the damping
        that takes half of the undamped amplitude. Strong damping leaves an amplitude that is the same for all epsilon.
    """
    figure = Figure(figsize=(3.4, 2.7), layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", ylabel="largest response / start")
    axes.set_xlabel(r"damping time $\tau$")
    last = max(curve.damping_time[-1] for curve in curves)
    for number, curve in enumerate(curves):
        colour = f"C{number}"
        axes.plot(curve.damping_time, curve.amplitude, color=colour, linewidth=0.9)
        axes.plot([curve.tau_d, last], [curve.undamped] * 2, color=colour, linewidth=0.6, linestyle=":")
        at = np.exp(np.interp(np.log(curve.tau_d), np.log(curve.damping_time), np.log(curve.amplitude)))
        axes.plot([curve.tau_d], [at], "o", color=colour, label=r"$\tau = \tau_d$")
        axes.plot([curve.half_time], [0.5 * curve.undamped], "o", color=colour, fillstyle="none", label="half")
        axes.annotate(
            rf"$\varepsilon = {scientific(curve.epsilon)}$",
            (last, curve.undamped),
            xytext=(-2, 2),
            textcoords="offset points",
            ha="right",
            va="bottom",
            color=colour,
        )
    axes.set_xlim(min(curve.damping_time[0] for curve in curves), last)
    axes.set_ylim(top=3 * max(curve.undamped for curve in curves))
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
def response_figure(run: Displacements, response: Displacements) -> Figure:
    """The linear response of a packing, from K, over the run of LAMMPS.

    Parameters
    ----------
    run : Displacements
        D(t) of the run.
    response : Displacements
        The linear response at the same times.

    Returns
    -------
    Figure
        Panel (a) both, panel (b) the difference in units of the largest D so far: D itself passes close to zero.

    Raises
    ------
    ValueError
        If the two are not at the same times.
    """
    if not np.array_equal(run.time, response.time):
        raise ValueError("The run and its linear response must be given at the same times.")
    figure = Figure(figsize=(3.4, 3.4), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    upper.set_yscale("log")
    # A thin dark line upon a broad pale one: where the two agree both are seen.
    upper.plot(*positive(run.time, run.msd), color="C4", linewidth=3.0, alpha=0.6, label="LAMMPS")
    upper.plot(*positive(response.time, response.msd), color=INK, linewidth=0.7, label="linear response, from $K$")
    # D is small at the start, and in every dip: five decades show all but the very first moments.
    top = 3 * run.msd.max()
    upper.set(ylabel="$D(t)$", ylim=(max(1e-5 * top, 0.3 * run.msd[run.msd > 0].min()), top))
    figure.legend(loc="outside upper center", ncols=2)
    largest = np.maximum.accumulate(run.msd)
    lower.set_yscale("log")
    lower.plot(*positive(run.time, np.abs(response.msd - run.msd) / largest), color=INK, linewidth=0.6)
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
