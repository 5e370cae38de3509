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

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from types import SimpleNamespace

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm
from scipy.sparse import block_array, csr_array, eye_array
from scipy.sparse.linalg import expm_multiply

from ..arrays import Floats, Matrix, floats
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

CHUNK, LOOKS_PER_CHUNK = 300, 10
"""Stable time steps between two looks at whether a motion has settled, some ten periods of a slow mode; and the rows of
numbers that are kept of these."""

WORK_OF_MOTION = 2e11
"""Multiplications with entries of the operators that one motion may take: three minutes."""

PUSH_OVER_RESIDUAL = 10.0
"""Displacement by a push over that by the residual forces, from which on the push counts: D then is right to a fifth,
and to a hundredth where the two displacements have nothing in common."""


class OneSidedSystem:
    """The equations of one configuration, in mass-weighted coordinates, by K and C of sticking contacts.

    A state has several motions, in columns: `time`, displacement `z` and velocity `v`, shape (E, P), and what contacts
    remember: `p` of sliders, shape (B, P), and `r`, shape (R, P), of contacts with two derivatives. Of the sliders
    `grip` (E, B), `excess` and `viscous_excess` (B, E) are G, Y and Z; of contacts with two derivatives `rates` (R, E)
    has the rates of the overlaps, and `wear` (E, R) is B.

    `changes` says which motions take contacts to another state. `missing` (B, 1) is what contacts that count as at
    Coulomb's bound lack to the bound, force; `residual_force` (E, 1) what is left where the packing is said to rest;
    `stable_step` the largest stable time step.
    """

    def __init__(self, motion: Motion) -> None:
        self.motion, self.configuration = motion, motion.configuration
        c, size, (rates, forces) = motion.configuration, len(motion.active), rescaling_operators(motion.configuration)
        self.stable_step = float(stable_timestep(c)) if size else 1.0
        self.weight = csr_array((1 / motion.root_mass, (motion.active, np.arange(size))), shape=(c.coordinates, size))
        back, s, changes = csr_array(self.weight.T), sliders_of(c), ContactChanges.of(c)
        self.residual_force = np.asarray(back @ c.coordinate_force[:, None])
        self._stiffness, self._damping = fast(motion.stiffness), fast(motion.damping)
        self.grip, self.excess = fast(back @ s.force), fast(s.excess @ self.weight)
        self.viscous_excess = fast(s.viscous_excess @ self.weight * float(motion.dissipative))
        self._rectified, self._viscous = s.rectified[:, None], s.viscous[:, None]
        two = np.flatnonzero(c.contacts.two_derivatives)
        self.rates, self.wear = fast(rates[two] @ self.weight), fast(back @ forces[:, two])
        self._worn = fast(csr_array((s.contact[:, None] == two).astype(float)))  # shape (B, R)
        rows, viscous = (fast(each @ self.weight) for each in (changes.rows, changes.viscous))
        self.changes = replace(changes, rows=rows, viscous=viscous)
        bears = c.contacts.friction - np.linalg.norm(c.contacts.tangential_force, axis=1)
        self.missing = np.maximum(bears, 0.0)[s.contact, None]
        whole = self.weight if c.constraint is None else c.constraint @ self.weight
        self._translations = fast(csr_array(whole)[: c.dimension * len(c)])

    @classmethod
    def of(cls, packing: HasConfiguration) -> "OneSidedSystem":
        """Of a configuration, with its own dashpots and drag."""
        return cls(Motion.of(packing, sliding=False))

    @property
    def remembers_nothing(self) -> bool:
        """Whether motion is linear: no contact at the bound, and none with two derivatives."""
        return not self.excess.shape[0] and not self.rates.shape[0]

    def start(self, velocity: Floats) -> SimpleNamespace:
        """The state at rest in the equilibrium, but for velocities of all coordinates, shape (coordinates, P)."""
        v = self.motion.root_mass[:, None] * velocity[self.motion.active]
        p, r = (np.zeros((matrix.shape[0], v.shape[1])) for matrix in (self.excess, self.rates))
        return SimpleNamespace(time=0.0, z=np.zeros_like(v), v=v, p=p, r=r)

    def steps(
        self, state: SimpleNamespace, time_step: float, rise: Floats | None = None, constant: Floats | float = 0.0
    ) -> Iterator[SimpleNamespace]:
        """One step of velocity Verlet after the other, each of which changes the state; with mass-weighted forces that
        rise, per time, and those that are always there."""
        force = self._force(state, rise) + constant
        while True:
            state.v += 0.5 * time_step * force
            change = time_step * state.v
            state.z += change
            state.time += time_step
            if len(state.r):
                state.r += np.abs(self.rates @ change)
            force = self._force(state, rise) + constant
            state.v += 0.5 * time_step * force
            yield state

    def _force(self, state: SimpleNamespace, load: Floats | None) -> Floats:
        """Mass-weighted forces; sliders give way."""
        force = -(self._stiffness @ state.z)
        if self.motion.dissipative:
            force -= self._damping @ state.v
        if load is not None:
            force += state.time * load
        if len(state.r):
            force += self.wear @ state.r
        if len(state.p):
            springs = self.excess @ state.z + self._rectified * (self._worn @ state.r)
            whole = springs + self.viscous_excess @ state.v
            np.maximum(state.p, np.where(self._viscous, whole, springs), out=state.p)
            force -= self.grip @ np.maximum(state.p, whole)
        return np.asarray(force)

    def advance(self, state: SimpleNamespace, time: float, share: float, rise: Floats | None = None) -> None:
        """Go on to a time, in equal steps of no more than a share of the stable one; `rise` as of `steps`."""
        count = int(np.ceil((time - state.time) / (share * self.stable_step) - 1e-9))
        if count > 0:
            for _ in islice(self.steps(state, (time - state.time) / count, rise), count):
                pass
            state.time = time

    def displacement(self, z: Floats) -> Floats:
        """Displacements of the particles, shape (N, d, P), of mass-weighted coordinates in columns."""
        c = self.configuration
        return np.asarray((self._translations @ z).reshape(c.dimension, len(c), -1).transpose(1, 0, 2))

    def mean_square_displacement(self, z: Floats) -> Floats:
        """D of mass-weighted coordinates in columns, shape (P,)."""
        return np.asarray(np.sum((self._translations @ z) ** 2, axis=0) / len(self.configuration))


