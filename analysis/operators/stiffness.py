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

The 36 numbers of a contact are nine numbers and their negatives. Translations of the two disks have opposite signs in
N, P and T, and rotations the same sign:

.. math::

    K_c = \begin{pmatrix} S & a\boldsymbol\tau & -S & a\boldsymbol\tau \\
    \mathbf h^T & -a & -\mathbf h^T & -a \\ -S & -a\boldsymbol\tau & S & -a\boldsymbol\tau \\
    \mathbf h^T & -a & -\mathbf h^T & -a \end{pmatrix}, \qquad \mathbf h = a\boldsymbol\tau - b\,\mathbf n

with :math:`S = f_n' \mathbf n \mathbf n^T - (f_n/r + a) \boldsymbol\tau \boldsymbol\tau^T +
b\, \boldsymbol\tau \mathbf n^T + (f_t/r)\, \mathbf n \boldsymbol\tau^T`. K is assembled from these (`contact_terms`).

Without friction only N and P remain, and K is an operator on the 2N coordinates (x, y): rows and columns of rotations
are empty.
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array, csr_array

from ..configuration import HasConfiguration
from ..packing.law import Derivatives
from ..packing.packing import Floats, Indices, Packing
from .linearised_contacts import assembled_stiffness

Form = Literal["consistent", "paper"]

SIDES = np.array([[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0]])
SIGNS = np.einsum("pa,qb->pqab", SIDES, SIDES)
"""Signs of the nine numbers in the blocks of a contact, by partner of the row, of the column, and coordinates."""


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
    if not isinstance(packing, Packing):  # the assembly below is for disks of one law alone, and three times faster
        if form == "paper" or coupled is not None:
            raise ValueError("The operator of a Configuration is the consistent one, of all of its contacts.")
        configuration = packing.configuration
        if configuration.stiffness is None:
            return _with_spring(assembled_stiffness(configuration, parting), configuration, configuration.spring)
        if np.any(np.asarray(parting) != 0.5) or np.any(sliding):
            raise ValueError(
                "K of this configuration is a difference of forces, the mean of closing and parting, and of both "
                "sides of Coulomb's bound: leave parting and sliding out."
            )
        return configuration.stiffness.copy()
    contacts = packing.contacts
    pairs = len(contacts) - np.count_nonzero(contacts.floor)
    normal, _, distance, overlap = packing.geometry
    law = packing.law.derivatives(overlap, contacts.slip, parting, sliding)
    if coupled is not None:
        law = law._replace(overlap_derivative=np.where(coupled, law.overlap_derivative, 0.0))
    terms = contact_terms(law, normal.T, distance, pairs, form)
    return _with_spring(
        assemble_stiffness(terms, contacts.i, contacts.j[:pairs], len(packing)), packing, packing.spring
    )


def _with_spring(stiffness: csr_array, packing: HasConfiguration, spring: float) -> csr_array:
    """K with the spring that draws the layer: k/n between all pairs of its n particles, along x.

    Each particle feels -k X for the mean displacement X of the layer.
    """
    if not spring:
        return stiffness
    layer = np.flatnonzero(packing.top)
    rows, columns = np.repeat(layer, len(layer)), np.tile(layer, len(layer))
    values = np.full(len(rows), spring / max(1, len(layer)))
    of_layer = csr_array((values, (rows, columns)), shape=stiffness.shape)
    return csr_array(stiffness + packing.configuration.project(of_layer))


def assemble_stiffness(terms: Floats, i: Indices, j: Indices, disks: int) -> csr_array:
    """K from the numbers of each contact.

    Parameters
    ----------
    terms : ndarray, shape (3, 3, C)
        See `contact_terms`.
    i : ndarray of int, shape (C,)
        First partners.
    j : ndarray of int, shape (P,)
        Second partners of the contacts of two disks, which come first.
    disks : int
        N.

    Returns
    -------
    scipy.sparse.csr_array, shape (3N, 3N)
        As `stiffness_matrix`.
    """
    axes, pairs = 3 if terms[2].any() else 2, len(j)
    terms, signs = terms[:axes, :axes], SIGNS[:, :, :axes, :axes, None]
    # Two disks share one contact, so the off-diagonal blocks are final; only the diagonal ones are sums.
    diagonal = np.empty((axes, axes, disks))
    for row in range(axes):
        for column in range(axes):
            term = terms[row, column]
            diagonal[row, column] = np.bincount(i, term, disks)
            diagonal[row, column] += signs[1, 1, row, column] * np.bincount(j, term[:pairs], disks)
    every, axis = np.arange(disks, dtype=np.int32), np.arange(0, axes * disks, disks, dtype=np.int32)
    i, j = i[:pairs].astype(np.int32), j.astype(np.int32)  # half the memory of what the sparse format sorts
    shared = terms[:, :, :pairs]
    values = np.concatenate([diagonal, signs[0, 1] * shared, signs[1, 0] * shared], axis=2)
    rows = axis[:, None, None] + np.concatenate([every, i, j])
    columns = axis[:, None] + np.concatenate([every, j, i])
    where = tuple(np.broadcast_to(index, values.shape).ravel() for index in (rows, columns))
    matrix = coo_array((values.ravel(), where), shape=(3 * disks, 3 * disks)).tocsr()
    matrix.eliminate_zeros()
    return matrix


def contact_terms(law: Derivatives, normal: Floats, distance: Floats, pairs: int, form: Form = "consistent") -> Floats:
    """The nine numbers of each contact that K is assembled from: its block of the first partner with itself.

    Parameters
    ----------
    law : Derivatives
        Of the contact law, at each contact.
    normal : ndarray, shape (2, C)
        Unit vectors n towards i.
    distance : ndarray, shape (C,)
        Lengths of the branch vectors.
    pairs : int
        Contacts of two disks; those with the floor follow.
    form : {"consistent", "paper"}
        As in :func:`stiffness_matrix`.

    Returns
    -------
    ndarray, shape (3, 3, C)
        Force / length, rows and columns (x, y, u).
    """
    a, b, stiffness = law.slip_derivative, law.overlap_derivative, law.normal_stiffness
    # only contacts of finite length turn; the floor's distance is a height and may even be zero
    across, turn = a.copy(), np.zeros_like(b)
    across[:pairs] += law.normal_force[:pairs] / distance[:pairs]
    if form == "consistent":
        turn[:pairs] = law.tangential_force[:pairs] / distance[:pairs]
    square, product = normal * normal, normal[0] * normal[1]
    skew, both = (b + turn) * product, (stiffness + across) * product
    along = stiffness * square - across * square[::-1]
    turning = turn * square - b * square[::-1]
    torque = a * normal
    terms = np.empty((3, 3, len(a)))
    np.subtract(along[0], skew, out=terms[0, 0])
    np.add(both, turning[0], out=terms[0, 1])
    np.negative(torque[1], out=terms[0, 2])
    np.subtract(both, turning[1], out=terms[1, 0])
    np.add(along[1], skew, out=terms[1, 1])
    terms[1, 2] = torque[0]
    np.subtract(terms[:2, 2], b * normal, out=terms[2, :2])
    np.negative(a, out=terms[2, 2])
    return terms
