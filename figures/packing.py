r"""A packing: disks to scale, force chains, load, floor and periodic images.

The disks of the upper layer are yellow, rattlers hollow; floor, walls and disks that are held are red. A bar joins the
centres of each contact; the width of the bar is proportional to the normal force :math:`f_n`, and its colour is one of

- ``mobilised``, :math:`|f_t|/(\mu f_n)`: the mobilised fraction of Coulomb's bound, one for a sliding contact,
- ``slip``, :math:`|s|/t^*`: the slip over the slip limit; a Configuration has no slips,
- ``force``, :math:`f_n` itself,
- ``none``: ink.

Most contacts of a stable packing are far below Coulomb's bound, so that both fractions have a logarithmic scale.
"""

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from matplotlib.colors import Colormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from faultgouge.analysis import BadInputError, Configuration, Packing
from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.counted import counted
from faultgouge.analysis.has_configuration import HasConfiguration

from .disk_view import View
from .spheres import SpheresArtist, new_figure
from .style import BULK, EDGE, FLOOR, INK, MOBILIZATION, UPPER, figure_of, styled

LEAST_SHARE = 1e-4
"""Lower end of the scale of mobilised friction and slip."""

PACKING_WIDTH = 3.4
"""Width of a figure that holds one packing, inch."""

WIDEST_OF_SPHERES = 9.0
"""Width of the bar of the largest normal force among spheres, points."""


def _slip_share(packing: HasConfiguration) -> Floats:
    if not isinstance(packing, Packing):
        raise BadInputError("A packing of LAMMPS has forces and no slips: let colours show mobilised, force or none.")
    limit = packing.law.slip_limit(packing.geometry.overlap)
    return np.divide(np.abs(packing.contacts.slip), limit, out=np.zeros(len(limit)), where=limit > 0)


def _share_scale(_: Floats) -> Normalize:
    return LogNorm(LEAST_SHARE, 1, clip=True)  # a contact without slip has the lowest colour


def _force_scale(values: Floats) -> Normalize:
    return Normalize(0, values.max(initial=0.0) or 1.0)


COLOURS: dict[str, tuple[str, Callable[[HasConfiguration], Floats], Callable[[Floats], Normalize], str | Colormap]] = {
    "mobilised": (r"mobilised friction $|f_t|/(\mu f_n)$", attrgetter("mobilised"), _share_scale, MOBILIZATION),
    "slip": ("slip / slip limit", _slip_share, _share_scale, MOBILIZATION),
    "force": ("normal force $f_n$", attrgetter("normal_force"), _force_scale, "viridis_r"),
}
"""What the bars of the contacts may show: label, values of the contacts, scale, colours."""


