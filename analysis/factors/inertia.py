r"""How many eigenvalues of a sparse symmetric matrix lie below a number, and the places that divide its spectrum.

*Sylvester's law of inertia*: in :math:`S - \sigma = L D L^T` the negative pivots are as many as there are eigenvalues
below :math:`\sigma`. Factors take a small part of the time of eigenvalues, so that shifts are placed before any
eigenvalue is known.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import eigsh

from ..arrays import Floats

Counting = Callable[[Floats], Sequence[int]]
"""Shifts -> how many eigenvalues are below each."""


def count_places(
    matrix: csc_array, count: Counting, modes: tuple[int, int], coarse: int
) -> tuple[Floats, NDArray[np.int64]]:
    """Places between which there are few eigenvalues of a symmetric matrix, ascending, and how many are below each.
    `modes` are the numbers of the first eigenvalue about which places are wanted, and of the first about which they are
    not; between two places are `coarse` eigenvalues at the most, unless they lie within 1e-6 of the largest."""
    size, (first, stop) = matrix.shape[0], modes
    bound = float(abs(matrix).sum(axis=0).max())  # no eigenvalue is beyond
    start = np.random.default_rng(0).standard_normal(size)
    top = float(eigsh(matrix, k=1, which="LA", tol=1e-3, v0=start, return_eigenvectors=False)[0])
    places, numbers = np.array([-1e-9 * bound, 1.01 * top]), np.array([0, size])
    numbers[0] = count(places[:1])[0]
    while numbers[0] > 0 and places[0] > -bound:  # a few negative ones lie next to zero, far from the bound
        places = np.insert(places, 0, 10 * places[0])
        numbers = np.insert(numbers, 0, count(places[:1])[0] if places[0] > -bound else 0)
    while True:
        wanted = (numbers[1:] > first) & (numbers[:-1] < stop)
        wide = np.flatnonzero(wanted & (np.diff(numbers) > coarse) & (np.diff(places) > 1e-6 * top))
        if len(wide) == 0:
            return places, numbers
        between = places[wide] + 0.5 * (places[wide + 1] - places[wide])
        numbers = np.insert(numbers, wide + 1, count(between))
        places = np.insert(places, wide + 1, between)


def places_of_numbers(places: Floats, numbers: NDArray[np.int64], wanted: NDArray[np.int64]) -> Floats:
    """Places below which there are as many eigenvalues as wanted, interpolated between the counts."""
    from scipy.interpolate import PchipInterpolator

    numbers, last = np.unique(numbers[::-1], return_index=True)
    return np.asarray(PchipInterpolator(numbers, places[::-1][last])(wanted))
