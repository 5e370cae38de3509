r"""All eigenvalues of a large sparse non-symmetric operator, a slice of the spectrum after the other.

LAPACK needs time with the cube of the number n of coordinates, and :math:`n^2` numbers. Here the spectrum is cut into
slices by shifts on the real axis, and block Arnoldi iterations with the inverse find the eigenvalues in a disc about
each shift, with a few hundred vectors. The time is a little more than the square of n.

**Shifts.** Every eigenvalue :math:`\lambda` of A has a real part between the lowest and the largest eigenvalue of the
symmetric part :math:`S = (A + A^T)/2` (Bendixson, Acta Math. 25, 359 (1902)). A is nearly symmetric, so that its
eigenvalues are as dense as those of S, which inertia counts. Discs overlap, and are as large as imaginary parts
demand.

**Discs.** In the block Krylov space of :math:`(A - \sigma)^{-1}` the eigenvalues closest to :math:`\sigma` come first:
they are the largest :math:`\theta = 1/(\lambda - \sigma)` of the projection H. A residual r of the inverse changes
:math:`\lambda` by :math:`\kappa\, r / |\theta|^2` at the most to first order. The space of :math:`(A - \sigma)^{-T}`
has the left vectors. Of two eigenvalues that nearly coalesce the vectors are nearly parallel, and uncertain; the
invariant subspaces of many eigenvalues are not. With orthonormal bases V of the right one and U of the left one, all is
in the small matrix :math:`B = (U^T V)^{-1} U^T A V`, whose error is the product of the errors of V and U (Stewart and
Sun, *Matrix Perturbation Theory*, 1990, ch. V).

**That all are found.** There is no law of inertia for A. But n eigenvalues are to be found, their sum is the trace of
A, and the sum of their squares the trace of :math:`A^2`. Where one of these is violated, the slices with fewer
eigenvalues than S has there are found again from other shifts, with larger blocks, and then all slices. If this does
not help there is an error.

**Islands.** Coordinates that are not coupled to all others, such as those of identical cells apart, have equal
eigenvalues, more than a block has vectors. Each island has slices of its own, or is small enough for LAPACK.
"""

from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig, schur
from scipy.sparse import csc_array, csr_array, eye_array
from scipy.sparse.csgraph import connected_components

from ..arrays import Complexes, Floats
from ..errors import FaultgougeError
from ..factors.inertia import count_places, places_of_numbers
from ..factors.lanczos import BlockKrylov, factor_shifted
from ..factors.sparse_lu import elimination_places, general_lu
from ..progress import report_progress
from .modes import Modes


class SpectrumError(FaultgougeError):
    """Eigenvalues were not found: one sentence."""


def all_eigenvalues(matrix: csr_array, own: int = 36, least: int = 540) -> tuple[Complexes, Modes]:
    """All eigenvalues of a sparse matrix that is nearly symmetric, such as M^(-1/2) K M^(-1/2) of the coordinates that
    feel a force.

    A slice has `own` eigenvalues: more cost more orthogonalisation, fewer cost more factors. LAPACK finds all of up to
    `least` coordinates, which a space of the largest size would hold, in no less time.

    Returns the values, sorted by real part, then imaginary part, and the modes of those with a positive imaginary part,
    of those that are real and negative, and of real ones that are oblique. Raises SpectrumError if not all are found.
    """
    count, island = connected_components(matrix, directed=False)
    values, parts = [], []
    for places in np.split(np.argsort(island, kind="stable"), np.cumsum(np.bincount(island, minlength=count))[:-1]):
        inner = csr_array(matrix[places][:, places])
        if inner.shape[0] > least:
            found, marked = _in_slices(inner, own)
        else:
            found, left, right = eig(inner.toarray(), left=True)
            chosen = _matters(found, np.abs(np.sum(left.conj() * right, axis=0)))
            marked = Modes(found[chosen], right[:, chosen], left[:, chosen])
        values.append(found)
        parts.append(marked.placed(places, matrix.shape[0]))
    every, marked = np.concatenate(values), Modes.joined(parts)
    return every[np.lexsort((every.imag, every.real))], marked.chosen(marked.values.imag >= 0)


def _matters(values: Complexes, overlap: Floats) -> NDArray[np.bool_]:
    """Which are complex, or negative, or so oblique that they may belong to a pair that is about to coalesce."""
    return (values.imag != 0) | (values.real < 0) | (overlap < 0.1)


