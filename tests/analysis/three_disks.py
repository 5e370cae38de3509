"""Three disks on a floor, one of whose contacts is at Coulomb's bound."""

from dataclasses import replace

import numpy as np

from faultgouge.analysis import Configuration, Contacts, MindlinLaw, Packing
from faultgouge.analysis.arrays import derive_frozen


def three_disks() -> Packing:
    """A pile of three disks, in no balance."""
    law = MindlinLaw(2e3, 6e2, 0.5, cn=2.0, ct=1.0, coulomb=True)
    c = Contacts([0, 1, 2, 2, 0], [-1, -1, 0, 1, 1], np.zeros(5))
    bare = Packing(position=[[0.0, 0.49], [0.99, 0.49], [0.495, 1.34]], radius=[0.5] * 3, contacts=c, law=law)
    return replace(bare, contacts=c.slipped(law.slip_limit(bare.geometry.overlap) * [0.3, -0.3, 0.2, 1.0, 0.1], None))


def balanced(packing: Packing) -> Configuration:
    """The configuration under the load that balances it."""
    moves = packing.configuration
    return derive_frozen(moves, load=-moves.contact_force)


def stuck_at_rest(**law: float) -> Configuration:
    """The pile at rest, with so large a friction that no contact is at the bound."""
    return balanced(replace(three_disks(), law=replace(three_disks().law, mu=50.0, **law)))
