r"""Films, frame by frame, and as files: of an undamped run, of a ramp or a drive, of modes.

The fixed background is drawn once. For each frame only the few moving artists are drawn on top, which takes a hundredth
of the time of a whole figure.

**Magnification.** The displacements of an undamped run span ten decades and more, and would be invisible at their true
size. They are multiplied by a power of ten, which is printed on the frame. The largest displacement so far determines
the factor, so that the factor falls in steps while D grows.

**Files.** A GIF is written by Pillow, with one palette for all frames, so that colours do not flicker; an MP4 by the
ffmpeg of imageio-ffmpeg.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgba_array
from matplotlib.figure import Figure
from numpy.typing import NDArray

from faultgouge.analysis import BadInputError, Packing, PackingFileError, RunFile, nearest_image
from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.files.atomic_write import replace_whole
from faultgouge.analysis.has_configuration import HasConfiguration
from faultgouge.analysis.responses.hysteresis import layer_displacement
from faultgouge.analysis.responses.slips import Slip

from .disk_view import View
from .mode import ModeArtist, ModeShape, finish
from .packing import COLOURS, PackingArtist, faces_of, figure_for
from .series import few_decades, in_powers_of_ten
from .style import BULK, EDGE, INK, styled

Picture = NDArray[np.uint8]
Progress = Callable[[Iterable[int], int], Iterable[int]]

DOTS = 110
"""Dots an inch of a frame of a GIF, unless others are asked for: a GIF of more dots is too large for a page."""

LINES = 1080
"""Lines of a frame of an MP4 at least, unless dots are asked for."""

LARGEST_SHOWN = 0.6
"""The largest displacement on the screen, in units of the smallest radius: disks stay beside their neighbours."""

DISPLACEMENT_COLOURS = LinearSegmentedColormap.from_list("moved", [BULK, "#f0b090", "#c0392b"])

WAY_COLOURS = LinearSegmentedColormap.from_list("way", [BULK, "#4fb286"])
"""Colours of disks by the way that they have gone: those of the force chains stand out from all of them."""

COLOURS_OF_GIF = 64
"""Colours of a GIF: a packing or a mode has some dozens, and shades of lines take the rest."""

PALETTE_FRAMES = 8
"""Frames whose colours a GIF has: of three, a disk that turns green has its last green only, and is grey before."""

COLOUR_DIFFERENCE = 18
"""A dot stays as it was while each of its three colours is off by no more than this, of 255. Without this a film of 20
units of time is twice as large; with twice as much contacts that moved leave gaps in others."""

TRANSPARENT_COLOUR = [1, 255, 1]
"""The colour whose place in the palette stands for a dot that stays as it was: no figure has this green."""


class FilmError(BadInputError):
    """A film that cannot be written, in one sentence."""


class Film:
    """A film, frame by frame.

    Parameters
    ----------
    figure : Figure
        With everything on it.
    moving : sequence of Artist
        What changes from frame to frame, in the order in which it is drawn.
    show : callable
        Puts these artists where they are in a frame, by its number.
    count : int
        How many frames there are.
    dots : int, optional
        Dots an inch; by default so many that a frame has `LINES` lines.
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
    def frame(self, number: int) -> Picture:
        """Colours of the frame, shape (height, width, 3)."""
        self._show(number)
        self._canvas.restore_region(self._still)
        for artist in self.moving:
            artist.axes.draw_artist(artist)  # type: ignore[union-attr]  # all of them are on axes
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()


