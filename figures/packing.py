r"""A packing: disks to scale or shaded spheres, force chains, load, floor and walls, periodic images.

The disks of the upper layer are yellow, rattlers hollow; floor, walls and particles that are held are red. A bar joins
the centres of each contact; the width of the bar is proportional to the normal force :math:`f_n`, and its colour shows

- ``mobilised``, :math:`|f_t|/(\mu f_n)`: the mobilised fraction of Coulomb's bound, one for a sliding contact,
- ``slip``, :math:`|s|/t^*`: the slip over the slip limit; a Configuration has no slips,
- ``force``, :math:`f_n` itself,
- ``none``: ink.

Most contacts of a stable packing are far below Coulomb's bound, so that both fractions have a logarithmic scale.
"""

from collections.abc import Callable
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

from faultgouge.analysis import BadInputError, Packing
from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.counted import counted
from faultgouge.analysis.has_configuration import HasConfiguration

from .disk_view import View
from .spheres import draw_spheres, frame_of
from .style import BULK, EDGE, FLOOR, INK, MOBILIZATION, UPPER, figure_of, require_axes, styled

PACKING_WIDTH, SPHERES_WIDTH = 3.4, 4.2
"""Width of a figure that holds one packing, of disks and of spheres, inch."""

WIDEST_OF_SPHERES = 9.0
"""Width of the bar of the largest normal force among spheres, points."""

LEAST_SHARE = 1e-4
"""Lower end of the scale of mobilised friction and slip."""

SHEAR = np.linspace(-1, 2, 7)
"""Places of the name of F_x and of its arrow, from where the arrow begins, in units of the arrows of F_y."""

Scale = Callable[[Floats], Normalize]


def slip_share(packing: HasConfiguration) -> Floats:
    """|s|/t* of each contact, shape (C,)."""
    if not isinstance(packing, Packing):
        raise BadInputError("A packing of LAMMPS has forces and no slips: let colours show mobilised, force or none.")
    limit = packing.law.slip_limit(packing.geometry.overlap)
    return np.divide(np.abs(packing.contacts.slip), limit, out=np.zeros(len(limit)), where=limit > 0)


def _share_scale(_: Floats) -> Normalize:
    return LogNorm(LEAST_SHARE, 1, clip=True)  # a contact without slip has the lowest colour


COLOURS: dict[str, tuple[str, Callable[[HasConfiguration], Floats], Scale, str | Colormap]] = {
    "mobilised": (r"mobilised friction $|f_t|/(\mu f_n)$", attrgetter("mobilised"), _share_scale, MOBILIZATION),
    "slip": ("slip / slip limit", slip_share, _share_scale, MOBILIZATION),
    "force": ("normal force $f_n$", attrgetter("normal_force"), lambda values: Normalize(0, values.max()), "viridis_r"),
}
"""Quantities that the bars of contacts may show: label, values of the contacts, scale, colours."""


def faces_of(packing: HasConfiguration) -> NDArray[np.str_]:
    """Colours of the disks, shape (N,)."""
    hollow = np.isin(np.arange(len(packing)), packing.rattlers)
    faces = np.where(hollow, "white", np.where(packing.top, UPPER, BULK))
    return np.where(packing.configuration.free, faces, FLOOR)


