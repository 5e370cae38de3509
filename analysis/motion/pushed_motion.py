"""Displacements of particles after a push, or under a load that rises, with contacts at Coulomb's bound as they are.

The equations and the steps are those of :mod:`~faultgouge.analysis.motion.one_sided`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats
from ..has_configuration import HasConfiguration
from .contact_reach import ContactReach
from .one_sided import OneSidedSystem, forces_on_coordinates, on_all_coordinates


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
        Between which multiples of the push, or of the rate, the motion holds, as it was seen in `FIRST_LOOKS` at its
        beginning and at these times: with smaller ones contacts that count as at the bound do not reach it, or the
        residual forces move the packing as well, and with larger ones other contacts reach the bound, open or
        close, or the force of one at the bound turns.
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
    packing: HasConfiguration,
    velocity: ArrayLike | None = None,
    rise: str | ArrayLike | None = None,
    times: ArrayLike = (0.0,),
) -> OneSidedMotion:
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
    configuration = packing.configuration
    time = np.atleast_1d(np.asarray(times, dtype=np.float64))
    if time.ndim != 1 or not np.all(np.isfinite(time)) or np.any(np.diff(time, prepend=0.0) < 0):
        raise ValueError("The times of a motion are finite, not negative, and in increasing order.")
    system = OneSidedSystem.of(configuration)
    push = on_all_coordinates(configuration, "velocity", velocity)
    state = system.start(push)
    load = None if rise is None else forces_on_coordinates(configuration, rise)
    seen, reach = [], ContactReach(system)
    reach.look_closely(state, float(time[-1]), load)
    advance = system.advance_exactly if system.remembers_nothing else system.advance
    for each in time:
        advance(state, float(each), load)
        reach.look(state)
        flight = system.free_flight(push, load, float(each))
        moved, speed = (
            system.displacement(z, free)[..., 0] for z, free in zip((state.z, state.v), flight, strict=True)
        )
        seen.append((moved, speed, state.p[:, 0].copy()))
    displacement, speed, slid = (np.array(each) for each in zip(*seen, strict=True))
    return OneSidedMotion(time, displacement, speed, slid, (reach.least_scale, reach.largest_scale))
