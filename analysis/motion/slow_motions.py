r"""The slowest motions of a large packing, so that a random state need not be followed until they have decayed.

In the state :math:`u = (\omega_0 z, \dot z)` small motion obeys :math:`\dot u = Z u`. The eigenvalues s of Z that are
next to a small real shift :math:`\sigma` belong to the slowest motions: long waves, and particles with weak contacts.
Those of :math:`(Z - \sigma)^{-1}` are the largest. A block Krylov space holds them, and one of the transpose holds
their left vectors. Both need the factors of one real matrix, :math:`P(\sigma) = \sigma^2 + \sigma G + A`.

Let X and Y be bases of the right and of the left vectors. The projection

.. math:: \Pi = 1 - X\, (Y^T X)^{-1}\, Y^T

takes these motions out of a state and leaves all others as they are: a left vector l of another motion has
:math:`l^H X = 0`. The waves of a box may have nearly equal s: the space of all of them is well known, where single
vectors are not. With unit vectors x and :math:`\kappa = 1/|y^H x|`, and the residuals :math:`r = |Z x - s x|` and
:math:`r' = |Z^H y - \bar s y|`, to first order

- the error of s is :math:`\kappa\, r\, r' / d`, with the distance d of s from those that are not in the space;
- a left vector l of another motion has :math:`|l^H x| \le r / |s_l - s|`, so that the projection changes l by no more
  than the sum of :math:`\kappa\, r / |s_l - s|` over the motions. Of motion that does not decay this is largest on the
  imaginary axis. Up to a tenth is allowed: the probability that the motion is overlooked rises by as much.

(Saad, *Numerical Methods for Large Eigenvalue Problems*, 2011, ch. 3 and 6.)
"""

from collections.abc import Callable

import numpy as np
from scipy.linalg import eig, schur
from scipy.sparse import csc_array, csr_array, eye_array

from ..arrays import Complexes, Floats
from ..factors.lanczos import BlockKrylov
from ..factors.sparse_lu import SingularMatrixError, symmetric_lu

KRYLOV = 300
"""Vectors of a Krylov space: of 8,000 spheres in a box it holds the twelve shear waves and all that is slower."""


def slow_motions(
    a: csr_array, g: csr_array, kept: csr_array, reference: float, drifts: int
) -> tuple[Complexes, Floats, Callable[[Floats], Floats]] | None:
    """The slowest motions by A and G; None if the Krylov spaces do not hold any well enough.

    States are of the m coordinates of the orthonormal basis `kept` (m, n). A tenth of the `reference` omega_0 is the
    shift, and no force opposes `drifts` motions.

    Returns the eigenvalues s but those of drift, their errors, 1 / time, and a function that takes these motions and
    drift out of a state u, shape (2m,).
    """
    shift, size = 0.1 * reference, a.shape[0]
    try:
        factors = symmetric_lu(csc_array(a + shift * g + shift**2 * eye_array(size)))
    except SingularMatrixError:
        return None

    def image(states: Floats) -> Floats:
        z, v = np.split(states, 2)
        return np.vstack([reference * v, -(a @ z) / reference - g @ v])

    def transposed(states: Floats) -> Floats:
        z, v = np.split(states, 2)
        return np.vstack([-(a.T @ v) / reference, reference * z - g.T @ v])

    def inverse(states: Floats) -> Floats:
        z, v = np.split(states, 2)
        found = factors.solve(-reference * v - g @ z - shift * z)
        return np.vstack([found, (z + shift * found) / reference])

    def inverse_transposed(states: Floats) -> Floats:
        z, v = np.split(states, 2)
        found = factors.solve(-reference * z - shift * v, "T")
        return np.vstack([(v + g.T @ found + shift * found) / reference, found])

    spaces = []
    for operator in (inverse, inverse_transposed):
        space = BlockKrylov(operator, np.random.default_rng(0).standard_normal((6, 2 * size)), min(KRYLOV, 2 * size))
        space.extend(space.most)
        values, vectors = eig(space.square)
        order = np.argsort(-np.abs(values))
        sizes = np.abs(values[order])
        vague = space.residuals(vectors[:, order]) > 1e-6 * sizes
        spaces.append((space, sizes, int(np.argmax([*vague[:-1], True]))))
    known = min(each[2] for each in spaces)
    if known <= 2 * drifts:
        return None
    # up to a place where both spaces part the motions from those beyond
    counts = range(2 * drifts + 1, known + 1)
    apart = [k for k in counts if all(sizes[k] < 0.97 * sizes[k - 1] for _, sizes, _ in spaces)]
    if not apart:
        return None
    count = apart[-1]
    bases = []
    for space, sizes, _ in spaces:
        least = np.sqrt(sizes[count - 1] * sizes[count])
        _, vectors, inside = schur(space.square, sort=lambda re, im, least=least: np.hypot(re, im) > least)
        bases.append(space.basis[: space.used].T @ vectors[:, :inside])
    right, left = bases
    if right.shape != left.shape:
        return None
    left = left @ np.linalg.inv(right.T @ left)  # Y^T X = 1
    s, y, x = eig(left.T @ image(right), left=True, right=True)
    order = np.argsort(np.abs(s))[2 * drifts :]
    s, x, y = s[order], right @ x[:, order], left @ y[:, order]
    x, y = x / np.linalg.norm(x, axis=0), y / np.linalg.norm(y, axis=0)
    kappa = 1 / np.abs(np.sum(y.conj() * x, axis=0))
    rest, rest_left = (np.linalg.norm(each, axis=0) for each in (image(x) - s * x, transposed(y) - s.conj() * y))
    changes = (kappa * rest / np.abs(1j * s.imag[:, None] - s)).sum(axis=1)
    if changes.max(initial=0.0) > 0.1:
        return None
    beyond = min(1 / sizes[count] for _, sizes, _ in spaces)  # from the shift
    rounding = 1e-14 * np.sqrt(np.abs(a.data).max())
    error = kappa * (rest * rest_left / (beyond - np.abs(s - shift)) + rounding)
    right, left = (np.vstack([kept @ half for half in np.split(each, 2)]) for each in (right, left))
    return s, error, lambda states: states - right @ (left.T @ states)
