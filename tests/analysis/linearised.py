"""The linearised motion M q'' + C q' + K q = 0 of a packing in dense matrices, for methods that the package has not."""

from dataclasses import replace

import numpy as np

from faultgouge.analysis import damping_matrix, stiffness_matrix


def matrices(packing):
    """K, C, the diagonal of M, and the coordinates that feel a force, to which these belong."""
    k, c = stiffness_matrix(packing).toarray(), damping_matrix(packing).toarray()
    active = np.flatnonzero(np.any(k != 0, axis=1))
    mass = np.concatenate([packing.mass, packing.mass, packing.inertia_factor * packing.mass])[active]
    return k[np.ix_(active, active)], c[np.ix_(active, active)], mass, active


def motion_matrix(packing):
    """The matrix S of (q, q')' = S (q, q')."""
    k, c, mass, _ = matrices(packing)
    return np.block([[np.zeros_like(k), np.eye(len(k))], [-k / mass[:, None], -c / mass[:, None]]])


def dissipative(packing, cn=0.0, ct=0.0, drag_time=None):
    """The packing with dashpots and drag."""
    return replace(packing, law=replace(packing.law, cn=cn, ct=ct), drag_time=drag_time)
