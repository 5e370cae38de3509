"""The transfer function of the upper layer, solved for frequency by frequency: a reference."""

import numpy as np
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import splu

from faultgouge.analysis import damping_matrix, stiffness_matrix
from faultgouge.analysis.motion.response import layer_force


def layer_response(packing, omega):
    """V = i omega e^T (K - omega^2 M + i omega C)^-1 f of unit forces along x on the upper layer, e their mean."""
    k, c = stiffness_matrix(packing), damping_matrix(packing)
    active = np.flatnonzero(np.diff(k.indptr))
    k, c = (csc_array(matrix[active][:, active]) for matrix in (k, c))
    mass = np.concatenate([packing.mass, packing.mass, packing.inertia_factor * packing.mass])
    push = layer_force(packing, 1.0)[active]
    return np.array(
        [
            1j * w * (push @ splu(csc_array(k - w**2 * diags_array(mass[active]) + 1j * w * c)).solve(push + 0j))
            for w in omega
        ]
    ) / int(packing.top.sum())
