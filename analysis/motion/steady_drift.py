r"""The motion with which a packing without contacts at Coulomb's bound follows a load that rises: its drift.

Under the load :math:`t\, \mathbf g` the lasting drift :math:`\dot u` solves :math:`K \dot u = \mathbf g`. If a law has
two derivatives, one while a contact closes and one while it parts, K has for each contact the derivative of its own
way. A force that is left over belongs to a motion that no force opposes, which the load accelerates for ever: then
there is no drift.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, diags_array, eye_array

from ..arrays import Floats
from ..counted import counted
from ..errors import FaultgougeError
from ..factors.sparse_lu import general_lu
from .contact_reach import SAME_WAY
from .eigenvalues import operator_rounding, zero_uncertainty
from .linear import linear_verdict
from .motion import Motion
from .one_sided import OneSidedSystem

DIAGONAL_SHIFT = 1e-11
"""Number added to the diagonal of K, as a share of the largest entry, so that free motions do not divide by zero."""

REFINEMENTS = 3
"""Steps of iterative refinement, each of which takes this shift out once more."""

UNBORNE_SHARE = 1e-6
"""Share of the load that may be left over where K bears the load."""

WAY_CHANGES = 60
"""How often the ways that contacts go may be changed: a few times are enough where the solution is unique."""


class NotFollowedError(FaultgougeError):
    """The motion under a load that rises has no constant drift and no vibration about it."""


def steady_velocity(system: OneSidedSystem, direction: Floats, free: int) -> Floats | None:
    """The drift, mass-weighted, shape (E, 1); None if the motion is to be followed.

    Parameters
    ----------
    system : OneSidedSystem
        Of the configuration.
    direction : ndarray, shape (coordinates, 1)
        Forces per unit of time.
    free : int
        Motions that no force opposes.

    Raises
    ------
    NotFollowedError
        If the load accelerates a motion that no force opposes.
    """
    if system.sliders[1].shape[0]:
        return None
    motion, load = system.motion, system.on_active(direction)
    rates, forces, _ = system.rescaled
    way = np.zeros(rates.shape[0])
    for _ in range(WAY_CHANGES):
        stiffness = csr_array(motion.stiffness - forces @ diags_array(way) @ rates) if len(way) else motion.stiffness
        velocity = static_response(replace(motion, stiffness=stiffness), load, free)
        before, way = way, np.sign(rates @ velocity)[:, 0]
        if np.array_equal(before, way):
            break
    else:
        return None
    if len(way):
        found = linear_verdict(replace(motion, stiffness=stiffness))
        if found.searched or not found.stable:
            return None
    return velocity


def change_by_turning(system: OneSidedSystem, velocity: Floats, turns: NDArray[np.bool_]) -> float:
    r"""Increase of the load at which contacts that slide on, since their forces have turned, change the drift.

    A force across f_t that is :math:`x\, a_c` after an increase x lets the contact pass the bound by
    :math:`x^2 a_c^2 / (2 \mu f_n)`. The packing, in which these contacts slide, moves until other contacts bear this.

    Parameters
    ----------
    system : OneSidedSystem
        Of a configuration in three dimensions.
    velocity : ndarray, shape (E, 1)
        The drift, mass-weighted.
    turns : ndarray of bool, shape (B,)
        Contacts at the bound whose forces turn.

    Raises
    ------
    NotFollowedError
        If no other contacts bear it.
    """
    grip, excess = (csr_array(each) for each in system.sliders[:2])
    sideways = np.where(turns[:, None], system.sideways[0] @ velocity, 0.0)
    stiffness = csr_array(system.motion.stiffness + grip[:, turns] @ excess[turns])
    try:
        moves = static_response(replace(system.motion, stiffness=stiffness), grip @ sideways**2, 1)
    except NotFollowedError:
        raise NotFollowedError(
            "the load turns the forces of contacts at Coulomb's bound, and nothing holds the particles that slide then"
        ) from None
    size, change = (system.mean_square_displacement(each)[0] for each in (velocity, moves))
    return float(SAME_WAY * np.sqrt(size / change)) if change else np.inf


def refuse_flight(system: OneSidedSystem, direction: Floats) -> None:
    """Refuse a load on particles that touch nothing, which accelerate for ever.

    Raises
    ------
    NotFollowedError
        If there are such particles.
    """
    motion = system.motion
    loaded = motion.configuration.coordinate_free & (direction[:, 0] != 0)
    loaded[motion.active] = False
    flying = np.unique(np.flatnonzero(loaded) % len(motion.configuration))
    if len(flying):
        raise NotFollowedError(
            f"the load accelerates {counted(len(flying), 'particle')} that nothing touches: give no forces on these"
        )


def static_response(motion: Motion, load: Floats, free: int) -> Floats:
    """v of A v = load, without the motions that no force opposes, shape (E, 1).

    Parameters
    ----------
    motion : Motion
        A.
    load : ndarray, shape (E, 1)
        Mass-weighted forces.
    free : int
        Motions that no force opposes.

    Raises
    ------
    NotFollowedError
        If the load accelerates such a motion.
    """
    matrix = motion.stiffness
    shift = DIAGONAL_SHIFT * float(np.abs(matrix.data).max(initial=0.0))
    if free:
        rounding = operator_rounding(motion.configuration, matrix.data)
        shift = max(shift, 10 * zero_uncertainty(motion.configuration, rounding))
    factors = general_lu(csc_array(matrix + shift * eye_array(matrix.shape[0])))
    velocity = np.zeros_like(load)
    for _ in range(1 + REFINEMENTS):
        velocity += factors.solve(load - matrix @ velocity)
    if np.linalg.norm(load - matrix @ velocity) > UNBORNE_SHARE * np.linalg.norm(load):
        moves = f"{counted(free, 'motion')} that no force opposes" if free else "a motion that next to no force opposes"
        raise NotFollowedError(f"the load accelerates {moves}")
    return velocity
