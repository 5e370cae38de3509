r"""Steps of the linearised packing, as LAMMPS takes them: contact by contact, without the matrices K and C.

The few steps of a proof take a quarter of the time of the assembly of K and C; a test compares them with the matrices.
With the symbols of :mod:`~faultgouge.analysis.assembly`, a displacement and a velocity of the coordinates change the
forces of each contact by

.. math::

    \mathrm d f_n = f_n'\, \mathrm d\delta + c_n \dot\delta, \qquad
    \mathrm d\mathbf f_t = -k_t'\, \mathrm d\mathbf s - c_t \dot{\mathbf s} + \mathbf b\, \mathrm d\delta
    - \mathbf n\, (\mathbf f_t \cdot \mathrm d\mathbf n) .

A contact at Coulomb's bound slides on ahead and sticks on the way back, by the play of
:mod:`~faultgouge.analysis.operators.sliders`; a contact a little below the bound sticks until it reaches the bound. In
laws with two derivatives b is that of the way in which the contact moves.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.sparse import csr_array

from ...analysis import Configuration
from ...analysis.arrays import Floats, Indices
from ...analysis.assembly import cross, dot


@dataclass
class Memory:
    """What the contacts of one motion remember: the excess p of each slider, with what was missing to the bound, shape
    (B,); and of all contacts the rate of the branch, its way up to now, and the way of its absolute value, shape (C,).
    """

    excess: Floats
    opening: Floats
    way: Floats


class LinearForces(Protocol):
    """Changes of the forces on the coordinates, to first order."""

    def at_rest(self) -> Memory:
        """The memory of contacts at the beginning."""

    def change(self, displacement: Floats, velocity: Floats, memory: Memory) -> Floats:
        """By how much a displacement and a velocity, shape (axes N,), change the forces (F, T/R); shape (axes N,)."""

    def fastest_rate(self) -> float:
        """A bound of the rates at which anything moves, 1 / time; zero where nothing feels a force."""


def linear_forces(configuration: Configuration) -> LinearForces:
    """The forces of a Configuration: those of its contacts, or those of the K and C that it is given."""
    if configuration.stiffness is None:
        return ContactForces.of(configuration)
    return GivenForces(configuration, *configuration.assembled_operators())


def linear_steps(
    configuration: Configuration,
    forces: LinearForces,
    velocity: Floats,
    timestep: float,
    steps: int,
    *,
    extrapolates: bool,
) -> Floats:
    """Velocities of the coordinates, shape (axes N,), after steps of velocity Verlet.

    Parameters
    ----------
    configuration : Configuration
        The packing. Forces that are left at rest act.
    forces : LinearForces
        Its forces.
    velocity : ndarray, shape (axes N,)
        At the beginning, length / time.
    timestep : float
        Of each step.
    steps : int
        Their number.
    extrapolates : bool
        Whether dashpots feel 2 v(n + 1/2) - v(n), as those of mindlin/smooth do, in place of v(n + 1/2).
    """
    mobility = configuration.coordinate_free / configuration.coordinate_mass
    left = configuration.coordinate_force
    memory, displacement = forces.at_rest(), np.zeros_like(velocity)
    change = mobility * (left + forces.change(displacement, velocity, memory))
    for _ in range(steps):
        half = velocity + 0.5 * timestep * change
        displacement = displacement + timestep * half
        felt = 2 * half - velocity if extrapolates else half
        change = mobility * (left + forces.change(displacement, felt, memory))
        velocity = half + 0.5 * timestep * change
    return velocity


@dataclass(frozen=True, eq=False)
class GivenForces:
    """Those of K and C, shape (axes N, axes N), which remember nothing."""

    configuration: Configuration
    stiffness: csr_array
    damping: csr_array

    def at_rest(self) -> Memory:
        """Nothing."""
        return Memory(np.zeros(0), np.zeros(0), np.zeros(0))

    def change(self, displacement: Floats, velocity: Floats, memory: Memory) -> Floats:
        """-K q - C v."""
        return np.asarray(-(self.stiffness @ displacement) - self.damping @ velocity)

    def fastest_rate(self) -> float:
        """By the largest sums of rows in absolute values."""
        scale = 1 / np.sqrt(self.configuration.coordinate_mass)
        rows = (scale * (abs(matrix) @ scale) for matrix in (self.stiffness, self.damping))
        return _rate(*(float(each.max(initial=0.0)) for each in rows))


@dataclass(frozen=True, eq=False)
class ContactForces:
    """Those of linearised contacts. Vectors are in columns: all walks along contacts.

    Attributes
    ----------
    configuration : Configuration
        Whose contacts they are.
    partner : tuple of ndarray of int, shape (C,)
        i and j; 0 of a wall.
    pair : ndarray, shape (C,)
        1, or 0 of a contact with a wall.
    slip, lever, shrinks : ndarray, shape (2, C)
        Arms of the slip and of the torque of both partners, and the slope of the latter, in units of their radii.
    normal, tangential, coupling, rectified, turn : ndarray, shape (3, C)
        n, f_t, b as the mean of closing and parting, half of their difference, and n x f_t.
    slides : ndarray of int, shape (B,)
        The contacts at Coulomb's bound.
    along : ndarray, shape (3, B)
        Directions of their tangential forces.
    """

    configuration: Configuration
    partner: tuple[Indices, Indices]
    pair: Floats
    slip: Floats
    lever: Floats
    shrinks: Floats
    normal: Floats
    tangential: Floats
    coupling: Floats
    rectified: Floats
    turn: Floats
    slides: Indices
    along: Floats

    @classmethod
    def of(cls, configuration: Configuration) -> "ContactForces":
        """Sort the numbers of the contacts, all of which stick but for those at the bound."""
        c = configuration.contacts
        partner = c.i, np.where(c.wall, 0, c.j)
        pair = np.where(c.wall, 0.0, 1.0)
        per_radius = np.stack([np.ones(len(c)), pair]) / configuration.radius[np.stack(partner)]
        normal, tangential, closing, parting = (
            np.ascontiguousarray(each.T) for each in (c.normal, c.tangential_force, c.closing, c.parting)
        )
        slides = np.flatnonzero(c.one_sided)
        along = tangential[:, slides]
        return cls(
            configuration=configuration,
            partner=partner,
            pair=pair,
            slip=c.slip_arm.T * per_radius,
            lever=c.lever_arm.T * per_radius,
            shrinks=c.lever_slope * per_radius,
            normal=normal,
            tangential=tangential,
            coupling=0.5 * (closing + parting),
            rectified=0.5 * (closing - parting),
            turn=cross(normal, tangential),
            slides=slides,
            along=along / np.linalg.norm(along, axis=0),
        )

    def at_rest(self) -> Memory:
        """The memory at rest: sliders begin with the force that is missing to the bound."""
        return Memory(self._missing, np.zeros(len(self.pair)), np.zeros(len(self.pair)))

    @property
    def _missing(self) -> Floats:
        c = self.configuration.contacts
        return np.asarray(c.friction[self.slides] - np.linalg.norm(self.tangential[:, self.slides], axis=0))

    def change(self, displacement: Floats, velocity: Floats, memory: Memory) -> Floats:
        """Of all contacts; `memory` goes on."""
        c = self.configuration.contacts
        opening, across, slip = self._rates(displacement)
        tilt = across / c.distance
        normal_force = -c.normal_stiffness * opening
        tangential = -c.tangential_stiffness * slip - opening * self.coupling
        if self.rectified.any():
            memory.way = memory.way + np.abs(opening - memory.opening)
            memory.opening = opening
            tangential += memory.way * self.rectified
        elastic = tangential[:, self.slides]
        if self.configuration.damped:
            opens, _, slips = self._rates(velocity)
            normal_force -= c.normal_dashpot * opens
            tangential -= c.tangential_dashpot * slips
        else:
            opens = np.zeros_like(opening)
        if len(self.slides):
            self._let_slide(tangential, elastic, opening, opens, memory)
        turned = tangential - dot(self.tangential, tilt) * self.normal
        force = normal_force * self.normal + c.normal_force * tilt + turned
        turn = cross(tilt, self.tangential) + cross(self.normal, tangential)
        one, other = (-self.lever[p] * turn - self.shrinks[p] * opening * self.turn for p in (0, 1))
        return self._on_coordinates((force, -self.pair * force), (one, other))

    def _let_slide(self, tangential: Floats, elastic: Floats, opening: Floats, opens: Floats, memory: Memory) -> None:
        """Take from tangential forces by how much they pass the bound, of springs alone or of dashpots, too."""
        c, which = self.configuration.contacts, self.slides
        mu = c.friction[which] / c.normal_force[which]
        springs = dot(self.along, elastic) + mu * c.normal_stiffness[which] * opening[which]
        whole = springs + dot(self.along, tangential[:, which] - elastic)
        whole += mu * c.normal_dashpot[which] * c.viscous_slider[which] * opens[which]
        memory.excess = np.maximum(memory.excess, np.where(c.viscous_slider[which], whole, springs))
        tangential[:, which] -= self.along * (np.maximum(memory.excess, whole) - self._missing)

    def _rates(self, coordinates: Floats) -> tuple[Floats, Floats, Floats]:
        """n . u, P u and the slip of each contact, by displacements or velocities."""
        vectors = (np.ascontiguousarray(each.T) for each in self.configuration.vectors(coordinates))
        # `take` takes a seventh of the time of an index
        (moves_i, moves_j), (turns_i, turns_j) = ([each.take(k, axis=1) for k in self.partner] for each in vectors)
        u = moves_i - self.pair * moves_j
        opening = dot(self.normal, u)
        across = u - opening * self.normal
        rolls = self.slip[0] * turns_i + self.slip[1] * turns_j
        return opening, across, across + cross(self.normal, rolls)

    def _on_coordinates(self, forces: tuple[Floats, Floats], torques: tuple[Floats, Floats]) -> Floats:
        """Sums of the forces, and of the torques over radii, of both partners."""
        c, both = self.configuration, np.concatenate(self.partner)

        def total(parts: tuple[Floats, Floats]) -> Floats:
            return np.column_stack([np.bincount(both, row, len(c)) for row in np.hstack(parts)])

        made = c.join_vectors(total(forces), total(torques))
        return made if c.constraint is None else np.asarray((c.constraint != 0).T @ made)

    def fastest_rate(self) -> float:
        """By the sum of the norms of each particle's blocks, which is a bound of the spectrum."""
        c = self.configuration.contacts
        if not len(c):
            return 0.0
        size = np.linalg.norm(self.tangential, axis=0)
        turns = (np.abs(c.normal_force) + 3 * size) / c.distance + np.linalg.norm(self.coupling, axis=0)
        k = self._largest_block(c.normal_stiffness, c.tangential_stiffness + turns)
        return _rate(k, self._largest_block(c.normal_dashpot, c.tangential_dashpot))

    def _largest_block(self, normal: Floats, tangential: Floats) -> float:
        """Largest sum of a row of blocks over masses, from springs along and across the normals."""
        c, both = self.configuration, np.concatenate(self.partner)
        moves = np.stack([c.free[self.partner[0]], c.free[self.partner[1]] & (self.pair > 0)])
        inverse, turning = (1 / each[np.stack(self.partner)] for each in (c.mass, c.inertia / c.radius**2))
        straight = np.sqrt(moves * inverse)
        rolls, turns = (np.sqrt(moves * (inverse + arm**2 * turning)) for arm in (self.slip, self.lever))
        rows = normal * straight * straight.sum(axis=0) + tangential * turns * rolls.sum(axis=0)
        return float(np.bincount(both, rows.ravel(), len(c)).max())


def _rate(stiffness: float, damping: float) -> float:
    """The root of s^2 = c s + k."""
    return float(0.5 * (damping + np.sqrt(damping * damping + 4 * stiffness)))
