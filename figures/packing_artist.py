r"""The artists of a packing on axes: its disks, the bars of its contacts, and its floor.

The colours of contacts show

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
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from matplotlib.colors import Colormap, LogNorm, Normalize
from numpy.typing import NDArray

from faultgouge.analysis import BadInputError, Packing
from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.has_configuration import HasConfiguration

from .disk_view import View
from .style import BULK, EDGE, FLOOR, INK, MOBILIZATION, UPPER

LEAST_SHARE = 1e-4
"""Lower end of the scale of mobilised friction and slip."""


def slip_share(packing: HasConfiguration) -> Floats:
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
    "slip": ("slip / slip limit", slip_share, _share_scale, MOBILIZATION),
    "force": ("normal force $f_n$", attrgetter("normal_force"), _force_scale, "viridis_r"),
}
"""Quantities that the bars of contacts may show: label, values of the contacts, scale, colours."""


def style_of_bars(packing: HasConfiguration, color: str) -> dict[str, Any]:
    """Colours of the bars of all contacts."""
    if color != "none":
        _, values_of, scale_of, colours = COLOURS[color]
        values = values_of(packing)
        if values.any():
            return {"array": values, "cmap": colours, "norm": scale_of(values)}
    return {"colors": INK}


class PackingArtist:
    """A packing on axes, whose disks and bars can be moved from frame to frame.

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
        style = style_of_bars(packing, color)
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
