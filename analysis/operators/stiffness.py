r"""The stability operator :math:`K = -\partial F / \partial q` of a packing.

Coordinates and forces are those of :mod:`~faultgouge.analysis.packing.packing`, in the order (x_1.., y_1.., u_1..),
:math:`u = R\theta`. In the six coordinates :math:`(x_i, y_i, u_i, x_j, y_j, u_j)` of one contact put

.. math::

    N &= (\mathbf n, 0, -\mathbf n, 0), & \mathrm d\delta &= -N \cdot \mathrm dq \\
    P &= (\boldsymbol\tau, 0, -\boldsymbol\tau, 0), & \mathrm d\mathbf n &= \boldsymbol\tau\,
    (P \cdot \mathrm dq)/r, \quad \mathrm d\boldsymbol\tau = -\mathbf n\, (P \cdot \mathrm dq)/r \\
    T &= (\boldsymbol\tau, -1, -\boldsymbol\tau, -1), & \mathrm ds &= T \cdot \mathrm dq

The force on all six is :math:`f_n N + f_t T`, and its derivative, with :math:`f_n' = \mathrm df_n/\mathrm d\delta`
and with a and b of :mod:`~faultgouge.analysis.packing.law`,

.. math::

    -K_c = -f_n'\, N N^T + \frac{f_n}{r}\, P P^T + a\, T T^T
    - b\, T N^T - \frac{f_t}{r}\, N P^T

For the floor only the first three coordinates exist and P = 0. The last two terms are not symmetric: the tangential
force depends on the overlap but the normal force does not depend on the slip, and the tangential force rotates with the
contact. ``form="paper"`` leaves out the last term, as does the operator published by Charan, Pomyalov and Procaccia.
They differentiate the slip vector with :math:`\partial t/\partial r = 1 - \mathbf n \mathbf n^T`, and so lose the
rotation of the tangent. ``form="consistent"`` is the exact derivative of the integrated forces.

Without friction only N and P remain, and K is an operator on the 2N coordinates (x, y): rows and columns of rotations
are empty.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from ..has_configuration import HasConfiguration
from ..packing.disk_operators import Form


def stiffness_matrix(
    packing: HasConfiguration,
    form: Form = "consistent",
    coupled: NDArray[np.bool_] | None = None,
    parting: ArrayLike = 0.5,
    sliding: ArrayLike = False,
) -> csr_array:
    """Assemble K = -dF/dq.

    Parameters
    ----------
    packing : Packing or Configuration
        The configuration; it need not be in balance.
    form : {"consistent", "paper"}
        The exact derivative, or the derivative without the rotation of the tangent.
    coupled : ndarray of bool, shape (C,), optional
        Contacts whose tangential force depends on their overlap; all by default. For the other contacts b = d f_t / d
        overlap is set to zero. The result is not a derivative of this law; it shows the effect of b.
    parting : array_like, shape () or (C,)
        Weight of the derivative of an opening contact, for a law that rescales slips: 0 for closing contacts, 1 for
        opening contacts, and by default 1/2, the first harmonic of a small vibration
        (:mod:`~faultgouge.analysis.packing.law`).
    sliding : array_like of bool, shape () or (C,)
        Which of the contacts at Coulomb's bound continue to slide, for Coulomb's slider, which has two derivatives
        there. By default they stick, like contacts after a small vibration.

    Returns
    -------
    scipy.sparse.csr_array, shape (3N, 3N), or (6N, 6N) of spheres
        Force / length, in the order (x.., y.., R theta..), or as in
        :mod:`~faultgouge.analysis.configuration`. Rows of rattlers are empty, and so are all rows and columns
        of rotations without friction.

    Raises
    ------
    ValueError
        If the form is neither of the two, or an option does not apply to a Configuration.
    """
    if form not in ("consistent", "paper"):
        raise ValueError(f'form = "{form}" must be "consistent" or "paper".')
    return packing.assembled_stiffness(form=form, coupled=coupled, parting=parting, sliding=sliding)
