"""Pictures of complex modes: shares, rates and least Q over the load, and the frequencies in their plane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from ...figures.film import Film
from ...figures.style import INK, styled

ROCK = (50, 300)
"""Quality factors of rock."""

TICKS = (0.003, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
"""F_x/F_y that stand below an axis, where they were looked at."""

LABELS = {
    "share": "share of complex modes",
    "growth_rate": r"largest $2\,|\mathrm{Im}\,\omega|$",
    "least_q": "least Q",
    "critical_restitution": "critical restitution",
}

MediansOverLoad = Mapping[str, Any]
"""loads, and for each quantity a list of [median, low, high]."""


@styled
def over_load(
    courses: Mapping[str, MediansOverLoad], names: Sequence[str] = ("share", "growth_rate", "least_q")
) -> Figure:
    """Medians with their intervals over F_x/F_y, a panel for each quantity.

    Parameters
    ----------
    courses : mapping
        What is written beside a line -> its numbers.
    names : sequence of str
        The quantities.
    """
    figure = Figure((3.6 * len(names), 3.4), layout="constrained")
    for axes, name in zip(np.atleast_1d(figure.subplots(1, len(names))), names, strict=True):
        for number, (label, course) in enumerate(courses.items()):
            draw_band(axes, course["loads"], np.array(course[name], dtype=float), f"C{number}", label)
        axes.set(xscale="log", xlabel=r"$F_x/F_y$", ylabel=LABELS[name])
        seen = {load for course in courses.values() for load in course["loads"]}
        axes.set_xticks([load for load in TICKS if load in seen], [f"{load:g}" for load in TICKS if load in seen])
        axes.xaxis.set_minor_formatter(NullFormatter())
        found = np.concatenate([np.ravel(np.array(course[name], dtype=float)) for course in courses.values()])
        if not np.any(np.isfinite(found) & (found > 0)):
            axes.text(0.5, 0.5, "no motion grows", transform=axes.transAxes, ha="center", color=INK)
            axes.set_xlim(0.5 * min(seen), 2 * max(seen))
        elif name in ("growth_rate", "least_q"):
            axes.set_yscale("log")
        if name == "least_q":
            axes.axhspan(*ROCK, color="0.9", zorder=0)
            axes.text(0.02, ROCK[0] * 1.1, "rock", transform=axes.get_yaxis_transform(), color=INK, fontsize="small")
        axes.grid(alpha=0.3)
    if len(courses) > 1:
        figure.axes[0].legend(title="disks")
    return figure


def draw_band(axes: Axes, loads: Sequence[float], values: Any, colour: str, label: str) -> None:
    shown = np.where(np.isfinite(values) & (values > 0), values, np.nan)
    axes.plot(loads, shown[:, 0], "o-", color=colour, label=label, markersize=3)
    axes.fill_between(loads, shown[:, 1], shown[:, 2], color=colour, alpha=0.2, linewidth=0)


@styled
def plane(loads: Sequence[Mapping[str, Any]]) -> Figure:
    """Frequencies of the complex pairs in the plane of Re omega and Im omega, a panel for each of a few loads.

    Parameters
    ----------
    loads : sequence of mapping
        Of one packing, with fx_over_fy, share and frequencies.
    """
    figure = Figure((3.2 * len(loads), 3.2), layout="constrained")
    for axes, load in zip(np.atleast_1d(figure.subplots(1, len(loads), sharex=True, sharey=True)), loads, strict=True):
        points = np.reshape(load["frequencies"], (-1, 2))
        axes.plot(points[:, 0], points[:, 1], ".", color="C3", markersize=4)
        axes.set(xlabel=r"$\mathrm{Re}\,\omega$", yscale="log", title=_title(load))
        axes.grid(alpha=0.3)
    figure.axes[0].set_ylabel(r"$\mathrm{Im}\,\omega$")
    return figure


class PlaneFilm(Film):
    """The plane of frequencies along a ramp, a frame for each load.

    Parameters
    ----------
    loads : sequence of mapping
        As of :func:`plane`.
    """

    @styled
    def __init__(self, loads: Sequence[Mapping[str, Any]]) -> None:
        figure = Figure((5, 4), layout="constrained")
        axes = figure.add_subplot()
        self._points = [np.reshape(load["frequencies"], (-1, 2)) for load in loads]
        every = np.concatenate(self._points)
        (self._line,) = axes.plot([], [], ".", color="C3", markersize=4)
        self._words = axes.text(0.5, 1.02, _title(loads[-1]), transform=axes.transAxes, ha="center")
        axes.set(xlabel=r"$\mathrm{Re}\,\omega$", ylabel=r"$\mathrm{Im}\,\omega$", yscale="log")
        axes.set(xlim=(0, 1.05 * every[:, 0].max()), ylim=(0.5 * every[:, 1].min(), 2 * every[:, 1].max()))
        self._loads = loads
        moving: list[Artist] = [self._line, self._words]
        super().__init__(figure, moving, len(loads))

    def show(self, number: int) -> None:
        """The frequencies of one load."""
        load, points = self._loads[number], self._points[number]
        self._line.set_data(points[:, 0], points[:, 1])
        self._words.set_text(_title(load))


def _title(load: Mapping[str, Any]) -> str:
    return f"$F_x/F_y$ = {load['fx_over_fy']:g}: {100 * load['share']:.0f} % complex"
