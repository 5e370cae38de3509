"""Pictures of packings, pairs of eigenvalues and runs: for notebooks, commands and reports alike.

A function takes a packing or arrays, and axes if it is to draw into a figure that exists; it returns the figure. No
window is opened, and no setting of matplotlib is changed. Lengths, forces and times carry no unit in the labels:
a scene is free to choose them.
"""

from .cycle import draw_cycle
from .packing import draw_packing
from .pair import PairCurve, draw_pair
from .series import draw_series
from .style import save

__all__ = ["PairCurve", "draw_cycle", "draw_packing", "draw_pair", "draw_series", "save"]
