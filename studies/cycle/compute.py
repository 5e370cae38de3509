r"""Eigenvalues of the states of a driven run: complex pairs, growth with and without dissipation, and folds.

The spring k draws the n disks of the upper layer, and its far end stands still for a small motion:

.. math:: K \to K + \frac{k}{n}\, \mathbf e \mathbf e^T, \qquad \mathbf e = 1 \text{ on x of the layer, 0 elsewhere.}

Two instabilities may begin a slip. **Growth**: a complex pair without dissipation, or Re s > 0 with dissipation.
**Fold**: a real eigenvalue of K, with contacts at Coulomb's bound that slide on, goes through zero, and the branch of
equilibria ends there (J. R. Rice, A. L. Ruina, J. Appl. Mech. 50, 343, 1983, have the same two of a spring and a
slider). Contacts at the bound are neither all sliding nor all sticking
(:mod:`~faultgouge.analysis.operators.sliders`): each number is given for both.

**Loose disks.** A disk that is about to leave its last contact has an eigenvalue near zero, of either sign, that says
nothing of the layer. Motions that only one disk takes part in are counted aside (`alone`). They do not count in the
rates and in the lowest eigenvalue.

**A state of a moving layer** is no equilibrium: its numbers are those of its positions and slips. The flag `rests`
says which states are equilibria.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from ...analysis import Configuration, Packing
from ...analysis.arrays import Complexes, Floats, derive_frozen
from ...analysis.has_configuration import HasConfiguration
from ...analysis.motion.eigenvalues import SAFETY, growing_undamped, in_balance, unit_rounding, zero_uncertainties
from ...analysis.motion.linear import all_rates, linear_verdict
from ...analysis.motion.modes import Modes, participation_ratio
from ...analysis.motion.motion import Motion

LONE_PARTICIPATION = 1.5
"""Disks that take part in a motion, below which the motion is that of one disk."""

ALL_RATES = 1500
"""Coordinates up to which LAPACK computes all eigenvalues with dissipation, ten seconds: the fastest growing motion
alone, which is known of more coordinates, may be that of one disk."""

INVERSE_STEPS = 3
"""Steps of inverse iteration with an eigenvalue that is known to nine digits: two leave 1e-12 of the others."""


@dataclass(frozen=True)
class LinearState:
    """Linear motion about a state, with all contacts at Coulomb's bound sticking, or all sliding.

    Attributes
    ----------
    pairs : int
        Complex pairs of K without dissipation.
    undamped : float
        Growth rate of D without dissipation, 1 / time: of complex pairs and of negative eigenvalues.
    damped : float, optional
        Largest 2 Re s with dissipation, 1 / time; None if no motion of several disks is known.
    lowest : float
        Least real part of the eigenvalues of K, 1 / time^2.
    alone : int
        Motions of one disk that grow without dissipation. The other numbers leave out the motions of one disk.
    """

    pairs: int
    undamped: float
    damped: float | None
    lowest: float
    alone: int


def with_spring(packing: HasConfiguration, spring: float) -> Configuration:
    """A state of a driven run with the stiffness of the spring, force / length on each disk of the layer."""
    return derive_frozen(packing.configuration, spring=spring)


def cycle_state(packing: Packing, spring: float) -> dict[str, Any]:
    """Numbers of one state of a driven run.

    Parameters
    ----------
    packing : Packing
        The state.
    spring : float
        Stiffness of the spring, force / length on each disk of the layer.

    Returns
    -------
    dict
        rests (whether forces balance), residual (the largest on a disk over the largest normal force), at_bound
        (contacts at Coulomb's bound), and of `LinearState` NAME_sticking and NAME_sliding. A smoothed law has one
        derivative at the bound, and the two are the same.
    """
    configuration = with_spring(packing, spring)
    sticking = linear_state(configuration, sliding=False)
    both = configuration.contacts.one_sided.any()
    sliding = linear_state(configuration, sliding=True) if both else sticking
    return {
        "rests": bool(in_balance(configuration)),
        "residual": float(configuration.residual / configuration.normal_force.max(initial=np.finfo(float).tiny)),
        "at_bound": int(configuration.contacts.at_bound.sum()),
        **{f"{name}_sticking": value for name, value in asdict(sticking).items()},
        **{f"{name}_sliding": value for name, value in asdict(sliding).items()},
    }


def linear_state(configuration: Configuration, sliding: bool) -> LinearState:
    """The growth rates of linear motion about a configuration."""
    motion = Motion.of(configuration, sliding=sliding)
    modes = Modes.of_matrix(motion.stiffness)
    rounding = unit_rounding(motion.stiffness.data)
    zero = zero_uncertainties(configuration, rounding, motion.particle, modes.left, modes.right)
    values = modes.values
    complex_, negative = growing_undamped(values, modes.overlap, rounding, zero)
    shared = _disks(motion, modes.right) >= LONE_PARTICIPATION
    grows = (complex_ | negative) & shared
    rates = 2 * np.abs(np.sqrt(values[grows].astype(complex)).imag)
    return LinearState(
        pairs=int(np.count_nonzero(complex_ & shared)) // 2,
        undamped=float(rates.max(initial=0.0)),
        damped=_damped_rate(motion),
        lowest=float(values[shared & (np.abs(values) > zero)].real.min(initial=np.inf)),
        alone=int(np.count_nonzero((complex_ | negative) & ~shared)),
    )


def _damped_rate(motion: Motion) -> float | None:
    """Largest 2 Re s of the motions that more than one disk takes part in; None if no such motion is known."""
    stiffness, damping = motion.stiffness.toarray(), motion.damping.toarray()
    for s in _rates(motion):
        pencil = s * s * np.eye(len(stiffness)) + s * damping + stiffness
        if _disks(motion, null_vector(pencil)[:, None])[0] >= LONE_PARTICIPATION:
            return float(2 * s.real)
    return None


def _rates(motion: Motion) -> Sequence[complex] | Complexes:
    """Eigenvalues s with dissipation, the fastest growing first: all of them, unless the packing is large."""
    if len(motion.active) > ALL_RATES:
        return [linear_verdict(motion, decides=False).s]
    return all_rates(motion)[0]


def null_vector(singular: Complexes) -> Complexes:
    """The vector that a matrix takes to zero but for rounding, by inverse iteration.

    A shift by some roundings keeps the pivots of a matrix that is exactly singular from being zero.
    """
    shift = SAFETY * unit_rounding(singular) * np.eye(len(singular))
    factors = lu_factor(singular + shift, check_finite=False)
    vector = np.random.Generator(np.random.PCG64(0)).standard_normal(len(singular)).astype(complex)
    for _ in range(INVERSE_STEPS):
        vector = lu_solve(factors, vector, check_finite=False)
        vector /= np.linalg.norm(vector)
    return vector


def _disks(motion: Motion, right: Complexes | Floats) -> Floats:
    """How many disks take part in each motion, from vectors of the active coordinates in columns."""
    whole = np.zeros((motion.configuration.coordinates, right.shape[1]), dtype=np.complex128)
    whole[motion.active] = right
    return len(motion.configuration) * participation_ratio(whole, motion.configuration.axes)