def _in_slices(matrix: csr_array, own: int) -> tuple[Complexes, Modes]:
    """Of many coordinates, all of which are coupled."""
    size, symmetric = matrix.shape[0], csc_array(0.5 * (matrix + matrix.T))
    order = np.argsort(elimination_places(symmetric))
    symmetric, a = csc_array(symmetric[order][:, order]), csc_array(matrix[order][:, order])

    def below(shifts: Floats) -> list[int]:
        return [factor_shifted(symmetric, shift)[1] for shift in shifts]

    places, numbers = count_places(symmetric, below, (0, size), 2 * own)
    edges = np.linspace(0, size, max(1, round(size / own)) + 1).astype(int)
    borders, spacing = places_of_numbers(places, numbers, edges), float(places[-1] - places[0]) / size
    apart = np.append(True, np.diff(borders) > 0.1 * spacing)  # all that are equal are in one slice
    borders, edges = borders[apart], edges[apart]
    pieces = len(edges) - 1
    # the error by one of the two spaces, that by both is of the size of its square
    accuracy = max(1e-5 * spacing, 4 * np.finfo(float).eps * np.abs(borders).max())
    trace, square = a.diagonal().sum(), (a @ a).diagonal().sum()
    found = [(np.zeros(0, complex), Modes.none(size))] * pieces
    first, todo = 3 * own, np.arange(pieces)
    for block in (4, 8, 16, 48):  # four vectors are solved for in the time of two; larger blocks take more vectors
        again, most = block > 4, 15 * max(own, block)
        for k in todo:
            report_progress(f"slice {k + 1} of {pieces} of the spectrum{' once more' * again}")
            shift = float(borders[k] + (0.44 if again else 0.5) * (borders[k + 1] - borders[k]))
            try:
                every, modes, first = eigenvalues_about(a, shift, borders[k : k + 2], accuracy, (block, first, most))
            except SpectrumError:
                continue
            low, high = borders[k] if k else -np.inf, borders[k + 1] if k + 1 < pieces else np.inf
            inside, marked = ((low <= each.real) & (each.real < high) for each in (every, modes.values))
            found[k] = every[inside], modes.chosen(marked)
        values = np.concatenate([each for each, _ in found])
        off = abs(values.sum() - trace), abs((values**2).sum() - square) / (2 * np.abs(values).max(initial=1e-300))
        if len(values) == size and max(off) <= 1e-3 * spacing:
            return values, Modes.joined([modes for _, modes in found]).placed(order, size)
        todo = np.flatnonzero([len(each) for each, _ in found] < np.diff(edges)) if block == 4 else np.arange(pieces)
    why = f"{len(values)} were found" if len(values) != size else f"their sum is off the trace by {max(off):.3g}"
    raise SpectrumError(f"All eigenvalues of {size} coordinates: {why}.")


def eigenvalues_about(
    matrix: csc_array, shift: float, wanted: Floats, accuracy: float, vectors: tuple[int, int, int]
) -> tuple[Complexes, Modes, int]:
    """All eigenvalues about a shift, at least of real parts between two `wanted` ones, and those that matter with
    vectors; and how many vectors would have been enough.

    `accuracy` is the error of an eigenvalue by one space, and `vectors` are those of a block, of the spaces before
    their eigenvalues are looked at, and at the most. A SpectrumError if the largest space does not hold them.
    """
    (block, first, most), (low, high) = vectors, wanted
    size = matrix.shape[0]
    factors = general_lu(csc_array(matrix - shift * eye_array(size)), ordered=True)
    random = np.random.default_rng(block)
    starts = ((partial(factors.solve, trans=side), random.standard_normal((block, size))) for side in "NT")
    right, left = (BlockKrylov(solve, start, most) for solve, start in starts)
    while True:
        distances, radii = [], []
        for space in (right, left):
            space.extend(first)
            theta, y, x = eig(space.square, left=True, right=True, check_finite=False)
            order = np.argsort(-np.abs(theta), kind="stable")
            with np.errstate(divide="ignore", invalid="ignore"):
                error = space.residuals(x) / np.abs(theta) ** 2 / np.abs(np.sum(y.conj() * x, axis=0))
                known = (shift + 1 / theta[order])[np.logical_and.accumulate(error[order] <= accuracy)]
            distances.append(np.abs(known - shift))
            radii.append(np.inf if len(known) == size else distances[-1].max(initial=0.0))
        height = np.abs(known.imag[(known.real >= low) & (known.real <= high)]).max(initial=0.0)
        radius, needed = min(radii), float(np.hypot(1.1 * max(high - shift, shift - low), 1.5 * height))
        if radius >= needed or right.full:
            break
        first = int(right.used * min(1.5, max(1.05, needed / max(radius, 1e-300))))  # the radius grows as the space
    if radius < needed:
        raise SpectrumError(f"a space of {right.used} vectors does not hold the eigenvalues about {shift:.6g}")
    # two that nearly coalesce are on the same side of the widest gap
    near = np.sort([needed, *(d for d in distances[0] if needed < d < radius), min(radius, 2 * distances[0].max())])
    k = int(np.argmax(np.diff(near))) if len(near) > 1 else 0
    radius = 0.5 * (near[k] + near[min(k + 1, len(near) - 1)])
    bases = []
    try:
        for space in (right, left):
            within = {"sort": lambda a, b: np.hypot(a, b) * radius > 1, "check_finite": False}
            *_, turn, count = schur(space.square, output="real", **within)
            bases.append(space.basis[: space.used].T @ turn[:, :count])
        v, u = bases
        both = u.T @ v
        values, y, x = eig(np.linalg.solve(both, u.T @ (matrix @ v)), left=True, right=True)
        y_whole = np.linalg.solve(both.T, y)
    except (ValueError, np.linalg.LinAlgError) as error:  # rounding has moved one of a cluster in one of the spaces
        raise SpectrumError(f"the eigenvalues about {shift:.6g} are not set apart from others") from error
    length = np.linalg.norm(y_whole, axis=0)
    chosen = _matters(values, np.abs(np.sum(y.conj() * x, axis=0)) / length)
    modes = Modes(values[chosen], v @ x[:, chosen], u @ (y_whole / length)[:, chosen])
    return values, modes, int(1.06 * right.used * min(1.0, needed / radius))
