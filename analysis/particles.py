r"""Particles of a packing in two or three dimensions, and the coordinates on which they move.

**Coordinates** are translations and rotations as lengths, :math:`R\theta`, axis by axis:
(x.., y.., R theta..) of disks and (x.., y.., z.., R theta_x.., R theta_y.., R theta_z..) of spheres. Vectors always
have three components; those of disks lie in the plane, and disks turn about z.

**Bodies.** Coordinates that move as one, such as the particles of a rigid lid, are q = P Q with the `constraint` P.
The operators are those of Q: P_1^T K P, and C likewise, where P_1 is 1 where P is not 0. Column k of P has the
coordinates that Q_k moves, and the coordinate k itself by 1. The mass of Q_k is the sum of masses times P.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from .arrays import Floats, Indices, booleans, floats, integers, number, positive_each, set_frozen, square


@dataclass(frozen=True, init=False, eq=False)
class Particles:
    """Particles, their box and their load, without their contacts.

    `Configuration` explains its arguments, which are the attributes here.
    """

    dimension: int
    position: Floats
    radius: Floats
    mass: Floats
    inertia: Floats
    box: Floats
    origin: Floats
    periodic: NDArray[np.bool_]
    load: Floats
    free: NDArray[np.bool_]
    ids: Indices
    kind: Indices
    fx: float
    load_error: float
    top: NDArray[np.bool_]
    drag_rate: float
    constraint: csr_array | None

    def __init__(
        self,
        *,
        dimension: int,
        position: ArrayLike,
        radius: ArrayLike,
        mass: ArrayLike,
        inertia: ArrayLike,
        box: ArrayLike,
        origin: ArrayLike,
        periodic: ArrayLike,
        load: ArrayLike,
        free: ArrayLike | None,
        ids: ArrayLike | None,
        kind: ArrayLike | None,
        fx: float,
        load_error: float,
        top: ArrayLike | None,
        drag_rate: float,
        constraint: csr_array | None,
    ) -> None:
        n = len(np.atleast_1d(np.asarray(radius)))
        if dimension not in (2, 3) or n == 0:
            raise ValueError(f"A configuration has particles in two or three dimensions, not {n} in {dimension}.")
        sizes = {"radius": radius, "mass": mass, "inertia": inertia}
        set_frozen(
            self,
            dimension=int(dimension),
            position=floats("position", position, (n, dimension)),
            **{name: positive_each(name, floats(name, value, (n,))) for name, value in sizes.items()},
            box=floats("box", box, (3, 3)),
            origin=floats("origin", origin, (3,)),
            periodic=booleans("periodic", periodic, 3),
            load=floats("load", load, (n, 2, 3)),
            free=booleans("free", np.ones(n, bool) if free is None else free, n),
            ids=integers("ids", np.arange(1, n + 1) if ids is None else ids),
            kind=integers("kind", np.ones(n, int) if kind is None else kind),
            fx=number("fx", fx),
            load_error=number("load_error", load_error),
            top=booleans("top", np.zeros(n, bool) if top is None else top, n),
            drag_rate=number("drag_rate", drag_rate),
        )
        set_frozen(self, constraint=None if constraint is None else square("constraint", constraint, self.coordinates))
        if len(self.ids) != n or len(self.kind) != n:
            raise ValueError(f"ids and kind must be lists of {n} integers, one for each particle.")
        unique, count = np.unique(self.ids, return_counts=True)
        if len(unique) < n:
            raise ValueError(f"Two particles have the ID {unique[count > 1][0]}: give each its own.")

    def __len__(self) -> int:
        return len(self.radius)

    @property
    def axes(self) -> int:
        """Coordinates of each particle: 3 of a disk, 6 of a sphere."""
        return 3 if self.dimension == 2 else 6

    @property
    def coordinates(self) -> int:
        """Number of all coordinates."""
        return self.axes * len(self)

    @property
    def coordinate_mass(self) -> Floats:
        """Masses of the coordinates, m of translations and I/R^2 of rotations, shape (axes N,)."""
        turning = self.inertia / self.radius**2
        mass = np.concatenate([self.mass] * self.dimension + [turning] * (self.axes - self.dimension))
        if self.constraint is None:
            return mass
        moved = self.constraint.T @ mass
        return np.where(moved > 0, moved, mass)  # a coordinate that leads no other has no rows

    @property
    def coordinate_free(self) -> NDArray[np.bool_]:
        """Which coordinates move, and lead where several move as one, shape (axes N,)."""
        free = np.tile(self.free, self.axes)
        return free if self.constraint is None else np.asarray(abs(self.constraint).sum(axis=0) > 0)

    @property
    def joined(self) -> Indices:
        """Indices of the particles that move as one with others."""
        if self.constraint is None:
            return np.zeros(0, dtype=np.intp)
        moved = self.constraint.tocoo()
        shared = np.bincount(moved.col, minlength=moved.shape[1])[moved.col] > 1
        return np.unique(moved.row[shared] % len(self))

    def project(self, matrix: csr_array) -> csr_array:
        """P_1^T A P of a matrix of the particles' own coordinates."""
        if self.constraint is None:
            return matrix
        return csr_array((self.constraint != 0).astype(np.float64).T @ matrix @ self.constraint)

    def vectors(self, coordinates: NDArray) -> tuple[NDArray, NDArray]:
        """Translations and rotations R theta, shape (N, 3) each, of values of the coordinates, shape (axes N,)."""
        return self._apart(coordinates if self.constraint is None else self.constraint @ coordinates)

    def _apart(self, coordinates: NDArray) -> tuple[NDArray, NDArray]:
        d, parts = self.dimension, coordinates.reshape(self.axes, -1)
        translation, rotation = np.zeros((2, len(self), 3), dtype=parts.dtype)
        translation[:, :d], rotation[:, d - self.axes :] = parts[:d].T, parts[d:].T
        return translation, rotation

    def join_vectors(self, translation: NDArray, rotation: NDArray) -> NDArray:
        """The reverse of `vectors`; of coordinates that move as one the leading one counts."""
        d = self.dimension
        return np.concatenate([translation[:, :d].T.ravel(), rotation[:, d - self.axes :].T.ravel()])