class PackingArtist:
    """A packing on axes, whose disks and bars can be moved from frame to frame.

    Parameters
    ----------
    axes : Axes
        Where.
    packing : Packing
        What.
    color : str
        A key of `COLOURS`, or "none".
    view : View, optional
        Edges and images; all that a still picture needs by default.
    points : float, optional
        Points per unit of length; as the axes stand now by default.

    Attributes
    ----------
    disks : EllipseCollection
        Every image of every disk.
    chains : LineCollection
        Every image of every contact.
    moving : tuple of Artist
        What a film draws in each frame, in its order: disks and contacts, and the floor that hides what goes below.
    """

    def __init__(
        self,
        axes: Axes,
        packing: HasConfiguration,
        color: str = "none",
        view: View | None = None,
        points: float | None = None,
    ) -> None:
        self.packing, self.view = packing, view or View.of(packing)
        axes.set(aspect="equal", xlim=(self.view.left, self.view.right), ylim=(self.view.bottom, self.view.ceiling))
        axes.set_axis_off()
        self.points = self.view.points(axes) if points is None else points
        self.disks = self._disks(axes)
        self.widest = 0.5 * packing.radius.min() * self.points
        self.chains = self._chains(axes, color)
        corners = [self.view.part_of(wall) for wall in self.view.walls]
        floor = PolyCollection(corners, facecolors=FLOOR, linewidths=0, zorder=4, label="floor")
        axes.add_collection(floor)
        if len(self.view.edges):
            dashes: dict[str, Any] = {"linewidths": 0.8, "linestyles": (0, (3, 3)), "clip_on": False}
            axes.add_collection(LineCollection(list(self.view.edges), colors=INK, **dashes))
        self.moving = (self.disks, self.chains, floor)

    def move(self, displacement: Floats) -> None:
        """Draw disks and contacts displaced from where the packing has them; length, shape (N, 2)."""
        view, contacts = self.view, self.packing.configuration.contacts
        self.disks.set_offsets(view.place + displacement[view.disk])
        i, j = contacts.i[view.contact], contacts.j[view.contact]
        normal = (view.start - view.end) / np.linalg.norm(view.start - view.end, axis=1, keepdims=True)
        along_wall = displacement[i] - np.sum(normal * displacement[i], axis=1, keepdims=True) * normal
        far = np.where((j < 0)[:, None], along_wall, displacement[j])
        self.chains.set_segments(list(np.stack([view.start + displacement[i], view.end + far], axis=1)))

    @staticmethod
    def faces(packing: HasConfiguration) -> NDArray[np.str_]:
        """Colours of the disks, shape (N,)."""
        hollow = np.isin(np.arange(len(packing)), packing.rattlers)
        faces = np.where(hollow, "white", np.where(packing.top, UPPER, BULK))
        return np.where(packing.configuration.free, faces, FLOOR)

    def _disks(self, axes: Axes) -> EllipseCollection:
        packing, disk = self.packing, self.view.disk
        faces = self.faces(packing)
        edges = np.where(packing.top & (faces == "white"), UPPER, EDGE)
        diameter = 2 * packing.radius[disk]
        disks = EllipseCollection(
            diameter,
            diameter,
            np.zeros(len(disk)),
            units="xy",
            offsets=self.view.place,
            offset_transform=axes.transData,
            facecolors=faces[disk],
            edgecolors=edges[disk],
            linewidths=min(0.6, 0.05 * self.points),
            zorder=1,
            label="disks",
        )
        axes.add_collection(disks)
        return disks

    def _chains(self, axes: Axes, color: str) -> LineCollection:
        packing, view = self.packing, self.view
        force = packing.normal_force
        style = _style_of_bars(packing, color)
        if "array" in style:
            style["array"] = style["array"][view.contact]
        chains = LineCollection(
            list(np.stack([view.start, view.end], axis=1)),
            linewidths=self.widest * (force / force.max(initial=np.finfo(float).tiny))[view.contact],
            capstyle="round",
            zorder=3,
            label="contacts",
            **style,
        )
        axes.add_collection(chains)
        return chains


@styled
def draw_packing(
    packing: HasConfiguration, axes: Axes | None = None, color: str = "mobilised", caption: bool = False
) -> Figure:
    """Draw a packing with its force chains (the paper's figure 1).

    Parameters
    ----------
    packing : Packing or Configuration
        Any configuration of disks, or of spheres (:mod:`~faultgouge.figures.spheres`).
    axes : Axes, optional
        Where to draw; a figure of its own, with a legend, by default.
    color : {"mobilised", "slip", "force", "none"}
        What the colour of a contact shows, see the module. Arrows show where the load acts, not its size.
    caption : bool
        Whether to print load and numbers of contacts above, in a new figure.

    Returns
    -------
    Figure
        The figure of the axes.

    Raises
    ------
    BadInputError
        If axes are no matplotlib axes.
    ValueError
        If no such colour is known.
    """
    if axes is not None and not isinstance(axes, Axes):
        raise BadInputError(
            f"draw takes matplotlib's Axes, and no {type(axes).__name__}: draw(packing).savefig(path) writes a file."
        )
    if color != "none" and color not in COLOURS:
        raise ValueError(f"color = {color!r} is none of {', '.join(COLOURS)}, none.")
    if packing.dimension == 3:
        return _draw_spheres(packing.configuration, axes, color, caption)
    if axes is not None:
        artist = PackingArtist(axes, packing, color)
        _draw_load(axes, artist)
        return figure_of(axes)
    view = View.of(packing)
    across = PACKING_WIDTH - (0.1 if color == "none" else 0.72)  # the scale of colours takes the rest
    height = across * (view.ceiling - view.bottom) / (view.right - view.left)
    figure = Figure(figsize=(PACKING_WIDTH, height + (0.85 if caption else 0.52)), layout="constrained")
    if caption:
        load, _, numbers = in_words(packing).partition(": ")
        numbers = numbers.replace("; ", "\n")
        figure.suptitle(f"{load.replace('F_x', '$F_x$').replace('F_y', '$F_y$')}\n{numbers}", fontsize=7.5)
    axes = figure.add_subplot()
    artist = PackingArtist(axes, packing, color, view, points=72 * across / (view.right - view.left))
    _draw_load(axes, artist)
    _add_colours(figure, axes, artist.chains, color)
    _add_key(figure, artist)
    return figure


