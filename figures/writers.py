"""Films as files: GIF by Pillow, MP4 by the ffmpeg of imageio-ffmpeg."""

from collections.abc import Callable, Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faultgouge.analysis import BadInputError
from faultgouge.analysis.files.atomic_write import replace_whole

from .film import Film

COLOURS = 64
"""Colours of a GIF: a packing or a mode has some dozens, and shades of lines take the rest."""

PALETTE_FRAMES = 8
"""Frames whose colours a GIF has: of three, a disk that turns green has its last green only, and is grey before."""

COLOUR_DIFFERENCE = 18
"""A dot stays as it was while each of its three colours is off by no more than this, of 255. Without this a film of 20
units of time is twice as large; with twice as much contacts that moved leave gaps in others."""

TRANSPARENT_COLOUR = [1, 255, 1]
"""The colour whose place in the palette stands for a dot that stays as it was: no figure has this green."""

Progress = Callable[[Iterable[int], int], Iterable[int]]


class FilmError(BadInputError):
    """A film that cannot be written, in one sentence."""


def no_progress(frames: Iterable[int], count: int) -> Iterable[int]:
    """Show nothing."""
    return frames


def write_film(film: Film, path: Path, rate: float = 10.0, progress: Progress = no_progress) -> None:
    """Write a film; frames are made one at a time.

    Parameters
    ----------
    path : Path
        A name that ends in .gif or .mp4.
    rate : float
        Frames a second. A GIF counts in hundredths of a second, so that 100 must be a multiple of it.

    Raises
    ------
    FilmError
        If the name ends otherwise, or imageio-ffmpeg is not installed.
    """
    check_name(path)
    write = _gif if path.suffix.lower() == ".gif" else _mp4
    with replace_whole(path) as new:
        write(film, new, rate, progress)


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
    """Frame by frame: Pillow's own way to save a film would keep all frames in memory."""
    from PIL import Image
    from PIL.GifImagePlugin import getdata, getheader

    # One palette for all frames, so that colours do not flicker, from frames at even intervals: disks change colour.
    some = np.unique(np.linspace(0, film.count - 1, PALETTE_FRAMES).astype(int))
    samples = np.concatenate([film.frame(int(k)) for k in some])
    # It spans the colours evenly; the median cut, Pillow's own choice, has greys for the few dots of a bright colour.
    palette = Image.fromarray(samples).quantize(COLOURS - 1, method=Image.Quantize.MAXCOVERAGE, kmeans=3)
    colours = np.reshape((palette.getpalette() or [])[: 3 * (COLOURS - 1)], (-1, 3))
    colours[colours.min(axis=1) > 247] = 255  # the ground is white, as that of the page
    colours = np.concatenate([colours, [TRANSPARENT_COLOUR] * (COLOURS - len(colours))])
    palette.putpalette(colours.ravel().tolist())

    timing: dict[str, Any] = {"duration": round(1000 / rate), "disposal": 1}
    with path.open("wb") as file:
        shown = None
        for number in progress(range(film.count), film.count):
            frame = film.frame(number)
            picture = Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
            now = np.asarray(picture)
            if shown is None:
                file.writelines(getheader(picture, info={"loop": 0, "background": 0})[0])
                file.writelines(getdata(picture, **timing))
                shown = now.copy()
            else:
                # what stays as it was is transparent, which compresses well; one dot at least keeps the time
                changed = np.abs(frame - colours[shown]).max(axis=2) > COLOUR_DIFFERENCE
                box = Image.fromarray(changed).getbbox() or (0, 0, 1, 1)
                picture.paste(COLOURS - 1, mask=Image.fromarray(~changed))
                file.writelines(getdata(picture.crop(box), box[:2], transparency=COLOURS - 1, **timing))
                shown[changed] = now[changed]
        file.write(b";")


def _mp4(film: Film, path: Path, rate: float, progress: Progress) -> None:
    writer = _ffmpeg().write_frames(str(path), film.size, fps=rate, macro_block_size=2, quality=7)
    writer.send(None)
    try:
        for number in progress(range(film.count), film.count):
            frame: NDArray[np.uint8] = film.frame(number)
            writer.send(np.ascontiguousarray(frame))
    finally:
        writer.close()


def _ffmpeg() -> Any:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise FilmError("an .mp4 needs imageio-ffmpeg: pip install 'faultgouge[movie]', or write a .gif") from error
    return imageio_ffmpeg
