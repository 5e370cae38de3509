r"""A packing of another code, in two or three dimensions, with its contacts to first order.

Any contact law enters the operators through a few numbers at each contact: the normal, the distance and the lever arms;
the normal and the tangential force; and the derivatives of both. `LinearisedContacts` has them, `Configuration` adds
the particles, and :mod:`~faultgouge.analysis.operators.linearised_contacts` assembles the operators.

**Coordinates** are translations and rotations as lengths, :math:`R\theta`, axis by axis:
(x.., y.., R theta..) of disks and (x.., y.., z.., R theta_x.., R theta_y.., R theta_z..) of spheres. Vectors always
have three components; those of disks lie in the plane, and disks turn about z.

**Two derivatives.** For some laws (LAMMPS's mindlin_rescale) the derivative :math:`b = \partial \mathbf f_t / \partial
\delta` differs between a growing and a falling overlap; every operator takes the weight of opening contacts
(:mod:`~faultgouge.analysis.packing.law`). A contact at Coulomb's bound sticks if the motion reverses, and slides if the
motion continues: `sliding` chooses.

**Operators that are given.** A Configuration whose `stiffness` is given has K and C as they were measured, by
differences of forces, and its contacts have places and forces alone, as far as these are known: their derivatives are
zero, and Coulomb's bound is infinite, since nothing is known of either.

**Bodies.** Coordinates that move as one, such as the particles of a rigid lid, are q = P Q with the `constraint` P.
The operators are those of Q: P_1^T K P, and C likewise, where P_1 is 1 where P is not 0. Column k of P has what Q_k
moves, and the coordinate k itself by 1. The mass of Q_k is the sum of masses times P.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from .arrays import (
    Floats,
    Indices,
    booleans,
    derive_frozen,
    floats,
    frozen,
    integers,
    number,
    positive_each,
    real,
    same_bits,
    set_frozen,
    square,
)

WALL = -1
"""The index that stands for a wall as the second partner of a contact."""

AT_COULOMBS_BOUND = 1 - 1e-6
"""Share of mu f_n from which on a contact counts as one at the bound. A packing at rest has a residual of 1e-6 of its
forces or less, and a dashpot has carried that much of the tangential force."""

UNIT = 1e-6
"""Error of a unit vector, and of a direction in the plane, that text of seven digits has."""

PERPENDICULAR = 1e-2
"""Share of a tangential force that may be along the normal: LAMMPS turns histories a step behind their contacts."""

PER_CONTACT = {
    "i": (), "j": (), "normal": (3,), "distance": (), "overlap": (), "slip_arm": (2,), "lever_arm": (2,),
    "lever_slope": (), "normal_force": (), "tangential_force": (3,), "normal_stiffness": (), "tangential_stiffness": (),
    "closing": (3,), "parting": (3,), "friction": (), "sliding": (), "normal_dashpot": (), "tangential_dashpot": (),
    "slider": (), "viscous_slider": (),
}  # fmt: skip
"""Fields of `LinearisedContacts`, with the shape of each for one contact."""

BOOLEAN = {"sliding": False, "slider": True, "viscous_slider": True}
"""Fields that are true or false, with the values of contacts that do not say."""


@dataclass(frozen=True, init=False, eq=False)
class LinearisedContacts:
    """The contacts of a packing to first order: forces and derivatives. Arrays are copied and made read-only.

    Parameters
    ----------
    i : array_like of int, shape (C,)
        First partner.
    j : array_like of int, shape (C,)
        Second partner; -1 is a wall, which neither moves nor rotates.
    normal : array_like, shape (C, 3)
        Unit vector n towards i.
    distance : array_like, shape (C,)
        Length r of the branch vector between two centres; infinite for a wall, whose normal does not rotate.
    overlap : array_like, shape (C,)
        delta, length.
    slip_arm : array_like, shape (C, 2)
        Arms s_i, s_j of the slip: the rolling s_i d theta_i + s_j d theta_j slides the contact; length.
    lever_arm : array_like, shape (C, 2)
        Arms l_i, l_j of the torques -l n x f_t; length.
    lever_slope : array_like, shape (C,)
        -d l / d delta: 0 if the arm is a radius, 1/2 if it ends in the middle of the overlap.
    normal_force : array_like, shape (C,)
        f_n, force, positive for a repulsion.
    tangential_force : array_like, shape (C, 3)
        f_t, force on i.
    normal_stiffness, tangential_stiffness : array_like, shape (C,)
        d f_n / d delta and -d f_t / d s, force / length.
    closing, parting : array_like, shape (C, 3)
        b = d f_t / d delta at constant slip while the overlap grows, and while the overlap falls; force / length.
    friction : array_like, shape (C,)
        mu f_n, Coulomb's bound, force; infinite without such a bound.
    sliding : array_like of bool, shape (C,)
        Contacts that slide: they have no stiffness along f_t, and b is that of f_t = mu f_n.
    normal_dashpot, tangential_dashpot : array_like, shape (C,)
        Force time / length.
    slider : array_like of bool, shape (C,)
        Contacts whose tangential force is that of a spring in series with Coulomb's slider, so that its derivative
        jumps at the bound; the default. The force of a smoothed law has one derivative there.
    viscous_slider : array_like of bool, shape (C,)
        Contacts whose slip at Coulomb's bound yields to the elastic and the viscous force together, with the bound mu
        times the normal force of spring and dashpot: LAMMPS's slider, and the default. The slip of other contacts
        yields to the elastic force alone, and the sum of both forces is cut at mu times the elastic normal force.

    Raises
    ------
    ValueError
        If a shape does not fit, a number is not finite, or a value is none that a contact can have: a normal that is
        no unit vector, a tangential force along the normal, a distance that is not positive, or a negative arm, bound
        or index.
    """

    i: Indices
    j: Indices
    normal: Floats
    distance: Floats
    overlap: Floats
    slip_arm: Floats
    lever_arm: Floats
    lever_slope: Floats
    normal_force: Floats
    tangential_force: Floats
    normal_stiffness: Floats
    tangential_stiffness: Floats
    closing: Floats
    parting: Floats
    friction: Floats
    sliding: NDArray[np.bool_]
    normal_dashpot: Floats
    tangential_dashpot: Floats
    slider: NDArray[np.bool_]
    viscous_slider: NDArray[np.bool_]

    def __init__(self, **given: ArrayLike) -> None:
        given = {name: np.full(np.shape(given.get("i", ())), value) for name, value in BOOLEAN.items()} | given
        if given.keys() != PER_CONTACT.keys():
            raise ValueError(f"Contacts need {', '.join(PER_CONTACT)}; these are {', '.join(given)}.")
        values: dict[str, NDArray] = {name: integers(name, given[name]) for name in ("i", "j")}
        count = len(values["i"])
        values |= {name: booleans(name, given[name], count) for name in BOOLEAN}
        for name in ("distance", "friction"):  # may be infinite
            values[name] = real(name, given[name])
            floats(name, np.where(values[name] == np.inf, 0.0, values[name]), (count,))
        for name in PER_CONTACT.keys() - values.keys():
            values[name] = floats(name, given[name], (count, *PER_CONTACT[name]))
        if len(values["i"]) != len(values["j"]) or np.any(values["i"] == values["j"]):
            raise ValueError("Every contact has two different partners, i and j.")
        _check_contacts(values)
        set_frozen(self, **{name: values[name] for name in PER_CONTACT})

    def __len__(self) -> int:
        return len(self.i)

    def __eq__(self, other: object) -> bool:
        """Whether every array is the same to the bit."""
        return same_bits(self, other) if isinstance(other, LinearisedContacts) else NotImplemented

    def __hash__(self) -> int:
        return hash((len(self), self.overlap.tobytes()))

    @property
    def wall(self) -> NDArray[np.bool_]:
        """Which contacts are with a wall, shape (C,)."""
        return self.j == WALL

    @property
    def at_bound(self) -> NDArray[np.bool_]:
        """Which contacts are at Coulomb's bound, shape (C,)."""
        tangential = np.linalg.norm(self.tangential_force, axis=1)
        return (tangential > 0) & (tangential >= AT_COULOMBS_BOUND * self.friction)

    @property
    def one_sided(self) -> NDArray[np.bool_]:
        """Which contacts slide on ahead and stick on the way back, shape (C,): sliders at Coulomb's bound."""
        return self.at_bound & self.slider

    def overlap_derivative(self, parting: ArrayLike = 0.5) -> Floats:
        """b of each contact, shape (C, 3), with the weight of opening, shape () or (C,)."""
        share = np.broadcast_to(np.asarray(parting, dtype=np.float64), (len(self),))[:, None]
        stick = (1 - share) * self.closing + share * self.parting
        # a sliding contact keeps |f_t| = mu f_n, in the direction in which it slides
        slide = np.divide(
            self.tangential_force * self.normal_stiffness[:, None], self.normal_force[:, None],
            out=np.zeros_like(stick), where=self.normal_force[:, None] != 0,
        )  # fmt: skip
        return np.where(self.sliding[:, None], slide, stick)

    def chosen(self, which: NDArray) -> "LinearisedContacts":
        """Some of the contacts, selected by a mask or by numbers."""
        return derive_frozen(self, **{name: np.array(getattr(self, name)[which]) for name in PER_CONTACT})


