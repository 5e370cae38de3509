r"""Does a packing at rest move? The verdict, with its own dissipation and its contacts at Coulomb's bound as they are.

**No contact at Coulomb's bound.** Small motion is linear. The packing is stable if no eigenvalue s of
:math:`s^2 M + s C + K` has Re s > 0 beyond rounding (:mod:`~faultgouge.analysis.motion.linear`), with C of its own
dashpots and drag. Complex pairs of K alone are the answer without loss, and no verdict on a packing with dashpots.

**Contacts at the bound** slide on ahead and stick on the way back, and no eigenvalue decides
(:mod:`~faultgouge.analysis.motion.one_sided`). The motion is followed from random pushes until it grows or rests
(:mod:`~faultgouge.analysis.motion.pushes`). So is the motion of laws with two derivatives, one while a contact closes
and one while it parts, which lets vibration carry particles on.

**How far it holds.** Of linear motion a bound for all pushes says (:mod:`~faultgouge.analysis.motion.reach`), of
one-sided motion the pushes that were followed.

**A load that rises** is followed in the same way (:mod:`~faultgouge.analysis.motion.rising_load`).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, number
from ..configuration import Configuration
from ..counted import counted
from ..has_configuration import HasConfiguration
from ..operators.asymmetry import asymmetry
from ..operators.sliders import with_sticking_contacts
from .eigenvalues import Linear
from .linear import linear_verdict
from .motion import Motion
from .no_verdict import no_verdict
from .one_sided import VERDICT_STEP, OneSidedSystem, forces_on_coordinates
from .pushes import PUSHES, Creep, OneSidedOutcome, follow_creep, follow_pushes
from .reach import change_of_growing, reach_of
from .rising_load import NotFollowedError, motion_under_load, static_response
from .spectrum import Spectrum, spectrum
from .verdict import Stability, WithoutDissipation

LARGE = 6000
"""Coordinates beyond which one push and its opposite stand for several, and K's spectrum is not computed."""

SPECTRUM_UP_TO = 2000
"""Coordinates up to which K's spectrum is computed as a remark on a packing with dissipation."""

UNSETTLED = (
    "its residual forces alone take a contact to Coulomb's bound, open or close one: bring the packing to rest more "
    "closely"
)
"""Why there is no verdict where the residual forces alone change a contact."""


def stability(
    packing: HasConfiguration,
    rise: str | ArrayLike | None = None,
    time: float | None = None,
    *,
    follow: Callable[[Stability], Stability] | None = None,
    spectrum_of_stiffness: Spectrum | None = None,
    reasons: Sequence[str] = (),
) -> Stability:
    """Whether a packing moves, with its own dissipation and its contacts at Coulomb's bound as they are.

    Parameters
    ----------
    packing : Configuration or Packing
        The equilibrium.
    rise : "fx" or array_like, shape (N, d), optional
        The direction in which the load rises: the force on the upper layer, or forces per unit of time.
    time : float, optional
        How long one-sided motion is followed; until it has settled by default, or some minutes.
    follow : callable, optional
        What adds to the verdict on a packing that grows where LAMMPS's motion ends; ``faultgouge.stability`` also takes
        True, and a LAMMPS instance.
    spectrum_of_stiffness : Spectrum, optional
        That of the packing, where it is known.
    reasons : sequence of str
        What the caller knows that makes a verdict impossible.

    Returns
    -------
    Stability

    Raises
    ------
    ValueError
        If the direction has another shape, or is "fx" of a packing without an upper layer; or if the time is not
        positive.
    """
    limit = None if time is None else _positive_time(time)
    configuration = with_sticking_contacts(packing.configuration)
    if configuration is not packing.configuration:
        spectrum_of_stiffness = None  # of contacts that slide
    direction = None if rise is None else _direction(configuration, rise)
    undamped, sticking = _linear_motion(configuration, spectrum_of_stiffness, limit)
    one_sided = bool(configuration.contacts.one_sided.any())
    sliding = linear_verdict(Motion.of(configuration, sliding=True), decides=False) if one_sided else sticking
    contacts, given = configuration.contacts, configuration.stiffness is not None
    # where K is given, contacts, as far as they are known, have no derivatives
    touching = contacts.touching
    count = max(len(touching), len(configuration) - len(configuration.rattlers)) if given else len(touching)
    doubts = (*reasons, *no_verdict(configuration))
    found = Stability(
        stable=None if doubts or not count else sticking.stable, growth_rate=sticking.growth_rate,
        error=sticking.error, at_least=sticking.at_least, undamped=undamped, at_bound=int(touching.at_bound.sum()),
        rolling_at_bound=int(contacts.at_bound.sum() - touching.at_bound.sum()),
        sticking=sticking, sliding=sliding, asymmetry={} if given else asymmetry(configuration),
        dissipative=configuration.damped, free=sticking.free, contacts=count,
        reasons=doubts or sticking.reasons, remarks=configuration.remarks,
    )  # fmt: skip
    if not doubts and count:
        found = _followed(found, OneSidedSystem.of(configuration, VERDICT_STEP), limit)
    if direction is not None:
        found = _rising(found, configuration, direction, limit, bool(doubts))
    return follow(found) if follow is not None and found.stable is False else found


