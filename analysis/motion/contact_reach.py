"""The sizes of a push, or of a rate of loading, for which a motion to first order holds.

Motion to first order has no size of its own. Real motion has: a small motion leaves contacts that count as at Coulomb's
bound short of the bound, and residual forces move the particles as far; a large motion takes other contacts to the
bound, or opens them. `ContactReach` follows how far a motion takes contacts, and gives both limits as multiples of this
motion.
"""

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from .one_sided import OneSidedState, OneSidedSystem

SLIP_SHARE = 0.1
"""Slip of a contact, as a share of the largest, from which on it matters whether the contact has reached the bound."""

LOOK_STEP = 0.3
"""Time between two looks at contacts as a share of the largest stable time step: ten looks in the fastest period."""

FIRST_LOOKS = 1000
"""Looks in these steps, over some ten periods of a slow mode. Contacts go farthest at the beginning."""

PUSH_OVER_RESIDUAL = 10.0
"""Displacement by a push over that by the residual forces, from which on the push counts: D then is right to a fifth,
and to a hundredth where the two displacements have nothing in common."""


@dataclass(eq=False)
class ContactReach:
    """How far a motion goes, and takes contacts.

    Attributes
    ----------
    system : OneSidedSystem
        Of the configuration.
    size : ndarray, shape (P,), or None
        Largest D that was seen.
    farthest : ndarray, shape (R, P), or None
        Largest products of the system's margins with displacements.
    slid : ndarray, shape (B, P), or None
        p of sliders at the last look.
    by_residual : ContactReach or None
        The same of the motion by the residual forces, which nothing pushes.
    """

    system: OneSidedSystem
    size: Floats | None = None
    farthest: Floats | None = None
    slid: Floats | None = None
    by_residual: "ContactReach | None" = None

    def look(self, state: OneSidedState) -> None:
        """Look at the motion once more."""
        size, now = self.system.mean_square_displacement(state.z), self.system.margins[0] @ state.z
        self.size = size if self.size is None else np.maximum(self.size, size)
        self.farthest = now if self.farthest is None else np.maximum(self.farthest, now)
        self.slid = state.p.copy()

    def look_closely(self, start: OneSidedState, time: float = np.inf, rise: Floats | None = None) -> None:
        """Look at the beginning of a motion step by step, and at the motion by the residual forces.

        Parameters
        ----------
        start : OneSidedState
            Stays as it is.
        time : float
            When the motion ends.
        rise : ndarray, shape (coordinates, P), optional
            Forces that rise, per time.
        """
        system, self.by_residual = self.system, ContactReach(self.system)
        step = LOOK_STEP / system.step_share * system.time_step
        count = int(min(FIRST_LOOKS, np.ceil((time - start.time) / step)))
        state = OneSidedState(start.time, *(each.copy() for each in (start.z, start.v, start.p, start.r)))
        system.take_steps(state, step, count, rise=None if rise is None else system.on_active(rise), look=self.look)
        still = system.start(np.zeros((system.motion.configuration.coordinates, 1)))
        system.take_steps(still, step, count, constant=system.residual_force, look=self.by_residual.look)

    @property
    def residual_displacement(self) -> float:
        """The root of the largest D to which the residual forces alone move the packing, length."""
        seen = None if self.by_residual is None else self.by_residual.size
        return 0.0 if seen is None else float(np.sqrt(seen.max(initial=0.0)))

    @property
    def residual_scale(self) -> float:
        """The multiple of the motion that goes as far as the residual forces move the packing."""
        if self.size is None or self.by_residual is None or self.by_residual.size is None:
            return 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.nan_to_num(np.sqrt(self.by_residual.size / self.size), nan=0.0).max(initial=0.0))

    @property
    def least_scale(self) -> float:
        """The multiple from which on sliders have slipped by more than was missing to the bound, and residual forces
        do not count; infinite if these alone take another contact to the bound, or open one."""
        if self.by_residual is not None and self.by_residual.largest_scale < 1:
            return np.inf
        missing = 0.0 if self.slid is None else reaching_scale(self.system, self.slid)
        return max(missing, PUSH_OVER_RESIDUAL * self.residual_scale)

    @property
    def largest_scale(self) -> float:
        """The multiple up to which no contact that is not at the bound reaches the bound or opens."""
        if self.farthest is None:
            return np.inf
        with np.errstate(divide="ignore", invalid="ignore"):
            limit = self.system.margins[1][:, None] / self.farthest
        return float(limit[self.farthest > 0].min(initial=np.inf))


def reaching_scale(system: OneSidedSystem, slid: Floats) -> float:
    """The multiple of a motion from which on contacts that count as at Coulomb's bound reach the bound.

    Parameters
    ----------
    system : OneSidedSystem
        Of the configuration.
    slid : ndarray, shape (B, P)
        p of each contact at the bound; of contacts that hardly slip it does not matter what is missing.
    """
    c = system.motion.configuration.contacts
    missing = np.maximum(c.friction - np.linalg.norm(c.tangential_force, axis=1), 0.0)[c.one_sided, None]
    missing = np.broadcast_to(missing, slid.shape)
    counts = slid > SLIP_SHARE * slid.max(axis=0, initial=0.0)
    return float((missing[counts] / slid[counts]).max(initial=0.0))
