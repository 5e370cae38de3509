r"""Small motion of a packing whose contacts at Coulomb's bound slide on ahead and stick on the way back.

To first order in the displacement q from the equilibrium,

.. math::

    M \ddot q = -K q - C \dot q - G (p + x) + B r + t\, \mathbf g, \qquad
    p_c(t) = \max_{t' \le t} \left(Y_c q + Z_c \dot q + h_c r_c\right)_+, \qquad
    r_c(t) = \int_0^t \left|\dot\delta_c\right| \mathrm dt'

with K and C of sticking contacts, the sliders' G, Y, Z and h of :mod:`~faultgouge.analysis.operators.sliders`, x the
part of the excess that the slider of this package cuts without memory, and the load :math:`t\, \mathbf g` that rises. B
and r are those of laws with two derivatives, one while a contact closes and one while it parts, whose mean is in K
(:func:`~faultgouge.analysis.operators.linearised_contacts.rescaling_operators`). Each contact at the bound is a play
operator; nothing else remembers.

The motion is positively homogeneous of degree one: a times the push (or a times the rate of loading) gives a times the
motion, for a > 0. No amplitude enters. No matrix describes the motion: it may grow where the packing with sticking
contacts is stable, and rest where the packing with sliding contacts is unstable. The equations of a slider
with a load that rises slowly are those of rate-independent plasticity; self-sustained vibration of sliding contacts is
known as flutter (Bigoni and Noselli, J. Mech. Phys. Solids 59, 2208, 2011).

The motion is followed in steps of velocity Verlet, with dashpots at the velocity of the half step, as in LAMMPS.
Without a contact that remembers the motion is linear, and the exponential function of the first-order matrix gives the
motion to rounding.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm
from scipy.sparse import block_array, bsr_array, csr_array, eye_array
from scipy.sparse.linalg import expm_multiply

from ..arrays import Floats, Indices, Matrix, floats
from ..configuration import Configuration
from ..has_configuration import HasConfiguration
from ..operators.contact_changes import ContactChanges
from ..operators.linearised_contacts import rescaling_operators
from ..operators.sliders import sliders_of
from .motion import Motion
from .stable_timestep import stable_timestep

MOTION_STEP = 0.05
"""Time step, as a share of the largest stable one. Beside LAMMPS D is right to some per cent after growth by twelve
decades; with twice the step, to some 8 per cent."""

VERDICT_STEP = 0.3
"""The same where a verdict is wanted: D then is right to 2 %, rates of growth to 3 %, in a third of the time of 0.1."""

WORK_OF_MOTION = 2e11
"""Multiplications with entries of the operators that one motion may take: three minutes."""

DENSE_ENTRIES = 150**2
"""Entries up to which a product with the dense matrix is as fast: ten times as fast for 60 coordinates and fewer."""


@dataclass
class OneSidedState:
    """Several motions at one time, in columns: mass-weighted displacement z and velocity v, shape (E, P), and what
    contacts remember: p of sliders, shape (B, P), and r, shape (R, P), of contacts with two derivatives."""

    time: float
    z: Floats
    v: Floats
    p: Floats
    r: Floats


@dataclass(frozen=True, eq=False)
class OneSidedSystem:
    """The equations of one configuration, assembled once.

    Attributes
    ----------
    motion : Motion
        K and C of sticking contacts.
    step_share : float
        Time step, as a share of the largest stable one.
    """

    motion: Motion
    step_share: float = MOTION_STEP

    @classmethod
    def of(cls, packing: HasConfiguration, step_share: float = MOTION_STEP) -> "OneSidedSystem":
        """Assemble the equations, with the packing's own dashpots and drag."""
        return cls(Motion.of(packing, sliding=False), step_share)

    @cached_property
    def time_step(self) -> float:
        """Longest time step of `advance`, time."""
        configuration = self.motion.configuration
        return self.step_share * float(stable_timestep(configuration)) if len(self.motion.active) else 1.0

    @cached_property
    def mass_weight(self) -> csr_array:
        """M^(-1/2) on the active coordinates, shape (coordinates, E)."""
        m = self.motion
        shape = (m.configuration.coordinates, len(m.active))
        return csr_array((1 / m.root_mass, (m.active, np.arange(len(m.active)))), shape=shape)

    @cached_property
    def _weight_transposed(self) -> csr_array:
        """Its transpose, in rows."""
        return csr_array(self.mass_weight.T)

    @cached_property
    def residual_force(self) -> Floats:
        """Mass-weighted forces that are left where the packing is said to rest, shape (E, 1)."""
        return self.on_active(self.motion.configuration.coordinate_force[:, None])

    def on_active(self, forces: Floats) -> Floats:
        """Mass-weighted forces, shape (E, P), of forces on all coordinates, shape (coordinates, P)."""
        return np.asarray(self._weight_transposed @ forces)

    @cached_property
    def _two_derivatives(self) -> Indices:
        """Numbers of the contacts whose derivatives differ while they close and while they part."""
        return np.flatnonzero(self.motion.configuration.contacts.two_derivatives)

    @cached_property
    def sliders(self) -> tuple[Matrix, Matrix, Matrix, Floats, NDArray[np.bool_]]:
        """G, shape (E, B), Y and Z, shape (B, E), h, and which p remembers dashpots, shape (B, 1)."""
        s = sliders_of(self.motion.configuration)
        if not self.motion.dissipative:
            s.viscous_excess.data[:] = 0.0
        grip = _for_products(self._weight_transposed @ s.force)
        excess, viscous = (_for_products(rows @ self.mass_weight) for rows in (s.excess, s.viscous_excess))
        return grip, excess, viscous, s.rectified[:, None], s.viscous[:, None]

    @cached_property
    def missing_forces(self) -> Floats:
        """What contacts that count as at Coulomb's bound lack to the bound, shape (B, 1), force."""
        c = self.motion.configuration.contacts
        return np.maximum(c.friction - np.linalg.norm(c.tangential_force, axis=1), 0.0)[c.one_sided, None]

    @cached_property
    def contact_changes(self) -> ContactChanges:
        """Which mass-weighted motions take contacts to another state."""
        changes = ContactChanges.of(self.motion.configuration)
        rows, viscous = (_for_products(each @ self.mass_weight) for each in (changes.rows, changes.viscous))
        return replace(changes, rows=rows, viscous=viscous)

    @cached_property
    def sideways(self) -> Matrix:
        """Forces of sliders across f_t by displacements, over the roots of twice the bounds, shape (B, E). Their
        squares are forces by which sliders pass the bound, of second order."""
        changes = self.contact_changes
        rows, weight = len(changes.bound) + changes.slides, 1 / np.sqrt(2 * changes.bound[changes.slides])
        return _for_products(csr_array(weight * changes.rows[rows]))

    @cached_property
    def rescaled(self) -> tuple[Matrix, Matrix, Matrix]:
        """N, shape (R, E), and B, shape (E, R), of the R contacts with two derivatives; h selects, shape (B, R)."""
        rates, forces = rescaling_operators(self.motion.configuration)
        contacts = self.motion.configuration.contacts
        two = self._two_derivatives
        bound = np.flatnonzero(contacts.one_sided)
        here, place = np.isin(bound, two), np.searchsorted(two, bound)
        select = csr_array((np.ones(here.sum()), (np.flatnonzero(here), place[here])), shape=(len(bound), len(two)))
        rows, columns = rates[two] @ self.mass_weight, self._weight_transposed @ forces[:, two]
        return _for_products(rows), _for_products(columns), _for_products(select)

    @cached_property
    def _operators(self) -> tuple[Matrix | bsr_array, Matrix | bsr_array | None]:
        """A and, if there is dissipation, G."""
        m = self.motion
        in_blocks = m.configuration.dimension == 3 and len(m.active) ** 2 > DENSE_ENTRIES
        form = m.in_blocks if in_blocks else _for_products
        return form(m.stiffness), form(m.damping) if m.dissipative else None

    def start(self, velocity: Floats) -> OneSidedState:
        """At rest in the equilibrium, but for velocities of all coordinates, shape (coordinates, P)."""
        v = np.asfortranarray(self.motion.root_mass[:, None] * velocity[self.motion.active])
        count = v.shape[1]
        p, r = (np.zeros((matrix.shape[0], count)) for matrix in (self.sliders[1], self.rescaled[0]))
        return OneSidedState(0.0, np.zeros_like(v), v, p, r)

    def advance(self, state: OneSidedState, time: float, rise: Floats | None = None) -> None:
        """Go on to a time, in equal steps no longer than `time_step`.

        Parameters
        ----------
        state : OneSidedState
            Changes in place.
        time : float
            Not before the time of the state.
        rise : ndarray, shape (coordinates, P), optional
            Forces that rise, per time: the load is t times these.
        """
        count = int(np.ceil((time - state.time) / self.time_step - 1e-9))
        if count < 1:
            return
        load = None if rise is None else self.on_active(rise)
        self.take_steps(state, (time - state.time) / count, count, rise=load)
        state.time = time

    def take_steps(
        self,
        state: OneSidedState,
        time_step: float,
        count: int,
        *,
        rise: Floats | None = None,
        constant: Floats | float = 0.0,
        extrapolates: bool = False,
        look: Callable[[OneSidedState], None] | None = None,
    ) -> None:
        """Take steps of velocity Verlet.

        Parameters
        ----------
        state : OneSidedState
            Changes in place.
        time_step : float
            Of each step, time.
        count : int
            Number of steps.
        rise, constant : ndarray, shape (E, P), optional
            Mass-weighted forces, per time, and those that are always there.
        extrapolates : bool
            Whether dashpots feel 2 v(n + 1/2) - v(n), as those of mindlin/smooth do, in place of v(n + 1/2).
        look : callable, optional
            What looks at the state after each step.
        """
        force = self._force(state, state.v, rise) + constant
        for _ in range(count):
            before = state.v.copy() if extrapolates else 0.0
            state.v += 0.5 * time_step * force
            change = time_step * state.v
            state.z += change
            state.time += time_step
            if len(state.r):
                state.r += np.abs(self.rescaled[0] @ change)
            force = self._force(state, 2 * state.v - before if extrapolates else state.v, rise) + constant
            state.v += 0.5 * time_step * force
            if look is not None:
                look(state)

    @property
    def remembers_nothing(self) -> bool:
        """Whether motion is linear: no contact at the bound, and none with two derivatives."""
        return not self.sliders[1].shape[0] and not self.rescaled[0].shape[0]

    def advance_exactly(self, state: OneSidedState, time: float, rise: Floats | None = None) -> None:
        """As `advance`, of a linear motion: by the exponential of (z, v, t, 1), to rounding."""
        a, g = self.motion.stiffness, self.motion.damping
        size, columns = state.z.shape
        omega = float(np.sqrt(abs(a).sum(axis=1).max(initial=0.0))) or 1.0  # so that both halves weigh as much
        load = np.zeros((size, columns)) if rise is None else self.on_active(rise)
        clock = csr_array([[0.0, 1.0], [0.0, 0.0]])  # of t and 1
        for k in range(columns):
            pull = csr_array(np.column_stack([load[:, k], np.zeros(size)]))
            system = block_array([[None, omega * eye_array(size), None], [-a / omega, -g, pull], [None, None, clock]])
            before = np.concatenate([omega * state.z[:, k], state.v[:, k], [state.time, 1.0]])
            after = expm_multiply((time - state.time) * csr_array(system), before)
            state.z[:, k], state.v[:, k] = after[:size] / omega, after[size : 2 * size]
        state.time = time

    def _force(self, state: OneSidedState, velocity: Floats, load: Floats | None) -> Floats:
        """Mass-weighted forces; sliders give way."""
        stiffness, damping = self._operators
        force = -_product(stiffness, state.z)
        if damping is not None:
            force -= _product(damping, velocity)
        if load is not None:
            force += state.time * load
        if len(state.r):
            force += self.rescaled[1] @ state.r
        if len(state.p):
            grip, excess, viscous_excess, rectified, viscous = self.sliders
            springs = excess @ state.z
            if len(state.r):
                springs += rectified * (self.rescaled[2] @ state.r)
            whole = springs if damping is None else springs + viscous_excess @ velocity
            np.maximum(state.p, np.where(viscous, whole, springs), out=state.p)
            force -= grip @ np.maximum(state.p, whole)
        return force

    def mean_square_displacement(self, z: Floats) -> Floats:
        """D of mass-weighted coordinates in columns, shape (P,)."""
        return np.asarray(np.sum(self.displacement(z) ** 2, axis=1).mean(axis=0))

    def free_flight(self, velocity: Floats, rise: Floats | None, time: float) -> Floats:
        """Displacements and velocities of the coordinates that no contact acts on, zero of the others.

        Parameters
        ----------
        velocity : ndarray, shape (coordinates, P)
            At t = 0.
        rise : ndarray, shape (coordinates, P), optional
            Forces per time.
        time : float
            After which time, shape of the result (2, coordinates, P).
        """
        c = self.motion.configuration
        flies = c.coordinate_free.copy()
        flies[self.motion.active] = False
        drag = c.drag_rate if self.motion.dissipative else 0.0
        of_both = expm(time * np.array([[0, 1, 0, 0], [0, -drag, 1, 0], [0, 0, 0, 1], [0, 0, 0, 0]]))[:2]
        gain = np.zeros_like(velocity) if rise is None else rise / c.coordinate_mass[:, None]
        return np.array([np.where(flies[:, None], v * velocity + g * gain, 0.0) for _, v, _, g in of_both])

    @cached_property
    def _translations(self) -> Matrix:
        """Displacements of the particles along the axes, shape (d N, E), by mass-weighted coordinates."""
        c = self.motion.configuration
        whole = self.mass_weight if c.constraint is None else c.constraint @ self.mass_weight
        return _for_products(csr_array(whole)[: c.dimension * len(c)])

    def displacement(self, z: Floats, flight: Floats | None = None) -> Floats:
        """Displacements of the particles, shape (N, d, P), of mass-weighted coordinates, and of `free_flight`."""
        c = self.motion.configuration
        q = self._translations @ z
        if flight is not None:
            q += (flight if c.constraint is None else c.constraint @ flight)[: len(q)]
        return np.asarray(q.reshape(c.dimension, len(c), -1).transpose(1, 0, 2))