def _linear_motion(
    configuration: Configuration, known: Spectrum | None, time: float | None
) -> tuple[WithoutDissipation, Linear]:
    """Of sticking contacts: what grows without dissipation, and with it. K's spectrum decides where there is none."""
    damped, size = configuration.damped, configuration.coordinates
    if known is None and size <= (SPECTRUM_UP_TO if damped else LARGE):
        known = spectrum(configuration)
    alone = None if damped else Motion.of(configuration)
    if known is None:
        sticking = linear_verdict(alone or Motion.of(configuration, dissipation=False), decides=not damped, time=time)
        undamped = WithoutDissipation(max(sticking.growth_rate, 0.0), None, None, sticking.at_least)
    else:
        undamped = WithoutDissipation(known.growth_rate(), len(known.pairs), len(known.negative))
        roots = 1j * np.sqrt(known.unstable.astype(complex))
        s = complex(max(np.where(roots.real < 0, -roots, roots), key=np.real, default=0j))
        sticking = Linear(not len(roots), undamped.growth_rate, 0.0, known.free, s)
    return undamped, linear_verdict(Motion.of(configuration), time=time) if damped else sticking


def _followed(found: Stability, system: OneSidedSystem, time: float | None) -> Stability:
    """The verdict with what is followed where eigenvalues do not decide, and with its range."""
    motion, configuration = system.motion, system.motion.configuration
    pushes = 1 if configuration.coordinates > LARGE else PUSHES
    if configuration.contacts.one_sided.any():
        rests = found.sticking.stable is not False
        return _after_pushes(found, follow_pushes(system, found.growth_rate, rests, time, pushes))
    if found.stable is False:
        return replace(found, first_change=change_of_growing(motion, found.sticking.s) if found.sticking.s else None)
    if found.stable is None:
        return found
    if (reach := reach_of(motion, found.free)) is not None:
        mass = motion.translating_mass
        found = replace(
            found, largest_energy=reach.energy if np.isfinite(reach.energy) else None,
            largest_push=float(np.sqrt(2 * reach.energy / mass.max())) if np.isfinite(reach.energy) else None,
            push_time=reach.time if np.isfinite(reach.time) else None,
            residual_push=float(np.sqrt(2 * reach.residual_energy / mass.min())),
        )  # fmt: skip
        if reach.unsettled:
            return replace(found, stable=None, reasons=(UNSETTLED,))
    if system.remembers_nothing or configuration.stiffness is not None:
        return found
    return _with_creep(found, follow_creep(system, pushes, time, max(-0.5 * found.growth_rate, 0.0), found.free))


