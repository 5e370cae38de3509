r"""Films, frame by frame: of an undamped run, of a ramp or a drive, of modes.

The fixed background is drawn once. For each frame only the few moving artists are drawn on top, which takes a hundredth
of the time of a whole figure.

**Magnification.** The displacements of an undamped run span ten decades and more, and would be invisible at their true
size. They are multiplied by a power of ten, which is printed on the frame. The largest displacement so far determines
the factor, so that the factor falls in steps while D grows.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgba_array
from matplotlib.figure import Figure
from numpy.typing import NDArray

from faultgouge.analysis import Packing, PackingFileError, RunFile, nearest_image
from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.has_configuration import HasConfiguration
from faultgouge.analysis.motion.hysteresis import layer_displacement

from .cycle import in_powers_of_ten
from .disk_view import View
from .mode import ModeArtist, ModeShape, finish, side_by_side
from .packing_artist import COLOURS, PackingArtist
from .series import few_decades
from .style import BULK, EDGE, INK, styled

Picture = NDArray[np.uint8]

DOTS = 110
"""Dots an inch of a frame of a GIF, unless others are asked for: a GIF of more dots is too large for a page."""

LINES = 1080
"""Lines of a frame of an MP4 at least, unless dots are asked for."""

LARGEST_SHOWN = 0.6
"""The largest displacement on the screen, in units of the smallest radius: disks stay beside their neighbours."""

DISPLACEMENT_COLOURS = LinearSegmentedColormap.from_list("moved", [BULK, "#f0b090", "#c0392b"])

WAY_COLOURS = LinearSegmentedColormap.from_list("way", [BULK, "#4fb286"])
"""Colours of disks by the way that they have gone: those of the force chains stand out from all of them."""


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
        """From positions, shape (T, N, 2), and their low parts if there are any."""
        displacement = nearest_image(position - packing.position, packing.box_length)
        if position_low is not None:
            own = 0.0 if packing.position_low is None else packing.position_low
            displacement = displacement + (position_low - own)
        return cls(packing, time, displacement)

    @classmethod
    def read(cls, run: RunFile) -> "RunMotion | None":
        """The undamped run of an open file; None if the file has no trajectory."""
        if "trajectory" not in run.names_of_series:
            return None
        packing, series = run.packing(-1), run.series("trajectory")
        # the run begins at rest, before its first sample
        time, position = np.insert(series["time"], 0, 0.0), np.insert(series["position"], 0, packing.position, axis=0)
        low = series.get("position_low")
        if low is not None and packing.position_low is not None:
            low = np.insert(low, 0, packing.position_low, axis=0)
        return cls.of(packing, time, position, low)

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
        largest = np.maximum(largest, largest[largest > 0][0])
        return 10.0 ** np.floor(np.log10(LARGEST_SHOWN * self.packing.radius.min() / largest))


@dataclass(frozen=True, eq=False)
class Course:
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
        words = [f"$F_x = {each.fx:.5g}$" for each in packings]
        return cls(moved, forces, range(len(packings)), (label, "$F_x$"), words)


def _packing_and_curve(packing: Packing, scale: bool = False) -> tuple[Figure, Axes, Axes, float]:
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


def _beside_curve(
    figure: Figure, axes: tuple[Axes, Axes], artist: PackingArtist, course: Course, which: NDArray[np.int_],
    draw: Callable[[int], object], key: str = "", dots: int | None = DOTS,
) -> Film:  # fmt: skip
    """A film of a packing on the left, whose frames have a place on a curve on the right.

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
        k = which[number]
        draw(k)
        here = course.places[k]
        says.set_text(course.words[k])
        line.set_data(course.x[: here + 1], course.y[: here + 1])
        dot.set_data([course.x[here]], [course.y[here]])

    return Film(figure, [*artist.moving, says, line, dot], show, len(which), dots)


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
    view = View.of(packing, margin=2 * packing.radius.max())
    artist = PackingArtist(axes, packing, view=view, points=points)
    artist.chains.set(color=EDGE, linewidth=0.5, zorder=2)
    artist.disks.set(array=np.zeros(len(view.disk)), cmap=DISPLACEMENT_COLOURS, norm=Normalize(0, 1))
    seen = msd > 0
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
        artist.disks.set_array((share / (share.max() or 1.0))[view.disk])

    powers = np.round(np.log10(factor)).astype(int)
    words = [rf"$t = {t:.3f}$, displacements $\times\,10^{{{power}}}$" for t, power in zip(time, powers, strict=True)]
    course = Course(time, msd, range(len(time)), ("$t$", "$D(t)$"), words)
    which = np.clip(np.searchsorted(time, np.linspace(time[0], time[-1], frames)), 0, len(time) - 1)
    key = "red: moves farthest; grey: rests"
    return _beside_curve(figure, (axes, beside), artist, course, which, draw, key, dots)


