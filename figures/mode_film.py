"""A film of the motion of one or two modes."""

from collections.abc import Sequence

import numpy as np

from faultgouge.analysis.has_configuration import HasConfiguration

from .film import DOTS, Film
from .mode import ModeArtist, ModeShape, finish, side_by_side
from .style import styled


class ModeFilm(Film):
    """The motion of one or two modes, growth left out, a whole number of periods."""

    @styled
    def __init__(
        self,
        packing: HasConfiguration,
        modes: Sequence[ModeShape],
        words: str,
        frames: int,
        periods: int,
        dots: int | None = DOTS,
    ) -> None:
        figure, axes, points = side_by_side(packing, len(modes))
        self._artists = [
            ModeArtist(one, packing, mode, points, moves=True) for one, mode in zip(axes, modes, strict=True)
        ]
        for one, mode in zip(axes, modes, strict=True):
            one.set_title(mode.words, fontsize=7)
        finish(figure, axes, packing, words if len(modes) > 1 else "one mode, growth left out")
        self._phase = 2 * np.pi * periods / frames
        moving = [part for each in self._artists for part in each.artist.moving]
        super().__init__(figure, moving, frames, dots)

    def show(self, number: int) -> None:
        """The modes at the phase of the frame."""
        for artist in self._artists:
            artist.show(self._phase * number)
