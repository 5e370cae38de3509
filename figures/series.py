"""A quantity over time, such as the mean square displacement D(t), which spans many decades."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from numpy.typing import ArrayLike

from faultgouge.analysis import Growth
from faultgouge.analysis.arrays import Floats

from .style import figure_of, styled

BELOW_NOISE = 1e-2
"""Lower end of a picture of growth, in units of the median of the first quarter: the very first steps, which are many
decades lower, would flatten the rest."""

SHIFT = 1.5
"""Decades by which a predicted slope lies above D."""


@styled
def draw_series(
    time: ArrayLike,
    values: ArrayLike,
    axes: Axes | None = None,
    *,
    label: str | None = None,
    color: str = "C1",
) -> Figure:
    """Draw a positive quantity over time on a logarithmic axis; values that are not positive are left out.

    Without `axes`, the first steps are left out, far below the noise from which the quantity grows.

    Parameters
    ----------
    time, values : array_like, shape (n,)
        The series.
    axes : Axes, optional
        Where to draw; a figure of its own by default.
    label : str, optional
        Name in the legend.
    color : str
        Colour of the line.
    """
    alone, axes = axes is None, Figure(layout="constrained").add_subplot() if axes is None else axes
    time, values = positive(time, values, log_x=False)
    axes.set_yscale("log")
    axes.plot(time, values, color=to_hex(color), linewidth=0.8, label=label)
    axes.set(xlabel="$t$", ylabel="$D(t)$")
    axes.margins(x=0)
    if alone:
        begin_at_noise(axes, time, values)
    return figure_of(axes)


@styled
def draw_growth(time: Floats, msd: Floats, rate: float | None, fitted: Growth | None) -> Figure:
    """The mean square displacement of an undamped run, with the slope that the spectrum predicts.

    Parameters
    ----------
    time, msd : ndarray, shape (n,)
        D(t), length^2; drawn where it is positive.
    rate : float or None
        Growth rate of D from the spectrum, 1 / time: 0 of a stable packing, None if it is not known.
    fitted : Growth or None
        The growth measured. Its slope lies beside D, a decade and a half above; without it the slope begins at the
        noise, over the whole run.

    Returns
    -------
    Figure
        As the paper's figure 4.
    """
    figure = Figure(figsize=(3.4, 2.7), layout="constrained")
    axes = figure.add_subplot()
    label = "undamped run"
    if fitted is not None:
        label = rf"$\mathrm{{d}}\ln D/\mathrm{{d}}t = {fitted.rate:.5g}$, measured"
        if rate:
            label += rf" (${100 * (fitted.rate / rate - 1):+.2g}\,\%$)"
    draw_series(time, msd, axes, label=label)
    if rate:
        ends, slope = _slope(time, msd, rate, fitted)
        predicted = rf"$2\,|\mathrm{{Im}}\,\omega| = {rate:.5g}$, from the spectrum"
        axes.plot(ends, slope, color="C0", linestyle="--", label=predicted)
    begin_at_noise(axes, time, msd)
    few_decades(axes)
    title = "linearly stable: nothing grows" if rate == 0 else None
    figure.legend(loc="outside upper left", title=title, alignment="left")
    return figure


def _slope(time: Floats, msd: Floats, rate: float, fitted: Growth | None) -> tuple[Floats, Floats]:
    """Times and values of the two ends of the predicted slope."""
    above = msd > 0
    if fitted is not None:
        ends = np.array([fitted.start, fitted.end])
        inside = above & (time >= ends[0]) & (time <= ends[1])
        intercept = np.mean(np.log(msd[inside]) - rate * time[inside])
    else:
        noise = np.median(msd[above & (time <= time[0] + 0.25 * (time[-1] - time[0]))])
        room = np.log(10**SHIFT * msd.max() / noise) / rate  # to where the picture would end without the slope
        ends = np.array([time[0], min(time[-1], time[0] + room)])
        intercept = np.log(noise) - rate * time[0]
    return ends, 10**SHIFT * np.exp(intercept + rate * ends)


def begin_at_noise(axes: Axes, time: ArrayLike, values: ArrayLike) -> None:
    """The lower end of the axis of a quantity that grows, see `BELOW_NOISE`."""
    time, values = positive(time, values, log_x=False)
    if len(time):
        noise = values[time <= time[0] + 0.25 * (time[-1] - time[0])]
        axes.set_ylim(bottom=BELOW_NOISE * float(np.median(noise)))


def positive(x: ArrayLike, y: ArrayLike, log_x: bool = True) -> tuple[Floats, Floats]:
    """The points that logarithmic axes can show; without `log_x` the first axis is linear."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    seen = ((x > 0) | (not log_x)) & (y > 0)
    return x[seen], y[seen]


def few_decades(axes: Axes, count: int = 7) -> None:
    """Ticks at decades that have room, on the axes that are logarithmic."""
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "log":
            axis.set_major_locator(LogLocator(numticks=count))


def scientific(value: float) -> str:
    """1.2 x 10^-3 for mathtext."""
    exponent = int(np.floor(np.log10(value)))
    return rf"{value / 10.0**exponent:.1f} \times 10^{{{exponent}}}"
