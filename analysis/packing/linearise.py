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
    force, none, no = grows.normal_force, np.zeros(len(overlap)), np.zeros(len(overlap), np.bool_)
    return LinearisedContacts(
        overlap=overlap, lever_slope=none, normal_force=force, normal_stiffness=grows.normal_stiffness,
        tangential_force=grows.tangential_force[:, None] * tangent, tangential_stiffness=-grows.slip_derivative,
        closing=grows.overlap_derivative[:, None] * tangent, parting=falls.overlap_derivative[:, None] * tangent,
        friction=law.mu * force if law.frictional else none + np.inf, sliding=no, normal_dashpot=along,
        tangential_dashpot=across, slider=no | law.coulomb, viscous_slider=no, **where,
    )  # fmt: skip
