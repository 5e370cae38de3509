"""A quantity over time, such as the mean square displacement D(t), which spans many decades."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from numpy.typing import ArrayLike

from faultgouge.analysis.packing.arrays import Floats

from .style import figure_of, styled

BELOW_NOISE = 1e-2
"""Lower end of a picture of growth, in units of the median of the first quarter: the very first steps, which are many
decades lower, would flatten the rest."""


@styled
def draw_series(
    time: ArrayLike,
    values: ArrayLike,
    axes: Axes | None = None,
    *,
    label: str | None = None,
    color: str = "C1",
) -> Figure:
    """A positive quantity over time, on a logarithmic axis; what is not positive is not drawn.

    A figure of its own leaves out the first steps, far below the noise from which the quantity grows.

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

    Returns
    -------
    Figure
    """
    alone, axes = axes is None, Figure(layout="constrained").add_subplot() if axes is None else axes
    time, values = positive(time, values, times=False)
    axes.set_yscale("log")
    axes.plot(time, values, color=to_hex(color), linewidth=0.8, label=label)
    axes.set(xlabel="$t$", ylabel="$D(t)$")
    axes.margins(x=0)
    if alone:
        begin_at_noise(axes, time, values)
    return figure_of(axes)


def begin_at_noise(axes: Axes, time: ArrayLike, values: ArrayLike) -> None:
    """The lower end of the axis of a quantity that grows, see `BELOW_NOISE`."""
    time, values = positive(time, values, times=False)
    if len(time):
        noise = values[time <= time[0] + 0.25 * (time[-1] - time[0])]
        axes.set_ylim(bottom=BELOW_NOISE * float(np.median(noise)))


def positive(x: ArrayLike, y: ArrayLike, times: bool = True) -> tuple[Floats, Floats]:
    """The points that logarithmic axes can show; with times = False the first axis is linear."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    seen = ((x > 0) | (not times)) & (y > 0)
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
