"""Contacts of the law of this package to first order, for a :class:`~faultgouge.analysis.Configuration`."""

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats
from ..contacts import LinearisedContacts
from .law import MindlinLaw


def linearise_contacts(
    law: MindlinLaw, overlap: Floats, slip: Floats, tangent: Floats, **where: ArrayLike
) -> LinearisedContacts:
    """Contacts of the smooth law of this package, along a tangent, shape (C, 3); `where` has all other fields.

    They resist no slip at Coulomb's bound, on either side: that is the derivative of the smooth law.
    """
    grows, falls = (law.derivatives(overlap, slip, share) for share in (0.0, 1.0))
    along, across = law.dashpots(overlap, slip)
    count = len(overlap)
    return LinearisedContacts(
        overlap=overlap,
        lever_slope=np.zeros(count),
        normal_force=grows.normal_force,
        tangential_force=grows.tangential_force[:, None] * tangent,
        normal_stiffness=grows.normal_stiffness,
        tangential_stiffness=-grows.slip_derivative,
        closing=grows.overlap_derivative[:, None] * tangent,
        parting=falls.overlap_derivative[:, None] * tangent,
        friction=law.mu * grows.normal_force if law.frictional else np.full(count, np.inf),
        sliding=np.zeros(count, dtype=np.bool_),
        normal_dashpot=along,
        tangential_dashpot=across,
        slider=np.full(count, law.coulomb),
        viscous_slider=np.zeros(count, dtype=np.bool_),
        **where,
    )
