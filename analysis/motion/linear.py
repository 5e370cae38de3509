r"""Does linear motion grow? The verdict at any size, with the packing's dissipation.

**Up to** `LAPACK_UP_TO` **coordinates** LAPACK computes all eigenvalues s of the first-order matrix Z in coordinates of
the energy (:mod:`~faultgouge.analysis.motion.motion`), or all eigenvalues of A where there is no dissipation. What
grows beyond rounding is said by :mod:`~faultgouge.analysis.motion.eigenvalues`. A motion that no force opposes has s =
0 twice, in one Jordan block, which rounding turns into a pair of either sign. It belongs to a left vector y with
:math:`y^T A = y^T G = 0`: for every other motion :math:`s^2\, y^T z = 0`, so that z is orthogonal to y. So these y are
taken out first, exactly.

**Beyond**, a motion that grows is looked for (:mod:`~faultgouge.analysis.motion.random_state`). If none is found,
a certificate says that no fast motion grows, and slow ones are found one by one
(:mod:`~faultgouge.analysis.motion.certificate`). Where there is no certificate, as with dashpots that are too weak for
the asymmetry of the law, the slowest motions are found one by one (:mod:`~faultgouge.analysis.motion.slow_motions`),
and a random state without these is followed until it has decayed. Without dissipation only a symmetric K, or all its
eigenvalues (:mod:`~faultgouge.analysis.motion.spectrum`), say that nothing grows. Groups of particles that touch none
of another group have a verdict each: many spheres that lie on a plane by themselves have the same eigenvalues, of which
a block of vectors sees a few.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig, eigvals, qr, solve_triangular, svd
from scipy.sparse import block_diag, csc_array, csr_array, eye_array, vstack
from scipy.sparse.csgraph import connected_components

from ..arrays import Complexes, Floats
from ..factors.sparse_lu import negative_pivots
from .certificate import NoProofError, prove
from .eigenvalues import (
    SAFETY,
    Linear,
    growing_undamped,
    is_zero,
    operator_rounding,
    unit_rounding,
    zero_uncertainties,
    zero_uncertainty,
)
from .modes import Modes
from .motion import Motion, energy_norm, matrix_in_norm
from .random_state import fastest_growing, follow_decay

LAPACK_FIRST = 1000
"""Coordinates up to which LAPACK computes all s with dissipation at once, some seconds; a certificate takes less time
of more."""

LAPACK_UP_TO = 2000
"""Coordinates up to which LAPACK is asked at all: without dissipation, or where there is no certificate, 20 s."""


def linear_verdict(motion: Motion, *, decides: bool = True, time: float | None = None) -> Linear:
    """Whether linear motion grows; where no verdict depends on it, not `decides`, fast growth alone in a large packing.

    Where there is no certificate, a random state is followed for the `time`, by default for as long as some ten minutes
    of work allow.
    """
    size, a, g, packing = len(motion.active), motion.stiffness, motion.damping, motion.configuration
    if not size:
        return Linear(True, 0.0)
    if size <= max(8, LAPACK_FIRST if motion.dissipative else LAPACK_UP_TO):
        return _by_lapack(motion)
    if motion.dissipative and (found := _of_groups(motion, decides, time)) is not None:
        return found
    # strong dashpots leave slow growth alone, and make the search take short steps; 2e6 periods take some seconds
    fastest, loss = (float(abs(each).sum(axis=1).max(initial=0.0)) for each in (a, g))
    found = Linear(None, 0.0, searched=2 * float(np.sqrt(fastest)))  # nothing is faster than K alone would have it
    if loss <= 4 * np.sqrt(fastest):
        longest = 30.0 if decides and motion.dissipative else min(300.0, 2e6 / size)
        found = fastest_growing(a, g if motion.dissipative else None, (min(30.0, longest), longest))
    if found.stable is False or not decides:
        return found
    rounding = operator_rounding(packing, a.data)
    zero = zero_uncertainty(packing, rounding)
    if not motion.dissipative:
        if abs(a - a.T).max() <= SAFETY * rounding:
            shifts = (csc_array(0.5 * (a + a.T) + shift * eye_array(size)) for shift in (zero, -zero))
            below, above = map(negative_pivots, shifts)
            if below == 0 and above is not None:
                said = "the stiffness is symmetric, and its energy positive (proved)"
                return Linear(True, 0.0, free=above, said=said)
        why = f"without dissipation growth of D slower than exp({found.searched:.2g} t) may not have been seen in a "
        why += f"packing of {size} coordinates: give the packing its dashpots, or search it in slices by `onset`"
        return replace(found, reasons=(why,))
    kept = opposed(motion)
    try:
        found = prove(csr_array(kept.T @ a @ kept), csr_array(kept.T @ g @ kept), zero)
    except NoProofError as failure:
        why = str(failure)
        return _by_lapack(motion) if size <= LAPACK_UP_TO else follow_decay(motion, kept, why, time, found.searched)
    return replace(found, free=found.free + size - kept.shape[1])


def _of_groups(motion: Motion, decides: bool, time: float | None) -> Linear | None:
    """The verdict on groups of particles that touch none of another group; None of one group."""
    places = np.unique(motion.particle, return_inverse=True)[1]
    of_particle = csr_array((np.ones(len(places)), (np.arange(len(places)), places)))
    touches = of_particle.T @ (abs(motion.stiffness) + abs(motion.damping)) @ of_particle
    count, group = connected_components(touches, directed=False)
    if count == 1:
        return None
    found = []
    for each in np.argsort(-np.bincount(group[places]), kind="stable"):  # the largest first
        rows = np.flatnonzero(group[places] == each)
        a, g = (csr_array(matrix[rows][:, rows]) for matrix in (motion.stiffness, motion.damping))
        part = replace(motion, active=motion.active[rows], root_mass=motion.root_mass[rows], stiffness=a, damping=g)
        found.append(linear_verdict(part, decides=decides, time=time))
    free = sum(each.free for each in found)
    moves = [each for each in found if each.s or each.growth_rate or not each.stable] or found  # others drift
    worst = max(moves, key=lambda each: (each.stable is False, each.stable is None, each.growth_rate))
    if not worst.stable:
        return replace(worst, free=free, searched=max(each.searched for each in found))
    said, error = found[0].said, max(each.growth_rate + each.error for each in moves) - worst.growth_rate
    if said and worst is not found[0]:
        other = f"of {count - 1} groups of other particles one decays with D as exp({worst.growth_rate:.6g} t)"
        said = f"{said}; {other}"
    return replace(worst, error=max(worst.error, error), free=free, said=said)


def _by_lapack(motion: Motion) -> Linear:
    values, grows, free, error = all_rates(motion)
    if not len(values):
        return Linear(True, 0.0, free=free)
    s = complex(values[int(np.argmax(grows))])  # the first of those that grow, or the slowest
    known = grows.any() or abs(s.real) > error
    return Linear(not grows.any(), 2 * s.real if known else 0.0, 2 * error, free, s)


def all_rates(motion: Motion) -> tuple[Complexes, NDArray[np.bool_], int, float]:
    """All eigenvalues s of small motion, by LAPACK.

    Returns s with Im s >= 0, the fastest growing first, without motions that no force opposes; which have Re s > 0
    beyond rounding; how many motions drift, as no force opposes them; and the error of Re s that is perfectly
    conditioned, 1 / time.
    """
    packing, rounding = motion.configuration, operator_rounding(motion.configuration, motion.stiffness.data)
    if motion.dissipative:
        s, grows, free, error = _damped_rates(motion, rounding)
    else:
        modes, alike = Modes.of_matrix(motion.stiffness), zero_uncertainty(packing, rounding)
        zero = zero_uncertainties(packing, rounding, motion.particle, modes.left, modes.right)
        oscillates, buckles = growing_undamped(modes.values, modes.overlap, rounding, zero)
        grows = oscillates | buckles
        drifts = ~grows & is_zero(modes.values, modes.overlap, alike, zero)
        s = 1j * np.sqrt(np.where(grows, modes.values, np.abs(modes.values.real)).astype(complex))
        kept, free = ~drifts & (modes.values.imag >= 0), int(drifts.sum())
        s, grows = np.where(s.real < 0, -s, s)[kept], grows[kept]
        fastest = float(abs(motion.stiffness).sum(axis=1).max(initial=0.0))
        error = SAFETY * rounding / np.sqrt(max(fastest, np.finfo(float).tiny))
    order = np.argsort(-s.real, kind="stable")
    return s[order], grows[order], free, float(error)


def _damped_rates(motion: Motion, rounding: float) -> tuple[Complexes, NDArray[np.bool_], int, float]:
    """The same with dissipation, in any order."""
    a, g, packing = motion.stiffness.toarray(), motion.damping.toarray(), motion.configuration
    free, turned = _unopposed(motion, a, rounding)
    count, others = free.shape[1], np.eye(len(a))
    if count:  # those that no dashpot opposes, either: zero is double
        driven = g.T @ free  # but for what forces out of balance turn these vectors by
        _, sizes, turn = svd(driven - free @ (free.T @ driven), full_matrices=False)
        held = turn[sizes <= SAFETY * unit_rounding(g) + turned * np.linalg.norm(g)].T
        count -= held.shape[1]
        if held.shape[1]:
            others = qr(free @ held)[0][:, held.shape[1] :]
    a, g = others.T @ a @ others, others.T @ g @ others
    z = matrix_in_norm(energy_norm(a), a, g)
    values, of_z = eigvals(z, check_finite=False), operator_rounding(packing, z)
    grows = values.real > np.sqrt(SAFETY * of_z * np.abs(values).max(initial=0.0))  # no double one is as uncertain
    if np.any(~grows & (values.real > 0)):  # vectors take three times as long as eigenvalues
        values, left, right = eig(z, left=True, check_finite=False)
        grows = values.real * np.abs(np.sum(left.conj() * right, axis=0)) > SAFETY * of_z
    counts = values.imag >= 0
    counts[np.argsort(np.abs(values))[:count]] = False  # of motions that dashpots alone oppose one s is zero, once
    return values[counts], grows[counts], free.shape[1], SAFETY * of_z


def _unopposed(motion: Motion, a: Floats, rounding: float) -> tuple[Floats, float]:
    """Orthonormal left vectors y of A with y^T A = 0 but for rounding and for forces out of balance, shape (E, k), and
    by how much these may have turned the vectors."""
    alike, size = zero_uncertainty(motion.configuration, rounding), len(a)
    _, triangle, order = qr(a.T, mode="economic", pivoting=True, check_finite=False)
    pivots = np.abs(np.diag(triangle))
    rank = int(np.count_nonzero(pivots > alike))
    if rank == size:
        return np.zeros((size, 0)), 0.0
    vectors = np.empty((size, size - rank))
    vectors[order[:rank]] = -solve_triangular(triangle[:rank, :rank], triangle[:rank, rank:])
    vectors[order[rank:]] = np.eye(size - rank)
    vectors = qr(vectors, mode="economic")[0]
    _, sizes, turn = svd(a.T @ vectors, full_matrices=False)
    vectors = vectors @ turn.T
    zero = zero_uncertainties(motion.configuration, rounding, motion.particle, vectors, vectors)
    return vectors[:, sizes <= zero], alike / float(pivots[rank - 1]) if rank else 0.0


def opposed(motion: Motion) -> csr_array:
    """An orthonormal basis of all motion but that of one particle each that no force drives, shape (n, n - k).

    Whatever the other particles do, there is no force and no torque along such a vector y, as of a sphere that rolls on
    a plane or turns about the line through its two contacts: the rows of the particle have :math:`y^T A = y^T G = 0`.
    """
    matrices = (motion.stiffness, motion.damping)
    parts = (each.T / max(abs(each).max(), np.finfo(float).tiny) for each in matrices if each.nnz)
    both, particle = vstack(list(parts), format="csc"), motion.particle
    begins, blocks = np.flatnonzero(np.diff(particle, prepend=-1)), []
    for first, last in zip(begins, [*begins[1:], len(particle)], strict=True):
        here = both[:, first:last]
        rows, row = np.unique(here.indices, return_inverse=True)
        shape = max(len(rows), last - first), last - first
        columns = csc_array((here.data, row, here.indptr), shape=shape).toarray()
        _, sizes, vectors = np.linalg.svd(columns, full_matrices=False)
        # as given where all of it is opposed, so that the matrices stay sparse; 1e-10 of the largest entry is no force
        blocks.append(np.eye(last - first) if sizes.min() > 1e-10 else vectors[sizes > 1e-10].T)
    return csr_array(block_diag(blocks, format="csr"))