@dataclass(frozen=True, init=False, eq=False)
class Configuration:
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
    constraint : scipy.sparse.csr_array, shape (coordinates, coordinates), optional
        P of q = P Q; the identity by default, and only where `stiffness` is given.
    spring : float
        Stiffness k of a spring that draws the layer `top`, force / length: each of its particles feels the force
        k (X_0 - X) along x, X their mean displacement. None by default. X_0 is part of the load.
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
    periodic: NDArray[np.bool_]
    load: Floats
    free: NDArray[np.bool_]
    ids: Indices
    kind: Indices
    fx: float
    load_error: float
    top: NDArray[np.bool_]
    drag_rate: float
    stiffness: csr_array | None
    damping: csr_array | None
    operator_error: float
    jump: Floats
    constraint: csr_array | None
    spring: float
    proof: float | None = field(compare=False)
    remarks: tuple[str, ...] = field(compare=False)

    def __init__(
        self,
        *,
        dimension: int,
        position: ArrayLike,
        radius: ArrayLike,
        mass: ArrayLike,
        inertia: ArrayLike,
        contacts: LinearisedContacts,
        box: ArrayLike,
        origin: ArrayLike,
        periodic: ArrayLike,
        load: ArrayLike,
        free: ArrayLike | None = None,
        ids: ArrayLike | None = None,
        kind: ArrayLike | None = None,
        fx: float = 0.0,
        load_error: float = 0.0,
        top: ArrayLike | None = None,
        drag_rate: float = 0.0,
        stiffness: csr_array | None = None,
        damping: csr_array | None = None,
        operator_error: float = 0.0,
        jump: ArrayLike | None = None,
        constraint: csr_array | None = None,
        spring: float = 0.0,
        proof: float | None = None,
        remarks: Iterable[str] = (),
    ) -> None:
        n = len(np.atleast_1d(np.asarray(radius)))
        if dimension not in (2, 3) or n == 0:
            raise ValueError(f"A configuration has particles in two or three dimensions, not {n} in {dimension}.")
        if (stiffness is None) != (damping is None) or (stiffness is None and constraint is not None):
            raise ValueError("stiffness and damping are given together, and a constraint with them.")
        sizes = {"radius": radius, "mass": mass, "inertia": inertia}
        size = n * (3 if dimension == 2 else 6)
        matrices = {"stiffness": stiffness, "damping": damping, "constraint": constraint}
        set_frozen(
            self,
            dimension=int(dimension),
            position=floats("position", position, (n, dimension)),
            **{name: positive_each(name, floats(name, value, (n,))) for name, value in sizes.items()},
            contacts=contacts,
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
            operator_error=number("operator_error", operator_error),
            jump=floats("jump", np.zeros(n) if jump is None else jump, (n,)),
            **{name: None if each is None else square(name, each, size) for name, each in matrices.items()},
            spring=number("spring", spring),
            proof=None if proof is None else number("proof", proof),
            remarks=tuple(remarks),
        )
        if len(contacts) and max(contacts.i.max(), contacts.j.max()) >= n:
            raise ValueError(f"A contact names a particle beyond the last one, {n - 1}.")
        _check_particles(self)

    def __len__(self) -> int:
        return len(self.radius)

    def __eq__(self, other: object) -> bool:
        """Whether every array and number is the same to the bit."""
        return same_bits(self, other) if isinstance(other, Configuration) else NotImplemented

    def __hash__(self) -> int:
        return hash((len(self), self.fx, self.position.tobytes()))

    def __repr__(self) -> str:
        what = "disks" if self.dimension == 2 else "spheres"
        count, walls = len(self.contacts), int(self.contacts.wall.sum())
        bound = int(self.contacts.at_bound.sum())
        slide = ", which slide" if self.contacts.sliding.any() else ", which stick" if bound else ""
        state = f"{walls} with walls, {bound} at Coulomb's bound{slide}"
        if self.stiffness is not None:
            count_one_sided = len(self.one_sided_particles)
            sided = f", forces on {count_one_sided} particles one-sided" if count_one_sided else ""
            state = f"{walls} known with walls, K and C by differences of forces to {self.operator_error:.1g}{sided}"
        return (
            f"<Configuration: {len(self)} {what}, {count - walls} contacts between them and {state}, "
            f"{len(self.rattlers)} rattlers, residual {self.residual:.3g}, "
            f"{'not proved' if self.proof is None else f'proof {self.proof:.1g}'}>"
        )

    @property
    def operators(self) -> Literal["laws", "differences"]:
        """Whether K and C come from the laws of contacts, or are given, as differences of forces."""
        return "laws" if self.stiffness is None else "differences"

    @property
    def one_sided_particles(self) -> Indices:
        """Indices of the particles whose forces have other derivatives forwards than backwards, where K is given."""
        return np.flatnonzero(self.jump)

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
        return np.where(moved > 0, moved, mass)  # what leads nothing has no rows

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
    def mobilised(self) -> Floats:
        """|f_t|/(mu f_n): the share of Coulomb's bound that each contact uses, shape (C,); zero without friction."""
        size, limit = np.linalg.norm(self.contacts.tangential_force, axis=1), self.contacts.friction
        return np.divide(size, limit, out=np.zeros_like(limit), where=limit > 0)

    @cached_property
    def rattlers(self) -> Indices:
        """Indices of the particles that touch nothing; where K is given, of those that move and feel nothing."""
        if self.stiffness is None:
            return frozen(np.setdiff1d(np.arange(len(self)), [self.contacts.i, self.contacts.j]))
        feels = (np.diff(self.stiffness.indptr) > 0).astype(np.float64)
        feels = feels if self.constraint is None else self.constraint @ feels
        return frozen(np.flatnonzero(self.free & ~feels.reshape(self.axes, -1).any(axis=0)))

    @cached_property
    def net_force(self) -> Floats:
        """Force and torque on each particle, its load included, shape (N, 2, 3)."""
        return frozen(self.load + self.contact_force)

    @cached_property
    def contact_force(self) -> Floats:
        """Force and torque of its contacts on each particle, shape (N, 2, 3)."""
        c, total = self.contacts, np.zeros((len(self), 2, 3))
        force = c.normal_force[:, None] * c.normal + c.tangential_force
        turn, pair = -np.cross(c.normal, c.tangential_force), ~c.wall
        np.add.at(total, c.i, np.stack([force, c.lever_arm[:, :1] * turn], axis=1))
        np.add.at(total, c.j[pair], np.stack([-force, c.lever_arm[:, 1:] * turn], axis=1)[pair])
        return frozen(total)

    @property
    def coordinate_force(self) -> Floats:
        """F and T/R of `net_force` on the coordinates, sums where several move as one, shape (axes N,)."""
        forces = self.join_vectors(self.net_force[:, 0], self.net_force[:, 1] / self.radius[:, None])
        return forces if self.constraint is None else np.asarray((self.constraint != 0).T @ forces)

    @property
    def coordinate_free(self) -> NDArray[np.bool_]:
        """Which coordinates move, and lead where several move as one, shape (axes N,)."""
        free = np.tile(self.free, self.axes)
        return free if self.constraint is None else np.asarray(abs(self.constraint).sum(axis=0) > 0)

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
        return (
            self
            if np.all(kept) or self.stiffness is not None
            else derive_frozen(self, contacts=self.contacts.chosen(kept))
        )

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


