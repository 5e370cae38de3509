r"""A film, frame by frame, and as a file.

The fixed background is drawn once. For each frame only the few moving artists are drawn on top, which takes a hundredth
of the time of a whole figure. A GIF is written by Pillow, with one palette for all frames, so that colours do not
flicker; an MP4 by the ffmpeg of imageio-ffmpeg.
"""

from collections.abc import Callable, Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from faultgouge.analysis import BadInputError
from faultgouge.analysis.files.atomic_write import replace_whole

from .style import styled

Progress = Callable[[Iterable[int], int], Iterable[int]]

DOTS = 110
"""Dots an inch of a frame of a GIF, unless others are asked for: a GIF of more dots is too large for a page."""

LINES = 1080
"""Lines of a frame of an MP4 at least, unless dots are asked for."""

COLOURS_OF_GIF = 64
"""Colours of a GIF: a packing or a mode has some dozens, and shades of lines take the rest."""

PALETTE_FRAMES = 8
"""Frames whose colours a GIF has: of three, a disk that turns green has its last green only, and is grey before."""

COLOUR_DIFFERENCE = 18
"""A dot stays as it was while each of its three colours is off by no more than this, of 255. Without this a film of 20
units of time is twice as large; with twice as much contacts that moved leave gaps in others."""


class FilmError(BadInputError):
    """A film that cannot be written, in one sentence."""


class Film:
    """A film, frame by frame.

    `figure` has everything on it, `moving` what changes from frame to frame, in the order in which it is drawn, and
    `show` puts these artists where they are in a frame, by its number. Without `dots` an inch a frame has `LINES`
    lines.
    """

    @styled
    def __init__(
        self, figure: Figure, moving: Sequence[Artist], show: Callable[[int], object], count: int,
        dots: int | None = DOTS,
    ) -> None:  # fmt: skip
        self.count, self.moving, self._show = count, list(moving), show
        dots = dots or int(np.ceil(LINES / figure.get_size_inches()[1]))
        figure.set_dpi(dots)
        # films in MP4 need an even number of dots
        width, height = (2 * round(size * dots / 2) for size in figure.get_size_inches())
        figure.set_size_inches(width / dots, height / dots)
        self._canvas = FigureCanvasAgg(figure)
        show(0)  # the words of a frame take their room
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        for artist in self.moving:
            artist.set_animated(True)
        self._canvas.draw()
        self._still = self._canvas.copy_from_bbox(figure.bbox)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of a frame, dots."""
        return self._canvas.get_width_height()

    @styled
    def frame(self, number: int) -> NDArray[np.uint8]:
        """Colours of the frame, shape (height, width, 3)."""
        self._show(number)
        self._canvas.restore_region(self._still)
        for artist in self.moving:
            artist.axes.draw_artist(artist)  # type: ignore[union-attr]  # all of them are on axes
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()


def write_film(film: Film, path: Path, rate: float = 10.0, progress: Progress = lambda frames, count: frames) -> None:
    """Write a film to a name that ends in .gif or .mp4; frames are made one at a time.

    A GIF counts in hundredths of a second, so that 100 must be a multiple of the frames a second, `rate`. Raises
    FilmError if the name ends otherwise, or imageio-ffmpeg is not installed.
    """
    check_name(path)
    with replace_whole(path) as new:
        if path.suffix.lower() == ".gif":
            _gif(film, new, rate, progress)
            return
        writer = _ffmpeg().write_frames(str(new), film.size, fps=rate, macro_block_size=2, quality=7)
        writer.send(None)
        try:
            for number in progress(range(film.count), film.count):
                writer.send(np.ascontiguousarray(film.frame(number)))
        finally:
            writer.close()


def usual_suffix() -> str:
    """.mp4 where imageio-ffmpeg is installed, which takes a tenth of the size of a GIF and all colours; else .gif."""
    return ".mp4" if find_spec("imageio_ffmpeg") else ".gif"


def check_name(path: Path) -> None:
    """Refuse a film's name before any work."""
    if path.suffix.lower() not in (".gif", ".mp4"):
        raise FilmError(f"{path}: a film is a .gif or an .mp4, so give it a name that ends in one of them")
    if path.suffix.lower() == ".mp4":
        _ffmpeg()


def _gif(film: Film, path: Path, rate: float, progress: Progress) -> None:
    """One palette for all frames, so that colours do not flicker; dots that hardly change stay, which compresses."""
    from PIL import Image

    some = np.unique(np.linspace(0, film.count - 1, PALETTE_FRAMES).astype(int))  # disks change colour
    samples = np.concatenate([film.frame(int(k)) for k in some])
    # It spans the colours evenly; the median cut, Pillow's own choice, has greys for the few dots of a bright colour.
    palette = Image.fromarray(samples).quantize(COLOURS_OF_GIF, method=Image.Quantize.MAXCOVERAGE, kmeans=3)
    colours = np.reshape(palette.getpalette() or [], (-1, 3))
    colours[colours.min(axis=1) > 247] = 255  # the ground is white, as that of the page
    palette.putpalette(colours.ravel().tolist())

    def pictures() -> Iterable[Any]:
        shown = None
        for number in progress(range(film.count), film.count):
            frame = film.frame(number)
            now = np.asarray(Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE))
            if shown is not None:
                now = np.where(np.abs(frame - colours[shown]).max(axis=2) <= COLOUR_DIFFERENCE, shown, now)
            picture, shown = Image.fromarray(now, "P"), now
            picture.putpalette(colours.ravel().tolist())
            yield picture

    frames, duration = iter(pictures()), round(1000 / rate)
    next(frames).save(path, "GIF", save_all=True, append_images=frames, duration=duration, loop=0, optimize=True)


def _ffmpeg() -> Any:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise FilmError("an .mp4 needs imageio-ffmpeg: pip install 'faultgouge[movie]', or write a .gif") from error
    return imageio_ffmpeg