class PackingArtist:
    """Disks on axes, which can be moved from frame to frame, with the bars of their contacts, and their floor.

    Parameters
    ----------
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
        (left, bottom), (right, ceiling) = self.view.low, self.view.high
        axes.set(aspect="equal", xlim=(left, right), ylim=(bottom, ceiling))
        axes.set_axis_off()
        points = self.view.points(axes) if points is None else points
        self.widest = 0.5 * packing.radius.min() * points
        disk, contact, faces = self.view.disk, self.view.contact, faces_of(packing)
        edges = np.where(packing.top & (faces == "white"), UPPER, EDGE)
        diameter, style = 2 * packing.radius[disk], style_of_bars(packing, color)
        if "array" in style:
            style["array"] = style["array"][contact]
        self.disks = EllipseCollection(
            diameter, diameter, np.zeros(len(disk)), units="xy", offsets=self.view.place,
            offset_transform=axes.transData, facecolors=faces[disk], edgecolors=edges[disk],
            linewidths=min(0.6, 0.05 * points), zorder=1, label="disks",
        )  # fmt: skip
        share = packing.normal_force / packing.normal_force.max(initial=np.finfo(float).tiny)
        self.chains = LineCollection(
            list(np.stack([self.view.start, self.view.end], axis=1)), linewidths=self.widest * share[contact],
            capstyle="round", zorder=3, label="contacts", **style,
        )  # fmt: skip
        corners = [self.view.part_of(wall) for wall in self.view.walls]
        floor = PolyCollection(corners, facecolors=FLOOR, linewidths=0, zorder=4, label="floor")
        self.moving = (self.disks, self.chains, floor)
        for each in self.moving:
            axes.add_collection(each)
        if len(self.view.edges):
            dashes: dict[str, Any] = {"linewidths": 0.8, "linestyles": (0, (3, 3)), "clip_on": False}
            axes.add_collection(LineCollection(list(self.view.edges), colors=INK, **dashes))

    def move(self, displacement: Floats) -> None:
        """Draw disks and contacts displaced from where the packing has them; length, shape (N, 2)."""
        view, contacts = self.view, self.packing.configuration.contacts
        self.disks.set_offsets(view.place + displacement[view.disk])
        i, j = contacts.i[view.contact], contacts.j[view.contact]
        normal = (view.start - view.end) / np.linalg.norm(view.start - view.end, axis=1, keepdims=True)
        along_wall = displacement[i] - np.sum(normal * displacement[i], axis=1, keepdims=True) * normal
        far = np.where((j < 0)[:, None], along_wall, displacement[j])
        self.chains.set_segments(list(np.stack([view.start + displacement[i], view.end + far], axis=1)))


def style_of_bars(packing: HasConfiguration, color: str) -> dict[str, Any]:
    """Colours of the bars of all contacts."""
    if color != "none":
        _, values_of, scale_of, colours = COLOURS[color]
        values = values_of(packing)
        if values.any():
            return {"array": values, "cmap": colours, "norm": scale_of(values)}
    return {"colors": INK}


def figure_for(
    packing: HasConfiguration, count: int = 1, beside: float = 0.1, below: float = 0.52
) -> tuple[Figure, list[Axes], float]:
    """A figure with axes for the same packing so many times.

    Parameters
    ----------
    beside, below : float
        Room for scales beside each packing and for words above and below, of disks, inch.

    Returns
    -------
    figure, axes
        A list of axes.
    points : float
        Points per unit of length on the axes.
    """
    if packing.dimension == 3:
        left, right, bottom, top = frame_of(packing.configuration)
        across = SPHERES_WIDTH
        figure = Figure(figsize=(across * count, across * (top - bottom) / (right - left) + 0.6), layout="constrained")
    else:
        size, across = View.of(packing).size, PACKING_WIDTH - beside
        left, right = 0.0, float(size[0])
        figure = Figure(figsize=(PACKING_WIDTH * count, across * size[1] / size[0] + below), layout="constrained")
    axes = figure.subplots(1, count, squeeze=False)[0]
    return figure, list(axes), 72 * across / (right - left)


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
    require_axes(axes)
    if color != "none" and color not in COLOURS:
        raise ValueError(f"color = {color!r} is none of {', '.join(COLOURS)}, none.")
    flat, alone, points = packing.dimension == 2, axes is None, None
    if axes is None:
        # the scale of colours takes the rest
        room = 0.1 if color == "none" else 0.72, 0.85 if caption else 0.52
        figure, [axes], points = figure_for(packing, 1, *room)
        if caption:
            words = in_words(packing).replace("; ", "\n")
            if flat:
                words = words.replace(": ", "\n", 1).replace("F_x", "$F_x$").replace("F_y", "$F_y$")
            figure.suptitle(words, fontsize=7.5)
    if flat:
        artist = PackingArtist(axes, packing, color, points=points)
        chains, widest = artist.chains, artist.widest
        if isinstance(packing, Packing) and packing.top.any():
            _draw_load(axes, packing, artist.view)
    else:
        widest = WIDEST_OF_SPHERES
        chains = draw_spheres(axes, packing.configuration, style_of_bars(packing, color), widest)
    if alone:
        _add_keys(axes, packing, chains, color, widest)
    return figure_of(axes)


def in_words(packing: HasConfiguration) -> str:
    """Load, contacts, rattlers, and how many contacts slide."""
    c, rattlers = packing.configuration.contacts, counted(len(packing.rattlers), "rattler")
    contacts = counted(len(c), "contact")
    if isinstance(packing, Packing):
        sliding = int(np.count_nonzero(slip_share(packing) >= 1))
        load, disks = f"F_x = {packing.fx:g}, F_y = {packing.fy:g}", counted(len(packing), "disk")
        return f"{load}: {disks}, {contacts} ({sliding} {'slides' if sliding == 1 else 'slide'}), {rattlers}"
    slide = ", which slide" if c.sliding.any() else ", which stick" if c.at_bound.any() else ""
    particles = counted(len(packing), "disk" if packing.dimension == 2 else "sphere")
    return (
        f"{particles} as LAMMPS left them: {contacts} ({int(c.wall.sum())} with walls), {rattlers}; "
        f"{counted(int(c.at_bound.sum()), 'contact')} at Coulomb's bound{slide}"
    )


def _add_keys(axes: Axes, packing: HasConfiguration, chains: LineCollection, color: str, widest: float) -> None:
    """The scale of colours, the meaning of the colours of particles, and that of the widths of bars, points."""
    figure, flat, largest = figure_of(axes), packing.dimension == 2, packing.normal_force.max(initial=0.0)
    if chains.get_array() is not None:
        scale = ScalarMappable(chains.norm, chains.get_cmap())
        bar = figure.colorbar(scale, ax=axes, shrink=0.7, aspect=28, pad=0.03)
        bar.set_label(COLOURS[color][0])
        bar.outline.set_linewidth(0.4)
    kinds = {
        "upper layer": (UPPER, flat and packing.top.any()),
        "rattler (no contact)": ("white", flat and len(packing.rattlers) > 0),
        "wall": (FLOOR, not flat and packing.configuration.contacts.wall.any()),
        "held": (FLOOR, not packing.configuration.free.all()),
    }
    about: dict[str, Any] = {"edgecolor": EDGE, "linewidth": 0.6}
    patches: list[Any] = [Patch(facecolor=c, label=name, **about) for name, (c, shown) in kinds.items() if shown]
    if flat and patches:
        below: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "ncols": 2}
        figure.axes[0].legend(handles=patches, handlelength=1.0, handleheight=1.0, **below)
    if largest:
        unit = 10.0 ** np.floor(np.log10(largest))
        values = [part * unit for part in (0.5, 1, 2, 5) if part * unit <= largest]
        names = [f"$f_n = {values[0]:g}$", *(f"${value:g}$" for value in values[1:])]
        sizes = [(name, widest * value / largest) for name, value in zip(names, values, strict=True)]
        bars = [Line2D([], [], color=INK, linewidth=width, label=name) for name, width in sizes]
        entries = [*([] if flat else patches), *bars]
        figure.legend(handles=entries, loc="outside lower center", ncols=len(entries), columnspacing=1.2)


def _draw_load(axes: Axes, packing: Packing, view: View) -> None:
    """Arrows down onto the upper layer, and one along x above it; their names stand where there is room."""
    x, y = packing.position[packing.top].T
    x = x if packing.box_length is None else x % packing.box_length
    crest, length = y + packing.radius[packing.top], 1.2 * packing.radius.max()
    style: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "zorder": 5, "color": INK, "width": 0.006}
    style |= {"clip_on": False, "in_layout": False}
    (left, _), (right, ceiling) = view.low, view.high
    height, sense = ceiling - 0.3 * length, float(np.sign(packing.fx))
    # the arrow of F_x begins next to the middle, where it and its name meet none of the arrows of F_y
    reaching = x[crest + length > height - 0.4 * length] if packing.fy else x[:0]
    middle, room = 0.5 * (left + right), max(0.5 * (right - left) - 2.2 * length, 0.0)
    places = np.linspace(middle - room, middle + room, 101)
    places = places[np.argsort(np.abs(places - middle), kind="stable")]
    ends = np.sort(places[:, None] + sense * length * SHEAR[[0, -1]], axis=1)
    apart = np.maximum(ends[:, :1] - reaching, reaching - ends[:, 1:]).min(axis=1, initial=np.inf)
    free = apart > 0.25 * length
    begin = float(places[np.argmax(free if free.any() else apart)])
    if packing.fy:
        axes.quiver(x, crest + length, np.zeros_like(x), np.full_like(x, -length), **style)
        # its name: beside the arrow with the most room, away from disks, arrows and borders
        beside = np.column_stack([x + 0.5 * length, crest + 0.55 * length])
        shear = np.column_stack([begin + sense * length * SHEAR, np.full(len(SHEAR), height)])
        centres = np.concatenate([view.place, np.column_stack([x, crest + 0.5 * length]), shear])
        reach = np.concatenate([packing.radius[view.disk], np.zeros(len(centres) - len(view.disk))])
        to_borders = np.where(beside[:, :1] < right, np.abs(beside[:, :1] - np.array([left, right])), 0.0)
        empty = np.hstack([np.hypot(*np.moveaxis(beside[:, None] - centres, -1, 0)) - reach, to_borders]).min(axis=1)
        along, up = beside[np.argmax(empty)]
        axes.text(along, up, "$F_y$", ha="center", va="center", zorder=6)
    if packing.fx:
        axes.quiver([begin], [height], [sense * 2 * length], [0.0], **style)
        axes.text(begin - sense * 0.2 * length, height, "$F_x$", ha="right" if sense > 0 else "left", va="center")
