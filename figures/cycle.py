"""F_x over the displacement of the upper layer, on each path between two turning points."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from faultgouge.analysis import Packing
from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.motion.hysteresis import hysteresis, layer_displacement, turning_points

from .series import scientific
from .style import figure_of, styled


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
        way = slice(begin, end + 1)
        axes.plot(
            moved[way],
            fx[way],
            color=f"C{number}",
            linestyle=("-", "--", ":", "-.")[number % 4],
            label=rf"${fx[begin]:.4g} \to {fx[end]:.4g}$",
        )
    axes.plot(moved[[0]], fx[[0]], "o", color="C0", markersize=3)
    axes.set(xlabel=label, ylabel="$F_x$")
    axes.margins(0.08)
    axes.legend(title="$F_x$", fontsize=7, title_fontsize=7)
    left = hysteresis(packings)
    if left is not None:
        words = [
            f"{name} {_format_signed(value)}" for name, value in (("remains:", left.remaining), ("work:", left.work))
        ]
        says = "the path closes, to rounding" if left.closes else ", ".join(words)
        axes.set_title(f"back at $F_x = {left.fx:.4g}$: {says}", fontsize=7)
    return figure_of(axes)


def in_powers_of_ten(moved: Floats) -> tuple[Floats, str]:
    """Displacements of the upper layer in a power of ten, and the label of their axis."""
    power = int(np.floor(np.log10(np.abs(moved).max() or 1.0)))
    unit = rf" $/\,10^{{{power}}}$" if power else ""
    return moved / 10.0**power, f"displacement of the upper layer{unit}"


def _format_signed(value: float) -> str:
    return "0" if value == 0 else f"${'-' if value < 0 else ''}{scientific(abs(value))}$"
