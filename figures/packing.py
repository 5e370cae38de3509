r"""A packing: disks to scale or shaded spheres, force chains, load, floor and walls, periodic images.

The disks of the upper layer are yellow, rattlers hollow; floor, walls and particles that are held are red. A bar joins
the centres of each contact; the width of the bar is proportional to the normal force :math:`f_n`, and its colour shows

- ``mobilised``, :math:`|f_t|/(\mu f_n)`: the mobilised fraction of Coulomb's bound, one for a sliding contact,
- ``slip``, :math:`|s|/t^*`: the slip over the slip limit; a Configuration has no slips,
- ``force``, :math:`f_n` itself,
- ``none``: ink.

Most contacts of a stable packing are far below Coulomb's bound, so that both fractions have a logarithmic scale.
"""

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

from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.counted import counted
from faultgouge.analysis.has_configuration import HasConfiguration

from .disk_view import View, cut
from .spheres import draw_spheres, frame_of
from .style import BULK, EDGE, FLOOR, INK, MOBILIZATION, UPPER, figure_of, require_axes, styled

PACKING_WIDTH, SPHERES_WIDTH = 3.4, 4.2
"""Width of a figure that holds one packing, of disks and of spheres, inch."""

WIDEST_OF_SPHERES = 9.0
"""Width of the bar of the largest normal force among spheres, points."""

LEAST_SHARE = 1e-4
"""Lower end of the scale of mobilised friction and slip."""

COLOURS: dict[str, tuple[str, str, str | Colormap]] = {
    "mobilised": (r"mobilised friction $|f_t|/(\mu f_n)$", "mobilised", MOBILIZATION),
    "slip": ("slip / slip limit", "slip_share", MOBILIZATION),
    "force": ("normal force $f_n$", "normal_force", "viridis_r"),
}
"""Quantities that the bars of contacts may show: label, attribute of the packing, colours."""


def faces_of(packing: HasConfiguration) -> NDArray[np.str_]:
    """Colours of the disks, shape (N,)."""
    hollow = np.isin(np.arange(len(packing)), packing.rattlers)
    faces = np.where(hollow, "white", np.where(packing.top, UPPER, BULK))
    return np.where(packing.configuration.free, faces, FLOOR)


def style_of_bars(packing: HasConfiguration, color: str) -> dict[str, Any]:
    """Colours of the bars of all contacts."""
    values: Floats = np.zeros(0) if color == "none" else getattr(packing, COLOURS[color][1])
    if not values.any():
        return {"colors": INK}
    # a contact without slip has the lowest colour
    norm = Normalize(0, values.max()) if color == "force" else LogNorm(LEAST_SHARE, 1, clip=True)
    return {"array": values, "cmap": COLOURS[color][2], "norm": norm}


class PackingArtist:
    """Disks on axes, which can be moved from frame to frame, with the bars of their contacts, and their floor.

    Images move into sight from within `margin` beyond the sides of the box. With `points` per unit of length widths of
    lines are to scale, by default as the axes stand now. `disks` and `chains` have every image of every disk and
    contact; `moving` is what a film draws in each frame, in its order: these two, and the floor that hides what goes
    below.
    """

    def __init__(
        self, axes: Axes, packing: HasConfiguration, color: str = "none", margin: float = 0.0,
        points: float | None = None,
    ) -> None:  # fmt: skip
        self.axes, self.packing, self.margin, self.view = axes, packing, margin, View.of(packing, margin)
        low, high = self.view.low, self.view.high
        axes.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.set_axis_off()
        if points is None:
            box = axes.get_window_extent()
            points = float(72 / figure_of(axes).dpi * min((box.width, box.height) / self.view.size))
        self.widest, style = 0.5 * packing.radius.min() * points, style_of_bars(packing, color)
        disk, contact, faces = self.view.disk, self.view.contact, faces_of(packing)
        edges = np.where(packing.top & (faces == "white"), UPPER, EDGE)
        if "array" in style:
            style["array"] = style["array"][contact]
        self.disks = EllipseCollection(
            2 * packing.radius[disk], 2 * packing.radius[disk], np.zeros(len(disk)), units="xy",
            offsets=self.view.place, offset_transform=axes.transData, facecolors=faces[disk], edgecolors=edges[disk],
            linewidths=min(0.6, 0.05 * points), zorder=1, label="disks",
        )  # fmt: skip
        share = packing.normal_force / packing.normal_force.max(initial=np.finfo(float).tiny)
        self.chains = LineCollection(
            list(np.stack([self.view.start, self.view.end], axis=1)), linewidths=self.widest * share[contact],
            capstyle="round", zorder=3, label="contacts", **style,
        )  # fmt: skip
        beyond = [np.array(cut((plane,), high, low)) for plane in packing.planes]  # corners of the wall's other side
        walls = [[(x, y), (left, y), (left, bottom), (x, bottom)] for (left, bottom), (x, y) in beyond]
        floor = PolyCollection(walls, facecolors=FLOOR, linewidths=0, zorder=4, label="floor")
        self.moving = (self.disks, self.chains, floor)
        for each in self.moving:
            axes.add_collection(each)
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


