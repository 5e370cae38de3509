r"""A packing: disks to scale, force chains, load, floor and periodic images.

The disks of the upper layer are yellow, rattlers hollow; floor, walls and disks that are held are red. A bar joins the
centres of each contact; the width of the bar is proportional to the normal force :math:`f_n`, and its colour shows
what is asked for (:mod:`~faultgouge.figures.packing_artist`).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from faultgouge.analysis import Configuration, Packing
from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.counted import counted
from faultgouge.analysis.has_configuration import HasConfiguration

from .disk_view import View
from .packing_artist import COLOURS, PackingArtist, slip_share, style_of_bars
from .spheres import SpheresArtist, new_figure
from .style import EDGE, FLOOR, INK, UPPER, figure_of, require_axes, styled

PACKING_WIDTH = 3.4
"""Width of a figure that holds one packing, inch."""

WIDEST_OF_SPHERES = 9.0
"""Width of the bar of the largest normal force among spheres, points."""


SHEAR = np.linspace(-1, 2, 7)
"""Places of the name of F_x and of its arrow, from where the arrow begins, in units of the arrows of F_y."""


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
        What the colour of a contact shows (:mod:`~faultgouge.figures.packing_artist`). Arrows show where the load
        acts, not its size.
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
    chains = SpheresArtist(here, packing).chains(here, style_of_bars(packing, color), WIDEST_OF_SPHERES)
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


def in_words(packing: HasConfiguration) -> str:
    """Load, contacts, rattlers, and how many contacts slide."""
    if isinstance(packing, Packing):
        sliding = int(np.count_nonzero(slip_share(packing) >= 1))
        return (
            f"F_x = {packing.fx:g}, F_y = {packing.fy:g}: {counted(len(packing), 'disk')}, "
            f"{counted(len(packing.contacts), 'contact')} "
            f"({sliding} {'slides' if sliding == 1 else 'slide'}), {counted(len(packing.rattlers), 'rattler')}"
        )
    c = packing.configuration.contacts.touching
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
    """Place of the name of F_y: beside the arrow with the most room, away from disks, arrows and borders."""
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