def _for_products(matrix: csr_array) -> Matrix:
    """A sparse matrix in the form that is faster for products with a few columns."""
    return matrix.toarray() if np.prod(matrix.shape) <= DENSE_ENTRIES else csr_array(matrix)


def _product(matrix: Matrix | bsr_array, columns: Floats) -> Floats:
    """Products with columns: of blocks one by one, which takes less than half of the time of all at once."""
    if not isinstance(matrix, bsr_array):
        return np.asarray(matrix @ columns)
    made = np.empty(columns.shape, order="F")
    for k in range(columns.shape[1]):
        made[:, k] = matrix @ columns[:, k]
    return made


def forces_on_coordinates(configuration: Configuration, rise: str | ArrayLike) -> Floats:
    """Forces on particles, shape (N, d), on all coordinates, shape (coordinates, 1): a sum where several move as one.

    "fx" is a unit force on each particle of the upper layer along x.

    Raises
    ------
    ValueError
        If the shape does not fit, or there is no upper layer.
    """
    if isinstance(rise, str):
        if rise != "fx" or not configuration.top.any():
            raise ValueError('rise is "fx" of a packing with an upper layer, or an array of forces, shape (N, d).')
        rise = np.outer(configuration.top, np.eye(configuration.dimension)[0])
    whole = on_all_coordinates(configuration, "rise", rise)
    return whole if configuration.constraint is None else np.asarray((configuration.constraint != 0).T @ whole)


def on_all_coordinates(configuration: Configuration, name: str, values: ArrayLike | None) -> Floats:
    """Vectors of the particles, shape (N, d), on all coordinates, shape (coordinates, 1); zero by default."""
    whole = np.zeros((configuration.axes, len(configuration)))
    if values is not None:
        whole[: configuration.dimension] = floats(name, values, (len(configuration), configuration.dimension)).T
    return whole.reshape(-1, 1)
