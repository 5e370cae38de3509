"""Equilibria in compensated arithmetic, see :mod:`~faultgouge.analysis.packing.compensated`."""

from dataclasses import replace

import numpy as np

from ....pywrap import Engine, Equilibrium, equilibrate


def compensated(equilibrium: Equilibrium) -> Equilibrium:
    """The same equilibrium, its coordinates with low parts and its forces balanced to the floor of that arithmetic."""
    packing = replace(equilibrium.packing, position_low=np.zeros_like(equilibrium.packing.position))
    with Engine(packing) as engine:
        return equilibrate(engine, replace(equilibrium, packing=packing), packing.fx)
