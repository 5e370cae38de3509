"""Packings of this package as Snapshots, to compare the operators of both."""

import numpy as np

from faultgouge.analysis import Configuration, Packing
from faultgouge.analysis.packing.linearise import linearise_contacts


def snapshot_of(packing: Packing) -> Configuration:
    """The linearised contacts of a packing, without its drag."""
    g, c, n = packing.geometry, packing.contacts, len(packing)
    flat = np.zeros(len(c))
    arms = np.column_stack([packing.radius[c.i], np.where(c.floor, 0.0, packing.radius[c.j])])
    contacts = linearise_contacts(
        packing.law, g.overlap, c.slip, np.column_stack([g.tangent, flat]), i=c.i, j=c.j, slip_arm=arms,
        lever_arm=arms, normal=np.column_stack([g.normal, flat]), distance=np.where(c.floor, np.inf, g.distance),
    )  # fmt: skip
    load = np.zeros((n, 2, 3))
    load[packing.top, 0, :2] = packing.fx, -packing.fy
    return Configuration(
        dimension=2, position=packing.position, radius=packing.radius, mass=packing.mass,
        inertia=packing.inertia_factor * packing.mass * packing.radius**2, contacts=contacts,
        box=np.diag([packing.box_length or 0.0, 0.0, 0.0]), origin=np.zeros(3),
        periodic=np.array([packing.box_length is not None, False, False]), load=load, fx=packing.fx,
    )  # fmt: skip