def _with_creep(found: Stability, creep: Creep) -> Stability:
    """The verdict on linear motion with what vibration adds."""
    if creep.grows:
        return replace(found, creep=creep, stable=False, growth_rate=creep.growth_rate)
    if creep.grows is None:
        says = (
            f"vibration wears contacts down, and its energy has risen within t = {creep.time:.4g}; whether this goes "
            "on was not followed"
        )
        return replace(found, creep=creep, stable=None, reasons=(says,))
    return replace(found, creep=creep)


def _after_pushes(found: Stability, outcome: OneSidedOutcome) -> Stability:
    """The verdict on one-sided motion; unknown, too, if it is the motion after no push of any size."""
    sticking, (least, most), reasons = found.sticking, outcome.scales, []
    if outcome.grows is None and outcome.slides_on:
        reasons.append(
            f"the motion has not settled: {counted(outcome.slides_on, 'contact')} at Coulomb's bound "
            f"slide{'s' * (outcome.slides_on == 1)} on after a push, and within t = {outcome.time:.4g} neither to rest "
            "nor faster and faster"
        )
    elif outcome.grows is None:
        reasons.append(
            f"the motion of contacts at Coulomb's bound has not settled within t = {outcome.time:.4g}, and D that "
            f"grows more slowly than exp({outcome.searched:.2g} t) may not have been seen"
            + (f"; `time` = {outcome.needed:.2g} may do" if outcome.needed else "")
        )
    elif not outcome.grows and np.isinf(least):
        reasons.append(UNSETTLED)
    elif not outcome.grows and least >= most:
        reasons.append(
            f"contacts that count as at Coulomb's bound reach it, or residual forces do not count, after pushes above "
            f"{least:.1g} (velocity along an axis) alone, and other contacts change after pushes above {most:.1g}: "
            "bring the packing to rest more closely"
        )
    elif not outcome.grows:
        reasons.extend(sticking.reasons)
    known = outcome.grows is not None and not reasons
    return replace(
        found,
        stable=not outcome.grows if known else None,
        reasons=tuple(reasons),
        one_sided=outcome,
        at_least=found.at_least and not outcome.grows,
        growth_rate=outcome.growth_rate if outcome.grows and outcome.growth_rate else found.growth_rate,
        error=outcome.error if outcome.grows and outcome.error else found.error,
        first_change=outcome.changes_at,
    )


def _rising(
    found: Stability, configuration: Configuration, direction: Floats, limit: float | None, doubts: bool
) -> Stability:
    """The verdict with the motion under a rising load, or why it was not followed."""
    why, rising = "", None
    if doubts:
        why = "no verdict is possible"
    elif found.stable is False:
        why = "small motion grows"
    elif UNSETTLED in found.reasons:
        why = UNSETTLED
    else:
        motion = Motion.of(configuration, sliding=False)
        system = OneSidedSystem(motion)
        # a force that begins to act displaces twice as far as one at rest
        moved = 2 * static_response(motion, system.residual_force, found.free)
        residual = float(np.sqrt(system.mean_square_displacement(moved).max(initial=0.0)))
        decays = found.sticking.stable is True
        try:
            rising = motion_under_load(motion, direction, limit, free=found.free, decays=decays, residual=residual)
        except NotFollowedError as error:
            why = str(error)
    return replace(found, rising=rising, not_followed=why)


def _positive_time(time: float) -> float:
    """The time as a number."""
    try:
        return number("time", time, positive=True)
    except (TypeError, ValueError):
        raise ValueError(f"The time that motion is followed is a positive number, not {time!r}.") from None


def _direction(configuration: Configuration, rise: str | ArrayLike) -> Floats:
    """Forces per unit of time on all coordinates, shape (coordinates, 1)."""
    forces = forces_on_coordinates(configuration, rise)
    if not forces[configuration.coordinate_free].any():
        raise ValueError("rise is a force on no particle that moves: give the forces by which the load rises.")
    return forces
