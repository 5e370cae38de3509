r"""A packing of another code, in two or three dimensions, with its contacts to first order.

Any contact law enters the operators through a few numbers at each contact: the normal, the distance and the lever arms;
the normal and the tangential force; and the derivatives of both forces.
:class:`~faultgouge.analysis.contacts.LinearisedContacts` has these numbers, and
:mod:`~faultgouge.analysis.assembly` makes the operators.

**Operators that are given.** If `stiffness` is given, K and C are differences of another code's forces. The contacts
then have only their places and forces, as far as the other code tells them. Their derivatives are zero and Coulomb's
bound is infinite, since neither is known.

**Coordinates** are translations and rotations as lengths, :math:`R\theta`, axis by axis:
(x.., y.., R theta..) of disks and (x.., y.., z.., R theta_x.., R theta_y.., R theta_z..) of spheres. Vectors always
have three components; those of disks lie in the plane, and disks turn about z.

**Bodies.** Coordinates that move as one, such as the particles of a rigid lid, are q = P Q with the `constraint` P.
The operators are those of Q: P_1^T K P, and C likewise, where P_1 is 1 where P is not 0. Column k of P has the
coordinates that Q_k moves, and the coordinate k itself by 1. The mass of Q_k is the sum of masses times P.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array, diags_array

from .arrays import (
    BY_DEFAULT,
    Booleans,
    EqualToTheBit,
    Floats,
    Indices,
    derive_frozen,
    exactly,
    floats,
    frozen,
    number,
    positive_each,
    ratio,
    set_frozen,
    square,
)
from .assembly import as_springs, contact_derivatives, each_of, pair_rows, spring_of_layer
from .contacts import UNIT_ERROR, LinearisedContacts, refuse_first
from .counted import counted
from .errors import BadInputError

if TYPE_CHECKING:
    from pandas import DataFrame

UNKNOWN_SLIPS = "the tangential forces were not given, and the slips began at zero: K depends on both"
UNKNOWN_SLIPS += " (`faultgouge import --contacts` takes slips)"
"""Why no verdict is possible where slips are not known."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Configuration(EqualToTheBit):
    """Particles of a packing in two or three dimensions, with their linearised contacts.

    Parameters
    ----------
    dimension : int
        2 or 3.
    position : array_like, shape (N, d)
        Centres, length.
    radius, mass, inertia : array_like, shape (N,)
        Radii, masses and moments of inertia, positive.
    contacts : LinearisedContacts
        The contacts.
    box : array_like, shape (3, 3)
        Edges of the box in rows, length; the edges of a sheared box are not along the axes.
    origin : array_like, shape (3,)
        Its lower corner.
    periodic : array_like of bool, shape (3,)
        Along which edges it is periodic.
    load : array_like, shape (N, 2, 3)
        Force and torque on each particle other than those of its contacts, for a packing at rest.
    free : array_like of bool, shape (N,), optional
        Particles that move; fixed particles only take part in contacts. All by default.
    ids : array_like of int, shape (N,), optional
        IDs of the particles in the other code; 1 to N by default.
    kind : array_like of int, shape (N,), optional
        Their types; 1 by default.
    fx : float
        Value of the load parameter of the configuration, if it belongs to a path.
    load_error : float
        Error of `fx` that corresponds to the residual, in units of `fx`.
    top : array_like of bool, shape (N,), optional
        The particles of a driven layer, on each of which fx acts; none by default.
    drag_rate : float
        1/tau of the drag -(m/tau) v and -(I/tau) omega on every particle, 1 / time; none by default.
    stiffness, damping : scipy.sparse.csr_array, shape (coordinates, coordinates), optional
        K, force / length, and C, force time / length, in place of the derivatives of contacts; both or none.
    operator_error : float
        Error of K and C, as a share of the largest entry.
    jump : array_like, shape (N,), optional
        Difference of the one-sided derivatives of the force on each particle, of which K and C have the mean, as a
        share of the largest entry; zero by default.
    wall_force : array_like, shape (N,), optional
        Size of the force on each particle of walls whose contacts are not known, force; zero by default.
    constraint : scipy.sparse.csr_array, shape (coordinates, coordinates), optional
        P of q = P Q; by default the identity, but for particles that are not free.
    spring : float
        Stiffness k of a spring that draws the layer `top`, force / length: each of its particles feels the force
        k (X_0 - X) along x, X their mean displacement. None by default. X_0 is part of the load.
    slips_known : bool
        Whether the tangential forces are known, or were taken as zero. Without them no stability is known.
    proof : float, optional
        Relative difference of a short motion of the other code from that of this configuration; None without such a
        motion. The proof is no property of the packing, and does not count when two configurations are compared.
    remarks : sequence of str
        What is to be known of its origin, such as laws that are others than their commands say; not compared either.

    Raises
    ------
    ValueError
        If a shape does not fit, a number is not finite or has the wrong sign, a contact names no particle or leaves
        the plane of disks, or two particles have one ID.
    """

    dimension: int
    position: Floats
    radius: Floats
    mass: Floats
    inertia: Floats
    contacts: LinearisedContacts
    box: Floats
    origin: Floats
    periodic: Booleans
    load: Floats
    free: Booleans = BY_DEFAULT
    ids: Indices = BY_DEFAULT
    kind: Indices = BY_DEFAULT
    fx: float = 0.0
    load_error: float = 0.0
    top: Booleans = BY_DEFAULT
    drag_rate: float = 0.0
    stiffness: csr_array | None = None
    damping: csr_array | None = None
    operator_error: float = 0.0
    jump: Floats = BY_DEFAULT
    wall_force: Floats = BY_DEFAULT
    constraint: csr_array | None = None
    spring: float = 0.0
    slips_known: bool = True
    proof: float | None = field(default=None, compare=False)
    remarks: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        n, d, one = np.size(self.radius), self.dimension, np.ones(np.size(self.radius), int)
        if d not in (2, 3) or n == 0:
            raise ValueError(f"A configuration has particles in two or three dimensions, not {n} in {d}.")
        if (self.stiffness is None) != (self.damping is None):
            raise ValueError("stiffness and damping are given together.")
        usual: dict[str, NDArray] = {"free": one == 1, "top": one == 0, "ids": np.cumsum(one), "kind": one}
        usual |= dict.fromkeys(("jump", "wall_force"), 0 * one)
        given = {name: getattr(self, name) for name in self.__dataclass_fields__}
        given |= {name: value for name, value in usual.items() if given[name] is None}
        values: dict[str, Any] = {"slips_known": bool(self.slips_known), "remarks": tuple(self.remarks)}
        shapes: dict[str, tuple[int, ...]] = {"position": (n, d), "box": (3, 3), "origin": (3,), "load": (n, 2, 3)}
        for name, shape in (shapes | dict.fromkeys(("jump", "wall_force"), (n,))).items():
            values[name] = floats(name, given[name], shape)
        for name in ("radius", "mass", "inertia"):
            values[name] = positive_each(name, given[name], (n,))
        for name in ("fx", "load_error", "drag_rate", "operator_error", "spring", "proof"):
            values[name] = None if given[name] is None else number(name, given[name])
        for name, count in (("periodic", 3), ("free", n), ("top", n)):
            values[name] = exactly(name, given[name], count, np.bool_)
        for name in ("ids", "kind"):
            values[name] = exactly(name, given[name], n, np.integer)
        for name in ("stiffness", "damping", "constraint"):
            values[name] = None if given[name] is None else square(name, given[name], self.axes * n)
        set_frozen(self, **values)
        unique, times = np.unique(self.ids, return_counts=True)
        if len(unique) < n:
            raise ValueError(f"Two particles have the ID {unique[times > 1][0]}: give each its own.")
        c = self.contacts
        if len(c) and max(c.i.max(), c.j.max()) >= n:
            raise ValueError(f"A contact names a particle beyond the last one, {n - 1}.")
        if d == 2:
            least = UNIT_ERROR * (np.abs(c.normal_force) + np.linalg.norm(c.tangential_force, axis=1))
            refuse_first(np.abs(c.normal[:, 2]) > UNIT_ERROR, "the normal {} of disks is not in the plane", c.normal)
            outside = np.abs(c.tangential_force[:, 2]) > least
            refuse_first(outside, "the tangential force {} on a disk is not in the plane", c.tangential_force)

    def __repr__(self) -> str:
        c, given = self.contacts.touching, self.stiffness is not None
        walls, sided = int(c.wall.sum()), counted(len(self.one_sided_particles), "particle")
        state = f"{walls} with walls, {int(c.at_bound.sum())} at Coulomb's bound"
        if given:
            state = f"{walls or 'none'} known with walls, K and C by differences of forces to {self.operator_error:.1g}"
            state += f", forces on {sided} one-sided" if len(self.one_sided_particles) else ""
        elif self.contacts.sliding.any() or self.contacts.one_sided.any():
            state += f", {'sliding' if self.contacts.sliding.any() else 'sticking'} in K"
        pairs = counted(len(c) - walls, "contact")
        proof = "not proved" if self.proof is None else f"proof {self.proof:.1g}"
        rest = f"{counted(len(self.rattlers), 'rattler')}, residual {self.residual:.3g}, {proof}"
        return f"<Configuration: {self._particles}, {pairs} between them and {state}, {rest}>"

    def __len__(self) -> int:
        return len(self.radius)

    law = None
    fy = 0.0
    """A :class:`Packing` has a law and a load F_y."""

    @property
    def in_words(self) -> str:
        """How many of which particles."""
        return f"{self._particles} as LAMMPS left them"

    @property
    def _particles(self) -> str:
        return counted(len(self), "disk" if self.dimension == 2 else "sphere")

    @property
    def box_length(self) -> float | None:
        """Period along x, length; None without."""
        return float(self.box[0, 0]) if self.periodic[0] else None

    @property
    def planes(self) -> tuple[tuple[int, float, float], ...]:
        """Planes along the axes that particles touch: the axis, the sign along it of its inner side, and its place."""
        c, d = self.contacts, self.dimension
        flat = np.flatnonzero(c.wall & (np.abs(c.normal[:, :d]).max(axis=1) > 1 - 1e-9))
        axis = np.argmax(np.abs(c.normal[flat]), axis=1)
        sign = np.sign(c.normal[flat, axis])
        place = self.position[c.i[flat], axis] - sign * (self.radius[c.i[flat]] - c.overlap[flat])
        sides = sorted({*zip(axis.tolist(), sign.tolist(), strict=True)})
        return tuple((a, s, float(np.mean(place[(axis == a) & (sign == s)]))) for a, s in sides)

    @property
    def slip_share(self) -> Floats:
        """Not known of a Configuration: a BadInputError."""
        raise BadInputError("A packing of LAMMPS has forces and no slips: let colours show mobilised, force or none.")

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
    def coordinate_free(self) -> Booleans:
        """Which coordinates move, and lead where several move as one, shape (axes N,)."""
        free = np.tile(self.free, self.axes)
        return free if self.constraint is None else np.asarray(abs(self.constraint).sum(axis=0) > 0)

    @property
    def joined(self) -> Indices:
        """Indices of the particles that move as one with others."""
        if self._summing is None:
            return np.zeros(0, dtype=np.intp)
        shared = self._summing @ (self._summing.sum(axis=0) > 1)
        return np.unique(np.flatnonzero(shared) % len(self))

    @cached_property
    def _summing(self) -> csr_array | None:
        """P_1, which sums forces where coordinates move as one."""
        return None if self.constraint is None else csr_array((self.constraint != 0).astype(np.float64))

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

    @property
    def operators(self) -> Literal["laws", "differences"]:
        """Whether K and C come from the laws of contacts, or are given, as differences of forces."""
        return "laws" if self.stiffness is None else "differences"

    @property
    def one_sided_particles(self) -> Indices:
        """Indices of the particles whose forces have other derivatives forwards than backwards, where K is given."""
        return np.flatnonzero(self.jump)

    @property
    def configuration(self) -> "Configuration":
        """The configuration itself; a Packing has one, too."""
        return self

    @property
    def damped(self) -> bool:
        """Whether there are dashpots or drag."""
        if self.damping is not None:
            return bool(self.damping.nnz)
        dashpots = self.contacts.normal_dashpot.any() or self.contacts.tangential_dashpot.any()
        return bool(dashpots or self.drag_rate > 0)

    @property
    def normal_force(self) -> Floats:
        """f_n of each contact, force, shape (C,)."""
        return self.contacts.normal_force

    @property
    def largest_force(self) -> float:
        """The largest normal force of a contact, or force of walls on a particle, as far as these are known."""
        return float(max(self.normal_force.max(initial=0.0), self.wall_force.max()))

    @property
    def branch(self) -> Floats:
        """From the second partner of each contact, or from the wall, to the first; length, shape (C, 3)."""
        c = self.contacts
        reach = np.where(c.wall, self.radius[c.i] - c.overlap, c.distance)
        return np.asarray(reach[:, None] * c.normal)

    @property
    def mobilised(self) -> Floats:
        """|f_t|/(mu f_n): the share of Coulomb's bound that each contact uses, shape (C,); zero without friction."""
        return ratio(np.linalg.norm(self.contacts.tangential_force, axis=1), self.contacts.friction)

    def contact_columns(self) -> dict[str, NDArray]:
        """A row for each contact: IDs, normal, forces, overlap and the share of Coulomb's bound.

        Returns
        -------
        dict of ndarray, each of shape (C,)
            id1 and id2, IDs of both partners, 0 for a wall; n_x, n_y, n_z, the normal, which points to the first; f_n,
            the normal force; f_t_x, f_t_y, f_t_z, the tangential force on the first; f_t, its size; overlap, length;
            mobilised, |f_t|/(mu f_n).
        """
        c, axes = self.contacts.touching, "xyz"
        columns = {"id1": self.ids[c.i], "id2": np.where(c.wall, 0, self.ids[np.maximum(c.j, 0)])}
        columns |= {f"n_{axis}": c.normal[:, k] for k, axis in enumerate(axes)}
        columns |= {"f_n": c.normal_force, "f_t": np.linalg.norm(c.tangential_force, axis=1)}
        columns |= {f"f_t_{axis}": c.tangential_force[:, k] for k, axis in enumerate(axes)}
        return columns | {"overlap": c.overlap, "mobilised": self.mobilised[~self.contacts.couple]}

    def to_pandas(self) -> "DataFrame":
        """The contacts as a table of pandas, with the columns of `contact_columns`; an ImportError without pandas."""
        from pandas import DataFrame

        return DataFrame(self.contact_columns())

    @cached_property
    def rattlers(self) -> Indices:
        """Indices of the particles that touch nothing and belong to no body; where K is given, of those that move and
        feel nothing."""
        if self.stiffness is None:
            touch = np.union1d(self.contacts.i, self.contacts.j)
            return frozen(np.setdiff1d(np.arange(len(self)), np.union1d(touch, self.joined)))
        feels = (np.diff(self.stiffness.indptr) > 0).astype(np.float64)
        feels = feels if self.constraint is None else self.constraint @ feels
        return frozen(np.flatnonzero(self.free & ~feels.reshape(self.axes, -1).any(axis=0)))

    def assembled_stiffness(
        self,
        *,
        form: str = "consistent",
        coupled: Booleans | None = None,
        parting: ArrayLike = 0.5,
        sliding: ArrayLike = False,
    ) -> csr_array:
        """K = -dF/dq; see :func:`~faultgouge.analysis.stiffness_matrix`.

        Raises
        ------
        ValueError
            If an option does not apply.
        """
        if form == "paper" or coupled is not None:
            raise ValueError("The operator of a Configuration is the consistent one, of all of its contacts.")
        if self.stiffness is not None and (np.any(np.asarray(parting) != 0.5) or np.any(sliding)):
            raise ValueError("K of this configuration is a difference of forces: leave parting and sliding out.")
        if self.stiffness is not None:
            return self.stiffness.copy()
        matrix, summing = self._assembled(self.contacts, parting), self._summing
        if self.spring:
            spring = spring_of_layer(self.spring, self.top, self.coordinates)
            matrix = csr_array(matrix + (spring if summing is None else summing.T @ spring @ self.constraint))
        return matrix

    def assembled_damping(self, sliding: ArrayLike = False) -> csr_array:
        """C = -dF/d(dq/dt); see :func:`~faultgouge.analysis.damping_matrix`."""
        if self.damping is not None:
            return self.damping.copy()
        matrix = self._assembled(as_springs(self.contacts))
        if self.drag_rate:
            moves = np.ones(self.coordinates) if self.constraint is None else self.coordinate_free
            matrix = csr_array(matrix + diags_array(self.drag_rate * self.coordinate_mass * moves))
        return matrix

    def assembled_operators(self) -> tuple[csr_array, csr_array]:
        """K and C."""
        return self.assembled_stiffness(), self.assembled_damping()

    def pair_rows(
        self, partners: tuple[Indices, Indices] | None = None, arms: Floats | None = None, *, forces: bool = False
    ) -> csr_array:
        """U of contacts, or of other pairs, or with arms W, shape (3C, coordinates): see `assembly`.

        With `forces` the transpose takes forces or torques on the pairs to forces on the coordinates that lead.
        """
        pairs = (self.contacts.i, self.contacts.j) if partners is None else partners
        rows = pair_rows(self.radius, self.free, self.axes, pairs, arms)
        leads = self._summing if forces else self.constraint
        return rows if leads is None else csr_array(rows @ leads)

    def force_rates(self, c: LinearisedContacts, parting: ArrayLike = 0.5) -> tuple[csr_array, csr_array]:
        """Forces on the coordinates by u and by w of each contact, shape (coordinates, 3C) each."""
        d = contact_derivatives(c, parting)
        force, torque = self.pair_rows(forces=True).T, self.pair_rows(arms=c.lever_arm, forces=True).T
        by_u = force @ each_of(d.force_by_u) - torque @ each_of(d.torque_by_u)
        if c.lever_slope.any():
            slopes = np.repeat(c.lever_slope[:, None], 2, axis=1)
            by_u = by_u + self.pair_rows(arms=slopes, forces=True).T @ each_of(d.growth)
        return by_u, force @ each_of(d.force_by_w) - torque @ each_of(d.torque_by_w)

    def _assembled(self, c: LinearisedContacts, parting: ArrayLike = 0.5) -> csr_array:
        """-dF/dq of contacts."""
        by_u, by_w = self.force_rates(c, parting)
        matrix = csr_array(-(by_u @ self.pair_rows() + by_w @ self.pair_rows(arms=c.slip_arm)))
        matrix.eliminate_zeros()
        matrix.sum_duplicates()
        return matrix

    @cached_property
    def net_force(self) -> Floats:
        """Force and torque on each particle, its load included, shape (N, 2, 3)."""
        return frozen(self.load + self.contact_force)

    @cached_property
    def contact_force(self) -> Floats:
        """Force and torque of its contacts on each particle, shape (N, 2, 3)."""
        c, total = self.contacts, np.zeros((len(self), 2, 3))
        force = ~c.couple[:, None] * (c.normal_force[:, None] * c.normal + c.tangential_force)
        turn, pair = -np.cross(c.normal, c.tangential_force), ~c.wall
        np.add.at(total, c.i, np.stack([force, c.lever_arm[:, :1] * turn], axis=1))
        np.add.at(total, c.j[pair], np.stack([-force, c.lever_arm[:, 1:] * turn], axis=1)[pair])
        return frozen(total)

    @property
    def coordinate_force(self) -> Floats:
        """F and T/R of `net_force` on the coordinates, sums where several move as one, shape (axes N,)."""
        forces = self.join_vectors(self.net_force[:, 0], self.net_force[:, 1] / self.radius[:, None])
        return forces if self._summing is None else np.asarray(self._summing.T @ forces)

    @property
    def residual(self) -> float:
        """Largest |(F, T/R)| on a particle that moves and has a contact, force; zero if none has."""
        return float(self.particle_residual.max(initial=0.0))

    @property
    def particle_residual(self) -> Floats:
        """|(F, T/R)| on each particle, force, shape (N,); zero if it does not move, or has no contact."""
        force = np.stack(self._apart(self.coordinate_force), axis=1)
        size = np.where(self.free, np.sqrt(np.sum(force * force, axis=(1, 2))), 0.0)
        size[self.rattlers] = 0.0
        return size

    @property
    def contact_states(self) -> bytes:
        """State of the contacts: which particles touch, and which contacts slide; equal for equal states."""
        c = self.contacts
        order = np.lexsort((c.j, c.i))
        return np.array([c.i, c.j, c.sliding], dtype=np.int64)[:, order].tobytes()

    def loaded(self, least: float) -> "Configuration":
        """The configuration without the contacts that carry no more than a given normal force; as it is where K is
        given, in which all contacts have a share."""
        kept = self.contacts.normal_force > least
        whole = np.all(kept) or self.stiffness is not None
        return self if whole else derive_frozen(self, contacts=self.contacts.chosen(kept))


Snapshot = Configuration
"""The name of `Configuration` until version 1."""