def _check_contacts(values: dict[str, NDArray]) -> None:
    """Refuse values that no contact can have; a ValueError names the first contact that has one."""
    normal, tangential, force = values["normal"], values["tangential_force"], values["normal_force"]
    along = np.abs(np.einsum("ca,ca->c", normal, tangential))
    tilted = along > PERPENDICULAR * np.linalg.norm(tangential, axis=1) + UNIT * np.abs(force)
    _refuse_first(values["i"] < 0, "i = {} is no particle", values["i"])
    _refuse_first(values["j"] < WALL, "j = {} is no particle; -1 is a wall", values["j"])
    _refuse_first(np.abs(np.linalg.norm(normal, axis=1) - 1) > UNIT, "the normal {} is no unit vector", normal)
    _refuse_first(tilted, "the tangential force {} has a part along the normal", tangential)
    _refuse_first(values["distance"] <= 0, "the distance {} is not positive", values["distance"])
    _refuse_first(values["friction"] < 0, "friction = {} is negative", values["friction"])
    for name in ("slip_arm", "lever_arm"):
        _refuse_first(np.any(values[name] < 0, axis=1), f"{name} = {{}} is negative", values[name])


def _check_particles(made: Configuration) -> None:
    """Refuse contacts of disks that leave the plane, and IDs and types that do not fit."""
    n, c = len(made), made.contacts
    if len(made.ids) != n or len(made.kind) != n:
        raise ValueError(f"ids and kind must be lists of {n} integers, one for each particle.")
    unique, count = np.unique(made.ids, return_counts=True)
    if len(unique) < n:
        raise ValueError(f"Two particles have the ID {unique[count > 1][0]}: give each its own.")
    if made.dimension == 2:
        scale = np.abs(c.normal_force) + np.linalg.norm(c.tangential_force, axis=1)
        _refuse_first(np.abs(c.normal[:, 2]) > UNIT, "the normal {} of disks is not in the plane", c.normal)
        outside = np.abs(c.tangential_force[:, 2]) > UNIT * scale
        _refuse_first(outside, "the tangential force {} on a disk is not in the plane", c.tangential_force)