def _draw_spheres(packing: Configuration, axes: Axes | None, color: str, caption: bool) -> Figure:
    """Spheres with their force chains."""
    figure = new_figure(packing, 1) if axes is None else figure_of(axes)
    here = figure.add_subplot() if axes is None else axes
    chains = SpheresArtist(here, packing).chains(here, _style_of_bars(packing, color), WIDEST_OF_SPHERES)
    if axes is None:
        if caption:
            figure.suptitle(in_words(packing).replace("; ", "\n"), fontsize=7.5)
        _add_colours(figure, here, chains, color)
        _add_widths(figure, packing, WIDEST_OF_SPHERES, _patches(packing))
    return figure


def _add_colours(figure: Figure, axes: Axes, chains: LineCollection, color: str) -> None:
    """The scale of the colours of the bars."""
    if chains.get_array() is None:
        return
    scale = ScalarMappable(chains.norm, chains.get_cmap())
    bar = figure.colorbar(scale, ax=axes, shrink=0.7, aspect=28, pad=0.03)
    bar.set_label(COLOURS[color][0])
    bar.outline.set_linewidth(0.4)


def _style_of_bars(packing: HasConfiguration, color: str) -> dict[str, Any]:
    """Colours of the bars of all contacts."""
    if color != "none":
        _, values_of, scale_of, colours = COLOURS[color]
        values = values_of(packing)
        if values.any():
            return {"array": values, "cmap": colours, "norm": scale_of(values)}
    return {"colors": INK}


def in_words(packing: HasConfiguration) -> str:
    """Load, contacts, rattlers, and how many contacts slide."""
    if isinstance(packing, Packing):
        sliding = int(np.count_nonzero(_slip_share(packing) >= 1))
        return (
            f"F_x = {packing.fx:g}, F_y = {packing.fy:g}: {counted(len(packing), 'disk')}, "
            f"{counted(len(packing.contacts), 'contact')} "
            f"({sliding} {'slides' if sliding == 1 else 'slide'}), {counted(len(packing.rattlers), 'rattler')}"
        )
    c = packing.configuration.contacts
    slide = ", which slide" if c.sliding.any() else ", which stick" if c.at_bound.any() else ""
    noun = "disk" if packing.dimension == 2 else "sphere"
    return (
        f"{counted(len(packing), noun)} as LAMMPS left them: {counted(len(c), 'contact')} "
        f"({int(c.wall.sum())} with walls), {counted(len(packing.rattlers), 'rattler')}; "
        f"{counted(int(c.at_bound.sum()), 'contact')} at Coulomb's bound{slide}"
    )


def _add_key(figure: Figure, artist: PackingArtist) -> None:
    """Add a key: the meaning of yellow, hollow and wide."""
    handles = _patches(artist.packing)
    if handles:
        below: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "ncols": 2}
        figure.axes[0].legend(handles=handles, handlelength=1.0, handleheight=1.0, **below)
    _add_widths(figure, artist.packing, artist.widest)


def _patches(packing: HasConfiguration) -> list[Any]:
    """The colours of the particles, for a key."""
    spheres = packing.dimension == 3
    kinds = {
        "upper layer": (UPPER, not spheres and packing.top.any()),
        "rattler (no contact)": ("white", not spheres and len(packing.rattlers) > 0),
        "wall": (FLOOR, spheres and packing.configuration.contacts.wall.any()),
        "held": (FLOOR, not packing.configuration.free.all()),
    }
    return [
        Patch(facecolor=face, edgecolor=EDGE, linewidth=0.6, label=name)
        for name, (face, shown) in kinds.items()
        if shown
    ]


