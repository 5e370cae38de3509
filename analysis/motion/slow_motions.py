r"""The slow motions of a large packing: eigenvalues s of the first-order matrix Z next to zero, and the space of these.

Dashpots at contacts take little from motion that stretches contacts little: a motion of the frequency :math:`\omega`
decays at a rate of about :math:`\omega^2`. So the motions that decay last, or never, are the slow ones, and most others
decay soon. The state is :math:`u = (\omega_0 z, \dot z)`, where

.. math::

    \dot u = Z u, \qquad (Z - \sigma)^{-1} \binom pw = \binom{a}{(p + \sigma a)/\omega_0}, \qquad
    (A + \sigma G + \sigma^2)\, a = -\omega_0 w - (G + \sigma)\, p .

A block Arnoldi iteration with the inverse (:mod:`~faultgouge.analysis.motion.block_arnoldi`) finds all eigenvalues in a
disc about a small real :math:`\sigma`, with one sparse factorisation of real numbers. Motions that no force opposes,
with s = 0, are among them. The space V of their right vectors is invariant: :math:`Z V = V B`. What is orthogonal to V,
:math:`w = (1 - V V^T) u`, obeys :math:`\dot w = (1 - V V^T) Z w`, an equation of its own, whose eigenvalues are all
others of Z. Left vectors are not needed.

**Free motions of one particle.** A block of few vectors cannot find an eigenvalue zero that many motions share. Most of
these motions belong to one particle each: a sphere that rolls on a plane, or turns about the line through its two
contacts. Whatever the other particles do, there is no force and no torque along such a vector y: the rows of the
particle have :math:`y^T A = y^T G = 0`. So :math:`y^T z` and :math:`y^T \dot z` stay zero if they are zero at first,
and every eigenvector whose eigenvalue is not zero is orthogonal to y. (The free motion itself may involve other
particles: it belongs to the columns of A, not to its rows.)
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, eye_array, vstack

from ..arrays import Complexes, Floats, Indices
from ..factors.sparse_lu import general_lu
from ..progress import report_progress
from .block_arnoldi import Krylov, SpectrumError, ritz_values

SLOW_SHIFT = 3e-3
"""sigma as a share of the largest frequency: below the slowest motions of 10,000 spheres, and far enough from motions
that no force opposes for factors of ten digits."""

BLOCK_OF_SLOW = 2
"""Vectors of a block: of motions that are exactly alike more than two hide. Of 180 vectors for a bed of 1,000 spheres
32 eigenvalues are known, and 14 with blocks of four."""

FIRST_SLOW, MOST_SLOW = 80, 640
"""Vectors of the first space, and of the largest."""

BYTES_OF_SPACE = 4e8
"""Memory of a space."""

SLOW_ACCURACY = 1e-9
"""Error of eigenvalues, to first order, as a share of the largest frequency."""

FREE_OF_SLOW = 1e-5
"""Eigenvalues below this share of the largest frequency are those of motions that no force opposes: zero is double, and
rounding of 1e-10 leaves its root."""

HOLDS_UP = 10.0
"""Damping over the largest frequency, by sums of rows, from which on a slow motion may have a force against it."""

UNOPPOSED = 1e-4
"""Force along a vector of the space over the largest of A that is none: vectors of a double zero have five digits."""

FREE_ROW = 1e-10
"""Force along a vector of one particle, as a share of the largest entry of A, and of G, that is no force."""


@dataclass(frozen=True, eq=False)
class SlowMotions:
    """Eigenvalues next to zero.

    Attributes
    ----------
    values : ndarray of complex, shape (k,)
        s with Im s >= 0, the slowest decay first, 1 / time.
    free : int
        Motions that no force opposes: each has two eigenvalues, or, with drag, one.
    radius : float
        All |s| below are known, 1 / time.
    reference : float
        omega_0, 1 / time.
    error : float
        Of Re s, 1 / time.
    alone : scipy.sparse.csr_array, shape (n, k)
        Vectors of one particle each along which there is no force.
    basis : ndarray, shape (2 n, m)
        V of all others, of states (omega_0 z, v).
    entries : int
        Entries of the factors: multiplications that a solution takes.
    """

    values: Complexes
    free: int
    radius: float
    reference: float
    error: float
    alone: csr_array
    basis: Floats
    entries: int

    @property
    def grows(self) -> NDArray[np.bool_]:
        """Which grow, beyond their errors."""
        return np.asarray(self.values.real > self.error)

    @property
    def rate_beyond(self) -> float:
        """Re s of about the slowest motion beyond the disc, estimated from the outer half of the known ones."""
        outer = self.values[np.abs(self.values) > 0.7 * self.radius]
        return float(outer.real.max(initial=-np.inf))

    def without(self, state: Floats) -> Floats:
        """(1 - V V^T) u."""
        state = without(self.alone, state)
        return np.asarray(state - self.basis @ (self.basis.T @ state))


def slow_motions(
    matrix: csr_array,
    damping: csr_array,
    particle: Indices,
    reference: float,
    rest: Callable[[SlowMotions], float],
) -> SlowMotions:
    """Find slow motions, as many as pay.

    Parameters
    ----------
    matrix, damping : scipy.sparse.csr_array, shape (n, n)
        A and G of the coordinates that feel a force.
    particle : ndarray of int, shape (n,)
        Whose coordinates these are, each particle's next to one another.
    reference : float
        omega_0, 1 / time.
    rest : callable
        Multiplications that are left to do with these. The space grows as long as more vectors cost less.

    Returns
    -------
    SlowMotions

    Raises
    ------
    SingularMatrixError
        If there are no factors.
    """
    size = matrix.shape[0]
    largest = float(np.sqrt(abs(matrix).sum(axis=1).max()))
    shift = SLOW_SHIFT * largest
    factors = general_lu(csc_array(matrix + shift * damping + shift**2 * eye_array(size)))

    def inverse(columns: Floats) -> Floats:
        place, speed = columns[:size], columns[size:]
        a = -factors.solve(reference * speed + damping @ place + shift * place)
        return without(alone, np.concatenate([a, (place + shift * a) / reference]))

    alone = motions_of_one(matrix, damping, particle)
    # strong dashpots hold up motions that a force opposes, which are then as slow as those that none does
    held = matrix if float(abs(damping).sum(axis=1).max()) > HOLDS_UP * largest else None
    start = without(alone, np.random.default_rng(0).standard_normal((2 * size, BLOCK_OF_SLOW))).T
    krylov = Krylov(inverse, start, int(min(MOST_SLOW, BYTES_OF_SPACE / (16 * size), 2 * (size - alone.shape[1]))))
    entries, wanted = matrix.nnz + damping.nnz + factors.entries, FIRST_SLOW

    def cost(vectors: int) -> float:
        """Multiplications of a space; those of dense matrices take a quarter of the time."""
        return vectors * entries + 0.25 * (8 * size * vectors**2 + 25 * vectors**3)

    while True:
        krylov.extend(wanted)
        found = replace(_inside(krylov, shift, largest, reference, alone, held), entries=factors.entries)
        report_progress(
            f"slow motions: {len(found.values)} up to {found.radius / largest:.2%} of the largest frequency"
        )
        wanted = 3 * krylov.used // 2
        if krylov.full or rest(found) < cost(wanted) - cost(krylov.used):
            return found


def motions_of_one(matrix: csr_array, damping: csr_array, particle: Indices) -> csr_array:
    """Unit vectors y of one particle each that no force drives, y^T A = y^T G = 0, shape (n, k), orthogonal."""
    parts = (each.T / max(abs(each).max(), np.finfo(float).tiny) for each in (matrix, damping))
    both = vstack(list(parts), format="csc")
    begins = np.flatnonzero(np.diff(particle, prepend=-1))
    found, places = [], []
    for first, last in zip(begins, [*begins[1:], len(particle)], strict=True):
        entries = slice(both.indptr[first], both.indptr[last])
        rows, row = np.unique(both.indices[entries], return_inverse=True)
        columns = np.zeros((max(len(rows), last - first), last - first))
        columns[row, np.repeat(np.arange(last - first), np.diff(both.indptr[first : last + 1]))] = both.data[entries]
        _, sizes, vectors = np.linalg.svd(columns, full_matrices=False)
        for vector in vectors[sizes <= FREE_ROW]:
            found.append(vector)
            places.append(np.arange(first, last))
    numbers = np.repeat(np.arange(len(found)), [len(each) for each in found])
    where = np.concatenate([np.zeros(0, int), *places]), numbers
    return csr_array((np.concatenate([np.zeros(0), *found]), where), shape=(len(particle), len(found)))


def without(alone: csr_array, states: Floats) -> Floats:
    """States, in columns, or one, without the places and the velocities of motions of one particle each."""
    parts = states.reshape(2, len(states) // 2, -1)
    return np.concatenate([part - alone @ (alone.T @ part) for part in parts]).reshape(states.shape)


def _inside(
    krylov: Krylov, shift: float, largest: float, reference: float, alone: csr_array, held: csr_array | None
) -> SlowMotions:
    """The eigenvalues up to the first one that has not converged; `held` is A where dashpots hold slow motions up."""
    values, overlap, errors = ritz_values(krylov, shift)
    is_free = np.abs(values) < FREE_OF_SLOW * largest
    if held is not None:
        for k in np.flatnonzero(is_free):
            place = krylov.vector(1 / (values[k] - shift))[: held.shape[0]]
            force = abs(np.vdot(place, held @ place)) / np.vdot(place, place).real
            is_free[k] = force <= UNOPPOSED * largest**2
    failed = np.flatnonzero((errors > SLOW_ACCURACY * largest * overlap) & ~is_free)
    count = int(failed[0]) if len(failed) else len(values)
    while count:
        try:
            basis = krylov.subspace(1 / (values[:count] - shift))
            break
        except SpectrumError:  # one of a pair, or of several that rounding does not set apart
            count -= 1
    else:
        basis = np.zeros((krylov.basis.shape[1], 0))
    radius = max(float(abs(values[min(count, len(values) - 1)] - shift)) - shift, 0.0)
    free, known = is_free[:count], values[:count]
    known = known[~free & (known.imag >= 0)]
    known = known[np.argsort(-known.real, kind="stable")]
    count_free = alone.shape[1] + int(free.sum() + 1) // 2
    return SlowMotions(known, count_free, radius, reference, 10 * SLOW_ACCURACY * largest, alone, basis, 0)
