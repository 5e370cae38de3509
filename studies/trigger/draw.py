"""Pictures of the map of waves that trigger."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from ...analysis.arrays import Floats
from ...figures.style import INK, styled
from ..result_rows import row_columns

WAVE = {"layer": "amplitude of the force $a$", "floor": "acceleration of the floor $a$"}


@styled
def map_figure(result: dict[str, Any]) -> Figure:
    """The critical amplitude over frequency and distance from the onset, from the contents of trigger.json.

    Colours are from K; there are circles where LAMMPS was asked, in the colour of its own answer.
    """
    distance, omega, amplitude = _grid(result["map"])
    figure = Figure(figsize=(3.4, 2.6), layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", xlabel=r"frequency $\omega$", ylabel="$1 - F_x/F_x^c$")
    norm = LogNorm(np.nanmin(amplitude), np.nanmax(amplitude))
    colours = axes.pcolormesh(_edges(omega), _edges(distance), amplitude, norm=norm, cmap="viridis_r")
    runs = [row for row in result["map"] if row["measured"] is not None]
    across, up, measured = row_columns(runs, "omega", "distance", "measured")
    axes.scatter(across, up, c=measured, norm=norm, cmap="viridis_r", s=22, edgecolors="white", linewidths=0.9)
    axes.minorticks_off()
    bar = figure.colorbar(colours, ax=axes)
    bar.set_label(rf"{WAVE[result['on']]}$_c$ that triggers")
    return figure


@styled
def threshold_figure(result: dict[str, Any]) -> Figure:
    """The critical amplitude over the frequency, a curve for each distance from the onset, from trigger.json.

    Lines are from K with the transient, dotted ones of the stationary motion alone at the smallest distance; triangles
    are runs of LAMMPS that did (upwards) and did not (downwards) trigger.
    """
    distance, omega, amplitude = _grid(result["map"])
    figure = Figure(figsize=(3.4, 2.9), layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", xlabel=r"frequency $\omega$", ylabel=WAVE[result["on"]])
    for k, (each, curve) in enumerate(zip(distance, amplitude, strict=True)):
        colour = f"C{k % 6}"
        axes.plot(omega, curve, color=colour, linewidth=3.2 - 2.4 * k / len(distance), label=f"${_power(each)}$")
        _runs(axes, [row for row in result["map"] if row["distance"] == each and row["measured"] is not None], colour)
    nearest = [row for row in result["map"] if row["distance"] == distance[0]]
    axes.plot(*row_columns(nearest, "omega", "stationary"), ":", color=INK, linewidth=0.8)
    axes.legend(title="$1 - F_x/F_x^c$", ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return figure


def _runs(axes: Axes, rows: list[dict[str, Any]], colour: str) -> None:
    """The bracket of each bisection, so far apart that both triangles are seen."""
    omega, below, above = row_columns(rows, "omega", "below", "above")
    axes.plot(omega, 1.12 * above, "^", color=colour, markersize=3.5)
    axes.plot(omega, below / 1.12, "v", color=colour, markersize=3.5, markerfacecolor="white")


def _grid(rows: list[dict[str, Any]]) -> tuple[Floats, Floats, Floats]:
    """Distances and frequencies, increasing, and a_c of the two."""
    at, of, predicted = row_columns(rows, "distance", "omega", "predicted")
    distance, omega = np.unique(at), np.unique(of)
    amplitude = np.full((len(distance), len(omega)), np.nan)
    amplitude[np.searchsorted(distance, at), np.searchsorted(omega, of)] = predicted
    return distance, omega, amplitude


def _edges(centres: Floats) -> Floats:
    """Borders of the cells about some values, half way on a logarithmic scale."""
    if len(centres) == 1:
        return centres[0] * np.array([0.8, 1.25])
    middle = np.sqrt(centres[1:] * centres[:-1])
    return np.concatenate([[centres[0] ** 2 / middle[0]], middle, [centres[-1] ** 2 / middle[-1]]])


def _power(value: float) -> str:
    """0.3 or 10^-4 for mathtext."""
    exponent = np.log10(value)
    return f"10^{{{round(exponent)}}}" if abs(exponent - round(exponent)) < 1e-9 and value < 0.1 else f"{value:g}"
