r"""A packing of spheres: shaded balls, force chains, floor and walls, or the arrows of a mode.

The picture is an orthographic projection. Each dot shows the sphere that is nearest along its ray, shaded by Lambert's
law: :math:`I = I_0 + I_1 \max(0, \mathbf n \cdot \mathbf l)` with the normal n and the direction l of a lamp above, on
the left. Spheres are pale, so that the bars of the contacts, drawn over them, are seen; bars at the back fade. The
width of a bar is proportional to the normal force, and its colour is that of a picture of disks. Walls that would hide
the packing are drawn as outlines.
"""

from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb

from faultgouge.analysis import Configuration
from faultgouge.analysis.arrays import Floats

from .disk_view import cut
from .style import BULK, EDGE, FLOOR

AZIMUTH, ELEVATION = np.radians([-62.0, 16.0])
"""Where the eye is."""

RIGHT = np.array([-np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0])
INTO = -np.array([np.cos(ELEVATION) * np.cos(AZIMUTH), np.cos(ELEVATION) * np.sin(AZIMUTH), np.sin(ELEVATION)])
UP = np.cross(-INTO, RIGHT)
"""Unit vectors to the right, into the picture, and up."""

LIGHT = np.array([-0.45, -0.55, 0.9]) / np.linalg.norm([-0.45, -0.55, 0.9])
AMBIENT, DIFFUSE, WHITE_SHARE = 0.45, 0.6, 0.4
"""Light from everywhere, light from the lamp, and the share of white."""

DOTS_ACROSS = 900
"""Dots across the picture of the spheres."""

FAR_OPACITY = 0.25
"""Opacity of the bars farthest from the eye."""

ENDS = np.array(list(product((0, 1), repeat=3)))
"""Corners of a cube."""

AxesLimits = tuple[float, float, float, float]


def flat(place: Floats) -> Floats:
    """Places in the picture, shape (..., 2), of places in space, shape (..., 3)."""
    return np.stack([place @ RIGHT, place @ UP], axis=-1)


def corners_of(configuration: Configuration) -> tuple[Floats, Floats]:
    """Lower and upper corner of the picture: the box along periodic axes, walls and spheres along the others."""
    c, reach, lengths = configuration, configuration.radius[:, None], np.diag(configuration.box)
    along = c.periodic & ~(c.box - np.diag(lengths)).any(axis=1)
    low = np.where(along, c.origin, (c.position - reach).min(axis=0))
    high = np.where(along, c.origin + lengths, (c.position + reach).max(axis=0))
    return cut(c.planes, low, high)


def frame_of(configuration: Configuration) -> AxesLimits:
    """Edges of the picture: left, right, bottom, top; with room for bars that leave a periodic box."""
    low, high = corners_of(configuration)
    place, reach = flat(configuration.position), configuration.radius[:, None]
    around = np.concatenate([flat(low + ENDS * (high - low)), place - reach, place + reach])
    room = 0.25 * configuration.radius.max()
    (left, bottom), (right, top) = around.min(axis=0) - room, around.max(axis=0) + room
    return float(left), float(right), float(bottom), float(top)


def shade_spheres(place: Floats, radius: Floats, colour: Floats, frame: AxesLimits) -> Floats:
    """Colours and opacity of every dot, shape (height, width, 4); `frame` is left, right, bottom, top."""
    left, right, bottom, top = frame
    size = (right - left) / DOTS_ACROSS
    x = left + size * (np.arange(DOTS_ACROSS) + 0.5)
    y = top - size * (np.arange(round((top - bottom) / size)) + 0.5)
    picture = np.zeros((len(y), len(x), 4))
    nearest = np.full(picture.shape[:2], np.inf)
    light = np.array([LIGHT @ RIGHT, LIGHT @ UP, -LIGHT @ INTO])
    for (cx, cy), d, r, face in zip(flat(place), place @ INTO, radius, colour, strict=True):
        columns, rows = np.flatnonzero(np.abs(x - cx) < r), np.flatnonzero(np.abs(y - cy) < r)
        part = np.ix_(rows, columns)
        u, v = np.meshgrid((x[columns] - cx) / r, (y[rows] - cy) / r)
        towards = np.sqrt(np.maximum(1 - u**2 - v**2, 0.0))
        seen = (u**2 + v**2 < 1) & (d - r * towards < nearest[part])
        bright = AMBIENT + DIFFUSE * np.maximum(u * light[0] + v * light[1] + towards * light[2], 0.0)
        shade = (1 - WHITE_SHARE) * np.minimum(bright[..., None] * face, 1.0) + WHITE_SHARE
        picture[part] = np.where(seen[..., None], np.dstack([shade, np.ones_like(u)]), picture[part])
        nearest[part] = np.where(seen, d - r * towards, nearest[part])
    return picture


def draw_spheres(
    axes: Axes, configuration: Configuration, style: dict[str, Any], widest: float, faces: Floats | None = None
) -> LineCollection:
    """Spheres on axes, with floor and walls, the edges of a periodic box, and the bars of the contacts from back to
    front.

    `style` has the colours of the bars, and `widest` is the width of the bar of the largest force, points; 0 for no
    bars. `faces` (N, 3) are the colours of the spheres; by default grey, and red of those that are held.
    """
    c, (low, high) = configuration.contacts, corners_of(configuration)
    frame = left, right, bottom, top = frame_of(configuration)
    axes.set(aspect="equal", xlim=(left, right), ylim=(bottom, top))
    axes.set_axis_off()
    for axis, sign, _ in configuration.planes:
        side = [end for end in ENDS if end[axis] == (sign < 0)]
        ring = low + np.array([side[k] for k in (0, 2, 3, 1)]) * (high - low)
        behind = sign * INTO[axis] < 0  # its inner face is turned to the eye
        face: Any = (*to_rgb(FLOOR), 0.55 if axis == 2 else 0.2) if behind else "none"
        wall = PolyCollection([flat(ring)], facecolors=face, edgecolors=FLOOR, linewidths=0.8)
        wall.set_zorder(0 if behind else 4)
        axes.add_collection(wall)
    if configuration.periodic.any():
        pairs = [(a, b) for a in ENDS for b in ENDS if (b - a).sum() == 1 and (b >= a).all()]
        lines = [flat(low + np.array(pair) * (high - low)) for pair in pairs]
        axes.add_collection(LineCollection(lines, colors=EDGE, linewidths=0.6, linestyles=(0, (3, 3)), zorder=0.5))
    if faces is None:
        faces = np.where(configuration.free[:, None], to_rgb(BULK), to_rgb(FLOOR))
    balls = shade_spheres(configuration.position, configuration.radius, faces, frame)
    axes.imshow(balls, extent=frame, zorder=1, interpolation="bilinear")
    start = configuration.position[c.i]
    end = start - configuration.branch
    depth = 0.5 * (start + end) @ INTO
    order = np.argsort(-depth)
    order = order[~c.couple[order]]  # rolling friction has no bar of its own
    near = (depth.max() - depth) / (np.ptp(depth) or 1.0) if len(c) else depth
    about = style | {"linewidths": (widest * c.normal_force / (c.normal_force.max(initial=0.0) or 1.0))[order]}
    about |= {"alpha": (FAR_OPACITY + (1 - FAR_OPACITY) * near)[order], "capstyle": "round", "zorder": 3}
    about |= {"array": np.asarray(style["array"])[order]} if "array" in style else {}
    bars = LineCollection(list(np.stack([flat(start), flat(end)], axis=1)[order]), **about)
    if widest:
        axes.add_collection(bars)
    return bars
