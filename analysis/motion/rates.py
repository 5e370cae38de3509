r"""The eigenvalues s of small motion: all, by LAPACK, or of large systems what can be known of them.

**What grows** beyond rounding is said by :mod:`~faultgouge.analysis.motion.eigenvalues`, of A without dissipation, and
of the first-order matrix Z in coordinates of the energy (:mod:`~faultgouge.analysis.motion.energy_norm`) with it. A
motion that no force opposes has s = 0 twice, in one Jordan block, which rounding turns into a pair of either sign.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig, eigvals

from ..arrays import Complexes, Floats
from .decay import WORK_OF_DECAY, Decay, follow_decay
from .eigenvalues import (
    SAFETY,
    growing,
    growing_undamped,
    is_zero,
    operator_rounding,
    zero_uncertainties,
    zero_uncertainty,
)
from .fastest_growing import fastest_growing
from .modes import Modes
from .motion import Motion

SLICED = 2000
"""Coordinates beyond which `spectrum` takes the eigenvalues of K in slices, and beyond which `rates_of` has the fastest
growing motions alone. Of 870 coordinates of disks LAPACK takes 0.8 of the time of slices, of 900 of spheres 0.4, and of
2,910 of disks 3.4 times as long."""

DENSE_DAMPED = 1000
"""Coordinates up to which all eigenvalues s with dissipation are computed by LAPACK, some seconds; of more those
of the fastest growing motions, and of slow ones."""

DENSE_AFTER_DECAY = 2000
"""Coordinates up to which LAPACK computes all eigenvalues s where a random state has not decayed in the same time: 20 s
and 0.5 GB. Motion that is fast and hardly damped decays too slowly in any steps."""

WORK_OF_LAPACK = 3.0
"""Multiplications of sparse steps that take as long as all eigenvalues s, over the cube of the coordinates: those of
1,272 coordinates take 5 s."""

DECAY_UP_TO = 6000
"""Coordinates up to which `rates_of` finds out whether all other motion decays; of more, who wants to know calls
:func:`~faultgouge.analysis.motion.decay.follow_decay`, which may take minutes."""

PERIODS_OF_LARGE = 2e6
"""Periods of the fastest motion in which growth is looked for, times the number of coordinates, with spaces of one
vector. It takes three seconds without dissipation, fourteen with it, and 35 where many motions grow alike and none
converges."""

LARGEST_LOSS = 4.0
"""Loss of dashpots over the fastest frequency beyond which no fast growth is sought: the search takes short steps, and
strong dashpots leave slow growth alone. Both are bounds, by sums of rows."""

FIRST_SEARCH, LONGEST_SEARCH = 30.0, 300.0
"""Periods of the fastest motion at first, which show fast growth in a tenth of the time, and at the most."""

FREE_SHARE = 1e-6
"""Eigenvalues s below this share of the largest may be those of motions that no force opposes: rounding leaves sqrt(u)
of a double zero. Motions that strong dashpots hold up are as slow."""

SLOW_SAFETY = 10.0
"""Safety of the estimate that a slow eigenvalue is none of a motion that a force opposes."""


@dataclass(frozen=True, eq=False)
class Rates:
    """The eigenvalues s of small motion, those with Im s >= 0.

    Attributes
    ----------
    values : ndarray of complex, shape (m,)
        s, the fastest growing first, 1 / time. Motions that no force opposes are left out.
    grows : ndarray of bool, shape (m,)
        Those with Re s > 0 beyond rounding.
    free : int
        Number of motions that no force opposes, and that drift.
    searched : float
        Growth rate of D, 1 / time, below which growth was not looked for; 0 where all eigenvalues are known, or nothing
        else grows.
    decay : Decay or None
        What became of a random state, where not all eigenvalues are known.
    at_least : bool
        Whether Re s is only known to be no less, as the search for the fastest motion did not converge.
    uncertainty : float
        Of Re s that is perfectly conditioned, 1 / time; 0 where eigenvalues have errors of their own.
    """

    values: Complexes
    grows: NDArray[np.bool_]
    free: int
    searched: float = 0.0
    decay: Decay | None = None
    at_least: bool = False
    uncertainty: float = 0.0

    def decided(self, decay: Decay) -> "Rates":
        """Where no motion was found to grow: with what has become of a random state, and of slow motions."""
        followed = np.array([0.5 * decay.growth_rate], complex)  # where the slow motions do not say so
        values = decay.slow if len(decay.slow) and (not decay.grows or decay.slowest > 0) else followed
        grows = values.real > 0 if decay.grows else np.zeros(len(values), bool)
        return Rates(values, grows, decay.free, decay.searched, decay)

    @property
    def growth_rate(self) -> float:
        """Of D, 1 / time: the largest 2 Re s; zero if this number is zero but for rounding, or if no eigenvalue is
        known, as none was found to grow."""
        largest = float(self.values.real.max(initial=-np.inf)) if len(self.values) else 0.0
        return 2 * largest if self.grows.any() or abs(largest) > self.uncertainty else 0.0


def rates_of(motion: Motion, *, decides: bool = True) -> Rates:
    """Eigenvalues s: all, by LAPACK, or of large systems those of the fastest growing motions.

    Parameters
    ----------
    motion : Motion
        The operators.
    decides : bool
        Whether a verdict depends on these eigenvalues: whether all other motion decays is found out then.
    """
    size = len(motion.active)
    if not size:
        return Rates(np.zeros(0, complex), np.zeros(0, bool), 0)
    if size <= (DENSE_DAMPED if motion.dissipative else SLICED):
        return _damped_rates(motion) if motion.dissipative else _undamped_rates(motion)
    longest = min(LONGEST_SEARCH, PERIODS_OF_LARGE / size)
    if not motion.dissipative or size > DECAY_UP_TO or not decides:
        return _fastest(motion, min(FIRST_SEARCH, longest), longest)
    found = _fastest(motion, FIRST_SEARCH, FIRST_SEARCH)
    if found.grows.any() and not found.at_least:
        return found
    # that all motion decays is more than a search says, and takes less time than a long one
    dense = WORK_OF_LAPACK * size**3 if size <= DENSE_AFTER_DECAY else np.inf
    decay = None if found.grows.any() else follow_decay(motion, work=min(dense, WORK_OF_DECAY))
    if decay is not None and decay.grows is None and dense < WORK_OF_DECAY:
        return _damped_rates(motion)
    seen = found.searched * FIRST_SEARCH / longest  # what grows faster is seen by a long search
    if decay is None or decay.grows is None or (decay.grows and decay.growth_rate > seen):
        found = _fastest(motion, FIRST_SEARCH, longest)
    return found if decay is None or found.grows.any() else found.decided(decay)


def _fastest(motion: Motion, first: float, longest: float) -> Rates:
    """Of motions that surely grow, looked for in so many periods; the others are not known."""
    fastest, loss = (float(abs(each).sum(axis=1).max(initial=0.0)) for each in (motion.stiffness, motion.damping))
    if loss > LARGEST_LOSS * np.sqrt(fastest):  # nothing grows faster than K alone would have it
        return Rates(np.zeros(0, complex), np.zeros(0, bool), 0, 2 * float(np.sqrt(fastest)))
    damping = motion.in_blocks(motion.damping) if motion.dissipative else None
    found = fastest_growing(motion.in_blocks(motion.stiffness), damping, count=1, periods=(first, longest))
    values = found.values if motion.dissipative else 1j * np.sqrt(found.values.astype(complex))
    values = np.where(values.real < 0, -values, values)
    if not found.converged:
        values = np.array(0.5 * found.least + 1j * values.imag)
    return Rates(values, np.ones(len(values), bool), 0, found.limit, at_least=not found.converged)


@dataclass(frozen=True)
class _StiffnessModes:
    """The eigenvalues of A: which grow without dissipation, and which belong to motions that no force opposes."""

    values: Complexes
    grows: NDArray[np.bool_]
    free: NDArray[np.bool_]

    @classmethod
    def of(cls, motion: Motion) -> "_StiffnessModes":
        modes, packing = Modes.of_matrix(motion.stiffness), motion.configuration
        rounding = operator_rounding(packing, motion.stiffness.data)
        zero = zero_uncertainties(packing, rounding, motion.particle, modes.left, modes.right)
        oscillates, buckles = growing_undamped(modes.values, modes.overlap, rounding, zero)
        grows, alike = oscillates | buckles, zero_uncertainty(packing, rounding)
        free = ~grows & is_zero(modes.values, modes.overlap, alike, zero)
        return cls(modes.values, grows, free)

    @property
    def softest(self) -> float:
        """The smallest |lambda| of a motion that a force opposes, 1 / time^2."""
        return float(np.abs(self.values[~self.free]).min(initial=np.inf))


def _undamped_rates(motion: Motion) -> Rates:
    found = _StiffnessModes.of(motion)
    grows, kept = found.grows, found.values.imag >= 0
    s = 1j * np.sqrt(np.where(grows, found.values, np.abs(found.values.real)).astype(complex))
    s = np.where(s.real < 0, -s, s)  # of a pair of roots the one that grows
    order = np.flatnonzero(kept & ~found.free)
    order = order[np.argsort(-s[order].real, kind="stable")]
    return Rates(s[order], grows[order], int(found.free.sum()))


def _damped_rates(motion: Motion) -> Rates:
    z = motion.first_order
    values, rounding = eigvals(z, check_finite=False), operator_rounding(motion.configuration, z)
    largest = np.abs(values).max()
    grows = values.real > np.sqrt(SAFETY * rounding * largest)  # no double eigenvalue is as uncertain
    slow = np.abs(values) <= FREE_SHARE * largest
    zero = zero_uncertainty(motion.configuration, operator_rounding(motion.configuration, motion.stiffness.data))
    drifts = grows & (np.abs(values) ** 2 <= zero)
    stiffness = _StiffnessModes.of(motion) if np.any(slow | drifts) else None
    free = slow & ~grows
    doubtful = np.any(~grows & (values.real > 0) & ~slow) or drifts.any()
    if doubtful or (stiffness is not None and _may_resist(motion, np.abs(values[slow]), stiffness.softest)):
        # vectors take three times as long as eigenvalues
        values, left, right = eig(z, left=True, check_finite=False)
        grows = growing(values, np.abs(np.sum(left.conj() * right, axis=0)), rounding)
        slow = np.abs(values) <= FREE_SHARE * largest
        free = (slow | (np.abs(values) ** 2 <= zero)) & _feels_no_force(motion, rounding, left, right)
        grows &= ~free
    order = np.flatnonzero((values.imag >= 0) & ~free)
    order = order[np.argsort(-values[order].real, kind="stable")]
    free_motions = 0 if stiffness is None else int(stiffness.free.sum())
    return Rates(values[order], grows[order], free_motions, uncertainty=SAFETY * rounding)


def _may_resist(motion: Motion, slow: Floats, softest: float) -> bool:
    """Whether a slow eigenvalue may be that of a motion which a force opposes, and strong dashpots hold up.

    Such a motion has s (s + g) = -lambda, with the damping g that the motion feels.
    """
    largest_damping = float(abs(motion.damping).sum(axis=1).max(initial=0.0))
    size = float(slow.max(initial=0.0))
    return SLOW_SAFETY * size * (size + largest_damping) >= softest


def _feels_no_force(motion: Motion, rounding: float, left: Complexes, right: Complexes) -> NDArray[np.bool_]:
    """Of which eigenvectors of Z the motion z has y^H A z = 0 but for rounding and for forces that are out of balance.

    Parameters
    ----------
    motion : Motion
        Of E coordinates.
    rounding : float
        u |Z|_F, 1 / time.
    left, right : ndarray of complex, shape (2E, k)
        Vectors of Z in coordinates of the energy.
    """
    size, a = len(motion.active), motion.stiffness
    places, sides = motion.energy_norm.unweight @ right[:size], left[size:]
    x, y = (each / np.linalg.norm(each, axis=0) for each in (places, sides))
    rounding_of_a = operator_rounding(motion.configuration, a.data)
    zero = zero_uncertainties(motion.configuration, rounding_of_a, motion.particle, y, x)
    zero += SAFETY * rounding * np.sqrt(np.linalg.norm(a.data))
    return np.asarray(np.abs(np.sum(y.conj() * (a @ x), axis=0)) <= zero)
