r"""Transient gain: how far a packing that is linearly stable moves away before it comes back.

Below the onset all eigenvalues are real and positive, and every motion of the linearised packing is a sum of
oscillations. K is not symmetric, though, its modes are oblique, and a start that is a small difference of two nearly
parallel modes becomes their sum once their phases differ by :math:`\pi`. The gain is the largest growth over all starts
and over the time t,

.. math:: \mathcal G(t) = \max_{q_0} \frac{|q(t)|^2}{|q_0|^2} = \|P(t)\|_2^2 .

**Displacement.** q is (x.., y.., R theta..), the start is a displacement at rest, and P(t) is the propagator of
:math:`M \ddot q + C \dot q + K q = 0`; without dissipation :math:`P = M^{-1/2} \cos(A^{1/2} t) M^{1/2}`.

**Energy.** The start is any displacement and any velocity, and the norm is the energy
:math:`\tfrac12 \dot q^T M \dot q + \tfrac12 q^T K_s q` with the symmetric part :math:`K_s` of K; P(t) is
:math:`e^{Zt}` of :mod:`~faultgouge.analysis.state_space`. Were K symmetric, both gains would be 1: the
antisymmetric part of K alone makes them larger. (See Trefethen and Embree, *Spectra and Pseudospectra*, 2005, for what
eigenvalues do not tell of such matrices.)

**The maximum.** With the modes x, the rows l of the inverse of their matrix and the functions f of the eigenvalues,
:math:`P(t) = \sum_k f_k(t)\, x_k l_k^H`. Close to an onset two terms have most of it, those of the pair that is about
to coalesce, :math:`|x_k| |l_k| = \kappa`: the gain is close to :math:`4\kappa^2` where their phases have come apart by
:math:`\pi`, at the beat time :math:`\pi/(\omega_1 - \omega_2)`. It grows as the inverse of the distance from the onset,
the amplitude and the time as its inverse root. Farther away several pairs share in it. So P is sampled on the few modes
with large :math:`|x_k| |l_k|`, `SAMPLES` times a period, over a window of time that is stated with the result; at the
best of these times the largest singular value of the whole propagator is found by Lanczos iteration, and its time is
refined. What is returned has been attained by the start that is returned.

Whether a later time has a larger gain no window tells, as the frequencies are incommensurate. But P is never larger
than :math:`\|X S\|_2 \|S^{-1} X^{-1}\|_2` with any scaling S of the modes, since no :math:`|f_k|` exceeds 1; with the
scaling that makes :math:`|x_k| = |l_k|` the square of this, `bound`, is close to the gain wherever one pair dominates
(the displacement, without dissipation; the energy, always).
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, svds

from .errors import FaultgougeError
from .matrix_functions import WELL_CONDITIONED, Modes, first_order, second_order
from .oscillator import Oscillator
from .packing import Floats, Indices, Packing
from .spectrum import Complexes
from .state_space import StateSpace, released
from .stiffness import Form

Norm = Literal["displacement", "energy"]

OBLIQUE = 1.1
"""Modes with a larger |x| |l| have a part in the sampling: 1 is what a mode of a symmetric matrix has."""

SHARE = 0.05
"""And of these the ones with this share of the largest."""

LEAST, MOST = 4, 16
"""The fewest and the most modes that are sampled; with dissipation a motion is two of them."""

ALONE = 100
"""Length of the window, in periods, where the most oblique mode has no partner among these."""

SAMPLES = 8
"""Times a period: a phase between two of them is off by no more than pi/8, which costs 8 % and is refined away."""

BEATS = 10
"""Length of the window, in beats of the most oblique pair; for long beats fewer, see `PERIODS`. With dissipation the
window ends where the bound, which falls with the slowest mode, leaves no gain."""

PERIODS = 20_000
"""The window of more than 1.5 beats has no more periods of the most oblique mode than these."""

NOISE = 1e-7
"""Growth rates and differences of frequencies below this share of the largest frequency are rounding where two modes
are about to coalesce: the root of that of a well-conditioned eigenvalue."""

SLOW = 1e-10
"""The same with dissipation, which keeps modes from coalescing."""

SYMMETRIC = 1e-6
"""An excess of the bound below this is no gain: K is symmetric, but for rounding."""

ACCURACY = 1e-9
"""Relative error of the largest singular value."""

CANDIDATES = 6
"""Maxima of the sampled modes at which the whole propagator is looked at, and besides the largest of each of so many
octaves of time: at t = 0 the whole propagator is one, but some of its modes alone make an oblique projector."""

REFINED = 6
"""Of these, the ones whose time is refined."""

MOST_DISKS = 300
"""Disks up to which commands compute the gain unasked."""

CHUNK = 4096
"""Times that are sampled at once."""


class NoGainError(FaultgougeError):
    """A packing without a transient gain: it is unstable, or has no energy."""


@dataclass(frozen=True, eq=False)
class TransientGain:
    """The largest transient growth of a stable packing.

    Attributes
    ----------
    gain : float
        |q(time)|^2 / |q(0)|^2, or the ratio of the energies.
    time : float
        When it is reached.
    start : ndarray, shape (3N,)
        The displacement (x.., y.., R theta..) that reaches it. Of norm 1, or with the velocity of energy 1/2.
    velocity : ndarray, shape (3N,)
        Its velocity at the start; zero for the displacement.
    norm : {"displacement", "energy"}
        What has grown.
    window : float
        The times from 0 to this were searched.
    bound : float
        No later time has a larger gain; inf where no bound is known.
    """

    gain: float
    time: float
    start: Floats
    velocity: Floats
    norm: Norm
    window: float
    bound: float

    @property
    def disk(self) -> int:
        """The worst disk to push: that which the start displaces farthest."""
        return int(np.argmax(np.linalg.norm(self.start.reshape(3, -1)[:2], axis=0)))

    @property
    def direction(self) -> Floats:
        """In which direction, a unit vector (x, y)."""
        push = self.start.reshape(3, -1)[:2, self.disk]
        return np.asarray(push / np.linalg.norm(push))

    @property
    def lone_gain(self) -> float:
        """At least this is what a displacement of that disk alone grows by; nan if the norm is the energy."""
        if self.norm == "energy":
            return np.nan
        return self.gain * float(np.sum(self.start.reshape(3, -1)[:2, self.disk] ** 2))


def transient_gain(
    packing: Packing, norm: Norm = "displacement", window: float | None = None, form: Form = "consistent"
) -> TransientGain:
    """The largest transient gain of a stable packing, with its dashpots and drag.

    Parameters
    ----------
    packing : Packing
        The equilibrium.
    norm : {"displacement", "energy"}
        Displacements from rest in the norm of (x, y, R theta), or all states in the norm of the energy.
    window : float, optional
        Search the times from 0 to this; by default `BEATS` beats of the most oblique pair.
    form : {"consistent", "paper"}
        As in :func:`~faultgouge.analysis.stiffness_matrix`.

    Returns
    -------
    TransientGain

    Raises
    ------
    NoGainError
        If some motion grows for ever, or the norm is the energy and K has none that is positive.
    numpy.linalg.LinAlgError
        If more than two eigenvalues coalesce.
    """
    system = StateSpace.of(packing, form)
    if norm == "energy" and not system.positive:
        raise NoGainError("the symmetric part of K is not positive: displacements have no energy to compare with")
    propagator = _Propagator.of(packing, system, norm)
    bound, columns = propagator.bound(), propagator.kept()
    if bound < 1 + SYMMETRIC:
        return _nothing(len(packing), norm, 0.0, bound)
    length = min(propagator.window(columns), propagator.end(bound)) if window is None else window
    best = sorted(propagator.candidates(columns, length), key=lambda at: -propagator.largest(0.5 * sum(at))[0])
    time = max((_refined(propagator, at) for at in best[:REFINED]), key=lambda each: each[1])[0]
    size, start = propagator.largest(time)
    if size <= 1:
        return _nothing(len(packing), norm, length, bound)
    displacement, velocity = np.zeros((2, 3 * len(packing)))
    root, count = system.root_mass, len(system.active)
    if norm == "displacement":
        displacement[system.active] = start
    else:
        displacement[system.active] = system.unweight @ start[:count] / root
        velocity[system.active] = start[count:] / root
    return TransientGain(size**2, time, displacement, velocity, norm, length, bound)


def _nothing(disks: int, norm: Norm, window: float, bound: float) -> TransientGain:
    """No start grows: K is symmetric, or what it feeds is less than the dissipation takes."""
    rest, start = np.zeros((2, 3 * disks))
    start[0] = 1.0
    return TransientGain(1.0, 0.0, start, rest, norm, window, bound)


@dataclass(frozen=True, eq=False)
class _Propagator:
    """P(t) = O f(t) I of modes: from starts, by I, to amplitudes, and by O to what is measured."""

    modes: Modes
    outward: Complexes
    inward: Complexes
    function: Any
    reach: Any
    twofold: bool = False
    """Whether each motion is the sum of two mirror images, of half its size."""

    @classmethod
    def of(cls, packing: Packing, system: StateSpace, norm: Norm) -> "_Propagator":
        """That of a packing; NoGainError if it is unstable."""
        dissipative = packing.law.damped or packing.drag_time is not None
        second = norm == "displacement" and not dissipative
        modes = Modes.of(system.stiffness if second else system.matrix)
        rates = -np.abs(np.sqrt(modes.values).imag) if second else -modes.values.real
        fastest = np.sqrt(np.abs(modes.values).max(initial=0.0)) if second else np.abs(modes.values).max(initial=0.0)
        if np.any(rates < -(SLOW if dissipative else NOISE) * fastest):
            raise NoGainError("the packing is unstable: some motion grows for ever, and no gain is the largest")
        root, size = system.root_mass, len(system.active)
        if second:
            outward, inward = modes.basis / root[:, None], modes.inverse * root
            return cls(modes, outward, inward, Oscillator().released, second_order)
        outward, inward = modes.basis, modes.inverse
        if norm == "displacement":
            outward = (system.unweight / root[:, None]) @ outward[:size]
            inward = inward[:, :size] @ (system.weight * root)
        return cls(modes, outward, inward, released, first_order, norm == "displacement")

    @property
    def frequency(self) -> Floats:
        """Of each mode, radian / time."""
        values = self.modes.values
        return np.abs(np.sqrt(values).real) if self.reach is second_order else np.abs(values.imag)

    def kept(self) -> Indices:
        """The columns of the modes that are sampled: the most oblique ones, and pairs that are kept together."""
        weight = np.linalg.norm(self.outward, axis=0) * np.linalg.norm(self.inward, axis=1)
        weight *= 2 if self.twofold else 1
        for column in self.modes.blocks:
            weight[[column, column + 1]] = np.inf
        finite = weight[np.isfinite(weight)].max(initial=1.0)
        least = max(OBLIQUE, SHARE * (finite if np.all(np.isfinite(weight)) else WELL_CONDITIONED**-1))
        order = np.argsort(-weight, kind="stable")[:MOST]
        return np.sort(order[(weight[order] > least) | (np.arange(len(order)) < LEAST)])

    def window(self, columns: Indices) -> float:
        """Some beats of the most oblique pair, time."""
        frequency = self.frequency[columns]
        shape = self.outward[:, columns] / np.linalg.norm(self.outward[:, columns], axis=0)
        parallel = np.abs(shape.conj().T @ shape)
        gap = np.abs(frequency[:, None] - frequency[None])
        for column in set(self.modes.blocks) & set(columns.tolist()):
            # a block has a basis that is not oblique: its two modes are nearly parallel
            place = int(np.searchsorted(columns, column))
            parallel[place, place + 1] = 1 + frequency.max() / max(gap[place, place + 1], 1e-300)
        parallel[gap <= NOISE * frequency.max(initial=0.0)] = 0.0  # itself, and its mirror image
        a, b = np.unravel_index(np.argmax(parallel), parallel.shape)
        if parallel[a, b] == 0.0:
            return float(ALONE * 2 * np.pi / frequency[a]) if frequency[a] else 1.0
        beat, period = np.pi / gap[a, b], 2 * np.pi / frequency[a]
        return float(max(1.5 * beat, min(BEATS * beat, PERIODS * period)))

    def end(self, bound: float) -> float:
        """A time beyond which the dissipation leaves no gain, time; inf without dissipation."""
        slowest = 0.0 if self.reach is second_order else -float(self.modes.values.real.max(initial=-np.inf))
        return 0.5 * float(np.log(bound)) / slowest if slowest > 0 else np.inf

    def candidates(self, columns: Indices, window: float) -> list[tuple[float, float]]:
        """The times between which P of some modes has its largest maxima."""
        left, right = (np.linalg.qr(part)[1] for part in (self.outward[:, columns], self.inward[columns].conj().T))
        step = 2 * np.pi / max(self.frequency[columns].max(initial=0.0), 1e-300) / SAMPLES
        time = np.linspace(0.0, window, max(2, int(np.ceil(window / step)) + 1))
        size = np.concatenate(
            [
                np.linalg.norm(
                    left @ self.modes.middle(self.function, part, columns, self.reach) @ right.conj().T, 2, (1, 2)
                )
                for part in np.array_split(time, len(time) // CHUNK + 1)
            ]
        )
        inner = np.flatnonzero((size[1:-1] >= size[:-2]) & (size[1:-1] > size[2:])) + 1
        peaks = np.concatenate([inner, [0, len(time) - 1]])
        peaks = peaks[np.argsort(-size[peaks], kind="stable")]
        shortest = window * 2.0**-CANDIDATES or 1.0  # an octave of its own below it; any number if all times are 0
        octave = np.log2(max(window, shortest) / np.maximum(time[peaks], shortest)).astype(int)
        best = np.union1d(peaks[:CANDIDATES], peaks[np.unique(octave, return_index=True)[1]])
        return [(float(time[max(k - 1, 0)]), float(time[min(k + 1, len(time) - 1)])) for k in best]

    def largest(self, time: float) -> tuple[float, Floats]:
        """Norm of the whole P(t), and the start of norm 1 that reaches it; real."""
        every = np.arange(len(self.modes.values))
        core = csr_array(self.modes.middle(self.function, np.array([time]), every, self.reach)[0])
        rows, columns = len(self.outward), self.inward.shape[1]
        forward = LinearOperator(
            (rows, columns),
            matvec=lambda v: (self.outward @ (core @ (self.inward @ v))).real,
            rmatvec=lambda u: ((u @ self.outward) @ core @ self.inward).real,
            dtype=np.float64,
        )
        if min(rows, columns) < 3:
            matrix = (self.outward @ (core @ self.inward)).real
            _, size, right = np.linalg.svd(matrix)
        else:
            _, size, right = svds(forward, k=1, v0=np.ones(min(rows, columns)), tol=ACCURACY)
        start = right[0] / np.linalg.norm(right[0])
        return float(size[0]), start * np.sign(start[np.argmax(np.abs(start))])

    def bound(self) -> float:
        """No P(t) has a larger norm squared: that of the modes with balanced sizes."""
        outward, inward = self.outward.copy(), self.inward.copy()
        for column, block in self.modes.blocks.items():
            pair = [column, column + 1]
            _, vectors = np.linalg.eig(block)
            if abs(np.linalg.det(vectors)) < np.finfo(float).eps:
                return np.inf
            outward[:, pair], inward[pair] = outward[:, pair] @ vectors, np.linalg.solve(vectors, inward[pair])
        scale = np.sqrt(np.linalg.norm(inward, axis=1) / np.linalg.norm(outward, axis=0))
        sizes = np.linalg.norm(outward * scale, 2), np.linalg.norm(inward / scale[:, None], 2)
        return float(sizes[0] * sizes[1]) ** 2


def _refined(propagator: _Propagator, between: tuple[float, float]) -> tuple[float, float]:
    """Time and norm of the whole propagator at a maximum."""
    a, b = between
    if a == b:
        return a, propagator.largest(a)[0]
    top = minimize_scalar(
        lambda t: -propagator.largest(float(t))[0], bounds=between, method="bounded", options={"xatol": 1e-3 * (b - a)}
    )
    return float(top.x), float(-top.fun)
