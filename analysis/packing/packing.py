r"""A packing of frictional disks, the data type that all parts exchange.

Two disks touch when :math:`\delta = R_i + R_j - r > 0`, with :math:`r` the length of the branch vector :math:`\mathbf
r_i - \mathbf r_j` (nearest image along x in a periodic box). :math:`\mathbf n = (\mathbf r_i - \mathbf r_j)/r` points
to i and :math:`\boldsymbol\tau = \hat z \times \mathbf n = (-n_y, n_x)`. The history of a contact is one number, the
slip s along :math:`\boldsymbol\tau`. The slip does not change under exchange of i and j: the normal, the relative
motion and the tangent all change sign. The flat floor at y = 0 is a partner with :math:`\mathbf n = (0, 1)`,
:math:`\boldsymbol\tau = (-1, 0)`, :math:`\delta = R - y` and a normal that never turns.

With the coordinates :math:`q = (x_1..x_N, y_1..y_N, u_1..u_N)`, :math:`u_i = R_i \theta_i`, the forces are
:math:`(F_x, F_y, T/R)`; a contact puts :math:`f_n \mathbf n + f_t \boldsymbol\tau` on i, the opposite on j,
and :math:`-f_t` as T/R on both, because the lever arm is the full radius. Each disk of the upper layer also carries the
force :math:`(f_x, -f_y)`.

Coordinates and slips are doubles, or doubles with low parts (:mod:`~faultgouge.analysis.packing.compensated`) in
compensated arithmetic.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, diags_array

from ..arrays import (
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
)
from ..assembly import spring_of_layer
from ..configuration import Configuration
from ..counted import counted
from .compensated import DoubleDouble
from .contacts import Contacts
from .disk_operators import Form, assemble_stiffness, contact_terms
from .geometry import ContactGeometry, check_box, contact_geometry
from .law import Derivatives, MindlinLaw
from .linearise import linearise_contacts


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Packing(EqualToTheBit):
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
        Low parts of the coordinates, length, of a packing in compensated arithmetic; none by default.
    drag_time : float, optional
        tau of the drag -(m/tau) v and -(I/tau) omega on every disk, time, positive; no drag by default.
    slips_known : bool
        Whether the slips are known, or were taken as zero because nothing is known of the tangential forces. Whether a
        packing of unknown slips is stable is not known either.
    spring : float
        Stiffness of a spring that draws the upper layer, force / length on each of its disks, as of a
        :class:`~faultgouge.analysis.Configuration`; its force is fx. None by default.

    Raises
    ------
    ValueError
        If a shape does not fit, a number is not finite or has the wrong sign, a contact names a disk that does not
        exist, or the box is so narrow that a disk could touch two images of another disk.
    """

    position: Floats
    radius: Floats
    contacts: Contacts
    law: MindlinLaw
    angle: Floats = BY_DEFAULT
    mass: Floats = BY_DEFAULT
    inertia_factor: float = 1.0
    box_length: float | None = None
    top: Booleans = BY_DEFAULT
    fx: float = 0.0
    fy: float = 0.0
    position_low: Floats | None = None
    drag_time: float | None = None
    slips_known: bool = True
    spring: float = 0.0

    def __post_init__(self) -> None:
        n = np.size(self.radius)
        if n == 0:
            raise ValueError("A packing needs at least one disk.")
        usual = {"angle": np.zeros(n), "mass": np.ones(n), "top": np.zeros(n, bool)}
        given = {name: getattr(self, name) for name in self.__dataclass_fields__}
        given |= {name: value for name, value in usual.items() if given[name] is None}
        for name in ("radius", "mass"):
            given[name] = positive_each(name, given[name], (n,))
        for name, shape in {"position": (n, 2), "angle": (n,), "position_low": (n, 2)}.items():
            given[name] = None if given[name] is None else floats(name, given[name], shape)
        for name in ("inertia_factor", "box_length", "drag_time", "fx", "fy", "spring"):
            positive = name not in ("fx", "fy", "spring")
            given[name] = None if given[name] is None else number(name, given[name], positive=positive)
        given |= {"top": exactly("top", given["top"], n, np.bool_), "slips_known": bool(self.slips_known)}
        set_frozen(self, **given)
        check_box(self.radius, self.box_length)
        _check_partners(self.contacts, n)

    def __len__(self) -> int:
        return len(self.radius)

    def __repr__(self) -> str:
        box = "open sides" if self.box_length is None else f"period {self.box_length:g}"
        disks = f"{counted(len(self), 'disk')}, {counted(len(self.contacts), 'contact')}, {int(self.top.sum())}"
        load = f"mu = {self.law.mu:g}, fx = {self.fx:g}, fy = {self.fy:g}{', compensated' * self.compensated}"
        return f"<Packing: {disks} in the upper layer, {box}, {load}>"

    dimension = 2
    axes = 3
    """Coordinates of each disk: x, y and R theta."""

    planes = ((1, 1.0, 0.0),)
    """The floor: its axis, the sign along it of its inner side, and its place; as of a Configuration."""

    @property
    def in_words(self) -> str:
        """Load, and how many disks."""
        return f"F_x = {self.fx:g}, F_y = {self.fy:g}: {counted(len(self), 'disk')}"

    @property
    def slip_share(self) -> Floats:
        """|s|/t* of each contact, shape (C,); zero without friction."""
        return ratio(np.abs(self.contacts.slip), self.law.slip_limit(self.geometry.overlap))

    @property
    def coordinates(self) -> int:
        """Number of all coordinates, 3N."""
        return 3 * len(self)

    @property
    def coordinate_mass(self) -> Floats:
        """Masses of the coordinates (x.., y.., R theta..), shape (3N,)."""
        return np.concatenate([self.mass, self.mass, self.inertia_factor * self.mass])

    @property
    def damped(self) -> bool:
        """Whether there are dashpots or drag."""
        return self.law.damped or self.drag_time is not None

    @property
    def sliding(self) -> Booleans:
        """Which contacts are at Coulomb's bound, shape (C,); none without friction."""
        return self.law.at_bound(self.geometry.overlap, self.contacts.slip)

    @property
    def contact_states(self) -> bytes:
        """State of the contacts: their disks, which of them slide, and in which direction; equal for equal states."""
        slides = np.sign(self.contacts.slip) * self.sliding
        return np.array([self.contacts.i, self.contacts.j, slides], dtype=np.int64).tobytes()

    @property
    def load_error(self) -> float:
        """r / n^(1/2) of a residual r and n top disks, force per disk: the shift of the load that balances r.

        Rounding leaves random forces of r or less on the disks. Their mean over n disks acts as a load.
        """
        return self.residual / float(np.sqrt(max(1, self.top.sum())))

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
        """Rounding error of a coordinate, length: its last place, or the last place of its low part."""
        if not self.compensated:
            return float(np.finfo(float).eps * np.abs(self.position).max())
        exponent = int(np.frexp(2 * self.radius.max())[1])
        return float(np.ldexp(1.0, exponent - 26 - 52))

    @cached_property
    def configuration(self) -> Configuration:
        """The disks with their contacts to first order."""
        g, c, n = self.geometry, self.contacts, len(self)
        flat = np.zeros(len(c))
        arms = np.column_stack([self.radius[c.i], np.where(c.floor, 0.0, self.radius[c.j])])
        contacts = linearise_contacts(
            self.law, g.overlap, c.slip, np.column_stack([g.tangent, flat]), i=c.i, j=c.j, slip_arm=arms,
            lever_arm=arms, normal=np.column_stack([g.normal, flat]), distance=np.where(c.floor, np.inf, g.distance),
        )  # fmt: skip
        load = np.zeros((n, 2, 3))
        load[self.top, 0, :2] = self.fx, -self.fy
        return Configuration(
            dimension=2, position=self.position, radius=self.radius, mass=self.mass,
            inertia=self.inertia_factor * self.mass * self.radius**2, contacts=contacts,
            box=np.diag([self.box_length or 0.0, 0.0, 0.0]), origin=np.zeros(3),
            periodic=np.array([self.box_length is not None, False, False]), load=load, fx=self.fx,
            load_error=self.load_error, top=self.top, drag_rate=1 / self.drag_time if self.drag_time else 0.0,
            slips_known=self.slips_known or not self.law.frictional, spring=self.spring,
        )  # fmt: skip

    @cached_property
    def geometry(self) -> ContactGeometry:
        """Normals, tangents, distances and overlaps of the contacts."""
        return self._exact_geometry[0]

    @cached_property
    def _exact_geometry(self) -> tuple[ContactGeometry, DoubleDouble, DoubleDouble]:
        """The geometry, and the branch vectors and overlaps with their low parts."""
        return contact_geometry(self.position, self.position_low, self.radius, self.contacts, self.box_length)

    @property
    def normal_force(self) -> Floats:
        """f_n of each contact, force, shape (C,)."""
        return self.law.normal_force(self.geometry.overlap)

    @property
    def tangential_force(self) -> Floats:
        """f_t of each contact along tau, force, shape (C,)."""
        return self.law.tangential_force(self.geometry.overlap, self.contacts.slip)

    @property
    def mobilised(self) -> Floats:
        """|f_t|/(mu f_n), the mobilised fraction of Coulomb's bound, shape (C,); zero without friction."""
        return ratio(np.abs(self.tangential_force), self.law.mu * self.normal_force)

    @cached_property
    def rattlers(self) -> Indices:
        """Indices of the disks that touch nothing; their rows of the stability operator are zero."""
        closed = self.geometry.overlap > 0
        touch = np.union1d(self.contacts.i[closed], self.contacts.j[closed])
        return frozen(np.setdiff1d(np.arange(len(self)), touch))

    @cached_property
    def net_force(self) -> Floats:
        """Force on every coordinate, load included: (Fx_1.., Fy_1.., T_1/R_1..), shape (3N,).

        For a compensated packing the sum is in numpy's long doubles, which have 64 bits on x86.
        """
        c, pair = self.contacts, ~self.contacts.floor
        i, j, fn, ft, normal = c.i, c.j, self.normal_force, self.tangential_force, self.geometry.normal
        if self.compensated:
            _, branch, overlap = self._exact_geometry
            delta, between = np.add(*overlap, dtype=np.longdouble), np.add(*branch, dtype=np.longdouble)
            slip = np.add(c.slip, 0.0 if c.slip_low is None else c.slip_low, dtype=np.longdouble)
            distance = np.sqrt(np.sum(between * between, axis=1))
            distance[c.floor] = between[c.floor, 1]
            fn, ft = self.law.normal_force(delta), self.law.tangential_force(delta, slip)
            normal = between / distance[:, None]
        on_i = np.column_stack([fn * normal[:, 0] - ft * normal[:, 1], fn * normal[:, 1] + ft * normal[:, 0]])
        total = np.zeros((3, len(self)), fn.dtype)
        total[0, self.top] = self.fx
        total[1, self.top] = -self.fy
        for axis in (0, 1):
            np.add.at(total[axis], i, on_i[:, axis])
            np.subtract.at(total[axis], j[pair], on_i[pair, axis])
        np.subtract.at(total[2], i, ft)
        np.subtract.at(total[2], j[pair], ft[pair])
        return frozen(total.ravel().astype(np.float64))

    def moved(
        self,
        position: ArrayLike,
        angle: ArrayLike,
        contacts: Contacts,
        position_low: ArrayLike | None = None,
        fx: float | None = None,
    ) -> "Packing":
        """The same disks at other positions; only the new values are checked. fx is unchanged by default."""
        n = len(self)
        _check_partners(contacts, n)
        return derive_frozen(
            self, position=floats("position", position, (n, 2)), angle=floats("angle", angle, (n,)), contacts=contacts,
            position_low=None if position_low is None else floats("position_low", position_low, (n, 2)),
            fx=self.fx if fx is None else number("fx", fx),
        )  # fmt: skip

    def with_dissipation(self, cn: float = 0.0, ct: float = 0.0, drag_time: float | None = None) -> "Packing":
        """The same equilibrium with dashpots of every contact and drag, by default none: they have no part in where a
        packing rests."""
        return replace(self, law=replace(self.law, cn=cn, ct=ct), drag_time=drag_time)

    def loaded(self, least: float) -> "Packing":
        """The packing without the contacts whose normal force does not exceed a given one. A disk that nothing holds
        comes to rest barely touching another: the stiffness of this contact is rounding, of order (force /
        k_n)^(1/3)."""
        kept, c = self.normal_force > least, self.contacts
        low = None if c.slip_low is None else c.slip_low[kept]
        return self if np.all(kept) else replace(self, contacts=Contacts(c.i[kept], c.j[kept], c.slip[kept], low))

    @property
    def smallest_overlap(self) -> float:
        """Smallest overlap of contacts that carry more than the imbalance, length; infinite without contacts."""
        return float(self.loaded(self.residual).geometry.overlap.min(initial=np.inf))

    @property
    def residual(self) -> float:
        """Largest |(Fx, Fy, T/R)| on a disk that has a contact, force; zero if none has.

        A rattler of the upper layer would fall under the load: it cannot be in balance and is not counted.
        """
        per_disk = np.linalg.norm(self.net_force.reshape(3, -1), axis=0)
        return float(np.delete(per_disk, self.rattlers).max(initial=0.0))

    def assembled_stiffness(
        self,
        *,
        form: Form = "consistent",
        coupled: Booleans | None = None,
        parting: ArrayLike = 0.5,
        sliding: ArrayLike = False,
    ) -> csr_array:
        """K = -dF/dq; see :func:`~faultgouge.analysis.stiffness_matrix`."""
        law = self.law.derivatives(self.geometry.overlap, self.contacts.slip, parting, sliding)
        if coupled is not None:
            law = law._replace(overlap_derivative=np.where(coupled, law.overlap_derivative, 0.0))
        matrix = self._assembled(law, form)
        return csr_array(matrix + spring_of_layer(self.spring, self.top, self.coordinates)) if self.spring else matrix

    def assembled_damping(self, sliding: ArrayLike = False) -> csr_array:
        """C = -dF/d(dq/dt); see :func:`~faultgouge.analysis.damping_matrix`."""
        along, across = self.law.dashpots(self.geometry.overlap, self.contacts.slip, sliding)
        zero = np.zeros_like(along)
        # K has N N^T times the normal and T T^T times the tangential stiffness
        matrix = self._assembled(Derivatives(zero, zero, along, -across, zero))
        if self.drag_time is None:
            return matrix
        return csr_array(matrix + diags_array(self.coordinate_mass / self.drag_time))

    def _assembled(self, law: Derivatives, form: Form = "consistent") -> csr_array:
        """K of contacts with these derivatives."""
        c, g, pairs = self.contacts, self.geometry, int(np.count_nonzero(~self.contacts.floor))
        terms = contact_terms(law, g.normal.T, g.distance, pairs, form)
        return assemble_stiffness(terms, c.i, c.j[:pairs], len(self))


def _check_partners(contacts: Contacts, disks: int) -> None:
    if len(contacts) and max(contacts.i.max(), contacts.j.max()) >= disks:
        raise ValueError(f"A contact names a disk beyond the last one, {disks - 1}.")