def fast(matrix: csr_array) -> Matrix:
    """A sparse matrix in the form that is faster for products with a few columns."""
    # ten times as fast for 60 coordinates and fewer
    return matrix.toarray() if np.prod(matrix.shape) <= 150**2 else csr_array(matrix)


def follow(
    system: OneSidedSystem, velocity: Floats, span: float, rise: Floats | None = None, beside: bool = False
) -> Iterator[SimpleNamespace]:
    """What motions have done so far, after one span of time after the other; every stable step is looked at.

    `velocity` of the start has all coordinates, and `rise`, mass-weighted forces per time, those of the motion. With
    `beside` two more motions are followed from rest: of what contacts lack to the bound, as a force; and of the
    residual forces.

    Yields
    ------
    SimpleNamespace
        Rows, one a look, `LOOKS_PER_CHUNK` a span, L so far: `time`, shape (L,); mean kinetic energies `energy`,
        largest D `size`; `first`, the smallest multiples of the motions that take a contact to another state, and
        `size_at_first`, their D there, shape (L, P); and `slid` and `paths`, p and r at the end of the look, shapes
        (L, B, P) and (L, R, P).
    """
    if beside:
        velocity = np.hstack([velocity, np.zeros((len(velocity), 2))])
        rise = None if rise is None else np.hstack([rise, np.zeros((len(rise), 2))])
    state, rows = system.start(velocity), list[tuple[Floats | float, ...]]()
    constant = np.zeros_like(state.z)
    if beside:
        constant[:, -2:] = np.hstack([-(system.grip @ system.missing), system.residual_force])
    span /= LOOKS_PER_CHUNK
    count, every = max(int(np.ceil(span / (VERDICT_STEP * system.stable_step) - 1e-9)), 1), round(1 / VERDICT_STEP)
    names = "time", "energy", "size", "first", "size_at_first", "slid", "paths"
    while True:
        steps, seen = system.steps(state, span / count, rise, constant), []
        for k in range(1, count + 1):
            next(steps)
            if k % every == 0 or k == count:
                seen.append([each.copy() for each in (state.z, state.v, state.p, state.r)])
        z, v, p, r = (np.hstack(each) for each in zip(*seen, strict=True))
        looks = system.mean_square_displacement(z), system.changes.first(z, v, p, r), np.sum(v**2, axis=0)
        size, first, energy = (each.reshape(len(seen), -1) for each in looks)
        at = first.argmin(axis=0), np.arange(size.shape[1])
        row = energy.mean(axis=0), size.max(axis=0), first[at], size[at], state.p.copy(), state.r.copy()
        rows.append((state.time, *row))
        if len(rows) % LOOKS_PER_CHUNK == 0:
            yield SimpleNamespace(**dict(zip(names, map(np.array, zip(*rows, strict=True)), strict=True)))


