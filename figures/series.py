"""Curves: a quantity over time, F_x over displacement, the force of a driven run, vibrations over frequency."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from numpy.typing import ArrayLike

from faultgouge.analysis import ElasticModuli, Growth, Packing, PlaneWave, Vibrations
from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.responses.hysteresis import layer_displacement, turning_points
from faultgouge.analysis.responses.slips import Slip

from .style import EDGE, FLOOR, INK, MOBILIZATION, figure_of, styled

SHARE_COLOUR = MOBILIZATION(0.35)
"""Blue, of shares of rotation and of transverse waves."""

BELOW_NOISE = 1e-2
"""Lower end of a picture of growth, in units of the median of the first quarter: the very first steps, which are many
decades lower, would flatten the rest."""

SHIFT = 1.5
"""Decades by which a predicted slope lies above D."""


@styled
def draw_series(
    time: ArrayLike, values: ArrayLike, axes: Axes | None = None, *, label: str | None = None, color: str = "C1"
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
    """The mean square displacement of an undamped run, with the slope that the spectrum predicts, as in the paper's
    figure 4.

    D(t) is drawn where it is positive. `rate` is the growth rate of D from the spectrum, 0 of a stable packing, None if
    it is not known. The predicted slope lies a decade and a half above the growth that was `fitted`; without it the
    slope begins at the noise, over the whole run.
    """
    figure = Figure(figsize=(3.4, 2.7), layout="constrained")
    axes, label = figure.add_subplot(), "undamped run"
    if fitted is not None:
        off = rf" (${100 * (fitted.rate / rate - 1):+.2g}\,\%$)" if rate else ""
        label = rf"$\mathrm{{d}}\ln D/\mathrm{{d}}t = {fitted.rate:.5g}$, measured{off}"
    draw_series(time, msd, axes, label=label)
    if rate:
        predicted = rf"$2\,|\mathrm{{Im}}\,\omega| = {rate:.5g}$, from the spectrum"
        axes.plot(*_slope(time, msd, rate, fitted), color="C0", linestyle="--", label=predicted)
    begin_at_noise(axes, time, msd)
    few_decades(axes)
    title = "linearly stable: nothing grows" if rate == 0 else None
    figure.legend(loc="outside upper left", title=title, alignment="left")
    return figure


def _slope(time: Floats, msd: Floats, rate: float, fitted: Growth | None) -> tuple[Floats, Floats]:
    """Times and values of the two ends of the predicted slope."""
    if fitted is not None:
        ends, inside = np.array([fitted.start, fitted.end]), (msd > 0) & (time >= fitted.start) & (time <= fitted.end)
        return ends, 10**SHIFT * np.exp(np.mean(np.log(msd[inside]) - rate * time[inside]) + rate * ends)
    noise = _noise(*positive(time, msd, log_x=False))
    room = np.log(10**SHIFT * msd.max() / noise) / rate  # to where the picture would end without the slope
    ends = np.array([time[0], min(time[-1], time[0] + room)])
    return ends, 10**SHIFT * noise * np.exp(rate * (ends - time[0]))


def _noise(time: Floats, values: Floats) -> float:
    """The median of the first quarter."""
    return float(np.median(values[time <= time[0] + 0.25 * (time[-1] - time[0])]))


def begin_at_noise(axes: Axes, time: ArrayLike, values: ArrayLike) -> None:
    """The lower end of the axis of a quantity that grows, see `BELOW_NOISE`."""
    time, values = positive(time, values, log_x=False)
    if len(time):
        axes.set_ylim(bottom=BELOW_NOISE * _noise(time, values))


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


@styled
def draw_cycle(packings: Sequence[Packing], axes: Axes | None = None) -> Figure:
    """Draw F_x over the mean displacement of the upper layer along x, a path that may close or not.

    Parameters
    ----------
    packings : sequence of Packing
        Equilibria one after the other, all of the same disks.
    axes : Axes, optional
        Where to draw; a figure of its own by default.
    """
    axes = Figure(layout="constrained").add_subplot() if axes is None else axes
    moved, label = in_powers_of_ten(layer_displacement(packings)[:, 0])
    fx = np.array([packing.fx for packing in packings])
    ends = [0, *turning_points(fx), len(fx) - 1]
    for number, (begin, end) in enumerate(pairwise(ends)):
        way, style = slice(begin, end + 1), ("-", "--", ":", "-.")[number % 4]
        label_of_way = rf"${fx[begin]:.4g} \to {fx[end]:.4g}$"
        axes.plot(moved[way], fx[way], color=f"C{number}", linestyle=style, label=label_of_way)
    axes.plot(moved[[0]], fx[[0]], "o", color="C0", markersize=3)
    axes.set(xlabel=label, ylabel="$F_x$")
    axes.margins(0.08)
    axes.legend(title="$F_x$", fontsize=7, title_fontsize=7)
    return figure_of(axes)


def in_powers_of_ten(moved: Floats) -> tuple[Floats, str]:
    """Displacements of the upper layer in a power of ten, and the label of their axis."""
    power = int(np.floor(np.log10(np.abs(moved).max() or 1.0)))
    unit = rf" $/\,10^{{{power}}}$" if power else ""
    return moved / 10.0**power, f"displacement of the upper layer{unit}"


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
    rows = [(series["force"], "force $F$"), (series["displacement"], "displacement")]
    rows += [(series["thickness"] - series["thickness"][0], "dilation"), (series["at_bound"], "at the bound")]
    draw_slips(panels, slips)
    for axes, (values, label) in zip(panels, rows, strict=True):
        axes.plot(series["time"], values, color="C1" if axes is panels[0] else "C0", linewidth=0.8)
        axes.set_ylabel(label)
        axes.margins(x=0)
    panels[0].margins(y=0.12)
    panels[-1].set_xlabel("$t$")
    figure.align_ylabels()
    return figure


def draw_slips(panels: Sequence[Axes], slips: Sequence[Slip]) -> None:
    """A band for each slip in panels over time, and its number in the first panel, which shows the force."""
    about: dict[str, Any] = {"xytext": (0, 3), "textcoords": "offset points", "ha": "center", "fontsize": 7}
    for number, slip in enumerate(slips, 1):
        for axes in panels:
            axes.axvspan(slip.begins, slip.ends, color="0.85", linewidth=0)
        panels[0].annotate(str(number), (slip.begins, slip.force_before), **about)


@styled
def draw_vibrations(found: Vibrations) -> Figure:
    """g with its standard error and its window, what the motions are like, and Q.

    Of all modes each is a dot; of random vectors there are none.
    """
    damped = bool(np.any(found.damping > 0))
    figure = Figure(figsize=(3.5, 5.6 if damped else 4.2), layout="constrained")
    density, share, *more = figure.subplots(3 if damped else 2, sharex=True)
    low, high = found.density - found.density_error, found.density + found.density_error
    density.fill_between(found.frequency, low, high, color=EDGE, linewidth=0, alpha=0.5)
    density.plot(found.frequency, found.density, color=INK, linewidth=0.9)
    density.set(ylabel=r"density of states $g(\omega)$", ylim=(0, None), xlim=(0, found.largest))
    begin, across = 0.03 * found.largest, density.get_xaxis_transform()
    end = begin + found.resolution[0]
    density.plot([begin, end], [0.92, 0.92], color=FLOOR, linewidth=1.5, transform=across)
    density.text(end + 0.5 * (end - begin), 0.92, "window", va="center", fontsize=6, color=FLOOR, transform=across)
    share.plot(found.frequency, found.rotation, color=SHARE_COLOUR, linewidth=0.9)
    share.set(ylabel="share of rotation", ylim=(0, 1), xlabel="" if damped else r"$\omega$")
    for axes in more:
        axes.plot(found.frequency, found.quality, color=SHARE_COLOUR, linewidth=0.9)
        axes.set(ylabel="quality factor $Q$", yscale="log", xlabel=r"$\omega$")
    if found.modes is not None:
        frequency, dots = found.modes["frequency"], {"color": INK, "markersize": 2, "zorder": 1}
        share.plot(frequency, found.modes["participation"], ".", **dots)
        share.set(ylabel="participation (dots), rotation (line)")
        for axes in more:
            axes.plot(frequency, frequency / np.maximum(found.modes["damping"], np.finfo(float).tiny), ".", **dots)
    return figure


@styled
def draw_waves(waves: Sequence[PlaneWave], moduli: ElasticModuli | None = None) -> Figure:
    """Frequency and attenuation of plane waves along one direction over their wave number, beside the speeds of the
    isotropic part of the elastic moduli."""
    figure = Figure(figsize=(3.5, 4.4), layout="constrained")
    above, below = figure.subplots(2, sharex=True)
    most = max(wave.wave_number for wave in waves)
    names = ("longitudinal", "transverse", "transverse, the other")
    for kind in sorted({wave.polarisation for wave in waves}):
        these = [(wave.wave_number, wave.frequency, wave.attenuation) for wave in waves if wave.polarisation == kind]
        number, frequency, attenuation = zip(*these, strict=True)
        style: dict[str, Any] = {"color": SHARE_COLOUR if kind else INK, "marker": "os^"[kind], "linestyle": ""}
        above.plot(number, frequency, markersize=3.5, label=names[kind], **style)
        below.plot(number, attenuation, markersize=3.5, **style)
    if moduli is not None:
        lame = moduli.bulk - 2 * moduli.shear / moduli.dimension
        speeds = np.sqrt(np.array([lame + 2 * moduli.shear, moduli.shear]) / moduli.density)
        for speed, shade, name in zip(speeds, (INK, SHARE_COLOUR), ("P", "S"), strict=True):
            line = {"color": shade, "linewidth": 0.7, "linestyle": "--", "label": f"{name}, elastic moduli"}
            above.plot([0, most], [0, speed * most], **line)
    above.set(ylabel=r"frequency $\omega$", ylim=(0, None))
    above.legend(fontsize=6)
    below.set(xlabel="wave number $q$", ylabel=r"attenuation $\gamma$", xlim=(0, 1.05 * most))
    below.axhline(0, color=EDGE, linewidth=0.5)
    return figure