@dataclass(frozen=True, eq=False)
class RunMotion:
    """Displacements of an undamped run.

    Attributes
    ----------
    packing : Packing
        The equilibrium where the run began.
    time : ndarray, shape (T,)
        Times.
    displacement : ndarray, shape (T, N, 2)
        From the equilibrium, length.
    """

    packing: Packing
    time: Floats
    displacement: Floats

    @classmethod
    def of(cls, packing: Packing, time: Floats, position: Floats, position_low: Floats | None = None) -> "RunMotion":
        """From positions, shape (T, N, 2), and their low parts if there are any; it begins at rest, at time zero."""
        displacement = nearest_image(position - packing.position, packing.box_length)
        if position_low is not None:
            displacement += position_low - (0.0 if packing.position_low is None else packing.position_low)
        return cls(packing, np.insert(time, 0, 0.0), np.insert(displacement, 0, 0.0, axis=0))

    @classmethod
    def read(cls, run: RunFile) -> "RunMotion | None":
        """The undamped run of an open file; None if the file has no trajectory."""
        if "trajectory" not in run.names_of_series:
            return None
        series = run.series("trajectory")
        return cls.of(run.packing(-1), series["time"], series["position"], series.get("position_low"))

    def between(self, first: float, last: float) -> "RunMotion":
        """A part of the run. Raises PackingFileError if the run has fewer than two samples there."""
        part = (self.time >= first) & (self.time <= last)
        if part.sum() < 2:
            raise PackingFileError(
                f"the run has {part.sum()} samples from t = {first:g} to {last:g}, and two are needed: its times go "
                f"from {self.time[0]:g} to {self.time[-1]:g}"
            )
        return RunMotion(self.packing, self.time[part], self.displacement[part])

    @property
    def msd(self) -> Floats:
        """D(t), length^2, shape (T,)."""
        return np.sum(self.displacement**2, axis=2).mean(axis=1)

    def magnification(self) -> Floats:
        """The power of ten at each time, shape (T,): see the module."""
        largest = np.maximum.accumulate(np.sqrt(np.sum(self.displacement**2, axis=2)).max(axis=1))
        if not largest[-1]:
            return np.ones(len(largest))
        # before any displacement the factor is that of the first displacement
        return _power_of_ten(self.packing, np.maximum(largest, largest[largest > 0][0]))


def _power_of_ten(packing: HasConfiguration, largest: Floats) -> Floats:
    """The power of ten that shows displacements up to the largest, so that disks stay beside their neighbours."""
    return np.asarray(10.0 ** np.floor(np.log10(LARGEST_SHOWN * packing.radius.min() / largest)))


class Course(NamedTuple):
    """A curve, and the places of packings on it.

    Attributes
    ----------
    x, y : ndarray, shape (P,)
        The curve.
    places : sequence of int
        Point of the curve of each packing.
    labels : (str, str)
        Of the axes.
    words : sequence of str
        Above each packing.
    """

    x: Floats
    y: Floats
    places: Sequence[int]
    labels: tuple[str, str]
    words: Sequence[str]

    @classmethod
    def of_ramp(cls, packings: Sequence[Packing]) -> "Course":
        """F_x over the displacement of the upper layer."""
        moved, label = in_powers_of_ten(layer_displacement(packings)[:, 0])
        forces = np.array([each.fx for each in packings])
        return cls(moved, forces, range(len(packings)), (label, "$F_x$"), [f"$F_x = {each:.5g}$" for each in forces])

    @classmethod
    def of_drive(
        cls, series: Mapping[str, Floats], slips: Sequence[Slip], times: Sequence[float], first: float, last: float
    ) -> "Course":
        """The force over time between two times, with the places of states at these times on it."""
        shown = (series["time"] >= first) & (series["time"] <= last)
        time, force = series["time"][shown], series["force"][shown]
        places = np.clip(np.searchsorted(time, times), 0, max(len(time) - 1, 0)).tolist()
        slipping = [any(slip.begins < each <= slip.ends for slip in slips) for each in times]
        words = [f"$t = {each:.1f}$" + ", slip" * now for each, now in zip(times, slipping, strict=True)]
        return cls(time, force, places, ("$t$", "$F$"), words)


def _packing_and_curve(packing: Packing, scale: float = 0.0) -> tuple[Figure, Axes, Axes, float]:
    """A figure with a packing, and room for a scale, on the left, and a curve on the right; points per unit of length
    on the left."""
    width, height = View.of(packing).size
    across = min(2.4, 3.2 * width / height)
    figure = Figure(figsize=(across + 2.5 + scale, max(2.0, across * height / width + 0.45)))
    figure.set_layout_engine("constrained", h_pad=0.07)
    left, right = figure.subplots(1, 2, width_ratios=(across + scale, 2.3))
    for spine in right.spines.values():
        spine.set_color(INK)
    return figure, left, right, 72 * across / width


