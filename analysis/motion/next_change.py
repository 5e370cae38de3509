r"""How far a load may rise until a contact changes: it reaches Coulomb's bound, opens, closes, or turns its force.

While the load rises by :math:`x`, the particles move by :math:`x u`, with the drift u, and contacts change as
:mod:`~faultgouge.analysis.operators.contact_changes` says. Contacts of particles farther apart are not foreseen.
"""

import numpy as np

from ..arrays import Floats
from .one_sided import OneSidedSystem
from .steady_drift import change_by_turning

REACHES, OPENS, CLOSES, TURNS = "reaches Coulomb's bound", "opens", "closes", "at Coulomb's bound turns its force"


def next_change(
    system: OneSidedSystem, velocity: Floats, slid: Floats, paths: Floats
) -> tuple[float | None, str | None]:
    """At which increase of the load a contact changes first, and what it does.

    None twice if no contact is known that changes.
    If the force of a contact at the bound turns first, the packing in which this contact slides decides how far.

    Parameters
    ----------
    system : OneSidedSystem
        Of the configuration.
    velocity : ndarray, shape (E, 1)
        Mean mass-weighted velocity at the rate 1.
    slid : ndarray, shape (B, 1)
        Mean rates at which contacts at the bound slide, force.
    paths : ndarray, shape (R, 1)
        Mean rates of the paths of the overlaps of contacts with two derivatives.

    Raises
    ------
    NotFollowedError
        If nothing holds the particles after the force of a contact has turned.
    """
    if system.motion.configuration.stiffness is not None:
        return None, None
    slowly = np.zeros_like(velocity)  # dashpots do not count
    multiples = system.contact_changes.multiples(velocity, slowly, slid, paths)
    changes = zip(multiples, (REACHES, OPENS, CLOSES, TURNS), strict=True)
    first, event = min((float(each.min(initial=np.inf)), name) for each, name in changes)
    if event == TURNS:
        first = min(first, change_by_turning(system, velocity, np.isfinite(multiples.turns[:, 0])))
    return (first, event) if first < np.inf else (None, None)
