"""Forces of a LAMMPS, which is a copy, on particles that are displaced or have velocities.

A displacement is one step of LAMMPS, so slow that dashpots exert nothing: histories of contacts follow as in any step.
A velocity is a run of zero steps, in which histories do not change.

**Copies.** One copy goes all ways there and back that restore the forces. Where a history is cut at Coulomb's bound, or
scaled, each way has a copy of its own.

**Bodies.** Dashpots feel the masses of the bodies of fix rigid. So these bodies stay in the copy, and hold their
velocities. A body takes its velocity from its particles only when a run begins, so that each step is a run with its
set-up.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from ...analysis.arrays import Floats, Indices
from .granular_commands import BODIES, NotTakenError, without_suffix
from .instance_queries import styles_of
from .lammps_arrays import owned_array
from .look_in_a_copy import in_a_copy, quieten
from .translating_bodies import HELD, translating_bodies

RETURN_ERROR = 1e-5
"""Change of forces that one way there and back may leave, as a share of the forces on the way. A history that turns
there and back leaves a share of step / radius."""

SUM_OF_RETURN_ERRORS = 1e-3
"""Change of forces that all ways there and back together may leave, as a share of the forces on one way."""

PROBE_ROUNDING = 1e-13
"""Rounding of forces, as a share of the largest force at rest."""


@dataclass(frozen=True, eq=False)
class ProbedParticles:
    """All particles of the copy: those that are displaced, and their neighbours.

    Attributes
    ----------
    dimension : int
        2 or 3.
    ids, position, radius : ndarray, shape (N,), (N, 3) and (N,)
        IDs, centres and radii.
    constraint : scipy.sparse.csr_array, shape (coordinates, coordinates)
        P of q = P Q.
    bodies : tuple of str
        The commands of fix rigid.
    """

    dimension: int
    ids: Indices
    position: Floats
    radius: Floats
    constraint: csr_array
    bodies: tuple[str, ...] = ()

    @property
    def axes(self) -> Indices:
        """The components of (translation, rotation) that are coordinates."""
        return np.arange(6) if self.dimension == 3 else np.array([0, 1, 5])


MOVES = ("nve", "rigid", "move", "overdamped", "nvt", "nph", "npt")
"""Fixes that move particles, by the beginnings of their styles."""

HOLDS = ("freeze", "setforce", "aveforce", "lineforce", "planeforce", "momentum", "recenter", "temp/")
"""Fixes that change forces or velocities of coordinates that are held, or that move as one."""


def hold_still(lmp: Any, bodies: tuple[str, ...]) -> None:
    """Leave what exerts forces in a copy alone: no output, no drag, and nothing that moves or holds particles by
    itself; what has a velocity moves by it. Dashpots feel the masses of bodies, and of frozen particles, which stay."""
    quieten(lmp, drag=True)
    for name, style in styles_of(lmp).fixes.items():
        if style.startswith((*MOVES, *HOLDS)) and without_suffix(style) not in (*BODIES, "freeze"):
            lmp.command(f"unfix {name}")
    for line in bodies:
        lmp.command(f"{line} {HELD}")
    group = "all"
    if bodies:
        group = "faultgouge_m"
        groups = {body.group for line in bodies for body in translating_bodies(line, lmp.extract_setting("dimension"))}
        lmp.command(f"group {group} subtract all {' '.join(sorted(groups))}")
    lmp.command(f"fix faultgouge_moves {group} nve/noforce")


def _rows(lmp: Any, particles: ProbedParticles) -> Indices:
    ids = owned_array(lmp, "id")
    rows = np.argsort(ids)
    if not np.array_equal(ids[rows], particles.ids):
        raise NotTakenError("Particles left LAMMPS while they were displaced: let the packing come to rest first.")
    return rows


def set_coordinate_velocity(lmp: Any, particles: ProbedParticles, velocity: Floats) -> None:
    """Give the particles velocities of their coordinates, shape (axes N,)."""
    values = np.zeros((6, len(particles.ids)))
    values[particles.axes] = velocity.reshape(len(particles.axes), -1)
    rows = _rows(lmp, particles)
    owned_array(lmp, "v")[rows] = values[:3].T
    owned_array(lmp, "omega")[rows] = values[3:].T / particles.radius[:, None]


def _forces(lmp: Any, particles: ProbedParticles) -> Floats:
    """Forces on the coordinates, F and T/R, shape (axes N,)."""
    rows = _rows(lmp, particles)
    torque = owned_array(lmp, "torque")[rows] / particles.radius[:, None]
    return np.hstack([owned_array(lmp, "f")[rows], torque]).T[particles.axes].ravel()


Sides = tuple[Floats, list[tuple[Floats, Floats]]]
"""Forces on the particles at rest, and ahead and behind for each size; shape (axes N,) each."""


@dataclass(frozen=True)
class Probe:
    """Forces of a LAMMPS, which is a copy, along displacements, or velocities where `duration` is None.

    `duration` is the length of a step, and `sizes` the shares of a displacement at which forces are taken. If
    `settles`, a step without motion follows each displacement, for models that act one step late.
    """

    lmp: Any
    particles: ProbedParticles
    duration: float | None
    sizes: tuple[float, ...]
    settles: bool = False

    def each(self, directions: list[Floats]) -> list[Sides]:
        """Forces along each direction Q, from the state in which LAMMPS is.

        Directions share a copy up to the first that changes histories. It has a copy for each of its ways; so have the
        directions after it, twice as many each time that the next shared copy comes to none.
        """
        found: list[Sides] = []
        rest, apart = None, 1
        while len(found) < len(directions):
            shared = in_a_copy(partial(self._there_and_back, directions[len(found) :]))
            found += shared
            apart = 1 if shared else 2 * apart
            for q in directions[len(found) :][:apart]:
                rest = self._alone(0.0 * q) if rest is None else rest
                found.append((rest, [(self._alone(s * q), self._alone(-s * q)) for s in self.sizes]))
        return found

    def _there_and_back(self, directions: list[Floats]) -> list[Sides]:
        """Forces along the directions before the first of which a way there and back changes the state."""
        first = rest = self._from_rest(0.0 * directions[0])
        found: list[Sides] = []
        place = self._positions()
        for q in directions:
            sides = []
            for way in (sign * size for size in self.sizes for sign in (1, -1)):
                there, back = self._go(way * q), self._go(-way * q if self.duration else 0.0 * q)
                left = np.abs(back - [rest, first]).max(axis=1) - PROBE_ROUNDING * np.abs(first).max()
                if np.any(left > np.array([RETURN_ERROR, SUM_OF_RETURN_ERRORS]) * np.abs(there - rest).max()):
                    return found
                if self.duration:
                    self._put(place)
                sides.append(there)
                rest = back  # the change that a way leaves is of second order in the step
            found.append((rest, list(zip(sides[::2], sides[1::2], strict=True))))
        return found

    def _alone(self, q: Floats) -> Floats:
        return in_a_copy(partial(self._from_rest, q))

    def _from_rest(self, q: Floats) -> Floats:
        """Forces along a direction, in a copy that goes this way alone; for a direction of zero the forces at rest."""
        set_coordinate_velocity(self.lmp, self.particles, np.zeros(len(q)))
        self.lmp.command("run 0 post no")
        return self._go(q)

    def _go(self, q: Floats) -> Floats:
        moves = self.particles.constraint @ q
        set_coordinate_velocity(self.lmp, self.particles, moves / self.duration if self.duration else moves)
        step = "run 1 post no" if self.particles.bodies else "run 1 pre no post no"
        self.lmp.command(step if self.duration else "run 0 post no")
        if self.settles:
            set_coordinate_velocity(self.lmp, self.particles, 0.0 * moves)
            self.lmp.command(step)
        return _forces(self.lmp, self.particles)

    def _positions(self) -> Floats:
        return np.array(owned_array(self.lmp, "x")[_rows(self.lmp, self.particles)])

    def _put(self, place: Floats) -> None:
        """Take the rounding of the way back away."""
        owned_array(self.lmp, "x")[_rows(self.lmp, self.particles)] = place