def figure_for(
    packing: HasConfiguration, count: int = 1, beside: float = 0.1, below: float = 0.52
) -> tuple[Figure, list[Axes], float]:
    """A figure with axes for the same packing so many times: figure, axes, and points per unit of length on the axes.

    `beside` each packing of disks is room for scales, and `below` room for words above and below, inch.
    """
    if packing.dimension == 3:
        left, right, bottom, top = frame_of(packing.configuration)
        width = across = SPHERES_WIDTH
        size, below = np.array([right - left, top - bottom]), 0.6
    else:
        size, width, across = View.of(packing).size, PACKING_WIDTH, PACKING_WIDTH - beside
    figure = Figure(figsize=(width * count, across * size[1] / size[0] + below), layout="constrained")
    return figure, list(figure.subplots(1, count, squeeze=False)[0]), float(72 * across / size[0])


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
        figure, [axes], points = figure_for(packing, 1, 0.1 if color == "none" else 0.72, 0.85 if caption else 0.52)
        if caption:
            words = in_words(packing).replace("; ", "\n").replace("F_x", "$F_x$").replace("F_y", "$F_y$")
            figure.suptitle(words.replace(": ", "\n", 1) if flat else words, fontsize=7.5)
    if flat:
        artist = PackingArtist(axes, packing, color, points=points)
        chains, widest = artist.chains, artist.widest
        _draw_load(axes, packing, artist.view)
    else:
        widest = WIDEST_OF_SPHERES
        chains = draw_spheres(axes, packing.configuration, style_of_bars(packing, color), widest)
    if alone:
        _add_keys(axes, packing, chains, color, widest)
    return figure_of(axes)


def in_words(packing: HasConfiguration) -> str:
    """Load, contacts, rattlers, and how many contacts slide."""
    c, rattlers = packing.configuration.contacts.touching, counted(len(packing.rattlers), "rattler")
    contacts = counted(len(c), "contact")
    if packing.law is not None:
        sliding = int(np.count_nonzero(packing.slip_share >= 1))
        return f"{packing.in_words}, {contacts} ({sliding} {'slides' if sliding == 1 else 'slide'}), {rattlers}"
    slide = ", which slide" if c.sliding.any() else ", which stick" if c.at_bound.any() else ""
    bound = f"{counted(int(c.at_bound.sum()), 'contact')} at Coulomb's bound{slide}"
    return f"{packing.in_words}: {contacts} ({int(c.wall.sum())} with walls), {rattlers}; {bound}"


def _add_keys(axes: Axes, packing: HasConfiguration, chains: LineCollection, color: str, widest: float) -> None:
    """The scale of colours, the meaning of the colours of particles, and that of the widths of bars, points."""
    figure, flat, largest = figure_of(axes), packing.dimension == 2, packing.normal_force.max(initial=0.0)
    if chains.get_array() is not None:
        bar = figure.colorbar(ScalarMappable(chains.norm, chains.get_cmap()), ax=axes, shrink=0.7, aspect=28, pad=0.03)
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
        names = [f"${'f_n = ' * (not k)}{value:g}$" for k, value in enumerate(values)]
        widths = [widest * value / largest for value in values]
        bars = [Line2D([], [], color=INK, linewidth=w, label=name) for w, name in zip(widths, names, strict=True)]
        entries = [*([] if flat else patches), *bars]
        figure.legend(handles=entries, loc="outside lower center", ncols=len(entries), columnspacing=1.2)


def _draw_load(axes: Axes, packing: HasConfiguration, view: View) -> None:
    """Arrows down onto the upper layer, and above all of them one along x."""
    if not packing.top.any():
        return
    x, y = packing.position[packing.top].T
    x = x % packing.box_length if packing.box_length else x
    crest, length = y + packing.radius[packing.top], 1.2 * packing.radius.max()
    style: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "zorder": 5, "color": INK}
    style |= {"width": 0.006, "clip_on": False, "in_layout": False}
    highest, middle = np.argmax(crest), 0.5 * (view.low[0] + view.high[0])
    if packing.fy:
        axes.quiver(x, crest + length, np.zeros_like(x), np.full_like(x, -length), **style)
        axes.text(x[highest], crest[highest] + length, "$F_y$", ha="center", va="bottom", zorder=6)
    if packing.fx:
        sense, height = np.sign(packing.fx), view.high[1] - 0.3 * length
        begin = middle + (2.0 if x[highest] < middle else -2.0) * length - sense * length
        axes.quiver([begin], [height], [sense * 2 * length], [0.0], **style)
        axes.text(begin - sense * 0.2 * length, height, "$F_x$", ha="right" if sense > 0 else "left", va="center")