def _beside_curve(
    axes: tuple[Axes, Axes],
    artist: PackingArtist,
    course: Course,
    which: NDArray[np.int_],
    draw: Callable[[int], object],
    key: str,
) -> tuple[list[Artist], Callable[[int], None]]:
    """What moves, and the function that shows a frame, of a packing on the left and its place on a curve on the right.

    Parameters
    ----------
    which : ndarray of int
        The place of each frame, counted along `course.places`.
    draw : callable
        Puts the packing where it is at such a place.
    key : str
        Words below the packing.
    """
    left, right = axes
    says = left.text(0.5, 1.01, "", transform=left.transAxes, ha="center", va="bottom", fontsize=8)
    left.text(0.5, -0.02, key, transform=left.transAxes, ha="center", va="top", fontsize=7)
    (line,) = right.plot([], [], color="C1", linewidth=1.0)
    (dot,) = right.plot([], [], "o", color="C0", markersize=4)
    right.set(xlabel=course.labels[0], ylabel=course.labels[1])

    def show(number: int) -> None:
        draw(k := int(which[number]))
        here = course.places[k]
        says.set_text(course.words[k])
        line.set_data(course.x[: here + 1], course.y[: here + 1])
        dot.set_data([course.x[here]], [course.y[here]])

    return [*artist.moving, says, line, dot], show


@styled
def film_of_run(motion: RunMotion, frames: int, dots: int | None = DOTS) -> Film:
    """An undamped run with magnified displacements, and D(t) beside it.

    Parameters
    ----------
    frames : int
        How many frames; the samples of the run are taken at even intervals of time.
    """
    packing, time, factor, msd = motion.packing, motion.time, motion.magnification(), motion.msd
    figure, axes, beside, points = _packing_and_curve(packing)
    artist = PackingArtist(axes, packing, view=View.of(packing, margin=2 * packing.radius.max()), points=points)
    disk, seen = artist.view.disk, msd > 0
    artist.chains.set(color=EDGE, linewidth=0.5, zorder=2)
    artist.disks.set(array=np.zeros(len(disk)), cmap=DISPLACEMENT_COLOURS, norm=Normalize(0, 1))
    beside.plot(time[seen], msd[seen], color=BULK, linewidth=1.2)
    beside.set(yscale="log")
    late = seen & (time >= 0.01 * time[-1])  # the very first steps are many decades lower
    if late.any():
        beside.set_ylim(0.3 * msd[late].min(), 3 * msd.max())
    beside.margins(x=0.02)
    few_decades(beside)

    def draw(k: int) -> None:
        moved = factor[k] * motion.displacement[k]
        artist.move(moved)
        share = np.linalg.norm(moved, axis=1)
        artist.disks.set_array((share / (share.max() or 1.0))[disk])

    powers = np.round(np.log10(factor)).astype(int)
    words = [rf"$t = {t:.3f}$, displacements $\times\,10^{{{power}}}$" for t, power in zip(time, powers, strict=True)]
    course = Course(time, msd, range(len(time)), ("$t$", "$D(t)$"), words)
    which = np.clip(np.searchsorted(time, np.linspace(time[0], time[-1], frames)), 0, len(time) - 1)
    shown = _beside_curve((axes, beside), artist, course, which, draw, "red: moves farthest; grey: rests")
    return Film(figure, *shown, frames, dots)


