r"""What makes K asymmetric, by leaving out one of its terms at a time.

The tangential force turns with its contact; the lever arm of the torque may differ from that of the slip; the
tangential force may depend on the overlap. Each share is a Frobenius norm of the antisymmetric part of
:math:`M^{-1/2} K M^{-1/2}` that the term adds.
"""

from typing import Any

import numpy as np
from scipy.sparse import diags_array

from ..arrays import derive_frozen
from ..configuration import Configuration
from ..contacts import LinearisedContacts
from .stiffness import stiffness_matrix

ROUNDING_OF_ENTRY = 1e-12
"""Asymmetry below this share of the largest entry is rounding."""


def asymmetry(configuration: Configuration) -> dict[str, float]:
    """What makes K asymmetric, as shares that sum up to one; zeros where K is symmetric.

    Returns
    -------
    dict
        tangential_force: the force turns with its contact; lever_arm: torque and slip have different arms; overlap: the
        tangential force depends on the overlap.
    """
    c = configuration.contacts
    none = np.zeros_like(c.tangential_force)
    without = {
        "tangential_force": derive_frozen(c, tangential_force=none),
        "lever_arm": derive_frozen(c, lever_arm=c.slip_arm, lever_slope=np.zeros(len(c))),
        "overlap": derive_frozen(c, closing=none, parting=none),
    }

    scale = diags_array(1 / np.sqrt(configuration.coordinate_mass))

    def skew(contacts: LinearisedContacts) -> Any:
        here = derive_frozen(configuration, contacts=contacts)
        a = scale @ stiffness_matrix(here) @ scale
        return a - a.T

    whole = skew(c)
    sizes = {name: float(np.linalg.norm((whole - skew(each)).data)) for name, each in without.items()}
    total = sum(sizes.values())
    least = ROUNDING_OF_ENTRY * float(np.abs((scale @ stiffness_matrix(configuration) @ scale).data).max(initial=0.0))
    return {name: size / total if total > least else 0.0 for name, size in sizes.items()}
