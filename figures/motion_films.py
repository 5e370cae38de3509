r"""Films of an undamped run, of a ramp or a drive, of modes.

**Magnification.** The displacements of an undamped run span ten decades and more, and would be invisible at their true
size. They are multiplied by a power of ten, which is printed on the frame. The largest displacement so far determines
the factor, so that the factor falls in steps while D grows.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgba_array
from matplotlib.figure import Figure
from numpy.typing import NDArray

from faultgouge.analysis import Packing, PackingFileError, RunFile, nearest_image
from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.has_configuration import HasConfiguration
from faultgouge.analysis.responses.hysteresis import layer_displacement
from faultgouge.analysis.responses.slips import Slip

from .disk_view import View
from .film import DOTS, Film
from .mode import ModeShape, finish
from .packing import COLOURS, PackingArtist, faces_of, figure_for
from .series import few_decades, in_powers_of_ten
from .style import BULK, EDGE, INK, figure_of, styled

LARGEST_SHOWN = 0.6
"""The largest displacement on the screen, in units of the smallest radius: disks stay beside their neighbours."""

OF_MODE = 0.5
"""Largest displacement of a disk in a film of a mode, in units of the largest radius."""

DISPLACEMENT_COLOURS = LinearSegmentedColormap.from_list("moved", [BULK, "#f0b090", "#c0392b"])

WAY_COLOURS = LinearSegmentedColormap.from_list("way", [BULK, "#4fb286"])
"""Colours of disks by the way that they have gone: those of the force chains stand out from all of them."""


class RunMotion(NamedTuple):
    """Displacements of an undamped run from the equilibrium where it began, shape (T, N, 2), at `time` (T,)."""

    packing: Packing
    time: Floats
    displacement: Floats

    @classmethod
    def read(cls, run: RunFile) -> "RunMotion | None":
        """The undamped run of an open file, from rest at time zero; None if the file has no trajectory."""
        if "trajectory" not in run.names_of_series:
            return None
        packing, series = run.packing(-1), run.series("trajectory")
        displacement = nearest_image(series["position"] - packing.position, packing.box_length)
        if (low := series.get("position_low")) is not None:
            displacement += low - (0.0 if packing.position_low is None else packing.position_low)
        return cls(packing, np.insert(series["time"], 0, 0.0), np.insert(displacement, 0, 0.0, axis=0))

    def between(self, first: float, last: float) -> "RunMotion":
        """A part of the run. Raises PackingFileError if the run has fewer than two samples there."""
        part = (self.time >= first) & (self.time <= last)
        if part.sum() < 2:
            says = f"the run has {part.sum()} samples from t = {first:g} to {last:g}, and two are needed"
            raise PackingFileError(f"{says}: its times go from {self.time[0]:g} to {self.time[-1]:g}")
        return RunMotion(self.packing, self.time[part], self.displacement[part])

    def magnification(self) -> Floats:
        """The power of ten at each time, shape (T,): see the module."""
        largest = np.maximum.accumulate(np.sqrt(np.sum(self.displacement**2, axis=2)).max(axis=1))
        # before any displacement the factor is that of the first displacement
        seen = largest[largest > 0][:1]
        return _power_of_ten(self.packing, np.maximum(largest, seen)) if len(seen) else np.ones(len(largest))


def _power_of_ten(packing: HasConfiguration, largest: Floats) -> Floats:
    """The power of ten that shows displacements up to the largest, so that disks stay beside their neighbours."""
    return np.asarray(10.0 ** np.floor(np.log10(LARGEST_SHOWN * packing.radius.min() / largest)))


class Course(NamedTuple):
    """A curve `x`, `y` (P,) with the labels of its axes; `places` has the point of the curve of each packing, and
    `words` what stands above it."""

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


def _packing_and_curve(size: Floats, drawn: Packing, color: str = "none") -> tuple[PackingArtist, Axes]:
    """A packing on the left of a figure, with room for a scale of colours, and axes for a curve on the right."""
    (width, height), scale = size, 0.7 if color != "none" else 0.0
    across = min(2.4, 3.2 * width / height)
    figure = Figure(figsize=(across + 2.5 + scale, max(2.0, across * height / width + 0.45)))
    figure.set_layout_engine("constrained", h_pad=0.07)
    left, right = figure.subplots(1, 2, width_ratios=(across + scale, 2.3))
    right.spines[:].set_color(INK)
    return PackingArtist(left, drawn, color, 2 * drawn.radius.max(), 72 * across / width), right


def _beside_curve(
    artist: PackingArtist, axes: Axes, course: Course, which: NDArray[np.int_], draw: Callable[[int], object],
    key: str, dots: int | None,
) -> Film:  # fmt: skip
    """The film of a packing beside its place on a curve.

    `which` has the place of each frame, counted along `course.places`; `draw` puts the packing where it is at such a
    place; `key` is words below the packing.
    """
    left = artist.axes
    says = left.text(0.5, 1.01, "", transform=left.transAxes, ha="center", va="bottom", fontsize=8)
    left.text(0.5, -0.02, key, transform=left.transAxes, ha="center", va="top", fontsize=7)
    axes.plot(course.x, course.y, color=BULK, linewidth=1.2)
    (line,), (dot,) = axes.plot([], [], color="C1", linewidth=1.0), axes.plot([], [], "o", color="C0", markersize=4)
    axes.set(xlabel=course.labels[0], ylabel=course.labels[1])

    def show(number: int) -> None:
        draw(k := int(which[number]))
        here = course.places[k]
        says.set_text(course.words[k])
        line.set_data(course.x[: here + 1], course.y[: here + 1])
        dot.set_data([course.x[here]], [course.y[here]])

    return Film(figure_of(axes), [*artist.moving, says, line, dot], show, len(which), dots)


@styled
def film_of_run(motion: RunMotion, frames: int, dots: int | None = DOTS) -> Film:
    """An undamped run with magnified displacements, at even intervals of time, and D(t) beside it."""
    packing, time, factor = motion.packing, motion.time, motion.magnification()
    msd = np.sum(motion.displacement**2, axis=2).mean(axis=1)
    artist, beside = _packing_and_curve(View.of(packing).size, packing)
    disk = artist.view.disk
    artist.chains.set(color=EDGE, linewidth=0.5, zorder=2)
    artist.disks.set(array=np.zeros(len(disk)), cmap=DISPLACEMENT_COLOURS, norm=Normalize(0, 1))
    beside.set(yscale="log")
    late = (msd > 0) & (time >= 0.01 * time[-1])  # the very first steps are many decades lower
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
    return _beside_curve(artist, beside, course, which, draw, "red: moves farthest; grey: rests", dots)


@styled
def film_of_ramp(
    packings: Sequence[Packing], frames: int, color: str = "mobilised", dots: int | None = DOTS,
    course: Course | None = None, by_way: bool = False,
) -> Film:  # fmt: skip
    """The equilibria of a ramp, each for about as long as the others, and beside them the course, by default F_x over
    the displacement of the upper layer. Colours are those of :func:`~faultgouge.figures.draw_packing`; `by_way`, those
    of disks show how far they have moved since the first packing, in place of the layers."""
    first, course = packings[0], course or Course.of_ramp(packings)
    shifts = np.array([nearest_image(each.position - first.position, first.box_length) for each in packings])
    largest = np.linalg.norm(shifts, axis=2).max()
    factor = max(1.0, float(_power_of_ten(first, largest))) if largest > 0 else 1.0
    view = View.of(first)
    # the last equilibrium has most of the slips, so that there are colours from the first frame on
    artist, beside = _packing_and_curve(view.size, packings[-1], color)
    disks, chains, axes = artist.disks, artist.chains, artist.axes
    widest = max(each.normal_force.max(initial=0.0) for each in packings) or 1.0
    if coloured := chains.get_array() is not None:
        bar = figure_of(beside).colorbar(chains, ax=axes, shrink=0.6, aspect=28, pad=0.02, location="left")
        bar.set_label(COLOURS[color][0])
    axes.set(xlim=(view.low[0], view.high[0]))
    faces = faces_by_way(packings, shifts) if by_way else [to_rgba_array(faces_of(each)) for each in packings]

    def draw(k: int) -> None:
        packing = packings[k]
        artist.packing, artist.view = packing, View.of(packing, artist.margin)
        contact, disk = artist.view.contact, artist.view.disk
        # as many as images, which disks gain and lose at the edges
        disks.set(widths=2 * packing.radius[disk], heights=2 * packing.radius[disk], angles=np.zeros(len(disk)))
        disks.set_facecolor([tuple(face) for face in faces[k][disk]])
        chains.set_linewidth(artist.widest * packing.normal_force[contact] / widest)
        if coloured:
            chains.set_array(getattr(packing, COLOURS[color][1])[contact])
        artist.move((factor - 1) * shifts[k])

    magnified = rf"$\times\,10^{{{round(np.log10(factor))}}}$" if factor > 1 else "to scale"
    course = course._replace(words=[f"{each}, displacements {magnified}" for each in course.words])
    which = np.linspace(0, len(packings) - 1, frames).round().astype(int)
    key = "the greener, the farther moved" if by_way else ""
    return _beside_curve(artist, beside, course, which, draw, key, dots)


def faces_by_way(packings: Sequence[Packing], shifts: Floats) -> list[NDArray[Any]]:
    """Colours of the disks of each packing, shape (N, 4), greener the larger their `shifts` (S, N, 2) since the first;
    rattlers stay white."""
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
    packing: HasConfiguration, modes: Sequence[ModeShape], words: str, frames: int, periods: int,
    dots: int | None = DOTS,
) -> Film:  # fmt: skip
    """The motion of one or two modes of disks, growth left out, a whole number of periods."""
    figure, axes, points = figure_for(packing, len(modes), below=0.95)
    reach = OF_MODE * packing.radius.max()
    artists = [PackingArtist(one, packing, margin=reach, points=points) for one in axes]
    for one, artist, mode in zip(axes, artists, modes, strict=True):
        artist.chains.set(color=EDGE, linewidth=0.4, zorder=2)
        artist.disks.set(array=np.zeros(len(artist.view.disk)), cmap="RdBu_r", norm=Normalize(-1, 1))
        one.set_title(mode.words, fontsize=7)
    finish(axes, packing, words if len(modes) > 1 else "one mode, growth left out")

    def show(number: int) -> None:
        for artist, mode in zip(artists, modes, strict=True):
            moved = mode.at(2 * np.pi * periods / frames * number)
            artist.disks.set_array(moved[2, artist.view.disk] / (np.abs(mode.displacement[2]).max() or 1.0))
            artist.move(reach * moved[:2].T)

    return Film(figure, [part for each in artists for part in each.moving], show, frames, dots)
