"""Pictures of packings, pairs of eigenvalues and runs, for notebooks, commands and reports.

A function takes a packing or arrays, and optionally axes of an existing figure; it returns the figure. The functions
open no window and change no setting of matplotlib. Labels of lengths, forces and times have no units, because a scene
may have any units.
"""

from .mode import draw_mode
from .packing import draw_packing
from .pages import render
from .pair import PairCurve, draw_pair
from .series import draw_cycle, draw_series
from .style import INK, save, save_as, styled

__all__ = [
    "INK", "PairCurve", "draw_cycle", "draw_mode", "draw_packing", "draw_pair", "draw_series", "render", "save",
    "save_as", "styled",
]  # fmt: skip
