"""The state in LAMMPS at the end of a displacement: a configuration and its forces.

Newton's method tries several configurations in each increment and keeps one. A `Trial` contains only the output of
LAMMPS. Only for the configuration that is kept, a `Packing` is made and checked.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...analysis import Packing
from ...analysis.arrays import Floats
from ...analysis.packing.law import Derivatives
from .contact_graph import ContactGraph

EPSILON = float(np.finfo(float).eps)
"""Distance of the doubles next to one."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A configuration and the forces on it.

    `still` is a packing with what a displacement leaves as it is: radii, masses, box, law, and the load but for `fx`.
    `position` (N, 2), `angle` (N,), `graph` and `slip` (C,) are the state; low parts are those of compensated
    arithmetic. `force` (3N,) is (Fx.., Fy.., T/R..), load included, and `displacement` (3N,) the one that ends here,
    (dx.., dy.., R dtheta..). `known` is the configuration, if the trial was made of one.
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
    displacement: Floats | None = None
    known: Packing | None = None

    @classmethod
    def of(cls, packing: Packing) -> "Trial":
        """A packing as a trial, forces unknown."""
        c, graph = packing.contacts, ContactGraph(packing.contacts, packing.radius)
        place, force = (packing.position, packing.position_low, packing.angle), np.full(3 * len(packing), np.nan)
        return cls(packing, packing.fx, *place, graph, c.slip, c.slip_low, force, known=packing)

    @cached_property
    def packing(self) -> Packing:
        """The configuration with its load."""
        if self.known is not None:
            return self.known
        contacts = self.graph.contacts.slipped(self.slip, self.slip_low)
        return self.still.moved(self.position, self.angle, contacts, self.position_low, self.fx)

    @cached_property
    def branches(self) -> tuple[Floats, Floats, Floats]:
        """Normals towards i, shape (2, C), distances and overlaps of the contacts, length, shape (C,).

        Of doubles in doubles: good enough for Newton's matrix, and a tenth of the cost of the digits that a `Packing`
        has. The distance to the floor is the height.
        """
        if self.position_low is not None:
            geometry = self.packing.geometry
            return geometry.normal.T, geometry.distance, geometry.overlap
        graph, period = self.graph, self.still.box_length
        place = self.position.T.copy()
        branch = place.take(graph.i, axis=1)
        branch[:, : graph.pairs] -= place.take(graph.j[: graph.pairs], axis=1)
        x, y = branch
        if period is not None:
            x -= period * np.rint(x / period)
        x[graph.pairs :] = 0.0
        distance = np.sqrt(x * x + y * y)
        distance[graph.pairs :] = y[graph.pairs :]  # signed
        return branch / distance, distance, graph.reach - distance

    @cached_property
    def derivatives(self) -> Derivatives:
        """Forces and stiffnesses of the contacts; contacts that have come to Coulomb's bound slide on."""
        normal, distance, overlap = self.branches
        parting: NDArray[np.bool_] | float = 0.0  # contacts whose overlap has decreased, if the law distinguishes them
        if self.still.law.rescales and self.displacement is not None:
            graph, moved = self.graph, self.displacement.reshape(3, -1)[:2]
            branch = moved.take(graph.i, axis=1)
            branch[:, : graph.pairs] -= moved.take(graph.j[: graph.pairs], axis=1)
            middle = normal * distance - 0.5 * branch
            middle[0, graph.pairs :] = 0.0  # the floor does not turn
            parting = np.einsum("dc,dc->c", middle, branch) > 0
        return self.still.law.derivatives(overlap, self.slip, parting, sliding=True)

    @cached_property
    def residual(self) -> float:
        """Largest force, with torque over radius, on a disk that has a contact."""
        square = (self.force * self.force).reshape(3, -1).sum(axis=0)
        return math.sqrt(square[self.graph.has_contact].max(initial=0.0))

    @cached_property
    def floor(self) -> float:
        """As `rounding_floor`, force."""
        compensated = self.position_low is not None
        unit = self.packing.coordinate_rounding if compensated else EPSILON * float(np.abs(self.position).max())
        return self.graph.rounding(self.derivatives.normal_stiffness, unit)
