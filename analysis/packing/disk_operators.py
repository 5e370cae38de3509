r"""K and C of disks of one law: from nine numbers of each contact, in a third of the time of contacts of any law.

Symbols are those of :mod:`~faultgouge.analysis.operators.stiffness`. The 36 numbers of a contact are nine numbers and
their negatives. Translations of the two disks have opposite signs in N, P and T, and rotations the same sign:

.. math::

    K_c = \begin{pmatrix} S & a\boldsymbol\tau & -S & a\boldsymbol\tau \\
    \mathbf h^T & -a & -\mathbf h^T & -a \\ -S & -a\boldsymbol\tau & S & -a\boldsymbol\tau \\
    \mathbf h^T & -a & -\mathbf h^T & -a \end{pmatrix}, \qquad \mathbf h = a\boldsymbol\tau - b\,\mathbf n

with :math:`S = f_n' \mathbf n \mathbf n^T - (f_n/r + a) \boldsymbol\tau \boldsymbol\tau^T +
b\, \boldsymbol\tau \mathbf n^T + (f_t/r)\, \mathbf n \boldsymbol\tau^T`. K is assembled from these (`contact_terms`).
"""

from typing import Literal

import numpy as np
from scipy.sparse import coo_array, csr_array

from ..arrays import Floats, Indices
from .law import Derivatives

Form = Literal["consistent", "paper"]

SIDES = np.array([[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0]])
SIGNS = np.einsum("pa,qb->pqab", SIDES, SIDES)
"""Signs of the nine numbers in the blocks of a contact, by partner of the row, of the column, and coordinates."""


def assemble_stiffness(terms: Floats, i: Indices, j: Indices, disks: int) -> csr_array:
    """K, shape (3N, 3N), from the numbers of each contact (`contact_terms`), the first partners, and the second ones of
    the contacts of two disks, which come first."""
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
    """The nine numbers of each contact that K is assembled from, its block of the first partner with itself: rows and
    columns (x, y, u), shape (3, 3, C). The first `pairs` contacts are those of two disks; normals have the shape (2,
    C)."""
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
