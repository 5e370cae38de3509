"""Films, frame by frame.

The fixed background is drawn once. For each frame only the few moving artists are drawn on top, which takes a hundredth
of the time of a whole figure.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from faultgouge.analysis import Packing

from .disk_view import View
from .style import INK, styled

Picture = NDArray[np.uint8]

DOTS = 110
"""Dots an inch of a frame of a GIF, unless others are asked for: a GIF of more dots is too large for a page."""

LINES = 1080
"""Lines of a frame of an MP4 at least, unless dots are asked for."""

LARGEST_SHOWN = 0.6
"""The largest displacement on the screen, in units of the smallest radius: disks stay beside their neighbours."""


class Film(ABC):
    """A film, frame by frame.

    Parameters
    ----------
    figure : Figure
        With everything on it.
    moving : sequence of Artist
        What changes from frame to frame.
    count : int
        How many frames there are.
    dots : int, optional
        Dots an inch; by default so many that a frame has `LINES` lines.
    """

    def __init__(self, figure: Figure, moving: Sequence[Artist], count: int, dots: int | None = DOTS) -> None:
        self.count, self._moving = count, list(moving)
        dots = dots or int(np.ceil(LINES / figure.get_size_inches()[1]))
        figure.set_dpi(dots)
        # films in MP4 need an even number of dots
        width, height = (2 * round(size * dots / 2) for size in figure.get_size_inches())
        figure.set_size_inches(width / dots, height / dots)
        self._canvas = FigureCanvasAgg(figure)
        self.show(0)  # the words of a frame take their room
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        for artist in self._moving:
            artist.set_animated(True)
        self._canvas.draw()
        self._still = self._canvas.copy_from_bbox(figure.bbox)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of a frame, dots."""
        return self._canvas.get_width_height()

    @styled
    def frame(self, number: int) -> Picture:
        """Colours of the frame, shape (height, width, 3)."""
        self.show(number)
        self._canvas.restore_region(self._still)
        for artist in self._moving:
            artist.axes.draw_artist(artist)  # type: ignore[union-attr]  # all of them are on axes
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    @abstractmethod
    def show(self, number: int) -> None:
        """Put the artists where they are in a frame."""


def packing_and_curve(packing: Packing, scale: bool = False) -> tuple[Figure, Axes, Axes, float]:
    """A figure with a packing on the left and a curve on the right; points per unit of length on the left."""
    view = View.of(packing)
    ratio = (view.ceiling - view.bottom) / (view.right - view.left)
    across = min(2.4, 3.2 / ratio)
    size: dict[str, Any] = {"figsize": (across + 2.5 + (0.7 if scale else 0.0), max(2.0, across * ratio + 0.45))}
    figure = Figure(**size)
    figure.set_layout_engine("constrained", h_pad=0.07)
    left, right = figure.subplots(1, 2, width_ratios=(across + (0.7 if scale else 0.0), 2.3))
    for spine in right.spines.values():
        spine.set_color(INK)
    return figure, left, right, 72 * across / (view.right - view.left)