def _refuse_first(wrong: NDArray[np.bool_], says: str, values: NDArray) -> None:
    if wrong.any():
        k = int(np.argmax(wrong))
        raise ValueError(f"Contact {k}: {says.format(values[k])}.")


class HasConfiguration(Protocol):
    """What an analysis takes: a Configuration, or a Packing, which has one. Members are those of a Configuration."""

    @property
    def configuration(self) -> Configuration: ...
    @property
    def dimension(self) -> int: ...
    @property
    def axes(self) -> int: ...
    @property
    def coordinates(self) -> int: ...
    @property
    def coordinate_mass(self) -> Floats: ...
    @property
    def position(self) -> Floats: ...
    @property
    def radius(self) -> Floats: ...
    @property
    def mass(self) -> Floats: ...
    @property
    def top(self) -> NDArray[np.bool_]: ...
    @property
    def damped(self) -> bool: ...
    @property
    def normal_force(self) -> Floats: ...
    @property
    def mobilised(self) -> Floats: ...
    @property
    def rattlers(self) -> Indices: ...
    @property
    def residual(self) -> float: ...
    @property
    def fx(self) -> float: ...
    @property
    def load_error(self) -> float: ...
    @property
    def contact_states(self) -> bytes: ...
    def loaded(self, least: float) -> "HasConfiguration": ...
    def __len__(self) -> int: ...
