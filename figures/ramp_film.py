"""A film of the equilibria of a ramp, or of a drive, and the curve on which they lie beside them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, to_rgba_array
from numpy.typing import NDArray

from faultgouge.analysis import Packing, nearest_image
from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.motion.hysteresis import layer_displacement

from .contact_colours import COLOURS
from .cycle import in_powers_of_ten
from .disk_view import View
from .film import DOTS, LARGEST_SHOWN, Film, packing_and_curve
from .packing_artist import PackingArtist
from .style import BULK, styled

WAY_COLOURS = LinearSegmentedColormap.from_list("way", [BULK, "#4fb286"])
"""Colours of disks by the way that they have gone: those of the force chains stand out from all of them."""


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
    frames : int
        How many frames; each equilibrium is shown for about as long as the others.
    color : str
        As of :func:`~faultgouge.figures.draw_packing`.
    course : Course, optional
        The curve beside the packings, and their places on it; F_x over the displacement by default.
    by_way : bool
        Whether the colours of disks show how far they have moved since the first packing, in place of the layers.
    """

    @styled
    def __init__(
        self,
        packings: Sequence[Packing],
        frames: int,
        color: str = "mobilised",
        dots: int | None = DOTS,
        course: Course | None = None,
        by_way: bool = False,
    ) -> None:
        self._packings, self._color = packings, color
        self._which = np.linspace(0, len(packings) - 1, frames).round().astype(int)
        first = packings[0]
        shifts = np.array([nearest_image(each.position - first.position, first.box_length) for each in packings])
        self._displacement = shifts
        ways = np.linalg.norm(shifts, axis=2)
        largest = ways.max()
        # single disks, which are squeezed out or roll, move farther than all others
        most = max(float(np.quantile(way, 0.9)) for way in ways)
        self._shares = np.minimum(ways / (most or 1.0), 1.0) if by_way else None
        shown = LARGEST_SHOWN * first.radius.min()
        self._factor = max(1.0, 10.0 ** np.floor(np.log10(shown / largest))) if largest > 0 else 1.0
        figure, axes, beside, points = packing_and_curve(first, scale=color != "none")
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
        if by_way:
            key = "the greener, the farther moved"
            axes.text(0.5, -0.02, key, transform=axes.transAxes, ha="center", va="top", fontsize=7)
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
        artist.disks.set_facecolor([tuple(face) for face in self._faces(k)[disk]])
        artist.chains.set_linewidth(artist.widest * packing.normal_force[contact] / self._widest)
        if artist.chains.get_array() is not None:
            artist.chains.set_array(COLOURS[self._color][1](packing)[contact])
        artist.move((self._factor - 1) * self._displacement[k])
        course, here = self._course, self._course.places[k]
        self._says.set_text(f"{course.words[k]}, {self._words}")
        self._line.set_data(course.x[: here + 1], course.y[: here + 1])
        self._dot.set_data([course.x[here]], [course.y[here]])

    def _faces(self, k: int) -> NDArray[Any]:
        """Colours of the disks, shape (N, 4)."""
        packing = self._packings[k]
        faces = to_rgba_array(self._artist.faces(packing))
        if self._shares is not None:
            touching = np.setdiff1d(np.arange(len(packing)), packing.rattlers)
            faces[touching] = WAY_COLOURS(self._shares[k][touching])
        return faces