def _add_widths(figure: Figure, packing: HasConfiguration, widest: float, others: Sequence[Any] = ()) -> None:
    """Add the meaning of the widths of bars, points, after other entries of a key."""
    largest = packing.normal_force.max(initial=0.0)
    if largest:
        unit = 10.0 ** np.floor(np.log10(largest))
        values = [part * unit for part in (0.5, 1, 2, 5) if part * unit <= largest]
        bars: list[Any] = [Line2D([], [], color=INK, linewidth=widest * value / largest) for value in values]
        names = [f"$f_n = {values[0]:g}$", *(f"${value:g}$" for value in values[1:])]
        entries, labels = [*others, *bars], [*(each.get_label() for each in others), *names]
        figure.legend(entries, labels, loc="outside lower center", ncols=len(entries), columnspacing=1.2)


def _draw_load(axes: Axes, artist: PackingArtist) -> None:
    """Arrows down onto the upper layer, and one along x above it."""
    packing, view = artist.packing, artist.view
    if not isinstance(packing, Packing) or not packing.top.any():
        return
    x, y = packing.position[packing.top].T
    x = x if packing.box_length is None else x % packing.box_length
    crest = y + packing.radius[packing.top]
    length = 1.2 * packing.radius.max()
    style: dict[str, Any] = {
        "angles": "xy",
        "scale_units": "xy",
        "scale": 1,
        "zorder": 5,
        "color": INK,
        "width": 0.006,
        "clip_on": False,
        "in_layout": False,
    }
    height, sense = view.ceiling - 0.3 * length, float(np.sign(packing.fx))
    reaching = x[crest + length > height - 0.4 * length] if packing.fy else x[:0]
    begin = _free_begin(view, reaching, sense, length)
    if packing.fy:
        axes.quiver(x, crest + length, np.zeros_like(x), np.full_like(x, -length), **style)
        along, up = _free_place(artist, x, crest, length, begin + sense * length * SHEAR)
        axes.text(along, up, "$F_y$", ha="center", va="center", zorder=6)
    if packing.fx:
        axes.quiver([begin], [height], [sense * 2 * length], [0.0], **style)
        axes.text(begin - sense * 0.2 * length, height, "$F_x$", ha="right" if sense > 0 else "left", va="center")


SHEAR = np.linspace(-1, 2, 7)
"""Places of the name of F_x and of its arrow, from where the arrow begins, in units of the arrows of F_y."""


def _free_begin(view: View, reaching: Floats, sense: float, length: float) -> float:
    """Where the arrow of F_x begins: next to the middle, where it and its name meet none of the arrows of F_y."""
    middle = 0.5 * (view.left + view.right)
    room = max(0.5 * (view.right - view.left) - 2.2 * length, 0.0)
    places = np.linspace(middle - room, middle + room, 101)
    places = places[np.argsort(np.abs(places - middle), kind="stable")]
    ends = np.sort(places[:, None] + sense * length * SHEAR[[0, -1]], axis=1)
    apart = np.maximum(ends[:, :1] - reaching, reaching - ends[:, 1:]).min(axis=1, initial=np.inf)
    free = apart > 0.25 * length
    return float(places[np.argmax(free)] if free.any() else places[np.argmax(apart)])


def _free_place(artist: PackingArtist, x: Floats, crest: Floats, length: float, shear_x: Floats) -> Floats:
    """Where the name of F_y stands: beside the arrow with the most room for it, away from disks, arrows and borders."""
    view = artist.view
    places = np.column_stack([x + 0.5 * length, crest + 0.55 * length])
    shear = np.column_stack([shear_x, np.full(len(shear_x), view.ceiling - 0.3 * length)])
    arrows = np.column_stack([x, crest + 0.5 * length])

    def apart(points: Floats) -> Floats:
        return np.hypot(*np.moveaxis(places[:, None] - points, -1, 0))

    to_disks = apart(view.place) - artist.packing.radius[view.disk]
    to_borders = np.abs(places[:, :1] - np.array([view.left, view.right]))
    room = np.hstack([to_disks, apart(arrows), apart(shear), np.where(places[:, :1] < view.right, to_borders, 0.0)])
    return np.asarray(places[np.argmax(room.min(axis=1))])