def least_scale(seen: SimpleNamespace) -> float:
    """The multiple of some motions from which on neither what contacts lack to the bound nor residual forces count, by
    their first looks, `beside` them; infinite if residual forces alone take a contact to another state."""
    if seen.first[:LOOKS_PER_CHUNK, -1].min() < 1:
        return np.inf
    size = seen.size[:LOOKS_PER_CHUNK].max(axis=0)
    return PUSH_OVER_RESIDUAL * float(np.sqrt(size[-2:].max() / size[:-2].min())) if size[-2:].any() else 0.0


@dataclass(frozen=True, eq=False)
class OneSidedMotion:
    """Displacements of the particles from the equilibrium, for the push or the rate of loading as it was given.

    Attributes
    ----------
    times : ndarray, shape (T,)
        Times.
    displacement, velocity : ndarray, shape (T, N, d)
        Length, and length / time.
    slid : ndarray, shape (T, B)
        p of each contact at the bound: the tangential force that its slider has taken away, force.
    scales : tuple of float
        Between which multiples of the push, or of the rate, the motion holds, as it was seen in the first `CHUNK`
        stable steps and at these times: with smaller ones contacts that count as at the bound do not reach it, or the
        residual forces move the packing as well, and with larger ones other contacts reach the bound, open or close, or
        the force of one at the bound turns.
    """

    times: Floats
    displacement: Floats
    velocity: Floats
    slid: Floats
    scales: tuple[float, float]

    @property
    def mean_square_displacement(self) -> Floats:
        """D: mean over the particles of |displacement|^2, length^2, shape (T,)."""
        return np.asarray(np.sum(self.displacement**2, axis=2).mean(axis=1))


