r"""The motions of a damped packing that decay most slowly: eigenvalues s next to the imaginary axis.

The axis is covered by discs, from zero to the largest frequency. In each of them Arnoldi's iteration with
:math:`(Z - \sigma)^{-1}` finds the eigenvalues of the first-order matrix Z next to the middle :math:`\sigma = i\omega`.
A disc reaches as far as its farthest eigenvalue. Let x be the rate of the slowest decay that has been found. The strip
:math:`-x \le \mathrm{Re}\, s` is covered by a disc of the radius r as far as :math:`\sqrt{r^2 - x^2}` up and down.

Where dashpots make fast motions decay fast, few discs reach far. A disc costs one sparse factorisation of
:math:`A + \sigma G + \sigma^2` and two or three solutions for each eigenvalue. Their number is limited: what lies above
the last of them is not known. Growth there is for :mod:`~faultgouge.analysis.motion.fastest_growing`.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array, eye_array
from scipy.sparse.linalg import LinearOperator, eigs

from ..arrays import Complexes
from ..factors.sparse_lu import general_lu
from ..progress import report_progress

NEAREST = 60
"""Eigenvalues of a disc."""

DISCS = 40
"""Discs at the most: of 1,000 spheres they took 60 s of one core."""

FIRST_DISC = 0.02
"""Middle of the first disc, as a share of the largest frequency; not zero, where motions without a force are."""

AHEAD = 0.8
"""Distance of a new middle from what is covered, in units of the last disc's reach, as radii change."""

ARNOLDI_TOLERANCE = 1e-9
"""Of Arnoldi's iteration: eigenvalues are right to this share of their distance from the middle."""

FREE_OF_DISC = 1e-5
"""Eigenvalues below this share of the largest frequency are those of motions that no force opposes: they are double,
and Arnoldi's iteration leaves the root of its tolerance."""

SLIGHTLY = 1e-9
"""Shift of a middle, so that it is no eigenvalue to the last digit."""


@dataclass(frozen=True, eq=False)
class SlowestDecay:
    """Eigenvalues next to the imaginary axis.

    Attributes
    ----------
    values : ndarray of complex, shape (k,)
        s with Im s >= 0, the slowest decay first, 1 / time.
    free : int
        Eigenvalues of motions that no force opposes, half of them: each has two.
    covered : float
        Frequency up to which nothing else decays as slowly as the first, 1 / time; infinite if the whole axis was
        covered.
    width : float
        Re s up to which nothing that grows was missed there, 1 / time.
    """

    values: Complexes
    free: int
    covered: float
    width: float


def slowest_decay(matrix: csr_array, damping: csr_array, discs: int = DISCS) -> SlowestDecay:
    """Find the motions that decay most slowly.

    Parameters
    ----------
    matrix : scipy.sparse.csr_array, shape (n, n)
        A = M^(-1/2) K M^(-1/2), 1 / time^2, of the coordinates that feel a force.
    damping : scipy.sparse.csr_array, shape (n, n)
        G = M^(-1/2) C M^(-1/2), 1 / time.
    discs : int
        How many at the most.

    Returns
    -------
    SlowestDecay

    Raises
    ------
    ArpackError
        If the eigenvalues of a disc do not converge.
    """
    largest = float(np.sqrt(abs(matrix).sum(axis=1).max()))  # no |lambda| of A is larger than the sum of a row
    nearest = min(NEAREST, matrix.shape[0] // 2)
    values, free = np.zeros(0, complex), 0
    middle, covered, width = FIRST_DISC * largest, 0.0, np.inf
    last = -middle, 0.0  # the mirror image of the first disc
    for number in range(discs):
        found = _nearest(matrix, damping, 1j * middle, nearest)
        radius = float(np.abs(found - 1j * middle).max())
        is_free = np.abs(found) < FREE_OF_DISC * largest
        free = max(free, int(is_free.sum() + 1) // 2)
        values = np.concatenate([values, found[~is_free & (found.imag >= 0)]])
        rate = -values.real.max(initial=-radius)
        reach = float(np.sqrt(max(radius**2 - rate**2, 0.0)))
        if middle - reach > covered:  # the disc is smaller than it was expected to be
            middle = 0.5 * (middle + covered)
            continue
        width, last = min(width, _common_width(last, (middle, radius))), (middle, radius)
        covered = middle + reach
        report_progress(f"slowest decay: disc {number + 1}, covered {min(covered / largest, 1):.0%} of the frequencies")
        if covered > largest:
            covered = np.inf
            break
        middle = covered + AHEAD * reach
    values = _distinct(values[np.argsort(-values.real, kind="stable")], 1e-7 * largest)
    return SlowestDecay(values, free, covered, width)


def _nearest(matrix: csr_array, damping: csr_array, middle: complex, count: int) -> Complexes:
    """The eigenvalues nearest to a point."""
    size, shift = matrix.shape[0], middle * (1 + SLIGHTLY)
    factors = general_lu(csc_array(matrix + shift * damping + shift**2 * eye_array(size)))

    def inverse(state: Complexes) -> Complexes:
        """(Z - shift)^(-1) of the state (x, s x)."""
        place, speed = state[:size], state[size:]
        x = -factors.solve(speed + damping @ place + shift * place)
        return np.concatenate([x, place + shift * x])

    start = np.random.default_rng(0).standard_normal(2 * size).astype(complex)
    operator = LinearOperator((2 * size, 2 * size), matvec=inverse, dtype=complex)
    return np.asarray(shift + 1 / eigs(operator, count, v0=start, tol=ARNOLDI_TOLERANCE, return_eigenvectors=False))


def _common_width(below: tuple[float, float], above: tuple[float, float]) -> float:
    """Real part of the point where two circles about points of the imaginary axis meet, by middles and radii."""
    distance, radius = above[0] - below[0], above[1]
    height = (distance**2 + radius**2 - (below[1] or radius) ** 2) / (2 * distance)  # of the upper middle above it
    return float(np.sqrt(max(radius**2 - height**2, 0.0)))


def _distinct(values: Complexes, close: float) -> Complexes:
    """Without those that discs have in common."""
    kept: list[complex] = []
    for value in values:
        if not any(abs(value - other) < close for other in kept[-10:]):
            kept.append(complex(value))
    return np.array(kept, complex)
