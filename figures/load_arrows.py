"""Arrows of the load on a packing."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from faultgouge.analysis import Packing
from faultgouge.analysis.arrays import Floats

from .disk_view import View
from .packing_artist import PackingArtist
from .style import INK


def draw_load(axes: Axes, artist: PackingArtist) -> None:
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
