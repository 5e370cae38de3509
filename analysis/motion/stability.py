r"""Does a packing at rest move? The verdict, with its own dissipation and its contacts at Coulomb's bound as they are.

**No contact at Coulomb's bound.** Small motion is linear. The packing is stable if no eigenvalue s of
:math:`s^2 M + s C + K` has Re s > 0 beyond rounding (:mod:`~faultgouge.analysis.motion.rates`), with C of its own
dashpots and drag. Complex pairs of K alone are the answer without loss, and no verdict on a packing with dashpots.

**Contacts at the bound** slide on ahead and stick on the way back, and no eigenvalue decides
(:mod:`~faultgouge.analysis.motion.one_sided`). The one-sided motion is followed from random pushes until it grows or
rests (:mod:`~faultgouge.analysis.motion.one_sided_outcome`). If the motion has not settled within the time that it was
followed, the verdict is unknown. The motion under a load that rises is followed in the same way
(:mod:`~faultgouge.analysis.motion.rising_load`).

**Laws with two derivatives**, one while a contact closes and one while it parts, let vibration carry particles on,
without a contact at the bound, too (:mod:`~faultgouge.analysis.motion.creep`).

**Large packings.** Where not all eigenvalues are known and the fastest motions do not grow, the motion from a random
state is followed (:mod:`~faultgouge.analysis.motion.decay`). Sticking contacts are stable only if this motion has
decayed so far that a motion that grows, however slowly, would be seen. Otherwise there is no verdict.
"""

from collections.abc import Sequence

from numpy.typing import ArrayLike

from ..arrays import Floats, number
from ..configuration import Configuration
from ..has_configuration import HasConfiguration
from ..operators.asymmetry import asymmetry
from ..operators.sliders import with_sticking_contacts
from .no_verdict import no_verdict
from .one_sided import OneSidedSystem, forces_on_coordinates
from .one_sided_outcome import PUSHES, STEP_OF_LARGE, VERDICT_STEP
from .rising_load import RisingMotion, motion_under_load
from .small_motion import UNSETTLED, LinearRates, SmallMotion, follow_small_motion
from .spectrum import Spectrum
from .steady_drift import NotFollowedError
from .verdict import LinearNeighbour, Stability

LARGE = 6000
"""Coordinates beyond which the fastest growing motions stand for all eigenvalues without dissipation, and one push and
its opposite for several, in larger steps."""


def stability(
    packing: HasConfiguration,
    rise: str | ArrayLike | None = None,
    time: float | None = None,
    *,
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
    large = configuration.coordinates > LARGE
    linear = LinearRates.of(configuration, spectrum_of_stiffness, large, limit)
    doubts = (*reasons, *no_verdict(configuration))
    outcome, rising, not_followed = SmallMotion.of_linear(linear, doubts), None, ""
    if not doubts:
        system = OneSidedSystem.of(configuration, STEP_OF_LARGE if large else VERDICT_STEP)
        outcome = follow_small_motion(system, linear, limit, 1 if large else PUSHES)
    if direction is not None:
        rising, not_followed = (
            (None, "no verdict is possible") if doubts else _rising(system, outcome, direction, limit)
        )
    return _stability(configuration, linear, outcome, rising, not_followed)


def _rising(
    system: OneSidedSystem, outcome: SmallMotion, direction: Floats, limit: float | None
) -> tuple[RisingMotion | None, str]:
    """The motion under a rising load, or why it was not followed."""
    if outcome.grows:
        return None, "small motion grows"
    if UNSETTLED in outcome.reasons:
        return None, UNSETTLED
    try:
        decays, residual = outcome.grows is False, outcome.residual_displacement
        return motion_under_load(system, direction, limit, free=outcome.free, decays=decays, residual=residual), ""
    except NotFollowedError as error:
        return None, str(error)


def _stability(
    configuration: Configuration,
    linear: LinearRates,
    outcome: SmallMotion,
    rising: RisingMotion | None,
    not_followed: str,
) -> Stability:
    """The verdict on the outcome."""
    contacts, given = configuration.contacts, configuration.stiffness is not None
    # where K is given, contacts, as far as they are known, have no derivatives
    contact_count = max(len(contacts), len(configuration) - len(configuration.rattlers)) if given else len(contacts)
    known = outcome.grows is not None and not outcome.reasons and contact_count > 0
    return Stability(
        stable=not outcome.grows if known else None, growth_rate=outcome.growth_rate, at_least=outcome.at_least,
        undamped=linear.undamped, at_bound=int(contacts.at_bound.sum()), one_sided=outcome.one_sided,
        creep=outcome.creep, largest_push=outcome.largest_push, push_time=outcome.push_time,
        residual_push=outcome.residual_push, said=outcome.said, rising=rising,
        sticking=outcome.sticking, sliding=LinearNeighbour.of(linear.sliding) if linear.one_sided else outcome.sticking,
        asymmetry={} if given else asymmetry(configuration), dissipative=configuration.damped,
        free=outcome.free, searched=outcome.sticking.searched, contacts=contact_count,
        reasons=tuple(outcome.reasons), not_followed=not_followed, remarks=configuration.remarks,
    )  # fmt: skip


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
