"""The picture of docs/complex_pairs.md: the discriminant of four pairs over one increment of the load.

python docs/pictures/search.py
"""

from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from faultgouge.analysis import complex_windows
from faultgouge.analysis.windows import Motions, System
from faultgouge.analysis.windows.edges import TrackPoint, track_point
from faultgouge.analysis.windows.search import lowest
from faultgouge.figures.style import INK, STYLE

Operator = Callable[[float], np.ndarray]

THIRD = 40.0
"""A third eigenvalue, far away."""


def crossing(product: float, jump: float = 2.0) -> Operator:
    """Two levels that pass each other at F = 0.45, by the product of their couplings; from `jump` on they are apart."""

    def operator(fx: float) -> np.ndarray:
        gap, coupling = fx - 0.45 + 0.3 * (fx > jump), abs(product) ** 0.5
        return np.array([[10 + gap, coupling, 0], [np.copysign(coupling, product), 10 - gap, 0], [0, 0, THIRD]])

    return operator


def turning(fx: float) -> np.ndarray:
    """A pair whose discriminant goes through zero once, at F = 0.6, and not along a straight line."""
    return np.array([[10, 1, 0], [(0.6 - fx) * (0.35 + 0.2 * fx), 10, 0], [0, 0, THIRD]])


def discriminant(operator: Operator, fx: float) -> float:
    """D of the two modes next to 10."""
    return float(pair_at(operator, fx, fx + 1.0)[1][1].real)


def pair_at(operator: Operator, fx: float, other: float) -> TrackPoint:
    """The two modes next to 10, with their slopes towards another load."""
    here, there = (System(load, operator(load)) for load in (fx, other))
    state = Motions.of(here)
    drift = state.slopes(there)
    near = np.argsort(np.abs(state.values - 10.0))
    return track_point(state, drift, *([near[0]] if state.grows[near[0]] else near[:2]))


def draw(axes: Axes, operator: Operator, title: str, says: str) -> None:
    """D over the increment from 0 to 1, the points that the search has computed, and the window that it finds."""
    loads = np.linspace(0, 1, 801)
    values = np.array([discriminant(operator, float(fx)) for fx in loads])
    pieces = np.flatnonzero(np.abs(np.diff(values)) > 0.1) + 1
    for part, d in zip(np.split(loads, pieces), np.split(values, pieces), strict=True):
        axes.plot(part, d, color="C0")
    axes.axhline(0, color=INK, linewidth=0.5)
    axes.fill_between(loads, 0, values, where=values < 0, color="C3", alpha=0.3, linewidth=0)
    ends = [pair_at(operator, 0.0, 1.0), pair_at(operator, 1.0, 0.0)]
    numbers = [(float(value[1].real), float(slope[1].real)) for _, value, slope in ends]
    reach = np.array([-0.09, 0.09])
    for end, (value, slope) in zip(ends, numbers, strict=True):
        axes.plot(end.fx + reach, value + slope * reach, color="C1", linewidth=1.6)
        axes.plot(end.fx, value, "o", color="C1")
    if numbers[0][0] * numbers[1][0] > 0:
        sign = np.sign(numbers[0][0])
        width, middle = (float(each[0]) for each in lowest(*(np.array([sign * n]) for end in numbers for n in end)))
        if width > 0:
            axes.plot([middle - width / 2, middle + width / 2], [-0.16, -0.16], color="C1", linewidth=2.5)
    for window in complex_windows(operator, [0.0, 1.0]):
        for edge in (window.fx_onset, window.fx_end):
            if edge is not None:
                axes.plot(edge, 0, "s", color="C3", markersize=3.5)
    axes.set_title(title, loc="left", fontsize=8)
    axes.text(0.5, 0.93, says, transform=axes.transAxes, ha="center", va="top", fontsize=7.5)
    axes.set(xlim=(-0.1, 1.1), xticks=[0, 1], xticklabels=["$a$", "$b$"])


@matplotlib.rc_context(fname=STYLE)
def search_figure() -> Figure:
    """Four pairs: they avoid each other, meet in a narrow window, coalesce once, and are torn apart by a jump."""
    figure = Figure(figsize=(6.8, 3.9), layout="constrained")
    (one, two), (three, four) = figure.subplots(2, 2)
    draw(one, crossing(0.002), "(a) avoided crossing", "a dip is possible:\nlooked at, no window")
    draw(
        two, crossing(-0.012), "(b) window within the increment", "a dip is possible:\nlooked at, two edges solved for"
    )
    draw(three, turning, "(c) coalescence", "the sign changes:\nthe root is solved for")
    draw(four, crossing(-0.012, 0.4), "(d) jump of the equilibrium", "the window ends\nwhere a contact changes")
    for axes, top in ((one, 2.2), (two, 2.2), (four, 3.4)):
        axes.set_ylim(-0.3, top)
    for axes in (one, three):
        axes.set_ylabel(r"$D = (\lambda_1 - \lambda_2)^2$")
    for axes in (three, four):
        axes.set_xlabel("$F_x$")
    return figure


if __name__ == "__main__":
    search_figure().savefig(Path(__file__).with_suffix(".png"), dpi=150)