@styled
def film_of_ramp(
    packings: Sequence[Packing],
    frames: int,
    color: str = "mobilised",
    dots: int | None = DOTS,
    course: Course | None = None,
    by_way: bool = False,
) -> Film:
    """The equilibria of a ramp, and F_x over the displacement of the upper layer beside them.

    Parameters
    ----------
    frames : int
        How many frames; each equilibrium is shown for about as long as the others.
    color : str
        As of :func:`~faultgouge.figures.draw_packing`.
    course : Course, optional
        The curve beside the packings, and their places on it; F_x over the displacement by default.
    by_way : bool
        Whether the colours of disks show how far they have moved since the first packing, in place of the layers.
    """
    first, course = packings[0], course or Course.of_ramp(packings)
    shifts = np.array([nearest_image(each.position - first.position, first.box_length) for each in packings])
    largest = np.linalg.norm(shifts, axis=2).max()
    factor = max(1.0, float(_power_of_ten(first, largest))) if largest > 0 else 1.0
    figure, axes, beside, points = _packing_and_curve(first, 0.7 if color != "none" else 0.0)
    margin = 2 * first.radius.max()
    # the last equilibrium has most of the slips, so that there are colours from the first frame on
    artist = PackingArtist(axes, packings[-1], color, View.of(packings[-1], margin=margin), points)
    disks, chains = artist.disks, artist.chains
    widest = max(each.normal_force.max(initial=0.0) for each in packings) or 1.0
    coloured = chains.get_array() is not None
    if coloured:
        bar = figure.colorbar(chains, ax=axes, shrink=0.6, aspect=28, pad=0.02, location="left")
        bar.set_label(COLOURS[color][0])
    view = View.of(first, margin=margin)
    axes.set(xlim=(view.low[0], view.high[0]))
    beside.plot(course.x, course.y, color=BULK, linewidth=1.2)
    faces = faces_by_way(packings, shifts) if by_way else [to_rgba_array(faces_of(each)) for each in packings]

    def draw(k: int) -> None:
        packing = packings[k]
        artist.packing, artist.view = packing, View.of(packing, margin=margin)
        contact, disk = artist.view.contact, artist.view.disk
        disks.set_widths(2 * packing.radius[disk])
        disks.set_heights(2 * packing.radius[disk])
        disks.set_angles(np.zeros(len(disk)))  # as many as images, which disks gain and lose at the edges
        disks.set_facecolor([tuple(face) for face in faces[k][disk]])
        chains.set_linewidth(artist.widest * packing.normal_force[contact] / widest)
        if coloured:
            chains.set_array(COLOURS[color][1](packing)[contact])
        artist.move((factor - 1) * shifts[k])

    magnified = rf"$\times\,10^{{{round(np.log10(factor))}}}$" if factor > 1 else "to scale"
    course = course._replace(words=[f"{each}, displacements {magnified}" for each in course.words])
    which = np.linspace(0, len(packings) - 1, frames).round().astype(int)
    key = "the greener, the farther moved" if by_way else ""
    return Film(figure, *_beside_curve((axes, beside), artist, course, which, draw, key), frames, dots)


def faces_by_way(packings: Sequence[Packing], shifts: Floats) -> list[NDArray[Any]]:
    """Colours of the disks of each packing, shape (N, 4), greener the farther they have moved; rattlers stay white.

    Parameters
    ----------
    shifts : ndarray, shape (S, N, 2)
        Displacements since the first packing, length.
    """
    ways, found = np.linalg.norm(shifts, axis=2), []
    # single disks, which are squeezed out or roll, move farther than all others
    most = np.quantile(ways, 0.9, axis=1).max() or 1.0
    for packing, way in zip(packings, ways, strict=True):
        faces = to_rgba_array(faces_of(packing))
        touching = np.setdiff1d(np.arange(len(packing)), packing.rattlers)
        faces[touching] = WAY_COLOURS(np.minimum(way / most, 1.0)[touching])
        found.append(faces)
    return found


@styled
def film_of_modes(
    packing: HasConfiguration,
    modes: Sequence[ModeShape],
    words: str,
    frames: int,
    periods: int,
    dots: int | None = DOTS,
) -> Film:
    """The motion of one or two modes, growth left out, a whole number of periods."""
    figure, axes, points = figure_for(packing, len(modes), below=0.95)
    artists = [ModeArtist(one, packing, mode, points, moves=True) for one, mode in zip(axes, modes, strict=True)]
    for one, mode in zip(axes, modes, strict=True):
        one.set_title(mode.words, fontsize=7)
    finish(axes, packing, words if len(modes) > 1 else "one mode, growth left out")

    def show(number: int) -> None:
        for artist in artists:
            artist.show(2 * np.pi * periods / frames * number)

    return Film(figure, [part for each in artists for part in each.artist.moving], show, frames, dots)


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
    palette = Image.fromarray(samples).quantize(COLOURS_OF_GIF - 1, method=Image.Quantize.MAXCOVERAGE, kmeans=3)
    colours = np.reshape((palette.getpalette() or [])[: 3 * (COLOURS_OF_GIF - 1)], (-1, 3))
    colours[colours.min(axis=1) > 247] = 255  # the ground is white, as that of the page
    colours = np.concatenate([colours, [TRANSPARENT_COLOUR] * (COLOURS_OF_GIF - len(colours))])
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
                picture.paste(COLOURS_OF_GIF - 1, mask=Image.fromarray(~changed))
                file.writelines(getdata(picture.crop(box), box[:2], transparency=COLOURS_OF_GIF - 1, **timing))
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
