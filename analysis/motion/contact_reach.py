r"""The sizes of a push, or of a rate of loading, for which a motion to first order holds.

Motion to first order has no size of its own. Real motion has. A large motion takes other contacts to Coulomb's bound,
opens contacts, closes others, or turns the forces of contacts at the bound
(:mod:`~faultgouge.analysis.operators.contact_changes`). A small motion leaves contacts that count as at the bound short
of the bound: contact c lacks a force :math:`m_c`, and slides by

.. math:: p_c(t) = \max_{t' \le t} \left(Y_c q + Z_c \dot q - m_c\right)_+ .

A motion s times as large is the motion with :math:`m_c / s`. Where sliding contacts make motion grow, the missing
forces may turn a small motion back before it has begun to grow. `ContactReach` follows the motion with missing forces
for larger and larger s, until it is the motion of contacts at the bound. A contact at the bound that is displaced
sideways by a force :math:`a_c` slides ahead, since then its force has the length :math:`\mu f_n` and another direction:
to second order by

.. math:: p_c(t) = \max_{t' \le t} \left(Y_c q + Z_c \dot q + \frac{s\, a_c^2}{2 \mu f_n}\right)_+ .

Where little holds the particles back ahead, this slip goes on and on, and the motion is followed for smaller and
smaller s until it is the motion to first order. The residual forces of a packing move the particles, too. The motion
counts if it goes much farther than they do.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Floats
from .one_sided import LOOK_STEP, OneSidedState, OneSidedSystem

SLIP_SHARE = 0.1
"""Slip of a contact, as a share of the largest, from which on it matters whether the contact has reached the bound."""

FIRST_LOOKS = 1000
"""Looks in steps of `LOOK_STEP`, over some ten periods of a slow mode. Contacts go farthest at the beginning."""

LOOKS_TOGETHER = 50
"""States that are looked at together."""

PUSH_OVER_RESIDUAL = 10.0
"""Displacement by a push over that by the residual forces, from which on the push counts: D then is right to a fifth,
and to a hundredth where the two displacements have nothing in common."""

COMPARED_STEPS = 300
"""Of these looks, those in which motions of two sizes are compared: three periods of a slow mode. A motion that turns
back does so at once."""

COMPARED_LOOKS = 10
"""Looks at which two motions are compared; those of the second half count."""

SAME_WAY = 0.1
"""Relative difference of two displacements that are the same: D then is right to a fifth."""

COMPARED_SIZES = 8
"""Sizes that are tried, each ten times the one before."""

COMPARED_UP_TO = 6000
"""Coordinates of packings whose motion at another size is followed: each size takes as long as `COMPARED_STEPS`. Of
larger ones the slip that is seen stands for this motion."""


@dataclass(eq=False)
class ContactReach:
    """How far a motion goes, and takes contacts.

    Attributes
    ----------
    system : OneSidedSystem
        Of the configuration.
    waiting : list of OneSidedState
        States that are looked at later: some together take less time than one by one.
    largest : ndarray, shape (P,), or zero
        Largest D among the states that do not wait.
    smallest : float
        Smallest multiple seen so far that takes a contact to another state.
    reaching : float
        Multiple of the motion from which on contacts that count as at Coulomb's bound reach the bound so soon that the
        motion is the same.
    time : float
        How long the motion was looked at closely.
    by_residual : ContactReach or None
        The reach of the motion by the residual forces, which nothing pushes.
    """

    system: OneSidedSystem
    waiting: list[OneSidedState] = field(default_factory=list)
    largest: Floats | float = 0.0
    smallest: float = np.inf
    reaching: float = 0.0
    time: float = 0.0
    by_residual: "ContactReach | None" = None

    def look(self, state: OneSidedState) -> None:
        """Look at the motion once more."""
        self.waiting.append(state.copy())
        if len(self.waiting) == LOOKS_TOGETHER:
            self._look_at_waiting()

    def _look_at_waiting(self) -> None:
        """At the sizes and contacts of the states that wait."""
        if not self.waiting:
            return
        together = [np.hstack([getattr(state, name) for state in self.waiting]) for name in ("z", "v", "p", "r")]
        sizes = self.system.mean_square_displacement(together[0]).reshape(len(self.waiting), -1)
        self.waiting.clear()
        self.largest = np.maximum(self.largest, sizes.max(axis=0))
        self.smallest = min(self.smallest, self.system.contact_changes.first(*together))

    @property
    def size(self) -> Floats:
        """Largest D of each motion that was seen, shape (P,), or a zero."""
        self._look_at_waiting()
        return np.asarray(self.largest)

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
        self.time = count * step
        load = None if rise is None else system.on_active(rise)
        state, compared = start.copy(), min(count, COMPARED_STEPS)
        seen = _follow(system, state, step, compared, load, look=self.look)
        self.reaching = _reaching_scale(system, start, seen, step, load)
        later = _follow(system, state, step, count - compared, load, look=self.look)
        if system.sliders[1].shape[0] and system.motion.configuration.dimension == 3:
            self._look_sideways(start, [*seen, *later], step, load)
        still = system.start(np.zeros((system.motion.configuration.coordinates, 1)))
        system.take_steps(still, step, count, constant=system.residual_force, look=self.by_residual.look)

    def _look_sideways(self, start: OneSidedState, seen: list[OneSidedState], step: float, load: Floats | None) -> None:
        """Reduce `smallest` until forces of contacts at Coulomb's bound that turn do not change the motion that was
        seen, in steps of this length under a load, shape (E, P), that rises."""
        system, size = self.system, self.largest_scale
        if not np.isfinite(size) or system.motion.configuration.coordinates > COMPARED_UP_TO:
            return
        for _ in range(COMPARED_SIZES):
            state, apart = start.copy(), np.zeros_like(self.size)
            state.size = size
            for each in seen:
                system.take_steps(state, step, round((each.time - state.time) / step), rise=load)
                apart = np.maximum(apart, system.mean_square_displacement(state.z - each.z))
            change = float(np.sqrt((apart / np.maximum(self.size, np.finfo(float).tiny)).max()))
            if change <= SAME_WAY:
                break
            size *= 0.9 * SAME_WAY / change if np.isfinite(change) else 0.1
        else:
            size = 0.0  # no size is known for which the motion is that to first order
        self.smallest = size

    @property
    def residual_displacement(self) -> float:
        """The root of the largest D to which the residual forces alone move the packing, length."""
        return 0.0 if self.by_residual is None else float(np.sqrt(self.by_residual.size.max(initial=0.0)))

    @property
    def residual_scale(self) -> float:
        """The multiple of the motion that goes as far as the residual forces move the packing."""
        if self.by_residual is None:
            return 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.nan_to_num(np.sqrt(self.by_residual.size / self.size), nan=0.0).max(initial=0.0))

    @property
    def unsettled(self) -> bool:
        """Whether residual forces alone take another contact to the bound, open one or close one."""
        return self.by_residual is not None and self.by_residual.largest_scale < 1

    @property
    def least_scale(self) -> float:
        """The multiple from which on neither missing forces nor residual forces count; infinite if none was found, or
        if the packing is `unsettled`."""
        if self.unsettled:
            return np.inf
        return max(self.reaching, PUSH_OVER_RESIDUAL * self.residual_scale)

    @property
    def largest_scale(self) -> float:
        """The multiple up to which no contact that is not at the bound reaches the bound, opens or closes, and none at
        the bound reaches it on the way back, or turns its force."""
        self._look_at_waiting()
        return self.smallest


def reaching_scale(system: OneSidedSystem, slid: Floats) -> float:
    """The multiple of a motion from which on contacts that count as at Coulomb's bound reach the bound.

    Parameters
    ----------
    system : OneSidedSystem
        Of the configuration.
    slid : ndarray, shape (B, P)
        p of each contact at the bound; of contacts that hardly slip it does not matter what is missing.
    """
    missing = np.broadcast_to(system.missing_forces, slid.shape)
    counts = slid > SLIP_SHARE * slid.max(axis=0, initial=0.0)
    return float((missing[counts] / slid[counts]).max(initial=0.0))


def _follow(
    system: OneSidedSystem,
    state: OneSidedState,
    step: float,
    count: int,
    load: Floats | None,
    look: Callable[[OneSidedState], None] | None = None,
) -> list[OneSidedState]:
    """Take some steps, and give the states at `COMPARED_LOOKS` times among them."""
    seen, done = [], 0
    for number in range(1, COMPARED_LOOKS + 1):
        steps = count * number // COMPARED_LOOKS - done
        system.take_steps(state, step, steps, rise=load, look=look)
        done += steps
        seen.append(state.copy())
    return seen


def _reaching_scale(
    system: OneSidedSystem, start: OneSidedState, seen: list[OneSidedState], step: float, load: Floats | None
) -> float:
    """The multiple of a motion from which on forces missing to Coulomb's bound do not change the motion; infinite if
    these change the largest motion that is tried.

    Parameters
    ----------
    system : OneSidedSystem
        Of the configuration.
    start : OneSidedState
        Where the motion begins.
    seen : list of OneSidedState
        The motion of contacts at the bound, at `COMPARED_LOOKS` times.
    step : float
        Its time step.
    load : ndarray, shape (E, P), optional
        Mass-weighted forces that rise, per time.
    """
    size = next((scale for each in seen if (scale := reaching_scale(system, each.p))), 0.0)
    if not size or system.motion.configuration.coordinates > COMPARED_UP_TO:
        return size
    count = round((seen[-1].time - start.time) / step)
    for _ in range(COMPARED_SIZES):
        state = start.copy()
        state.missing = system.missing_forces / size
        other = _follow(system, state, step, count, load)
        if all(_agree(*pair) for pair in zip(seen[COMPARED_LOOKS // 2 :], other[COMPARED_LOOKS // 2 :], strict=True)):
            return size
        size *= 10
    return np.inf


def _agree(one: OneSidedState, other: OneSidedState) -> bool:
    """Whether the displacements of two states are the same."""
    apart, size = (np.linalg.norm(each, axis=0) for each in (one.z - other.z, one.z))
    return bool(np.all(apart <= SAME_WAY * size))
