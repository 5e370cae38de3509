r"""The damping matrix :math:`C = -\partial F / \partial \dot q` of a packing.

Coordinates and the vectors N and T of a contact are those of :mod:`~faultgouge.analysis.operators.stiffness`. A contact
has a dashpot along its normal and one along its slip (:mod:`~faultgouge.analysis.packing.law`), and there may be a drag
on each disk,
:math:`-(m/\tau)\,\mathbf v` and :math:`-(I/\tau)\,\omega`:

.. math::

    C = \sum_c \left( C_N \delta^{p-1}\, N N^T + C_T \delta^{p-1}\, T T^T \right) + \frac1\tau M, \qquad
    M = \mathrm{diag}(m, m, I_0 m).

C is symmetric and positive semidefinite: the energy falls by :math:`\dot q^T C\, \dot q` per unit of time. Small motion
about an equilibrium obeys :math:`M \ddot q + C \dot q + K q = 0`.

A contact at Coulomb's bound has no term in T. At the bound the tangential force is not a differentiable function of the
velocity: the force stays at the bound if the contact continues to slide, and the dashpot acts if the contact slides
back. C uses the first case, as the stability operator does for the slip of such a contact.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import eigs

from ..arrays import derive_frozen
from ..has_configuration import HasConfiguration


def damping_matrix(packing: HasConfiguration, sliding: ArrayLike = False) -> csr_array:
    """Assemble C = -dF/d(dq/dt).

    Parameters
    ----------
    packing : Packing or Configuration
        The configuration, with dashpots ``law.cn`` and ``law.ct`` and with ``drag_time``; any of them may be absent.
    sliding : array_like of bool, shape () or (C,)
        As in `stiffness_matrix`: contacts that continue to slide have no tangential dashpot.

    Returns
    -------
    scipy.sparse.csr_array, shape (3N, 3N), or (6N, 6N) of spheres
        Force time / length, in the order (x.., y.., R theta..), or as in :mod:`~faultgouge.analysis.configuration`.
        For a Packing, C is symmetric and positive semidefinite. Without dashpots and drag, C is empty.
    """
    return packing.assembled_damping(sliding)


def largest_damping_rate(packing: HasConfiguration) -> float:
    """Largest eigenvalue of M^-1 C of the dashpots without drag, 1 / time; 0 without dashpots.

    Parameters
    ----------
    packing : Packing or Configuration
        The configuration.
    """
    matrix = damping_matrix(derive_frozen(packing.configuration, drag_rate=0.0))
    if matrix.nnz == 0:
        return 0.0
    scale = diags_array(1 / np.sqrt(packing.coordinate_mass))
    # a fixed start makes the result the same on every rank
    weighted, start = scale @ matrix @ scale, np.random.Generator(np.random.PCG64(0)).standard_normal(matrix.shape[0])
    # arms of torques that are not those of slips leave C not symmetric
    return float(eigs(weighted, 1, which="LR", v0=start, return_eigenvectors=False)[0].real)
