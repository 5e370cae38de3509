r"""Transient gain: how far a linearly stable packing moves away before it returns.

Below the onset all eigenvalues are real and positive, and every motion of the linearised packing is a sum of
oscillations. But K is not symmetric, and its modes are not orthogonal. An initial displacement that is a small
difference of two nearly parallel modes becomes their sum when their phases differ by :math:`\pi`. The gain is the
largest growth over all starts and over the time t,

.. math:: \mathcal G(t) = \max_{q_0} \frac{|q(t)|^2}{|q_0|^2} = \|P(t)\|_2^2 .

**Displacement.** q is (x.., y.., R theta..), the start is a displacement at rest, and P(t) is the propagator of
:math:`M \ddot q + C \dot q + K q = 0`; without dissipation :math:`P = M^{-1/2} \cos(A^{1/2} t) M^{1/2}`.

**Energy.** The start is any displacement and any velocity, and the norm is the energy :math:`\tfrac12 \dot q^T M \dot q
+ \tfrac12 q^T K_s q` with the symmetric part :math:`K_s` of K; P(t) is :math:`e^{Zt}` of
:mod:`~faultgouge.analysis.motion.motion`. If K were symmetric, both gains would be 1: only the antisymmetric part
of K makes them larger. (For properties of such matrices that eigenvalues do not show, see Trefethen and Embree,
*Spectra and Pseudospectra*, 2005.)

**The maximum.** With the modes x, the rows l of the inverse of their matrix and the rates s,
:math:`P(t) = \mathrm{Re} \sum_k e^{s_k t}\, x_k l_k`, one term for each motion. Close to an onset two terms dominate,
those of the pair that is about to coalesce, :math:`|x_k| |l_k| = \kappa`: the gain is close to :math:`4\kappa^2` when
their phases differ by :math:`\pi`, at the beat time :math:`\pi/(\omega_1 - \omega_2)`. The gain grows as the inverse of
the distance from the onset; the amplitude and the time grow as the inverse square root of this distance. Farther from
the onset several pairs contribute. So P is sampled on the few modes with large :math:`|x_k| |l_k|`, `TIMES_A_PERIOD`
times a period, over a window of time that is stated with the result. At the best of these times Lanczos iteration finds
the largest singular value of the whole propagator. Times are refined on the space of these vectors, where P(t) is a
small matrix: the norm of this matrix never exceeds that of P(t), and equals it, with its slope, at each time whose
vectors are in the space. The vectors at the maximum are added to the space until the maximum no longer changes (the
subspace method of Kangal, Meerbergen, Mengi and Michiels, SIAM J. Matrix Anal. Appl. 39, 48, 2018). The returned start
attains the returned gain.

The search in a window cannot exclude a larger gain at a later time, because the frequencies are incommensurate. But P
is never larger than :math:`\|X S\|_2 \|S^{-1} X^{-1}\|_2` with any scaling S of the modes, since no :math:`|e^{st}|`
exceeds 1; with the scaling that makes :math:`|x_k| = |l_k|` the square of this, `bound`, is close to the gain wherever
one pair dominates (the displacement, without dissipation; the energy, always).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.linalg import eig
from scipy.sparse.linalg import svds

from ..arrays import Complexes, Floats, Indices
from ..errors import FaultgougeError
from ..has_configuration import HasConfiguration
from ..motion.linear import all_rates
from ..motion.motion import Motion

Norm = Literal["displacement", "energy"]

LEAST_EXCESS = 1e-6
"""An excess of the bound below this is no gain: K is symmetric, but for rounding."""

MOST_OBLIQUE = 1e6
"""Largest |x| |l|: rounding of eigenvectors enters the gain as 1e-16 of its square."""

LEAST_OBLIQUITY, OBLIQUITY_SHARE, FEWEST_MODES, MOST_MODES = 1.1, 0.05, 4, 16
"""Modes with a larger |x| |l|, of which 1 is what a mode of a symmetric matrix has, and with at least this share of the
largest are sampled; so many at the least and at the most, of complex modes half as many."""

LONE_PERIODS, BEATS, MOST_PERIODS = 100, 10, 20_000
"""Length of the window: in periods where the most oblique mode has no partner; else in beats, of which there may be
fewer if they are more than 1.5 and more than so many periods. With dissipation it ends where the bound, which falls
with the slowest mode, leaves no gain."""

TIMES_A_PERIOD, TIMES_AT_ONCE = 8, 4096
"""Times a period: a phase between two of them is off by no more than pi/8, which costs 8 % and is refined away."""

RATE_NOISE = 1e-7
"""Differences of frequencies below this share of the largest frequency are rounding where two modes are about to
coalesce: the root of the rounding of a well-conditioned eigenvalue."""

NORM_ACCURACY, SAMPLE_ACCURACY, TIME_ACCURACY = 1e-9, 1e-4, 1e-4
"""Relative errors of the largest singular value, and of those at the best samples, which make the first space; error of
a refined time, in units of the time between the samples."""

CANDIDATES = 8
"""Maxima of the sampled modes at which the whole propagator is looked at, and besides the largest of each of so many
octaves of time: at t = 0 the whole propagator is one, but some of its modes alone make an oblique projector. As many
octaves of the first periods are looked at in any case."""

GRID_TIMES, RIVAL_SHARE, JOINED_VECTORS = 9, 0.98, 20
"""Times between two samples at which the norm on the space is looked at; share of the largest norm that was found from
which on maxima on the space are refined; vectors that join the space, at the most."""

GAIN_DISKS = 300
"""Disks up to which commands compute the gain."""


class NoGainError(FaultgougeError):
    """The packing has no transient gain: it is unstable, or has no energy."""


@dataclass(frozen=True, eq=False)
class TransientGain:
    """The largest transient growth of a stable packing.

    Attributes
    ----------
    gain : float
        |q(time)|^2 / |q(0)|^2, or the ratio of the energies.
    time : float
        Time of the largest gain.
    start : ndarray, shape (3N,)
        The initial displacement (x.., y.., R theta..) with this gain. Its norm is 1, or its energy with the velocity is
        1/2.
    velocity : ndarray, shape (3N,)
        The initial velocity; zero for the norm "displacement".
    norm : {"displacement", "energy"}
        Norm of which the gain is computed.
    window : float
        The search covers the times from 0 to this time.
    bound : float
        No later time has a gain larger than this; inf if no bound is known.
    dimension : int
        2 for disks, 3 for spheres.
    linear : bool
        Whether contacts move as K has it. Otherwise the gain leaves out what contacts do that slide on ahead and stick
        on the way back, or that have two derivatives, of which K has the mean: see
        :func:`~faultgouge.analysis.stability`.
    """

    gain: float
    time: float
    start: Floats
    velocity: Floats
    norm: Norm
    window: float
    bound: float
    dimension: int = 2
    linear: bool = True

    @property
    def disk(self) -> int:
        """The worst disk to push: the disk with the largest initial displacement."""
        translations = self.start.reshape(3 if self.dimension == 2 else 6, -1)[: self.dimension]
        return int(np.argmax(np.linalg.norm(translations, axis=0)))

    @property
    def direction(self) -> Floats:
        """Direction of the displacement of this disk, a unit vector (x, y) or (x, y, z)."""
        push = self.start.reshape(3 if self.dimension == 2 else 6, -1)[: self.dimension, self.disk]
        return np.asarray(push / np.linalg.norm(push))


def transient_gain(packing: HasConfiguration, norm: Norm = "displacement") -> TransientGain:
    """The largest transient gain of a stable packing, with its dashpots and drag.

    Parameters
    ----------
    packing : Packing
        The equilibrium.
    norm : {"displacement", "energy"}
        Displacements from rest in the norm of (x, y, R theta), or all states in the norm of the energy.

    Returns
    -------
    TransientGain

    Raises
    ------
    NoGainError
        If some motion grows for ever, two motions are about to coalesce, or the norm is the energy and the energy of K
        is not positive.
    """
    return next(_gains(packing, norm))


def transient_gains(packing: HasConfiguration) -> tuple[TransientGain, TransientGain]:
    """The gains in displacement and in energy, with the modes computed once; as of :func:`transient_gain`."""
    displacement, energy = _gains(packing, "displacement", "energy")
    return displacement, energy


def _gains(packing: HasConfiguration, *norms: Norm) -> Iterator[TransientGain]:
    system = Motion.of(packing)
    if all_rates(system)[1].any():
        raise NoGainError("the packing is unstable: some motion grows for ever, and no gain is the largest")
    if system.dissipative:
        rates, right = eig(system.first_order)
    else:
        values, right = eig(system.stiffness.toarray())
        rates = 1j * np.sqrt(values)
    inverse = np.linalg.inv(right)
    for norm in norms:
        if norm == "energy" and not system.energy_norm.positive:
            raise NoGainError("the symmetric part of K is not positive: displacements have no energy to compare with")
        yield _gain(packing, system, norm, _propagator(system, norm, rates, right, inverse))


class Propagator(NamedTuple):
    """P(t) = Re(O exp(s t) I): I takes starts to amplitudes, and O takes amplitudes to the measured quantities."""

    outward: Complexes
    rates: Complexes
    inward: Complexes

    def at(self, time: Floats) -> Floats:
        """P at some times, shape (T, a, b)."""
        factor = np.exp(time[:, None] * self.rates)
        return np.ascontiguousarray(((factor[:, None, :] * self.outward) @ self.inward).real)

    def largest(self, time: float, accuracy: float = NORM_ACCURACY) -> tuple[float, Floats, Floats]:
        """Norm of P(t), what reaches it and the start of norm 1 that does."""
        matrix = self.at(np.array([time]))[0]
        if min(matrix.shape) < 3:
            left, size, right = np.linalg.svd(matrix)
        else:
            left, size, right = svds(matrix, k=1, v0=np.ones(min(matrix.shape)), tol=accuracy)
        sign = np.sign(right[0, np.argmax(np.abs(right[0]))])
        return float(size[0]), sign * left[:, 0], sign * right[0]

    def real_parts(self) -> tuple[Floats, Floats]:
        """L and R of P = L D R with turns D: real and imaginary parts of the modes side by side."""
        if np.isrealobj(self.outward) or not self.outward.imag.any():
            return self.outward.real, self.inward.real
        return np.hstack([self.outward.real, self.outward.imag]), np.vstack([self.inward.real, self.inward.imag])


def _propagator(system: Motion, norm: Norm, rates: Complexes, right: Complexes, inverse: Complexes) -> Propagator:
    """The propagator of a packing in one of the norms; of two mirror images one stands for both."""
    root, size, energy = system.root_mass, len(system.active), system.energy_norm
    if not system.dissipative and norm == "displacement":
        return Propagator(right / root[:, None], rates, inverse * root)
    if not system.dissipative:
        outward = np.concatenate([energy.weight @ right, right * rates])
        return Propagator(outward, rates, np.hstack([inverse @ energy.unweight, inverse / rates[:, None]]))
    one = rates.imag >= 0
    twice = np.where(rates.imag > 0, 2.0, 1.0)
    outward, inward = (right * twice)[:, one], inverse[one]
    if norm == "displacement":
        outward = (energy.unweight / root[:, None]) @ outward[:size]
        inward = inward[:, :size] @ (energy.weight * root)
    return Propagator(outward, rates[one], inward)


def _gain(packing: HasConfiguration, system: Motion, norm: Norm, whole: Propagator) -> TransientGain:
    contacts = packing.configuration.contacts
    linear = not np.any(contacts.one_sided | contacts.two_derivatives)
    sizes = np.linalg.norm(whole.outward, axis=0), np.linalg.norm(whole.inward, axis=1)
    if np.max(sizes[0] * sizes[1]) > MOST_OBLIQUE:
        raise NoGainError("two motions are about to coalesce, where the gain has no digits: take a load a little below")
    scale = np.sqrt(sizes[1] / sizes[0])
    balanced = Propagator(whole.outward * scale, whole.rates, whole.inward / scale[:, None]).real_parts()
    bound = float(np.prod([np.linalg.norm(each, 2) ** 2 for each in balanced]))
    (displacement, velocity), size, time, length = np.zeros((2, packing.coordinates)), 0.0, 0.0, 0.0
    if bound >= 1 + LEAST_EXCESS:
        modes = _sampled_modes(sizes[0] * sizes[1] / (2 if norm == "energy" else 1), balanced[0].shape[1] > len(scale))
        length, slowest = _window(whole, modes), -float(whole.rates.real.max(initial=-np.inf))
        if slowest > 0:  # the dissipation leaves no gain beyond
            length = min(length, 0.5 * float(np.log(bound)) / slowest)
        time, size, start = _refine_maxima(whole, _candidates(whole, modes, length))
    if size <= 1:  # K is symmetric, or what it feeds is less than the dissipation takes
        displacement[0], time, size = 1.0, 0.0, 1.0
    elif norm == "displacement":
        displacement[system.active] = start
    else:
        count, root = len(system.active), system.root_mass
        displacement[system.active] = system.energy_norm.unweight @ start[:count] / root
        velocity[system.active] = start[count:] / root
    return TransientGain(size**2, time, displacement, velocity, norm, length, bound, packing.dimension, linear)


def _sampled_modes(weight: Floats, complex_modes: bool) -> Indices:
    """The most oblique modes."""
    least = max(LEAST_OBLIQUITY, OBLIQUITY_SHARE * weight.max(initial=1.0))
    order = np.argsort(-weight, kind="stable")[: MOST_MODES // (1 + complex_modes)]
    return np.sort(order[(weight[order] > least) | (np.arange(len(order)) < FEWEST_MODES)])


def _window(whole: Propagator, modes: Indices) -> float:
    """Some beats of the most oblique pair, time."""
    frequency, shape = np.abs(whole.rates[modes].imag), whole.outward[:, modes]
    shape = shape / np.linalg.norm(shape, axis=0)
    parallel, gap = np.abs(shape.conj().T @ shape), np.abs(frequency[:, None] - frequency[None])
    parallel[gap <= RATE_NOISE * frequency.max(initial=0.0)] = 0.0  # itself
    a, b = np.unravel_index(np.argmax(parallel), parallel.shape)
    if parallel[a, b] == 0.0:
        return float(LONE_PERIODS * 2 * np.pi / frequency[a]) if frequency[a] else 1.0
    beat, period = np.pi / gap[a, b], 2 * np.pi / frequency[a]
    return float(max(1.5 * beat, min(BEATS * beat, MOST_PERIODS * period)))


def _candidates(whole: Propagator, modes: Indices, window: float) -> list[tuple[float, float]]:
    """The times between which P of some modes has its largest maxima."""
    some = Propagator(whole.outward[:, modes], whole.rates[modes], whole.inward[modes])
    left, right = some.real_parts()
    basis, back = np.linalg.qr(left)[0], np.linalg.qr(right.T)[0]
    some = Propagator(basis.T @ some.outward, some.rates, some.inward @ back)
    step = 2 * np.pi / max(np.abs(some.rates.imag).max(initial=0.0), 1e-300) / TIMES_A_PERIOD
    time = np.linspace(0.0, window, max(2, int(np.ceil(window / step)) + 1))
    parts = np.array_split(time, len(time) // TIMES_AT_ONCE + 1)
    size = np.concatenate([np.linalg.norm(some.at(part), 2, (1, 2)) for part in parts])
    inner = np.flatnonzero((size[1:-1] >= size[:-2]) & (size[1:-1] > size[2:])) + 1
    peaks = np.concatenate([inner, [0, len(time) - 1]])
    peaks = peaks[np.argsort(-size[peaks], kind="stable")]
    shortest = window * 2.0**-CANDIDATES or 1.0  # an octave of its own below it; any number if all times are 0
    octave = np.log2(max(window, shortest) / np.maximum(time[peaks], shortest)).astype(int)
    best = np.union1d(peaks[:CANDIDATES], peaks[np.unique(octave, return_index=True)[1]])
    # dashpots make many motions oblique, which together grow within the first periods
    early = [(min(step * 2.0**k, window), min(step * 2.0 ** (k + 1), window)) for k in range(-1, CANDIDATES - 1)]
    return early + [(float(time[max(k - 1, 0)]), float(time[min(k + 1, len(time) - 1)])) for k in best]


def _refine_maxima(whole: Propagator, brackets: list[tuple[float, float]]) -> tuple[float, float, Floats]:
    """Time, norm and start of the largest norm of the whole propagator about some maxima."""
    from scipy.optimize import minimize_scalar

    grid = np.array([np.linspace(a, b, GRID_TIMES) for a, b in brackets])
    found = (whole.largest(t[GRID_TIMES // 2], SAMPLE_ACCURACY) for t in grid)
    _, left, right = (np.array(part).T for part in zip(*found, strict=True))
    seen, last = np.zeros(len(grid)), grid.max()
    best = 0.0, 0.0, right[:, 0]
    for _ in range(JOINED_VECTORS):
        left, right = np.linalg.qr(left)[0], np.linalg.qr(right)[0]
        small = Propagator(left.T @ whole.outward, whole.rates, whole.inward @ right)

        def sizes_at(times: Floats, small: Propagator = small) -> Floats:
            return np.linalg.norm(small.at(np.atleast_1d(times)), 2, (1, 2))

        sizes = sizes_at(grid.ravel()).reshape(grid.shape)
        tops = np.where(sizes.max(axis=1) > seen * (1 + NORM_ACCURACY), sizes.max(axis=1), 0.0)
        place = int(np.argmax(tops))
        if tops[place] <= RIVAL_SHARE * best[1]:
            break
        top = int(np.argmax(sizes[place]))
        time, b = grid[place, max(top - 1, 0)], grid[place, min(top + 1, GRID_TIMES - 1)]
        if time < b:
            options = {"xatol": TIME_ACCURACY * (b - time)}
            time = minimize_scalar(lambda t: -sizes_at(t)[0], bounds=(time, b), method="bounded", options=options).x
        size, out, start = whole.largest(float(time))
        seen[place] = size
        if top in (0, GRID_TIMES - 1):  # the few modes of the samples had their maximum elsewhere: go on where it rises
            grid[place] = np.clip(grid[place] + grid[place, top] - grid[place, GRID_TIMES // 2], 0.0, last)
        best = max(best, (float(time), size, start), key=lambda each: each[1])
        left, right = np.column_stack([left, out]), np.column_stack([right, start])
    return best