@styled
def film_of_ramp(
    packings: Sequence[Packing], frames: int, color: str = "mobilised", dots: int | None = DOTS,
    course: Course | None = None, by_way: bool = False,
) -> Film:  # fmt: skip
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
    factor = max(1.0, 10.0 ** np.floor(np.log10(LARGEST_SHOWN * first.radius.min() / largest))) if largest > 0 else 1.0
    figure, axes, beside, points = _packing_and_curve(first, scale=color != "none")
    margin = 2 * first.radius.max()
    view = View.of(first, margin=margin)
    # the last equilibrium has most of the slips, so that there are colours from the first frame on
    artist = PackingArtist(axes, packings[-1], color, View.of(packings[-1], margin=margin), points)
    widest = max(each.normal_force.max(initial=0.0) for each in packings) or 1.0
    if artist.chains.get_array() is not None:
        bar = figure.colorbar(artist.chains, ax=axes, shrink=0.6, aspect=28, pad=0.02, location="left")
        bar.set_label(COLOURS[color][0])
    axes.set(xlim=(view.left, view.right))
    beside.plot(course.x, course.y, color=BULK, linewidth=1.2)
    faces = [to_rgba_array(artist.faces(packing)) for packing in packings]
    if by_way:
        faces = faces_by_way(packings, shifts)

    def draw(k: int) -> None:
        packing = packings[k]
        artist.packing, artist.view = packing, View.of(packing, margin=margin)
        contact, disk = artist.view.contact, artist.view.disk
        artist.disks.set_widths(2 * packing.radius[disk])
        artist.disks.set_heights(2 * packing.radius[disk])
        artist.disks.set_angles(np.zeros(len(disk)))  # as many as images, which disks gain and lose at the edges
        artist.disks.set_facecolor([tuple(face) for face in faces[k][disk]])
        artist.chains.set_linewidth(artist.widest * packing.normal_force[contact] / widest)
        if artist.chains.get_array() is not None:
            artist.chains.set_array(COLOURS[color][1](packing)[contact])
        artist.move((factor - 1) * shifts[k])

    magnified = rf"$\times\,10^{{{round(np.log10(factor))}}}$" if factor > 1 else "to scale"
    words = [f"{each}, displacements {magnified}" for each in course.words]
    course = Course(course.x, course.y, course.places, course.labels, words)
    which = np.linspace(0, len(packings) - 1, frames).round().astype(int)
    key = "the greener, the farther moved" if by_way else ""
    return _beside_curve(figure, (axes, beside), artist, course, which, draw, key, dots)


def faces_by_way(packings: Sequence[Packing], shifts: Floats) -> list[NDArray[Any]]:
    """Colours of the disks of each packing, shape (N, 4), greener the farther they have moved; rattlers stay white.

    Parameters
    ----------
    shifts : ndarray, shape (S, N, 2)
        Displacements since the first packing, length.
    """
    ways = np.linalg.norm(shifts, axis=2)
    # single disks, which are squeezed out or roll, move farther than all others
    most = max(float(np.quantile(way, 0.9)) for way in ways) or 1.0
    found = []
    for packing, way in zip(packings, ways, strict=True):
        faces = to_rgba_array(PackingArtist.faces(packing))
        touching = np.setdiff1d(np.arange(len(packing)), packing.rattlers)
        faces[touching] = WAY_COLOURS(np.minimum(way / most, 1.0)[touching])
        found.append(faces)
    return found


@styled
def film_of_modes(
    packing: HasConfiguration, modes: Sequence[ModeShape], words: str, frames: int, periods: int,
    dots: int | None = DOTS,
) -> Film:  # fmt: skip
    """The motion of one or two modes, growth left out, a whole number of periods."""
    figure, axes, points = side_by_side(packing, len(modes))
    artists = [ModeArtist(one, packing, mode, points, moves=True) for one, mode in zip(axes, modes, strict=True)]
    for one, mode in zip(axes, modes, strict=True):
        one.set_title(mode.words, fontsize=7)
    finish(figure, axes, packing, words if len(modes) > 1 else "one mode, growth left out")

    def show(number: int) -> None:
        for artist in artists:
            artist.show(2 * np.pi * periods / frames * number)

    return Film(figure, [part for each in artists for part in each.artist.moving], show, frames, dots)
