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

**The maximum.** With the modes x, the rows l of the inverse of their matrix and the functions f of the eigenvalues,
:math:`P(t) = \sum_k f_k(t)\, x_k l_k^H`. Close to an onset two terms dominate, those of the pair that is about to
coalesce, :math:`|x_k| |l_k| = \kappa`: the gain is close to :math:`4\kappa^2` when their phases differ by :math:`\pi`,
at the beat time :math:`\pi/(\omega_1 - \omega_2)`. The gain grows as the inverse of the distance from the onset; the
amplitude and the time grow as the inverse square root of this distance. Farther from the onset several pairs
contribute. So P is sampled on the few modes with large :math:`|x_k| |l_k|`, `propagator.TIMES_A_PERIOD` times a period,
over a window of time that is stated with the result. At the best of these times Lanczos iteration finds the largest
singular value of the whole propagator. Times are refined on the space of these vectors, where P(t) is a small matrix:
the norm of this matrix never exceeds that of P(t), and equals it, with its slope, at each time whose vectors are in the
space. The vectors at the maximum are added to the space until the maximum no longer changes (the subspace method of
Kangal, Meerbergen, Mengi and Michiels, SIAM J. Matrix Anal. Appl. 39, 48, 2018). The returned start attains the
returned gain.

The search in a window cannot exclude a larger gain at a later time, because the frequencies are incommensurate. But P
is never larger than :math:`\|X S\|_2 \|S^{-1} X^{-1}\|_2` with any scaling S of the modes, since no :math:`|f_k|`
exceeds 1; with the scaling that makes :math:`|x_k| = |l_k|` the square of this, `bound`, is close to the gain wherever
one pair dominates (the displacement, without dissipation; the energy, always).
"""

from dataclasses import dataclass

import numpy as np

from ..has_configuration import HasConfiguration
from ..packing.packing import Floats
from .propagator import NORM_ACCURACY, NoGainError, Norm, Propagator, stable_motion
from .response import LinearMotion

LEAST_EXCESS = 1e-6
"""An excess of the bound below this is no gain: K is symmetric, but for rounding."""

SAMPLE_ACCURACY = 1e-4
"""Relative error of the norms at the best samples: what reaches them makes the first space."""

TIME_ACCURACY = 1e-4
"""Error of a refined time, in units of the time between the samples."""

GRID_TIMES = 9
"""Times between two samples at which the norm on that space is looked at."""

RIVAL_SHARE = 0.98
"""Maxima on that space which come so close to the largest norm that was found are refined, too."""

JOINED_VECTORS = 12
"""Vectors that join the space, at the most."""

GAIN_DISKS = 300
"""Disks up to which commands compute the gain."""


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
    def _translations(self) -> Floats:
        return self.start.reshape(3 if self.dimension == 2 else 6, -1)[: self.dimension]

    @property
    def disk(self) -> int:
        """The worst disk to push: the disk with the largest initial displacement."""
        return int(np.argmax(np.linalg.norm(self._translations, axis=0)))

    @property
    def direction(self) -> Floats:
        """Direction of the displacement of this disk, a unit vector (x, y) or (x, y, z)."""
        push = self._translations[:, self.disk]
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
        If some motion grows for ever, or the norm is the energy and the energy of K is not positive.
    numpy.linalg.LinAlgError
        If more than two eigenvalues coalesce.
    """
    return _gain(stable_motion(packing), norm)


def transient_gains(packing: HasConfiguration) -> tuple[TransientGain, TransientGain]:
    """The gains in displacement and in energy, with the modes computed once; as of :func:`transient_gain`."""
    motion = stable_motion(packing)
    return _gain(motion, "displacement"), _gain(motion, "energy")


def _gain(motion: LinearMotion, norm: Norm) -> TransientGain:
    system, packing = motion.system, motion.packing
    if norm == "energy" and not system.energy_norm.positive:
        raise NoGainError("the symmetric part of K is not positive: displacements have no energy to compare with")
    propagator = Propagator.of(motion, norm)
    bound, columns = propagator.bound(), propagator.sampled_modes()
    if bound < 1 + LEAST_EXCESS:
        return _zero_gain(packing, norm, 0.0, bound)
    length = min(propagator.window(columns), propagator.end(bound))
    time, size, start = _refine_maxima(propagator, propagator.candidates(columns, length))
    if size <= 1:
        return _zero_gain(packing, norm, length, bound)
    displacement, velocity = np.zeros((2, packing.coordinates))
    root, count = system.root_mass, len(system.active)
    if norm == "displacement":
        displacement[system.active] = start
    else:
        displacement[system.active] = system.energy_norm.unweight @ start[:count] / root
        velocity[system.active] = start[count:] / root
    return TransientGain(
        size**2, time, displacement, velocity, norm, length, bound, packing.dimension, _is_linear(packing)
    )


def _zero_gain(packing: HasConfiguration, norm: Norm, window: float, bound: float) -> TransientGain:
    """No start grows: K is symmetric, or what it feeds is less than the dissipation takes."""
    rest, start = np.zeros((2, packing.coordinates))
    start[0] = 1.0
    return TransientGain(1.0, 0.0, start, rest, norm, window, bound, packing.dimension, _is_linear(packing))


def _is_linear(packing: HasConfiguration) -> bool:
    contacts = packing.configuration.contacts
    return not np.any(contacts.one_sided | contacts.two_derivatives)


def _refine_maxima(propagator: Propagator, brackets: list[tuple[float, float]]) -> tuple[float, float, Floats]:
    """Time, norm and start of the largest norm of the whole propagator about some maxima."""
    grid = np.array([np.linspace(a, b, GRID_TIMES) for a, b in brackets])
    found = (propagator.largest(t[GRID_TIMES // 2], SAMPLE_ACCURACY) for t in grid)
    _, left, right = (np.array(part).T for part in zip(*found, strict=True))
    seen, last = np.zeros(len(grid)), grid.max()
    best = 0.0, 0.0, right[:, 0]
    for _ in range(JOINED_VECTORS):
        left, right = np.linalg.qr(left)[0], np.linalg.qr(right)[0]
        small = propagator.on(left, right)
        sizes = np.linalg.norm(small.at(grid.ravel()), 2, (1, 2)).reshape(grid.shape)
        tops = np.where(sizes.max(axis=1) > seen * (1 + NORM_ACCURACY), sizes.max(axis=1), 0.0)
        place = int(np.argmax(tops))
        if tops[place] <= RIVAL_SHARE * best[1]:
            break
        top = int(np.argmax(sizes[place]))
        time = _top(small, grid[place, max(top - 1, 0)], grid[place, min(top + 1, GRID_TIMES - 1)])
        size, out, start = propagator.largest(time)
        seen[place] = size
        if top in (0, GRID_TIMES - 1):  # the few modes of the samples had their maximum elsewhere: go on where it rises
            grid[place] = np.clip(grid[place] + grid[place, top] - grid[place, GRID_TIMES // 2], 0.0, last)
        best = max(best, (time, size, start), key=lambda each: each[1])
        left, right = np.column_stack([left, out]), np.column_stack([right, start])
    return best


def _top(propagator: Propagator, a: float, b: float) -> float:
    """The time between two others at which the norm of P(t) is largest."""
    from scipy.optimize import minimize_scalar

    if a == b:
        return a
    top = minimize_scalar(
        lambda t: -np.linalg.norm(propagator.at(np.array([t]))[0], 2),
        bounds=(a, b),
        method="bounded",
        options={"xatol": TIME_ACCURACY * (b - a)},
    )
    return float(top.x)
