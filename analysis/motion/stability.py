r"""Does a packing at rest move? The verdict, with its own dissipation and its contacts at Coulomb's bound as they are.

**No contact at Coulomb's bound.** Small motion is linear. The packing is stable if no eigenvalue s of
:math:`s^2 M + s C + K` has Re s > 0 beyond rounding (:mod:`~faultgouge.analysis.motion.linear`), with C of its own
dashpots and drag. Complex pairs of K alone are the answer without loss, and no verdict on a packing with dashpots.

**Contacts at the bound** slide on ahead and stick on the way back, and no eigenvalue decides
(:mod:`~faultgouge.analysis.motion.one_sided`). The motion is followed from random pushes until it grows or rests
(:mod:`~faultgouge.analysis.motion.pushes`). So is the motion of laws with two derivatives, one while a contact closes
and one while it parts, which lets vibration carry particles on.

**How far it holds.** Of linear motion a bound for all pushes says (:mod:`~faultgouge.analysis.motion.reach`), of
one-sided motion the pushes that were followed. Where the residual forces alone change a contact, no push is small
enough. If these contacts bear next to nothing, and linear motion without them does the same, that is the verdict.

**A load that rises** is followed in the same way (:mod:`~faultgouge.analysis.motion.rising_load`).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, derive_frozen
from ..counted import counted
from ..fields_by_name import FieldsByName
from ..has_configuration import HasConfiguration
from ..operators.asymmetry import asymmetry
from ..operators.sliders import with_sticking_contacts
from .eigenvalues import Linear
from .linear import linear_verdict
from .motion import Motion
from .no_verdict import no_verdict
from .one_sided import OneSidedSystem, forces_on_coordinates
from .pushes import PUSHES, follow_creep, follow_pushes
from .reach import change_of_growing, reach_of
from .rising_load import NotFollowedError, motion_under_load, static_response
from .spectrum import Spectrum, spectrum
from .verdict import Stability

LARGE = 6000
"""Coordinates beyond which one push and its opposite stand for several, and K's spectrum is not computed."""

UNSETTLED = "its residual forces alone take a contact to Coulomb's bound, open or close one: "
UNSETTLED += "bring the packing to rest more closely"
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
    if time is not None and not (isinstance(time, Real) and 0 < time < np.inf):
        raise ValueError(f"The time that motion is followed is a positive number, not {time!r}.")
    c = with_sticking_contacts(packing.configuration)
    known = spectrum_of_stiffness if c is packing.configuration else None  # the other is of contacts that slide
    direction = None if rise is None else forces_on_coordinates(c, rise)
    if direction is not None and not direction[c.coordinate_free].any():
        raise ValueError("rise is a force on no particle that moves: give the forces by which the load rises.")
    motion, contacts, given, doubts = Motion.of(c), c.contacts, c.stiffness is not None, (*reasons, *no_verdict(c))
    undamped, sticking = _linear_motion(motion, known, time)
    sided, touching = bool(contacts.one_sided.any()), contacts.touching
    sliding = linear_verdict(Motion.of(c, sliding=True), decides=False) if sided else sticking
    # where K is given, contacts, as far as they are known, have no derivatives
    count = max(len(touching), len(c) - len(c.rattlers)) if given else len(touching)
    found = Stability(
        stable=None if doubts or not count else sticking.stable, growth_rate=sticking.growth_rate,
        error=sticking.error, at_least=sticking.at_least, undamped=undamped, at_bound=int(touching.at_bound.sum()),
        rolling_at_bound=int(contacts.at_bound.sum() - touching.at_bound.sum()),
        sticking=sticking, sliding=sliding, asymmetry={} if given else asymmetry(c), dissipative=c.damped,
        free=sticking.free, contacts=count, reasons=doubts or sticking.reasons, remarks=c.remarks,
    )  # fmt: skip
    if count and not doubts and (sided or found.stable is not None or direction is not None):
        system = OneSidedSystem(motion)
        found = replace(found, **(_after_pushes if sided else _linear)(found, system, time))
        if direction is not None:
            found = replace(found, **_rising(found, system, direction, time))
    elif direction is not None:
        found = replace(found, not_followed="no verdict is possible")
    return follow(found) if follow is not None and found.stable is False else found


def _linear_motion(motion: Motion, known: Spectrum | None, time: float | None) -> tuple[FieldsByName, Linear]:
    """Of sticking contacts: what grows without dissipation, and with it. K's spectrum decides where there is none."""
    c, damped = motion.configuration, motion.configuration.damped
    if known is None and c.coordinates <= (2000 if damped else LARGE):
        known = spectrum(c)
    if known is None:
        alone = Motion.of(c, dissipation=False) if damped else motion
        sticking = linear_verdict(alone, decides=not damped, time=time)
        counts: dict[str, int | None] = {"pairs": None, "negative": None}
    else:
        roots = 1j * np.sqrt(known.unstable.astype(complex))
        s = complex(max(np.where(roots.real < 0, -roots, roots), key=np.real, default=0j))
        sticking = Linear(not len(roots), known.growth_rate(), 0.0, known.free, s)
        counts = {"pairs": len(known.pairs), "negative": len(known.negative)}
    rate = max(sticking.growth_rate, 0.0)
    undamped = FieldsByName(growth_rate=rate, **counts, at_least=sticking.at_least)
    return undamped, linear_verdict(motion, time=time) if damped else sticking


