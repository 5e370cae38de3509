r"""Films: an undamped run with magnified displacements and D(t), the motion of a mode, and a ramp.

The fixed background is drawn once. For each frame only the few moving artists are drawn on top, which takes a hundredth
of the time of a whole figure.

**Magnification.** The displacements of an undamped run span ten decades and more, and would be invisible at their true
size. They are multiplied by a power of ten, which is printed on the frame. The largest displacement so far determines
the factor, so that the factor falls in steps while D grows.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from faultgouge.analysis import Packing, PackingFileError, RunFile, nearest_image
from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.has_configuration import HasConfiguration
from faultgouge.analysis.motion.hysteresis import layer_displacement

from .cycle import in_powers_of_ten
from .disk_view import View
from .mode import ModeArtist, ModeShape, finish, side_by_side
from .packing import COLOURS, PackingArtist
from .series import few_decades
from .style import BULK, EDGE, INK, styled

Frame = NDArray[np.uint8]

DOTS = 110
"""Dots an inch of a frame of a GIF, unless others are asked for: a GIF of more dots is too large for a page."""

LINES = 1080
"""Lines of a frame of an MP4 at least, unless dots are asked for."""

LARGEST_SHOWN = 0.6
"""The largest displacement on the screen, in units of the smallest radius: disks stay beside their neighbours."""

DISPLACEMENT_COLOURS = LinearSegmentedColormap.from_list("moved", [BULK, "#f0b090", "#c0392b"])


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
        """A part of the run.

        Raises
        ------
        PackingFileError
            If the run has fewer than two samples there.
        """
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
        # before anything has moved the factor is already that of the first displacement
        largest = np.maximum(largest, largest[largest > 0][0])
        return 10.0 ** np.floor(np.log10(LARGEST_SHOWN * self.packing.radius.min() / largest))


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
    def frame(self, number: int) -> Frame:
        """Colours of the frame, shape (height, width, 3)."""
        self.show(number)
        self._canvas.restore_region(self._still)
        for artist in self._moving:
            artist.axes.draw_artist(artist)  # type: ignore[union-attr]  # all of them are on axes
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    @abstractmethod
    def show(self, number: int) -> None:
        """Put the artists where they are in a frame."""


class RunFilm(Film):
    """An undamped run with magnified displacements, and D(t) beside it.

    Parameters
    ----------
    motion : RunMotion
        The run.
    frames : int
        How many frames; the samples of the run are taken at even intervals of time.
    """

    @styled
    def __init__(self, motion: RunMotion, frames: int, dots: int | None = DOTS) -> None:
        wanted = np.linspace(motion.time[0], motion.time[-1], frames)
        self._sample = np.clip(np.searchsorted(motion.time, wanted), 0, len(motion.time) - 1)
        self._motion, self._factor, self._msd = motion, motion.magnification(), motion.msd
        packing = motion.packing
        figure, axes, beside, points = _two_panels(packing)
        view = View.of(packing, margin=2 * packing.radius.max())
        self._artist = PackingArtist(axes, packing, view=view, points=points)
        self._artist.chains.set(color=EDGE, linewidth=0.5, zorder=2)
        self._artist.disks.set(array=np.zeros(len(view.disk)), cmap=DISPLACEMENT_COLOURS, norm=Normalize(0, 1))
        self._says = axes.text(0.5, 1.01, "", transform=axes.transAxes, ha="center", va="bottom", fontsize=8)
        key = "red: moves farthest; grey: rests"
        axes.text(0.5, -0.02, key, transform=axes.transAxes, ha="center", va="top", fontsize=7)
        seen = self._msd > 0
        beside.plot(motion.time[seen], self._msd[seen], color=BULK, linewidth=1.2)
        (self._line,) = beside.plot([], [], color="C1", linewidth=1.0)
        (self._dot,) = beside.plot([], [], "o", color="C0", markersize=4)
        beside.set(xlabel="$t$", ylabel="$D(t)$", yscale="log")
        late = seen & (motion.time >= 0.01 * motion.time[-1])  # the very first steps are many decades lower
        if late.any():
            beside.set_ylim(0.3 * self._msd[late].min(), 3 * self._msd.max())
        beside.margins(x=0.02)
        few_decades(beside)
        moving = [*self._artist.moving, self._says, self._line, self._dot]
        super().__init__(figure, moving, frames, dots)

    def show(self, number: int) -> None:
        """The run at the time of the frame."""
        k = self._sample[number]
        factor = self._factor[k]
        moved = factor * self._motion.displacement[k]
        self._artist.move(moved)
        share = np.linalg.norm(moved, axis=1)
        share = share / (share.max() or 1.0)
        self._artist.disks.set_array(share[self._artist.view.disk])
        self._says.set_text(
            rf"$t = {self._motion.time[k]:.3f}$, displacements $\times\,10^{{{round(np.log10(factor))}}}$"
        )
        self._line.set_data(self._motion.time[: k + 1], self._msd[: k + 1])
        self._dot.set_data([self._motion.time[k]], [self._msd[k]])


class ModeFilm(Film):
    """The motion of one or two modes, growth left out, a whole number of periods.

    Parameters
    ----------
    packing : Packing or Configuration
        The packing.
    modes : sequence of ModeShape
        Which.
    words : str
        What they are.
    frames, periods : int
        How many.
    """

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


class RampFilm(Film):
    """The equilibria of a ramp, and F_x over the displacement of the upper layer beside them.

    Parameters
    ----------
    packings : sequence of Packing
        Equilibria of the same disks.
    frames : int
        How many frames; each equilibrium is shown for about as long as the others.
    color : str
        As of :func:`~faultgouge.figures.draw_packing`.
    course : Course, optional
        The curve beside the packings, and their places on it; F_x over the displacement by default.
    """

    @styled
    def __init__(
        self,
        packings: Sequence[Packing],
        frames: int,
        color: str = "mobilised",
        dots: int | None = DOTS,
        course: Course | None = None,
    ) -> None:
        self._packings, self._color = packings, color
        self._which = np.linspace(0, len(packings) - 1, frames).round().astype(int)
        first = packings[0]
        shifts = np.array([nearest_image(each.position - first.position, first.box_length) for each in packings])
        self._displacement = shifts
        largest = np.linalg.norm(shifts, axis=2).max()
        shown = LARGEST_SHOWN * first.radius.min()
        self._factor = max(1.0, 10.0 ** np.floor(np.log10(shown / largest))) if largest > 0 else 1.0
        figure, axes, beside, points = _two_panels(first, scale=color != "none")
        self._margin = 2 * first.radius.max()
        view = View.of(first, margin=self._margin)
        # the last equilibrium has most of the slips, so that there are colours from the first frame on
        self._artist = PackingArtist(axes, packings[-1], color, View.of(packings[-1], margin=self._margin), points)
        self._widest = max(each.normal_force.max(initial=0.0) for each in packings) or 1.0
        if self._artist.chains.get_array() is not None:
            bar = figure.colorbar(self._artist.chains, ax=axes, shrink=0.6, aspect=28, pad=0.02, location="left")
            bar.set_label(COLOURS[color][0])
        axes.set(xlim=(view.left, view.right))
        factor = rf"$\times\,10^{{{round(np.log10(self._factor))}}}$" if self._factor > 1 else "to scale"
        self._words = f"displacements {factor}"
        self._says = axes.text(0.5, 1.01, "", transform=axes.transAxes, ha="center", va="bottom", fontsize=8)
        self._course = course or Course.of_ramp(packings)
        beside.plot(self._course.x, self._course.y, color=BULK, linewidth=1.2)
        (self._line,) = beside.plot([], [], color="C1", linewidth=1.0)
        (self._dot,) = beside.plot([], [], "o", color="C0", markersize=4)
        beside.set(xlabel=self._course.labels[0], ylabel=self._course.labels[1])
        moving = [*self._artist.moving, self._says, self._line, self._dot]
        super().__init__(figure, moving, frames, dots)

    def show(self, number: int) -> None:
        """The equilibrium of the frame."""
        k = self._which[number]
        packing = self._packings[k]
        artist = self._artist
        artist.packing, artist.view = packing, View.of(packing, margin=self._margin)
        contact, disk = artist.view.contact, artist.view.disk
        artist.disks.set_widths(2 * packing.radius[disk])
        artist.disks.set_heights(2 * packing.radius[disk])
        artist.disks.set_angles(np.zeros(len(disk)))  # as many as images, which disks gain and lose at the edges
        artist.disks.set_facecolor([str(face) for face in artist.faces(packing)[disk]])
        artist.chains.set_linewidth(artist.widest * packing.normal_force[contact] / self._widest)
        if artist.chains.get_array() is not None:
            artist.chains.set_array(COLOURS[self._color][1](packing)[contact])
        artist.move((self._factor - 1) * self._displacement[k])
        course, here = self._course, self._course.places[k]
        self._says.set_text(f"{course.words[k]}, {self._words}")
        self._line.set_data(course.x[: here + 1], course.y[: here + 1])
        self._dot.set_data([course.x[here]], [course.y[here]])


def _two_panels(packing: Packing, scale: bool = False) -> tuple[Figure, Axes, Axes, float]:
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
