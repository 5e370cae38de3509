r"""What becomes of small motion under a load that is held: by eigenvalues, and by motion that is followed.

Eigenvalues of the linear motion say what sticking contacts do. Contacts at Coulomb's bound, laws with two derivatives,
and packings whose eigenvalues are not all known are followed: each makes a new outcome of the one before.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..configuration import Configuration
from .contact_reach import PUSH_OVER_RESIDUAL, ContactReach
from .creep import Creep, follow_creep
from .eigenvalues import Linear
from .linear import LAPACK_UP_TO, linear_verdict
from .motion import Motion
from .one_sided import OneSidedSystem
from .one_sided_outcome import OneSidedOutcome, follow_pushes, random_pushes
from .spectrum import Spectrum, spectrum
from .verdict import LinearNeighbour, WithoutDissipation

UNSETTLED = (
    "its residual forces alone take a contact to Coulomb's bound, open or close one: bring the packing to rest more "
    "closely"
)
"""Why there is no verdict where the residual forces alone change a contact."""

NOT_REACHED = (
    "no push was found after which contacts that count as at Coulomb's bound reach the bound: bring the packing to "
    "rest more closely"
)
"""Why there is no verdict where forces that are missing to the bound change the largest motion that was tried."""


@dataclass(frozen=True)
class LinearRates:
    """Eigenvalues of the linear motions.

    Attributes
    ----------
    undamped : WithoutDissipation
        Of sticking contacts, without dissipation.
    sticking, sliding : Linear
        With the dissipation, if all contacts at the bound stick, and if all slide on.
    one_sided : bool
        Whether contacts at the bound slide on ahead and stick on the way back.
    """

    undamped: WithoutDissipation
    sticking: Linear
    sliding: Linear
    one_sided: bool

    @classmethod
    def of(
        cls, configuration: Configuration, known: Spectrum | None, large: bool, time: float | None = None
    ) -> "LinearRates":
        """Compute the rates; K's spectrum may be known.

        This spectrum decides without dissipation. With dissipation the spectrum is a remark, and where it takes longer
        than all else, the fastest motion without dissipation stands for it.
        """
        wanted = configuration.coordinates <= LAPACK_UP_TO if configuration.damped else not large
        found = spectrum(configuration) if known is None and wanted else known
        undamped, sticking = _without_dissipation(configuration, found)
        if configuration.damped:
            sticking = linear_verdict(Motion.of(configuration), time=time)
        one_sided = bool(configuration.contacts.one_sided.any())
        sliding = linear_verdict(Motion.of(configuration, sliding=True), decides=False) if one_sided else sticking
        return cls(undamped, sticking, sliding, one_sided)


def _without_dissipation(configuration: Configuration, found: Spectrum | None) -> tuple[WithoutDissipation, Linear]:
    """Of sticking contacts: what grows without dissipation, and its eigenvalues s."""
    if found is None:
        alone = linear_verdict(Motion.of(configuration, dissipation=False), decides=not configuration.damped)
        return WithoutDissipation(alone.growth_rate, None, None, alone.at_least), alone
    rates = Linear(not len(found.unstable), found.growth_rate(), free=found.free)
    return WithoutDissipation(found.growth_rate(), len(found.pairs), len(found.negative)), rates


@dataclass(frozen=True)
class SmallMotion:
    """The fate of small motion under a load that is held; `grows` is None if it is unknown.

    `residual_displacement` is the root of the largest D to which the residual forces move the packing, length; most of
    the others are those of :class:`~faultgouge.analysis.motion.verdict.Stability`."""

    grows: bool | None
    growth_rate: float
    sticking: LinearNeighbour
    free: int
    at_least: bool = False
    reasons: Sequence[str] = ()
    one_sided: OneSidedOutcome | None = None
    creep: Creep | None = None
    largest_push: float | None = None
    push_time: float = 0.0
    residual_push: float = 0.0
    residual_displacement: float = 0.0
    said: str = ""

    @classmethod
    def of_linear(cls, linear: LinearRates, doubts: Sequence[str] = ()) -> "SmallMotion":
        """Of linear motion with sticking contacts."""
        sticking = LinearNeighbour.of(linear.sticking)
        unknown = doubts or linear.sticking.stable is None
        grows = None if unknown else not linear.sticking.stable
        reasons = [*doubts, *linear.sticking.reasons]
        said = linear.sticking.said
        return cls(grows, sticking.growth_rate, sticking, linear.sticking.free, sticking.at_least, reasons, said=said)

    def beside_residual_forces(self, reach: ContactReach) -> "SmallMotion":
        """The outcome with what the residual forces do, beside the motion whose reach is given."""
        pushes, moves = reach.residual_scale, reach.residual_displacement
        return replace(self, residual_push=pushes, residual_displacement=moves)


def follow_small_motion(system: OneSidedSystem, linear: LinearRates, time: float | None, pushes: int) -> SmallMotion:
    """The fate of small motion, followed in time where eigenvalues do not decide."""
    outcome = SmallMotion.of_linear(linear)
    if linear.one_sided:
        found, reach = follow_pushes(system, outcome.growth_rate, bool(outcome.grows), time, pushes)
        outcome = _after_pushes(outcome, found, reach)
    elif outcome.grows is False:
        outcome = _as_contacts_part(outcome, system, time, pushes)
    return outcome


def _as_contacts_part(linear: SmallMotion, system: OneSidedSystem, time: float | None, pushes: int) -> SmallMotion:
    """The outcome of linear motion that does not grow: how far it holds, and what laws of two derivatives add."""
    configuration = system.motion.configuration
    if not len(configuration.contacts):
        return linear
    reach = ContactReach(system)
    reach.look_closely(system.start(random_pushes(configuration, 1)))
    most, reasons = reach.largest_scale, [UNSETTLED] if np.isinf(reach.least_scale) else []
    # with a K that is given the bounds of contacts are not known
    largest = most if np.isfinite(most) and configuration.stiffness is None else None
    found = replace(linear.beside_residual_forces(reach), largest_push=largest, push_time=reach.time, reasons=reasons)
    if system.remembers_nothing:
        return found
    creep = follow_creep(system, pushes, time, decay=max(-0.5 * linear.growth_rate, 0.0))
    if creep.grows:
        reasons = [
            f"vibration wears contacts down, and adds more to D within t = {creep.time:.4g} than creep, which adds as "
            "the square of the time; whether this goes on was not followed"
        ]
    return replace(found, creep=creep, reasons=reasons)


def _after_pushes(sticks: SmallMotion, found: OneSidedOutcome, reach: ContactReach) -> SmallMotion:
    """The outcome of one-sided motion; unknown, too, if it is the motion after no push of any size."""
    reasons, (least, most), residual = list(sticks.reasons), found.scales, reach.residual_scale
    if found.grows is None:
        reasons.append(
            f"the motion of contacts at Coulomb's bound has not settled within t = {found.time:.4g}, where D is "
            f"{found.amplification:.3g} times the mean square velocity of the push, and D that grows more slowly "
            f"than exp({found.searched:.2g} t) may not have been seen"
            + (f"; `time` = {found.needed:.2g} may do" if found.needed else "")
        )
    elif not found.grows and np.isinf(least):
        reasons.append(UNSETTLED if reach.unsettled else NOT_REACHED)
    elif not found.grows and least >= most and least > PUSH_OVER_RESIDUAL * residual:
        reasons.append(
            f"contacts that count as at Coulomb's bound reach it after pushes above {least:.1g} (velocity along an "
            f"axis) alone, and others reach it, open or close, after pushes above {most:.1g}: bring the packing to "
            "rest more closely"
        )
    return replace(
        sticks.beside_residual_forces(reach),
        grows=found.grows if found.grows or sticks.grows is not None else None,
        at_least=sticks.at_least and not found.grows,
        growth_rate=sticks.growth_rate if not found.grows or found.growth_rate is None else found.growth_rate,
        reasons=reasons,
        one_sided=found,
    )
