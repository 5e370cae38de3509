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

from numpy.typing import ArrayLike
from scipy.sparse import csr_array

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