def _linear(found: Stability, system: OneSidedSystem, time: float | None) -> dict[str, Any]:
    """What else is to be said of linear motion: where growth ends, up to which push the verdict holds, and creep."""
    c, motion, told = system.configuration, system.motion, dict[str, Any]()
    if found.stable is False:
        return {"first_change": change_of_growing(system, found.sticking.s) if found.sticking.s else None}
    if found.stable is None:
        return {}
    if (reach := reach_of(system, found.free)) is not None:
        mass = motion.root_mass[motion.active < c.dimension * len(c)] ** 2
        if np.isfinite(reach.energy):
            told = {"largest_energy": reach.energy, "largest_push": float(np.sqrt(2 * reach.energy / mass.max()))}
        told["push_time"] = reach.time if np.isfinite(reach.time) else None
        told["residual_push"] = float(np.sqrt(2 * reach.residual_energy / mass.min()))
        if len(reach.unsettled):
            bears = np.isin(np.arange(len(c.contacts)), reach.unsettled, invert=True)
            force, without = c.contacts.normal_force, derive_frozen(c, contacts=c.contacts.chosen(bears))
            # by Hertz's law the stiffness of such a contact is a tenth of that of others
            weak = not np.any(force[~bears] > 1e-3 * force.mean())
            if not weak or linear_verdict(Motion.of(without), time=time).stable is not True:
                return told | {"stable": None, "reasons": (UNSETTLED,)}
            few = f"{counted(len(reach.unsettled), 'contact')} of next to no force"
            remark = f"the residual forces alone change {few}, without which the verdict is the same"
            told["remarks"] = (*found.remarks, remark)
    if system.remembers_nothing or c.stiffness is not None:
        return told
    pushes = 1 if c.coordinates > LARGE else PUSHES
    creep = follow_creep(system, pushes, time, max(-0.5 * found.growth_rate, 0.0), found.free)
    if creep.grows:
        told |= {"stable": False, "growth_rate": creep.growth_rate}
    elif creep.grows is None:
        rises = f"its energy has risen within t = {creep.time:.4g}; whether this goes on was not followed"
        told |= {"stable": None, "reasons": (f"vibration wears contacts down, and {rises}",)}
    return told | {"creep": creep}


def _after_pushes(found: Stability, system: OneSidedSystem, time: float | None) -> dict[str, Any]:
    """The verdict on one-sided motion; unknown, too, if it is the motion after no push of any size."""
    pushes = 1 if system.configuration.coordinates > LARGE else PUSHES
    outcome = follow_pushes(system, found.growth_rate, found.sticking.stable is not False, time, pushes)
    (least, most), reasons = outcome.scales, found.sticking.reasons
    told = {"one_sided": outcome, "first_change": outcome.changes_at}
    if outcome.grows is None and outcome.slides_on:
        slide = f"{counted(outcome.slides_on, 'contact')} at Coulomb's bound slide{'s' * (outcome.slides_on == 1)}"
        why = f"{slide} on after a push, and within t = {outcome.time:.4g} neither to rest nor faster and faster"
        reasons = (f"the motion has not settled: {why}",)
    elif outcome.grows is None:
        more = f"; `time` = {outcome.needed:.2g} may do" if outcome.needed else ""
        slower = f"D that grows more slowly than exp({outcome.searched:.2g} t) may not have been seen{more}"
        why = f"the motion of contacts at Coulomb's bound has not settled within t = {outcome.time:.4g}, and {slower}"
        reasons = (why,)
    elif outcome.grows:
        reasons, told["at_least"] = (), False
        told |= {"growth_rate": outcome.growth_rate} if outcome.growth_rate else {}
        told |= {"error": outcome.error} if outcome.error else {}
    elif np.isinf(least):
        reasons = (UNSETTLED,)
    elif least >= most:
        why = "contacts that count as at Coulomb's bound reach it, or residual forces do not count, after pushes "
        why += f"above {least:.1g} (velocity along an axis) alone, and other contacts change after pushes above "
        why += f"{most:.1g}: bring the packing to rest more closely"
        reasons = (why,)
    return told | {"stable": None if reasons else not outcome.grows, "reasons": reasons}


def _rising(found: Stability, system: OneSidedSystem, direction: Floats, time: float | None) -> dict[str, Any]:
    """The motion under a rising load, or why it was not followed."""
    if found.stable is False or UNSETTLED in found.reasons:
        return {"not_followed": UNSETTLED if found.stable is None else "small motion grows"}
    # a force that begins to act displaces twice as far as one at rest
    moved = 2 * static_response(system.motion, system.residual_force, found.free)
    residual = float(np.sqrt(system.mean_square_displacement(moved).max(initial=0.0)))
    decays = found.sticking.stable is True
    try:
        return {"rising": motion_under_load(system, direction, time, free=found.free, decays=decays, residual=residual)}
    except NotFollowedError as error:
        return {"not_followed": str(error)}
