"""The state in LAMMPS at the end of a displacement: a configuration and its forces.

Newton's method tries several configurations in each increment and keeps one. A `Trial` contains only the output of
LAMMPS. Only for the configuration that is kept, a `Packing` is made and checked.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...analysis import Packing
from ...analysis.arrays import Floats
from ...analysis.packing.law import Derivatives
from .contact_graph import ContactGraph

EPSILON = float(np.finfo(float).eps)
"""Distance of the doubles next to one."""


class Branches(NamedTuple):
    """Normals, distances and overlaps of the contacts; arrays over contacts.

    Attributes
    ----------
    normal : ndarray, shape (2, C)
        Unit vectors n towards i.
    distance : ndarray, shape (C,)
        Lengths of the branch vectors, the height for the floor.
    overlap : ndarray, shape (C,)
        Length.
    """

    normal: Floats
    distance: Floats
    overlap: Floats


@dataclass(frozen=True, eq=False)
class Trial:
    """A configuration and the forces on it.

    Attributes
    ----------
    still : Packing
        What a displacement leaves as it is: radii, masses, box, law, and the load but for
    fx : float
        Force along x on each disk of the upper layer.
    position : ndarray, shape (N, 2)
        Centres, length.
    position_low : ndarray, shape (N, 2), or None
        Their low parts, in compensated arithmetic.
    angle : ndarray, shape (N,)
        Orientations, radian.
    graph : ContactGraph
        Who touches whom.
    slip : ndarray, shape (C,)
        Length.
    slip_low : ndarray, shape (C,), or None
        Their low parts, in compensated arithmetic.
    force : ndarray, shape (3N,)
        (Fx.., Fy.., T/R..), load included.
    arrays : dict of ndarray
        All of this as LAMMPS has it, by the names of its arrays.
    displacement : ndarray, shape (3N,), or None
        The one that ends here, (dx.., dy.., R dtheta..).
    known : Packing or None
        The configuration, if the trial was made of one.
    """

    still: Packing
    fx: float
    position: Floats
    position_low: Floats | None
    angle: Floats
    graph: ContactGraph
    slip: Floats
    slip_low: Floats | None
    force: Floats
    arrays: dict[str, Floats]
    displacement: Floats | None = None
    known: Packing | None = None

    @classmethod
    def of(cls, packing: Packing) -> "Trial":
        """A packing as a trial, forces unknown."""
        contacts = packing.contacts
        graph = ContactGraph(contacts, packing.radius)
        place = packing.position, packing.position_low, packing.angle
        force = np.full(3 * len(packing), np.nan)
        return cls(packing, packing.fx, *place, graph, contacts.slip, contacts.slip_low, force, {}, known=packing)

    @cached_property
    def packing(self) -> Packing:
        """The configuration with its load."""
        if self.known is not None:
            return self.known
        contacts = self.graph.contacts.slipped(self.slip, self.slip_low)
        return self.still.moved(self.position, self.angle, contacts, self.position_low, self.fx)

    @cached_property
    def branches(self) -> Branches:
        """The geometry, of doubles in doubles: good enough for Newton's matrix, and a tenth of the cost of the digits
        that a `Packing` has."""
        if self.position_low is not None:
            geometry = self.packing.geometry
            return Branches(geometry.normal.T, geometry.distance, geometry.overlap)
        graph, period = self.graph, self.still.box_length
        pairs, floor = slice(0, graph.pairs), slice(graph.pairs, None)
        place = self.position.T.copy()
        branch = place.take(graph.i, axis=1)
        branch[:, pairs] -= place.take(graph.j[pairs], axis=1)
        x, y = branch
        if period is not None:
            x -= period * np.rint(x / period)
        x[floor] = 0.0
        distance = np.sqrt(x * x + y * y)
        distance[floor] = y[floor]  # signed
        return Branches(branch / distance, distance, graph.reach - distance)

    @cached_property
    def derivatives(self) -> Derivatives:
        """Forces and stiffnesses of the contacts; contacts that have come to Coulomb's bound slide on."""
        return self.still.law.derivatives(self.branches.overlap, self.slip, self._parting_contacts, sliding=True)

    @property
    def _parting_contacts(self) -> NDArray[np.bool_] | float:
        """Contacts whose overlap has decreased, shape (C,), if the law distinguishes them."""
        if not self.still.law.rescales or self.displacement is None:
            return 0.0
        graph, moved = self.graph, self.displacement.reshape(3, -1)[:2]
        branch = moved.take(graph.i, axis=1)
        branch[:, : graph.pairs] -= moved.take(graph.j[: graph.pairs], axis=1)
        middle = self.branches.normal * self.branches.distance - 0.5 * branch
        middle[0, graph.pairs :] = 0.0  # the floor does not turn
        return np.einsum("dc,dc->c", middle, branch) > 0

    @cached_property
    def residual(self) -> float:
        """Largest force, with torque over radius, on a disk that has a contact."""
        square = (self.force * self.force).reshape(3, -1).sum(axis=0)
        return math.sqrt(square[self.graph.has_contact].max(initial=0.0))

    @cached_property
    def coordinate_rounding(self) -> float:
        """Rounding of the coordinates, as in a :class:`~faultgouge.analysis.Packing`, length."""
        if self.position_low is not None:
            return self.packing.coordinate_rounding
        return EPSILON * float(np.abs(self.position).max())

    @cached_property
    def floor(self) -> float:
        """As `rounding_floor`, force."""
        return self.force_rounding(self.coordinate_rounding)

    def force_rounding(self, unit: float) -> float:
        """As `rounding`, of an error of so much in every overlap."""
        return rounding(self.derivatives.normal_stiffness, self.graph, unit)


def rounding(stiffness: Floats, graph: ContactGraph, unit: float) -> float:
    """Largest error of the force on a disk if every overlap has an independent error of one unit.

    Parameters
    ----------
    stiffness : ndarray, shape (C,)
        Normal stiffness of each contact, force / length.
    graph : ContactGraph
        Who touches whom.
    unit : float
        Length.
    """
    return unit * math.sqrt(graph.per_disk(stiffness**2).max(initial=0.0))