def one_sided_motion(
    packing: HasConfiguration, velocity: ArrayLike | None = None, rise: str | ArrayLike | None = None,
    times: ArrayLike = (0.0,),
) -> OneSidedMotion:  # fmt: skip
    """Small motion of a configuration after a push, or under a load that rises, contacts at the bound as they are.

    Parameters
    ----------
    packing : Configuration or Packing
        The equilibrium, with its dashpots and drag.
    velocity : array_like, shape (N, d), optional
        Velocities at t = 0, length / time; none by default. The motion is homogeneous, so that numbers of order one do.
    rise : "fx" or array_like, shape (N, d), optional
        Forces per unit of time that are added to the load, or a unit force on each particle of the upper layer along x;
        none by default.
    times : array_like, shape (T,)
        When to look, increasing, not negative.

    Returns
    -------
    OneSidedMotion
        Particles that touch nothing fly on, with their drag.

    Raises
    ------
    ValueError
        If a shape does not fit, times are not finite and increasing, or rise is "fx" without an upper layer.
    """
    time = np.atleast_1d(np.asarray(times, dtype=np.float64))
    if time.ndim != 1 or not np.all(np.isfinite(time)) or np.any(np.diff(time, prepend=0.0) < 0):
        raise ValueError("The times of a motion are finite, not negative, and in increasing order.")
    system = OneSidedSystem.of(packing)
    c, motion = system.configuration, system.motion
    push = _on_all_coordinates(c, "velocity", velocity)
    load = np.zeros_like(push) if rise is None else forces_on_coordinates(c, rise)
    pull = np.asarray(system.weight.T @ load)
    least, most, end = 0.0, np.inf, min(CHUNK * system.stable_step, float(time[-1]))
    if end:
        beginning = next(follow(system, push, end, pull, beside=True))
        least, most = least_scale(beginning), float(beginning.first[:, 0].min())
    flies = c.coordinate_free.copy()
    flies[motion.active] = False
    free = np.array([push, load / c.coordinate_mass[:, None]]) * flies[:, None]
    drag = c.drag_rate if motion.dissipative else 0.0
    flight = np.array([[0, 1, 0, 0], [0, -drag, 1, 0], [0, 0, 0, 1], [0, 0, 0, 0]])  # of x, v, t g and g
    state, seen = system.start(push), []
    for each in time:
        if system.remembers_nothing:
            _advance_exactly(system.motion, state, float(each), pull)
        else:
            system.advance(state, float(each), MOTION_STEP, pull)
        most = min(most, float(system.changes.first(state.z, state.v, state.p, state.r)[0]))
        moved = []
        for z, row in zip((state.z, state.v), expm(each * flight)[:2], strict=True):
            whole = system.weight @ z + row[1] * free[0] + row[3] * free[1]
            whole = whole if c.constraint is None else c.constraint @ whole
            moved.append(whole[: c.dimension * len(c)].reshape(c.dimension, len(c)).T)
        seen.append((*moved, state.p[:, 0].copy()))
    moved_by, speed, slid = (np.array(each) for each in zip(*seen, strict=True))
    return OneSidedMotion(time, moved_by, speed, slid, (least, most))


def _advance_exactly(motion: Motion, state: SimpleNamespace, time: float, rise: Floats) -> None:
    """Go on to a time, of one linear motion: by the exponential of (z, v, t, 1), to rounding."""
    a, g, size = motion.stiffness, motion.damping, len(state.z)
    omega = float(np.sqrt(abs(a).sum(axis=1).max(initial=0.0))) or 1.0  # so that both halves weigh as much
    pull, clock = csr_array(np.hstack([rise, 0 * rise])), csr_array([[0.0, 1.0], [0.0, 0.0]])  # of t and 1
    system = block_array([[None, omega * eye_array(size), None], [-a / omega, -g, pull], [None, None, clock]])
    before = np.concatenate([omega * state.z[:, 0], state.v[:, 0], [state.time, 1.0]])
    after = expm_multiply((time - state.time) * csr_array(system), before)
    state.z, state.v, state.time = after[:size, None] / omega, after[size : 2 * size, None], time


def forces_on_coordinates(configuration: Configuration, rise: str | ArrayLike) -> Floats:
    """Forces on particles, shape (N, d), on all coordinates, shape (coordinates, 1): a sum where several move as one.

    "fx" is a unit force on each particle of the upper layer along x; ValueError without one, or of another shape.
    """
    if isinstance(rise, str):
        if rise != "fx" or not configuration.top.any():
            raise ValueError('rise is "fx" of a packing with an upper layer, or an array of forces, shape (N, d).')
        rise = np.outer(configuration.top, np.eye(configuration.dimension)[0])
    whole = _on_all_coordinates(configuration, "rise", rise)
    return whole if configuration.constraint is None else np.asarray((configuration.constraint != 0).T @ whole)


def _on_all_coordinates(configuration: Configuration, name: str, values: ArrayLike | None) -> Floats:
    """Vectors of the particles, shape (N, d), on all coordinates, shape (coordinates, 1); zero by default."""
    whole = np.zeros((configuration.axes, len(configuration)))
    if values is not None:
        whole[: configuration.dimension] = floats(name, values, (len(configuration), configuration.dimension)).T
    return whole.reshape(-1, 1)
