r"""Eigenvalues to more digits than doubles have: Newton's method on an eigenpair, with residuals in extended precision.

For :math:`A x = \lambda x`, :math:`w^H x = 1` a step solves the bordered system

.. math::

    \begin{pmatrix} A - \lambda & -x \\ w^H & 0 \end{pmatrix} \begin{pmatrix} \Delta x \\ \Delta\lambda
    \end{pmatrix} = \begin{pmatrix} \lambda x - A x \\ 0 \end{pmatrix}

in doubles, with the right-hand side and the sums in ``numpy.longdouble``: iterative refinement. The remaining error is
the last step, and the rounding of extended precision, :math:`\epsilon |A|_F \kappa`, with the condition :math:`\kappa =
1/|y^H x|` of the eigenvalue.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import eig

from ....analysis import Packing, dynamical_matrix
from ....analysis.arrays import Floats
from ....analysis.motion.eigenvalues import Complexes, unit_rounding

NEWTON_STEPS = 30
"""Newton steps at the most. Near an exceptional point the bordered system is nearly singular and a step gains only a
few digits."""


class RefinedEigenvalue(NamedTuple):
    """A refined eigenvalue.

    Attributes
    ----------
    value : numpy.clongdouble
        The eigenvalue.
    error : float
        Its error.
    steps : int
        Steps of Newton's method.
    """

    value: np.clongdouble
    error: float
    steps: int


def refine_eigenvalue(matrix: Floats, value: complex, vector: Complexes, condition: float) -> RefinedEigenvalue:
    """The eigenvalue of a matrix of doubles, taken as exact, next to an approximation.

    Parameters
    ----------
    matrix : ndarray, shape (n, n)
        A.
    value : complex
        Where to begin.
    vector : ndarray of complex, shape (n,)
        The unit right vector to begin with.
    condition : float
        kappa = 1/|y^H x|.
    """
    n = len(matrix)
    exact = matrix.astype(np.longdouble)
    border = vector.conj()
    x, lam = vector.astype(np.clongdouble), np.clongdouble(value)
    rounding = float(np.finfo(np.longdouble).eps * np.linalg.norm(matrix) * condition)
    moved, steps = np.inf, 0
    while steps < NEWTON_STEPS:
        residual = lam * x - (exact @ x.real + 1j * (exact @ x.imag))
        bordered = np.zeros((n + 1, n + 1), dtype=np.complex128)
        bordered[:n, :n] = matrix - complex(lam) * np.eye(n)
        bordered[:n, n], bordered[n, :n] = -x.astype(np.complex128), border
        change = np.linalg.solve(bordered, np.append(residual, 0).astype(np.complex128))
        before, moved = moved, float(abs(change[n]))
        if moved > 0.5 * before:
            return RefinedEigenvalue(lam, before + rounding, steps)
        x, lam, steps = x + change[:n], lam + change[n], steps + 1
        if moved < rounding:
            break
    return RefinedEigenvalue(lam, moved + rounding, steps)


def refined_near(packing: Packing, shift: float, count: int) -> tuple[list[RefinedEigenvalue], float, float]:
    """The eigenvalues of a packing's operator that are nearest to a shift.

    Returns
    -------
    eigenvalues : list of RefinedEigenvalue
        By their distance from the shift.
    condition : float
        The largest kappa of them.
    rounding : float
        u |A|_F, 1 / time^2.
    """
    matrix = dynamical_matrix(packing)[0].toarray()
    values, left, right = eig(matrix, left=True, right=True)
    nearest = np.argsort(np.abs(values - shift))[:count]
    condition = 1 / np.abs(np.sum(left.conj() * right, axis=0))
    found = [refine_eigenvalue(matrix, complex(values[k]), right[:, k], float(condition[k])) for k in nearest]
    return found, float(condition[nearest].max()), unit_rounding(matrix)
