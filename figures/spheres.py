r"""A packing of spheres: shaded balls, force chains, floor and walls, or the arrows of a mode.

The picture is an orthographic projection. Each dot shows the sphere that is nearest along its ray, shaded by Lambert's
law: :math:`I = I_0 + I_1 \max(0, \mathbf n \cdot \mathbf l)` with the normal n and the direction l of a lamp above, on
the left. Spheres are pale, so that the bars of the contacts, drawn over them, are seen; bars at the back fade. The
width of a bar is proportional to the normal force, and its colour is that of a picture of disks. Walls that would hide
the packing are drawn as outlines.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgb
from matplotlib.figure import Figure

from faultgouge.analysis import Configuration
from faultgouge.analysis.arrays import Floats

from .disk_view import walls_of
from .style import BULK, EDGE, FLOOR, INK

AZIMUTH, ELEVATION = np.radians([-62.0, 16.0])
"""Where the eye is."""

LIGHT = np.array([-0.45, -0.55, 0.9]) / np.linalg.norm([-0.45, -0.55, 0.9])
AMBIENT, DIFFUSE, WHITE_SHARE = 0.45, 0.6, 0.4
"""Light from everywhere, light from the lamp, and the share of white."""

STILL_COLOUR, TURNING_COLOUR = "#f4f4f4", "#1f5fa8"
"""Colours of a sphere that does not rotate, and of the one that rotates most."""

DOTS_ACROSS = 900
"""Dots across the picture of the spheres."""

FAR_OPACITY = 0.25
"""Opacity of the bars farthest from the eye."""

ROOM_AROUND = 0.25
"""Room around the spheres, in units of the largest radius, for bars that leave a periodic box."""


AxesLimits = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class Eye:
    """The direction of the eye: unit vectors to the right, up, and into the picture, shape (3,)."""

    right: Floats
    up: Floats
    into: Floats

    @classmethod
    def at(cls, azimuth: float, elevation: float) -> "Eye":
        """An eye that sees the origin from a direction, radian."""
        along, up = np.cos(elevation), np.sin(elevation)
        towards = np.array([along * np.cos(azimuth), along * np.sin(azimuth), up])
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        return cls(right, np.cross(towards, right), -towards)

    def flat(self, place: Floats) -> Floats:
        """Places in the picture, shape (..., 2), of places in space, shape (..., 3)."""
        return np.stack([place @ self.right, place @ self.up], axis=-1)


def corners_of(configuration: Configuration) -> tuple[Floats, Floats]:
    """Lower and upper corner of the picture: the box along periodic axes, walls and spheres along the others."""
    reach = configuration.radius[:, None]
    low, high = (configuration.position - reach).min(axis=0), (configuration.position + reach).max(axis=0)
    across = configuration.periodic & (np.abs(configuration.box - np.diag(np.diag(configuration.box))).sum(axis=1) == 0)
    box = configuration.origin + np.diag(configuration.box)
    low, high = np.where(across, configuration.origin, low), np.where(across, box, high)
    for wall in walls_of(configuration):
        wall.cut(low, high)
    return low, high


def frame_of(configuration: Configuration, eye: Eye) -> AxesLimits:
    """Edges of the picture: left, right, bottom, top."""
    corners = eye.flat(np.array(list(product(*zip(*corners_of(configuration), strict=True)))))
    place, reach = eye.flat(configuration.position), configuration.radius[:, None]
    low, high = (np.concatenate([corners, place + sign * reach]) for sign in (-1, 1))
    room = ROOM_AROUND * configuration.radius.max()
    (left, bottom), (right, top) = low.min(axis=0) - room, high.max(axis=0) + room
    return float(left), float(right), float(bottom), float(top)


def shade_spheres(eye: Eye, place: Floats, radius: Floats, colour: Floats, frame: AxesLimits) -> Floats:
    """Colours and opacity of every dot, shape (height, width, 4); `frame` is left, right, bottom, top."""
    left, right, bottom, top = frame
    size = (right - left) / DOTS_ACROSS
    x = left + size * (np.arange(DOTS_ACROSS) + 0.5)
    y = top - size * (np.arange(round((top - bottom) / size)) + 0.5)
    picture = np.zeros((len(y), len(x), 4))
    nearest = np.full(picture.shape[:2], np.inf)
    flat, depth = eye.flat(place), place @ eye.into
    light = np.array([LIGHT @ eye.right, LIGHT @ eye.up, -LIGHT @ eye.into])
    for (cx, cy), d, r, face in zip(flat, depth, radius, colour, strict=True):
        columns, rows = np.flatnonzero(np.abs(x - cx) < r), np.flatnonzero(np.abs(y - cy) < r)
        if not len(columns) or not len(rows):
            continue
        part = np.ix_(rows, columns)
        u, v = np.meshgrid((x[columns] - cx) / r, (y[rows] - cy) / r)
        towards = np.sqrt(np.maximum(1 - u**2 - v**2, 0.0))
        seen = (u**2 + v**2 < 1) & (d - r * towards < nearest[part])
        bright = AMBIENT + DIFFUSE * np.maximum(u * light[0] + v * light[1] + towards * light[2], 0.0)
        shade = (1 - WHITE_SHARE) * np.minimum(bright[..., None] * face, 1.0) + WHITE_SHARE
        picture[part] = np.where(seen[..., None], np.dstack([shade, np.ones_like(u)]), picture[part])
        nearest[part] = np.where(seen, d - r * towards, nearest[part])
    return picture


class SpheresArtist:
    """Spheres on axes, with floor and walls.

    Parameters
    ----------
    faces : array_like, shape (N, 3), optional
        Their colours; by default grey, and red of those that are held.
    """

    def __init__(self, axes: Axes, configuration: Configuration, faces: Floats | None = None) -> None:
        self.configuration, self.eye = configuration, Eye.at(AZIMUTH, ELEVATION)
        self.low, self.high = corners_of(configuration)
        self.frame = left, right, bottom, top = frame_of(configuration, self.eye)
        axes.set(aspect="equal", xlim=(left, right), ylim=(bottom, top))
        axes.set_axis_off()
        self._surroundings(axes)
        if faces is None:
            faces = np.where(configuration.free[:, None], to_rgb(BULK), to_rgb(FLOOR))
        balls = shade_spheres(self.eye, configuration.position, configuration.radius, faces, self.frame)
        axes.imshow(balls, extent=self.frame, zorder=1, interpolation="bilinear")

    def _surroundings(self, axes: Axes) -> None:
        """Floor and walls behind the spheres, and the edges of a periodic box."""
        low, high = self.low, self.high
        for axis, sign, _ in walls_of(self.configuration):
            side = [np.array([a, b]) for a, b in zip(low, high, strict=True)]
            side[axis] = np.full(2, (low if sign > 0 else high)[axis])
            one, other = [k for k in range(3) if k != axis]
            ring = np.zeros((4, 3)) + [edge[0] for edge in side]
            ring[1, one] = ring[2, one] = side[one][1]
            ring[2, other] = ring[3, other] = side[other][1]
            behind = sign * self.eye.into[axis] < 0  # its inner face is turned to the eye
            face: Any = (*to_rgb(FLOOR), 0.55 if axis == 2 else 0.2) if behind else "none"
            wall = PolyCollection([self.eye.flat(ring)], facecolors=face, edgecolors=FLOOR, linewidths=0.8)
            wall.set_zorder(0 if behind else 4)
            axes.add_collection(wall)
        if self.configuration.periodic.any():
            ends = np.array(list(product((0, 1), repeat=3)))
            pairs = [(a, b) for a in ends for b in ends if (b - a).sum() == 1 and (b >= a).all()]
            lines = [self.eye.flat(low + np.array(pair) * (high - low)) for pair in pairs]
            axes.add_collection(LineCollection(lines, colors=EDGE, linewidths=0.6, linestyles=(0, (3, 3)), zorder=0.5))

    def chains(self, axes: Axes, style: dict[str, Any], widest: float) -> LineCollection:
        """The bars of the contacts, from back to front."""
        c, eye = self.configuration.contacts, self.eye
        start = self.configuration.position[c.i]
        end = start - self.configuration.branch
        depth = 0.5 * (start + end) @ eye.into
        order = np.argsort(-depth)
        order = order[~c.couple[order]]  # rolling friction has no bar of its own
        near = (depth.max() - depth) / (np.ptp(depth) or 1.0) if len(c) else depth
        force = c.normal_force / (c.normal_force.max(initial=0.0) or 1.0)
        if "array" in style:
            style = style | {"array": np.asarray(style["array"])[order]}
        bars = LineCollection(
            list(np.stack([eye.flat(start), eye.flat(end)], axis=1)[order]),
            linewidths=(widest * force)[order],
            alpha=(FAR_OPACITY + (1 - FAR_OPACITY) * near)[order],
            capstyle="round",
            zorder=3,
            **style,
        )
        axes.add_collection(bars)
        return bars


def new_figure(configuration: Configuration, count: int) -> Figure:
    """A figure for the same spheres so many times."""
    left, right, bottom, top = frame_of(configuration, Eye.at(AZIMUTH, ELEVATION))
    across = 4.2
    size = (across * count, across * (top - bottom) / (right - left) + 0.6)
    return Figure(figsize=size, layout="constrained")


def draw_turns(axes: Axes, configuration: Configuration, moved: Floats, scale: float) -> None:
    """A motion: arrows for displacements, blue for rotations; shape (6, N), the largest rotation one."""
    turn = np.linalg.norm(moved[3:], axis=0)[:, None]
    faces = (1 - turn) * np.array(to_rgb(STILL_COLOUR)) + turn * np.array(to_rgb(TURNING_COLOUR))
    artist = SpheresArtist(axes, configuration, faces)
    place, arrow = artist.eye.flat(configuration.position), scale * artist.eye.flat(moved[:3].T)
    depth = configuration.position @ artist.eye.into
    order = np.argsort(-depth)
    shape: dict[str, Any] = {
        "width": 0.008,
        "headwidth": 3.2,
        "headlength": 3.6,
        "headaxislength": 3.2,
        "minlength": 0.8,
    }
    where = np.concatenate([place[order], arrow[order]], axis=1).T
    axes.quiver(*where, angles="xy", scale_units="xy", scale=1, color=INK, zorder=5, **shape)


def add_scale_of_turns(figure: Figure, axes: Sequence[Axes]) -> None:
    """The scale of the rotations below."""
    scale = ScalarMappable(Normalize(0, 1), LinearSegmentedColormap.from_list("turns", [STILL_COLOUR, TURNING_COLOUR]))
    bar = figure.colorbar(scale, ax=list(axes), location="bottom", shrink=0.5, aspect=40)
    bar.set_ticks([0, 1], labels=["no rotation", "largest rotation"])
    bar.outline.set_linewidth(0.4)
