r"""The figures of remote triggering: friction that weakens, runs that erupt, and the theory beside them.

As in :mod:`~faultgouge.studies.figures` each is a function from numbers to a `matplotlib.figure.Figure`, in the units
of the scene. The friction coefficient falls with the velocity v of the upper layer,

.. math:: \mu(v) = \mu_0 \left(B\, e^{-w (v - v_0)/v_{ss}} + \mu_{ss}\right) \quad (v > v_0), \qquad \mu_0
   \quad (v \le v_0),

and passes :math:`v_0` without a jump if :math:`B + \mu_{ss} = 1`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator
from numpy.typing import ArrayLike

from faultgouge.analysis.normal_form import PowerLaw

from .figures import INK, STYLE, Floats

UNPERTURBED, PERTURBED, WEAKENING = "C1", "C2", "C0"


@dataclass(frozen=True)
class FrictionLaw:
    """Friction that weakens with velocity, the paper's Eq. 5.

    Parameters
    ----------
    mu_0 : float
        Static friction coefficient.
    B, w, mu_ss : float
        Numbers of the law; the defaults are those of the paper's simulations.
    v_0 : float
        Velocity at which it begins to fall.
    v_ss : float
        Velocity over which it falls, positive.
    """

    mu_0: float = 1.0
    B: float = 0.2
    w: float = 0.4
    mu_ss: float = 0.8
    v_0: float = 0.0
    v_ss: float = 1.0

    def __call__(self, velocity: ArrayLike) -> Floats:
        """mu at these velocities of the upper layer, an array of their shape."""
        v = np.asarray(velocity, dtype=float)
        above = np.maximum(v - self.v_0, 0.0) / self.v_ss
        return self.mu_0 * np.where(v > self.v_0, self.B * np.exp(-self.w * above) + self.mu_ss, 1.0)


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
        What the distance is, as in a legend.
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


@matplotlib.rc_context(fname=STYLE)
def friction_law_figure(law: FrictionLaw) -> Figure:
    """The law mu(v) (the paper's figure 2).

    Parameters
    ----------
    law : FrictionLaw
        `FrictionLaw()` is the paper's; its v_0 is a matter of the packing and its v_ss is not given, so that the axis
        counts from the one in units of the other.

    Returns
    -------
    Figure
    """
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(xlabel=r"$(v - v_0)/v_{ss}$", ylabel=r"$\mu(v)$")
    fall = 1 / law.w
    reduced = np.linspace(-1.2 * fall, 5.5 * fall, 400)
    axes.plot(reduced, law(law.v_0 + law.v_ss * reduced), color=WEAKENING)
    steady = law.mu_0 * law.mu_ss
    axes.axhline(steady, color=INK, linewidth=0.6, linestyle=":")
    axes.axvline(0, color=INK, linewidth=0.6, linestyle=":")
    span = law.mu_0 - steady
    axes.set(xlim=(reduced[0], reduced[-1]), ylim=(steady - 0.12 * span, law.mu_0 + 0.12 * span))
    axes.text(-0.15 * fall, steady + 0.04 * span, r"$\mu_0\,\mu_{ss}$", ha="right", va="bottom")
    axes.text(0.15 * fall, law.mu_0, "$v = v_0$", va="center")
    equation = rf"$\mu_0 = {law.mu_0:g}$, $\mu_{{ss}} = {law.mu_ss:g}$, $B = {law.B:g}$, $w = {law.w:g}$"
    axes.text(0.96, 0.82, equation, transform=axes.transAxes, ha="right", va="top")
    return figure


@matplotlib.rc_context(fname=STYLE)
def eruption_figure(unperturbed: Displacements, perturbed: Displacements, weakening: Displacements) -> Figure:
    """D(t) below the onset: left alone, perturbed, and perturbed with weakening friction (the paper's figure 5a).

    Parameters
    ----------
    unperturbed, perturbed, weakening : Displacements
        The three runs, of the same packing. What is not positive is not drawn.

    Returns
    -------
    Figure
        Both axes logarithmic.
    """
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", xlabel="$t$", ylabel="$D(t)$")
    for run, colour, name in (
        (weakening, WEAKENING, r"perturbed, friction $\mu(v)$"),
        (perturbed, PERTURBED, r"perturbed, $\mu_0$"),
        (unperturbed, UNPERTURBED, r"left alone, $\mu_0$"),
    ):
        time, msd = _positive(run.time, run.msd)
        axes.plot(time, msd, color=colour, linewidth=0.8, label=name)
    axes.margins(x=0)
    _few_decades(axes)
    # Above the axes: three curves over thirty decades leave no corner that stays free for every packing.
    figure.legend(loc="outside upper center", ncols=3, columnspacing=1.0, handlelength=1.2)
    return figure


@matplotlib.rc_context(fname=STYLE)
def weakening_figure(velocity: ArrayLike, mu: ArrayLike, law: FrictionLaw) -> Figure:
    """The friction coefficient that a run has gone through, over the velocity (the paper's figure 5b).

    Parameters
    ----------
    velocity : array_like, shape (n,)
        Mean velocity of the upper layer, length / time. Where it is not positive, mu is mu_0 and nothing is drawn.
    mu : array_like, shape (n,)
        Friction coefficient of the run at the same times.
    law : FrictionLaw
        The law with this run's v_0 and v_ss, as a line.

    Returns
    -------
    Figure
        The axis of velocities is logarithmic.
    """
    velocity, mu = _positive(velocity, mu)
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(xscale="log", xlabel="$v$", ylabel=r"$\mu(v)$")
    smooth = np.geomspace(velocity.min(), velocity.max(), 500)
    axes.plot(velocity, mu, ".", color=WEAKENING, markersize=4, markeredgewidth=0, label="run")
    axes.plot(smooth, law(smooth), color=INK, linewidth=0.6, label="law")
    for value, name in ((law.v_0, "$v_0$"), (law.v_ss, "$v_{ss}$")):
        if velocity.min() < value < velocity.max():
            axes.axvline(value, color=INK, linewidth=0.6, linestyle=":")
            axes.annotate(
                name,
                (value, 0.03),
                xycoords=axes.get_xaxis_transform(),
                xytext=(2, 0),
                textcoords="offset points",
            )
    steady = law.mu_0 * law.mu_ss
    axes.set_ylim(steady - 0.12 * (law.mu_0 - steady), law.mu_0 + 0.12 * (law.mu_0 - steady))
    axes.xaxis.set_major_locator(LogLocator(numticks=7))
    axes.legend(loc="upper right", bbox_to_anchor=(1, 0.9))
    return figure


@matplotlib.rc_context(fname=STYLE)
def measured_friction_figure() -> Figure:
    """The law with the parameters that the paper fitted to measurements (the paper's figure 6).

    B = 0.22, w = 4, v_0 = 0.05 v_ss, and mu_ss = 0.74 and 0.78 for the two driving velocities. The measured points, of
    Nasuno, Kudrolli, Bak and Gollub (1998), are not public and are not drawn, as the picture says. For 0.74 the law is
    not continuous at v_0: B + mu_ss = 0.96.

    Returns
    -------
    Figure
    """
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(xlabel="$v/v_{ss}$", ylabel=r"$\mu/\mu_0$")
    for mu_ss, colour, style in ((0.78, "C1", "-"), (0.74, "C0", "--")):
        law = FrictionLaw(mu_0=1.0, B=0.22, w=4.0, mu_ss=mu_ss, v_0=0.05)
        above = np.linspace(np.nextafter(law.v_0, 1), 1, 400)
        velocity = np.concatenate([[0.0, law.v_0], above])
        name = rf"$\mu_{{ss}} = {mu_ss:g}$" + (" (filled circles)" if mu_ss == 0.74 else " (open circles)")
        axes.plot(velocity, law(velocity), color=colour, linestyle=style, label=name)
    axes.set(xlim=(0, 1), ylim=(0.72, 1.02))
    legend = axes.legend(loc="upper right", title="$B = 0.22$, $w = 4$, $v_0 = 0.05\\,v_{ss}$")
    legend.get_title().set_fontsize(matplotlib.rcParams["legend.fontsize"])
    axes.text(
        0.96,
        0.47,
        "the paper's fits; the measured points\nare not public and are not drawn",
        transform=axes.transAxes,
        ha="right",
        va="center",
        fontstyle="italic",
        color=INK,
    )
    return figure


@matplotlib.rc_context(fname=STYLE)
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
    axes = figure.add_subplot(xscale="log", yscale="log", xlabel=r"$\varepsilon$", ylabel="$A$")
    for number, curve in enumerate(curves):
        colour = f"C{number}"
        fit, ends = curve.fit, np.array([curve.distance.min(), curve.distance.max()])
        inside = np.array(curve.fitted)
        axes.plot(ends, fit.factor * ends**fit.exponent, color=colour, linewidth=0.6, linestyle=":")
        axes.plot(inside, fit.factor * inside**fit.exponent, color=colour, linewidth=0.8)
        name = f"{curve.name}: slope ${_with_error(fit.exponent, fit.error)}$"
        axes.plot(curve.distance, curve.amplitude, "o", color=colour, label=name)
    _few_decades(axes)
    figure.legend(loc="outside upper center", handletextpad=0.2)
    return figure


@matplotlib.rc_context(fname=STYLE)
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
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", xlabel=r"$\tau$", ylabel="$A$")
    last = max(curve.damping_time[-1] for curve in curves)
    for number, curve in enumerate(curves):
        colour = f"C{number}"
        axes.plot(curve.damping_time, curve.amplitude, color=colour, linewidth=0.9)
        axes.plot([curve.tau_d, last], [curve.undamped] * 2, color=colour, linewidth=0.6, linestyle=":")
        at = np.exp(np.interp(np.log(curve.tau_d), np.log(curve.damping_time), np.log(curve.amplitude)))
        axes.plot([curve.tau_d], [at], "o", color=colour, label=r"$\tau = \tau_d$")
        axes.plot([curve.half_time], [0.5 * curve.undamped], "o", color=colour, fillstyle="none", label="half")
        axes.annotate(
            rf"$\varepsilon = {_scientific(curve.epsilon)}$",
            (last, curve.undamped),
            xytext=(-2, 2),
            textcoords="offset points",
            ha="right",
            va="bottom",
            color=colour,
        )
    axes.set_xlim(min(curve.damping_time[0] for curve in curves), last)
    axes.set_ylim(top=3 * max(curve.undamped for curve in curves))
    handles = axes.get_legend_handles_labels()[0][:2]
    key = axes.legend(handles, [r"$\tau = \tau_d = 1/(\delta\sqrt{\varepsilon})$", "half of the undamped amplitude"])
    for handle in key.legend_handles:
        handle.set_color(INK)  # type: ignore[union-attr]  # matplotlib types it as any artist; these are lines
    return figure


@matplotlib.rc_context(fname=STYLE)
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
    # Every sample would hide the line: a hundred and fifty rings follow its bends.
    every = max(1, len(run.time) // 150)
    rings = {"color": "C0", "linestyle": "none", "marker": "o", "fillstyle": "none", "markeredgewidth": 0.6}
    upper.plot(*_positive(run.time[::every], run.msd[::every]), label="LAMMPS", **rings)
    upper.plot(*_positive(response.time, response.msd), color="C1", linewidth=0.8, label="linear response, from $K$")
    # D is small at the start, and in every dip: five decades show all but the very first moments.
    top = 3 * run.msd.max()
    upper.set(ylabel="$D(t)$", ylim=(max(1e-5 * top, 0.3 * run.msd[run.msd > 0].min()), top))
    figure.legend(loc="outside upper center", ncols=2)
    largest = np.maximum.accumulate(run.msd)
    lower.set_yscale("log")
    lower.plot(*_positive(run.time, np.abs(response.msd - run.msd) / largest), color=INK, linewidth=0.6)
    lower.axhline(0.01, color="C0", linewidth=0.6, linestyle=":")
    lower.annotate(r"1 %", (0.99, 0.01), xycoords=lower.get_yaxis_transform(), ha="right", va="bottom", color="C0")
    lower.set(xlabel="$t$", ylabel=r"$|\Delta D|/\max D$")
    lower.set_ylim(top=1.0)
    lower.yaxis.set_major_locator(LogLocator(numticks=5))
    lower.yaxis.set_minor_locator(NullLocator())
    lower.margins(x=0)
    for axes, name in ((upper, "(a)"), (lower, "(b)")):
        axes.text(0.02, 0.95, name, transform=axes.transAxes, va="top")
    return figure


def _positive(x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
    """The points that a logarithmic axis can show."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    seen = (x > 0) & (y > 0)
    return x[seen], y[seen]


def _few_decades(axes: Axes) -> None:
    """Ticks at decades that have room."""
    axes.xaxis.set_major_locator(LogLocator(numticks=7))
    axes.yaxis.set_major_locator(LogLocator(numticks=7))


def _with_error(value: float, error: float) -> str:
    """-0.4999(2): the error in units of the last digit; two digits where the error is larger than that shows."""
    digits = 2 if error <= 0 else min(8, max(2, -int(np.floor(np.log10(error)))))
    return f"{value:.{digits}f}({np.ceil(error * 10**digits):.0f})"


def _scientific(value: float) -> str:
    """1.2 x 10^-3 for mathtext."""
    exponent = int(np.floor(np.log10(value)))
    mantissa = f"{value / 10.0**exponent:.1f}"
    return rf"{mantissa} \times 10^{{{exponent}}}"
