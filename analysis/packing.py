r"""A packing of frictional disks, the one data type that everything passes on.

Two disks touch when :math:`\delta = R_i + R_j - r > 0`, with :math:`r` the length of the branch vector
:math:`\mathbf r_i - \mathbf r_j` (nearest image along x in a periodic box).
:math:`\mathbf n = (\mathbf r_i - \mathbf r_j)/r` points to i and
:math:`\boldsymbol\tau = \hat z \times \mathbf n = (-n_y, n_x)`. The history of a contact is one number, the
slip s along :math:`\boldsymbol\tau`, and it is even under exchange of i and j: the normal, the relative
motion and the tangent all change sign. The flat floor at y = 0 is a partner with :math:`\mathbf n = (0, 1)`,
:math:`\boldsymbol\tau = (-1, 0)`, :math:`\delta = R - y` and a normal that never turns.

With the coordinates :math:`q = (x_1..x_N, y_1..y_N, u_1..u_N)`, :math:`u_i = R_i \theta_i`, the forces are
:math:`(F_x, F_y, T/R)`; a contact puts :math:`f_n \mathbf n + f_t \boldsymbol\tau` on i, the opposite on j,
and :math:`-f_t` as T/R on both, because the lever arm is the full radius. Each disk of the upper layer
carries :math:`(f_x, -f_y)` besides.

Coordinates and slips are doubles, or doubles with low parts (:mod:`~faultgouge.analysis.compensated`), if
compensated arithmetic has found them.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from .compensated import Pair, exact_sum, normalized, overlap_and_distance, separation
from .law import MindlinLaw

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

FLOOR = -1
"""The index that stands for the floor as the second partner of a contact."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """The contacts of a packing and their slips, kept in one canonical order.

    Whatever the order given, a pair is stored with i < j (the slip is even under the exchange), pairs stand
    in lexicographic order, and contacts with the floor follow all pairs, by disk.

    Parameters
    ----------
    i : array_like of int, shape (C,)
        First partner.
    j : array_like of int, shape (C,)
        Second partner; -1 is the floor.
    slip : array_like, shape (C,)
        Slip of each contact along tau, length.
    slip_low : array_like, shape (C,), optional
        Low parts of the slips, length; none by default.

    Raises
    ------
    ValueError
        If the arrays differ in shape, an index is negative, a slip is not finite, a disk touches itself, or a
        contact is listed twice.
    """

    i: Indices
    j: Indices
    slip: Floats
    slip_low: Floats | None = None

    def __post_init__(self) -> None:
        i, j = _integers("i", self.i), _integers("j", self.j)
        slip = _floats("slip", self.slip, np.shape(i))
        if i.shape != j.shape:
            raise ValueError(f"The contact arrays i and j have different shapes, {i.shape} and {j.shape}.")
        if np.any(i < 0) or np.any(j < FLOOR):
            raise ValueError("A contact has a negative disk index; only j may be -1, for the floor.")
        if np.any(i == j):
            raise ValueError(f"Disk {i[i == j][0]} is listed as touching itself.")
        low = None if self.slip_low is None else _floats("slip_low", self.slip_low, i.shape)
        if not _canonical(i, j):
            i, j, order = _ordered(i, j)
            slip, low = slip[order], None if low is None else low[order]
        for name, value in (("i", i), ("j", j), ("slip", slip)):
            object.__setattr__(self, name, _frozen(value))
        if low is not None:
            object.__setattr__(self, "slip_low", _frozen(low))

    def __len__(self) -> int:
        return len(self.i)

    @property
    def floor(self) -> NDArray[np.bool_]:
        """Which contacts are with the floor, shape (C,)."""
        return self.j == FLOOR

    def slipped(self, slip: ArrayLike, slip_low: ArrayLike | None = None) -> "Contacts":
        """The same contacts with other slips, whose order is the one here; length, shape (C,)."""
        other = object.__new__(Contacts)
        low = None if slip_low is None else _frozen(_floats("slip_low", slip_low, self.i.shape))
        other.__dict__.update(i=self.i, j=self.j, slip=_frozen(_floats("slip", slip, self.i.shape)), slip_low=low)
        return other


class ContactGeometry(NamedTuple):
    """Where each contact is and how it stands; arrays over contacts, read-only.

    Attributes
    ----------
    normal : ndarray, shape (C, 2)
        Unit vector n towards i.
    tangent : ndarray, shape (C, 2)
        Unit vector tau = (-n_y, n_x).
    distance : ndarray, shape (C,)
        Length r of the branch vector; for the floor the height y.
    overlap : ndarray, shape (C,)
        delta = R_i + R_j - r, or R - y for the floor; length.
    """

    normal: Floats
    tangent: Floats
    distance: Floats
    overlap: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Packing:
    """A configuration of disks with its contacts, law and load. Arrays are copied and made read-only.

    Parameters
    ----------
    position : array_like, shape (N, 2)
        Centres, length; x may lie in any image of a periodic box.
    radius : array_like, shape (N,)
        Radii, length, positive.
    contacts : Contacts
        Pairs and floor contacts with their slips.
    law : MindlinLaw
        The law of all contacts, floor included.
    angle : array_like, shape (N,), optional
        Orientations theta, radian; zero by default.
    mass : array_like, shape (N,), optional
        Masses, positive; one by default.
    inertia_factor : float
        I_0 in I = I_0 m R^2, positive.
    box_length : float, optional
        Period along x, length; not periodic by default.
    top : array_like of bool, shape (N,), optional
        The disks of the upper layer, which carry the load; none by default.
    fx, fy : float
        Force on each disk of the upper layer: fx along +x, fy downwards.
    position_low : array_like, shape (N, 2), optional
        Low parts of the coordinates, length: the packing is then a compensated one. None by default.

    Raises
    ------
    ValueError
        If a shape does not fit, a number is not finite or has the wrong sign, a contact names a disk that
        does not exist, or the box is so narrow that a disk could touch two images of another.
    """

    position: Floats
    radius: Floats
    contacts: Contacts
    law: MindlinLaw
    # None stands for the defaults that __post_init__ puts in its place: the attributes are arrays
    angle: Floats = None  # type: ignore[assignment]
    mass: Floats = None  # type: ignore[assignment]
    inertia_factor: float = 1.0
    box_length: float | None = None
    top: NDArray[np.bool_] = None  # type: ignore[assignment]
    fx: float = 0.0
    fy: float = 0.0
    position_low: Floats | None = None

    def __post_init__(self) -> None:
        n = len(np.atleast_1d(self.radius))
        if n == 0:
            raise ValueError("A packing needs at least one disk.")
        arrays: dict[str, NDArray] = {
            "position": _floats("position", self.position, (n, 2)),
            "radius": _floats("radius", self.radius, (n,)),
            "angle": _floats("angle", np.zeros(n) if self.angle is None else self.angle, (n,)),
            "mass": _floats("mass", np.ones(n) if self.mass is None else self.mass, (n,)),
            "top": np.array(np.zeros(n, bool) if self.top is None else self.top),
        }
        if self.position_low is not None:
            arrays["position_low"] = _floats("position_low", self.position_low, (n, 2))
        for name in ("radius", "mass"):
            if np.any(arrays[name] <= 0):
                raise ValueError(f"Every {name} must be positive; disk {np.argmin(arrays[name])} has another.")
        if arrays["top"].shape != (n,) or arrays["top"].dtype != np.bool_:
            raise ValueError(f"top must be {n} booleans, one for each disk.")
        for name, value in arrays.items():
            object.__setattr__(self, name, _frozen(value))
        for name in ("inertia_factor", "fx", "fy", "box_length"):
            if getattr(self, name) is None:
                continue
            number = float(getattr(self, name))
            object.__setattr__(self, name, number)
            if not np.isfinite(number) or (name in ("inertia_factor", "box_length") and number <= 0):
                raise ValueError(f"{name} = {number} is not a number that it can have.")
        _check_box(self.radius, self.box_length)
        if len(self.contacts) and max(self.contacts.i.max(), self.contacts.j.max()) >= n:
            raise ValueError(f"A contact names a disk beyond the last one, {n - 1}.")

    def __len__(self) -> int:
        return len(self.radius)

    @property
    def scaled_angle(self) -> Floats:
        """u = R theta, length, shape (N,)."""
        return self.radius * self.angle

    @property
    def compensated(self) -> bool:
        """Whether coordinates have low parts."""
        return self.position_low is not None

    @property
    def coordinate_rounding(self) -> float:
        """What a coordinate is known to, length: its last place, or that of its low part (see compensated.h)."""
        if not self.compensated:
            return float(np.finfo(float).eps * np.abs(self.position).max())
        exponent = int(np.frexp(2 * self.radius.max())[1])
        return float(np.ldexp(1.0, exponent - 26 - 52))

    @cached_property
    def geometry(self) -> ContactGeometry:
        """Normals, tangents, distances and overlaps of the contacts."""
        return self._measured[0]

    @cached_property
    def _measured(self) -> tuple[ContactGeometry, Pair, Pair]:
        """The geometry, and the branch vectors and overlaps with their low parts."""
        i, j, floor = self.contacts.i, self.contacts.j, self.contacts.floor
        low = self.position_low
        low_i, low_j = (None, None) if low is None else (low[i], low[j])
        branch = separation(self.position[i], low_i, self.position[j], low_j, self.box_length)
        foot = np.zeros((floor.sum(), 2))
        branch[0][floor] = foot + self.position[i[floor]] * (0.0, 1.0)
        branch[1][floor] = foot if low is None else low[i[floor]] * (0.0, 1.0)
        reach = exact_sum(self.radius[i], np.where(floor, 0.0, self.radius[j]))
        overlap, distance = overlap_and_distance(branch, reach)
        distance[floor] = branch[0][floor, 1]  # signed: a centre below the floor is pushed up all the same
        height = exact_sum(self.radius[i[floor]], -distance[floor])
        overlap[0][floor], overlap[1][floor] = normalized(height[0], height[1] - branch[1][floor, 1])
        if np.any(distance[~floor] == 0):
            k = np.flatnonzero(~floor & (distance == 0))[0]
            raise ValueError(f"Disks {i[k]} and {j[k]} have the same centre, so that their contact has no direction.")
        normal = np.empty_like(branch[0])
        normal[~floor] = branch[0][~floor] / distance[~floor, None]
        normal[floor] = (0.0, 1.0)
        tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
        geometry = ContactGeometry(normal=normal, tangent=tangent, distance=distance, overlap=overlap[0])
        for array in geometry:
            array.flags.writeable = False
        return geometry, branch, overlap

    @property
    def normal_force(self) -> Floats:
        """f_n of each contact, force, shape (C,)."""
        return self.law.normal_force(self.geometry.overlap)

    @property
    def tangential_force(self) -> Floats:
        """f_t of each contact along tau, force, shape (C,)."""
        return self.law.tangential_force(self.geometry.overlap, self.contacts.slip)

    @cached_property
    def rattlers(self) -> Indices:
        """Indices of the disks that touch nothing; their rows of the stability operator are zero."""
        closed = self.geometry.overlap > 0
        alone = np.ones(len(self), dtype=np.bool_)
        alone[self.contacts.i[closed]] = False
        alone[self.contacts.j[closed & ~self.contacts.floor]] = False
        return _frozen(np.flatnonzero(alone))

    @cached_property
    def net_force(self) -> Floats:
        """Force on every coordinate, load included: (Fx_1.., Fy_1.., T_1/R_1..), shape (3N,).

        Of a compensated packing it is summed in numpy's long doubles, which have 64 bits on x86.
        """
        i, j, pair = self.contacts.i, self.contacts.j, ~self.contacts.floor
        fn, ft, normal = self._contact_forces
        on_i = np.column_stack([fn * normal[:, 0] - ft * normal[:, 1], fn * normal[:, 1] + ft * normal[:, 0]])
        total = np.zeros((3, len(self)), fn.dtype)
        total[0, self.top] = self.fx
        total[1, self.top] = -self.fy
        for axis in (0, 1):
            np.add.at(total[axis], i, on_i[:, axis])
            np.subtract.at(total[axis], j[pair], on_i[pair, axis])
        np.subtract.at(total[2], i, ft)
        np.subtract.at(total[2], j[pair], ft[pair])
        return _frozen(total.ravel().astype(np.float64))

    @property
    def _contact_forces(self) -> tuple[NDArray, NDArray, NDArray]:
        """f_n, f_t and n of the contacts; of a compensated packing in long doubles, which keep what low parts add."""
        if not self.compensated:
            return self.normal_force, self.tangential_force, self.geometry.normal
        _, branch, overlap = self._measured
        delta = np.add(*overlap, dtype=np.longdouble)
        low = self.contacts.slip_low
        slip = np.add(self.contacts.slip, 0.0 if low is None else low, dtype=np.longdouble)
        between = np.add(*branch, dtype=np.longdouble)
        distance = np.sqrt(np.sum(between * between, axis=1))
        distance[self.contacts.floor] = between[self.contacts.floor, 1]
        normal = between / distance[:, None]
        return self.law.normal_force(delta), self.law.tangential_force(delta, slip), normal

    def moved(
        self,
        position: ArrayLike,
        angle: ArrayLike,
        contacts: Contacts,
        position_low: ArrayLike | None = None,
        fx: float | None = None,
    ) -> "Packing":
        """The same disks elsewhere; only what is new is checked.

        Parameters
        ----------
        position, angle, contacts, position_low
            As of the class.
        fx : float, optional
            Force along x on each disk of the upper layer; as it was by default.
        """
        n = len(self)
        if len(contacts) and max(contacts.i.max(), contacts.j.max()) >= n:
            raise ValueError(f"A contact names a disk beyond the last one, {n - 1}.")
        other = object.__new__(Packing)
        other.__dict__.update({name: getattr(self, name) for name in self.__dataclass_fields__})
        other.__dict__.update(
            position=_frozen(_floats("position", position, (n, 2))),
            angle=_frozen(_floats("angle", angle, (n,))),
            contacts=contacts,
            position_low=None if position_low is None else _frozen(_floats("position_low", position_low, (n, 2))),
        )
        if fx is not None:
            other.__dict__["fx"] = fx
        return other

    def loaded(self, least: float) -> "Packing":
        """The packing without the contacts that carry no more than a given force.

        A disk that nothing holds comes to rest just about touching another, with an overlap, and so a stiffness, that
        is rounding noise: of order (force / k_n)^(1/3), which is not small.

        Parameters
        ----------
        least : float
            Normal force that a contact has to exceed.
        """
        kept = self.normal_force > least
        if np.all(kept):
            return self
        low = self.contacts.slip_low
        contacts = Contacts(
            self.contacts.i[kept], self.contacts.j[kept], self.contacts.slip[kept], None if low is None else low[kept]
        )
        return replace(self, contacts=contacts)

    @property
    def residual(self) -> float:
        """Largest |(Fx, Fy, T/R)| on a disk that has a contact, force; zero if none has.

        A rattler of the upper layer would fall under the load: it has no balance to miss and is not counted.
        """
        per_disk = np.linalg.norm(self.net_force.reshape(3, -1), axis=0)
        return float(np.delete(per_disk, self.rattlers).max(initial=0.0))


def nearest_image(difference: Floats, box_length: float | None) -> Floats:
    """Coordinate differences, shape (..., 2), brought to the nearest periodic image along x; a new array."""
    difference = np.array(difference, dtype=np.float64)
    if box_length is not None:
        difference[..., 0] -= box_length * np.round(difference[..., 0] / box_length)
    return difference


def touching(position: ArrayLike, radius: ArrayLike, box_length: float | None = None) -> Contacts:
    """Every contact that positions alone imply, with zero slips.

    Parameters
    ----------
    position : array_like, shape (N, 2)
        Centres, length.
    radius : array_like, shape (N,)
        Radii, length.
    box_length : float, optional
        Period along x.

    Returns
    -------
    Contacts
        All pairs with positive overlap, and all disks that reach below y = 0.

    Raises
    ------
    ValueError
        If a number is not finite, shapes do not fit, or the box is narrower than two largest diameters.
    """
    radius = _floats("radius", radius, np.shape(radius))
    position = _floats("position", position, (len(radius), 2))
    _check_box(radius, box_length)
    wrapped = position.copy()
    if box_length is not None:
        wrapped[:, 0] %= box_length
        wrapped[wrapped[:, 0] >= box_length, 0] = 0.0  # a tiny negative x modulo L rounds to L
    tree = cKDTree(wrapped, boxsize=None if box_length is None else [box_length, 0.0])
    i, j = tree.query_pairs(2 * radius.max(), output_type="ndarray").T
    branch = separation(position[i], None, position[j], None, box_length)
    near = overlap_and_distance(branch, exact_sum(radius[i], radius[j]))[0][0] > 0
    floor = np.flatnonzero(radius - position[:, 1] > 0)
    return Contacts(
        np.concatenate([i[near], floor]),
        np.concatenate([j[near], np.full(len(floor), FLOOR)]),
        np.zeros(near.sum() + len(floor)),
    )


def _canonical(i: Indices, j: Indices) -> bool:
    """Whether contacts are in the order in which they are kept, each of them once."""
    floor, disks = j == FLOOR, int(i.max(initial=0)) + int(j.max(initial=0)) + 2
    place = np.where(floor, disks * disks, disks * i + j) + np.where(floor, i, 0)
    return bool(np.all((i < j) | floor) and np.all(place[1:] > place[:-1]))


def _ordered(i: Indices, j: Indices) -> tuple[Indices, Indices, Indices]:
    """Contacts in the order in which they are kept, and where each was."""
    floor = j == FLOOR
    first = np.where(floor, i, np.minimum(i, j))
    second = np.where(floor, FLOOR, np.maximum(i, j))
    order = np.lexsort((second, first, floor))
    first, second = first[order], second[order]
    twice = (np.diff(first) == 0) & (np.diff(second) == 0)
    if np.any(twice):
        k = np.flatnonzero(twice)[0]
        raise ValueError(f"The contact ({first[k]}, {second[k]}) is listed twice.")
    return first, second, order


def _check_box(radius: Floats, box_length: float | None) -> None:
    # In a narrower box a disk can touch two images of one neighbour, and one slip cannot describe that.
    if box_length is not None and box_length < 4 * radius.max():
        raise ValueError(f"The box length {box_length} is under two largest diameters, {4 * radius.max()}.")


def _frozen(array: NDArray) -> NDArray:
    array.flags.writeable = False
    return array


def _floats(name: str, value: ArrayLike, shape: Iterable[int]) -> Floats:
    array = np.array(value, dtype=np.float64)
    if array.shape != tuple(shape):
        raise ValueError(f"{name} has shape {array.shape}; {tuple(shape)} is needed.")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} holds a value that is not finite.")
    return array


def _integers(name: str, value: ArrayLike) -> Indices:
    array = np.array(value)
    if array.ndim != 1 or not (array.size == 0 or np.issubdtype(array.dtype, np.integer)):
        raise ValueError(f"The contact array {name} must be a list of integers.")
    return array.astype(np.int64)
