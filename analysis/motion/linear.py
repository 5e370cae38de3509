r"""Does linear motion grow? The verdict at any size, with the packing's dissipation.

**Up to** `LAPACK_UP_TO` **coordinates** LAPACK computes all eigenvalues s of the first-order matrix Z in coordinates of
the energy (:mod:`~faultgouge.analysis.motion.energy_norm`), or all eigenvalues of A where there is no dissipation. What
grows beyond rounding is said by :mod:`~faultgouge.analysis.motion.eigenvalues`. A motion that no force opposes has s =
0 twice, in one Jordan block, which rounding turns into a pair of either sign. It belongs to a left vector y with
:math:`y^T A = y^T G = 0`: for every other motion :math:`s^2\, y^T z = 0`, so that z is orthogonal to y. So these y are
taken out first, exactly.

**Beyond**, the fastest growing motion is looked for (:mod:`~faultgouge.analysis.motion.growing`). If none is found,
a certificate says that no fast motion grows, and slow ones are found one by one
(:mod:`~faultgouge.analysis.motion.certificate`). Where there is no certificate, as with dashpots that are too weak for
the asymmetry of the law, a random state is followed (:mod:`~faultgouge.analysis.motion.random_state`). Without
dissipation only a symmetric K, or all its eigenvalues, say that nothing grows.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig, eigvals, qr, solve_triangular, svd
from scipy.sparse import block_diag, csc_array, csr_array, eye_array, vstack
from scipy.sparse.csgraph import connected_components

from ..arrays import Complexes, Floats
from ..factors.sparse_lu import SingularMatrixError, symmetric_lu
from .all_eigenvalues import SpectrumError, all_eigenvalues
from .certificate import NoProofError, prove
from .eigenvalues import (
    SAFETY,
    Linear,
    growing,
    growing_undamped,
    is_zero,
    operator_rounding,
    unit_rounding,
    zero_uncertainties,
    zero_uncertainty,
)
from .energy_norm import EnergyNorm
from .growing import fastest_growing
from .modes import Modes
from .motion import Motion
from .random_state import follow_decay

TINY = 8
"""Coordinates in which there is nothing to search by products."""

LAPACK_FIRST = 1000
"""Coordinates up to which LAPACK computes all s with dissipation at once, some seconds; a certificate takes less time
of more."""

LAPACK_UP_TO = 2000
"""Coordinates up to which LAPACK is asked at all: without dissipation, or where there is no certificate, 20 s."""

SLICES_UP_TO = 6000
"""Coordinates up to which all eigenvalues of A are found in slices, two minutes."""

PERIODS_OF_LARGE = 2e6
"""Periods of the fastest motion in which growth is looked for, times the number of coordinates: some seconds."""

FIRST_SEARCH, LONGEST_SEARCH = 30.0, 300.0
"""Periods of the fastest motion at first, which show fast growth in a tenth of the time, and at the most."""

LARGEST_LOSS = 4.0
"""Loss of dashpots over the fastest frequency beyond which no fast growth is sought: the search takes short steps, and
strong dashpots leave slow growth alone. Both are bounds, by sums of rows."""

FREE_ROW = 1e-10
"""Force along a vector of one particle, as a share of the largest entry of A, and of G, that is no force."""


def linear_verdict(motion: Motion, *, decides: bool = True, time: float | None = None) -> Linear:
    """Whether linear motion grows.

    Parameters
    ----------
    motion : Motion
        The operators.
    decides : bool
        Whether a verdict depends on this motion: otherwise fast growth alone is looked for in a large packing.
    time : float, optional
        How long a random state is followed, where there is no certificate; three minutes of work by default.

    Returns
    -------
    Linear
    """
    size = len(motion.active)
    if not size:
        return Linear(True, 0.0)
    if size <= max(TINY, LAPACK_FIRST if motion.dissipative else LAPACK_UP_TO):
        return _by_lapack(motion)
    if motion.dissipative and len(parts := _parts(motion)) > 1:
        return _of_parts([linear_verdict(each, decides=decides, time=time) for each in parts])
    found = _fast_growth(motion, final=not decides or not motion.dissipative)
    if found.stable is False or not decides:
        return found
    if not motion.dissipative:
        return _without_loss(motion, found)
    kept = opposed(motion)
    a, g = (csr_array(kept.T @ each @ kept) for each in (motion.stiffness, motion.damping))
    alone = size - kept.shape[1]
    zero = zero_uncertainty(motion.configuration, operator_rounding(motion.configuration, motion.stiffness.data))
    try:
        proof = prove(a, g, zero)
    except NoProofError as failure:
        return (
            _by_lapack(motion)
            if size <= LAPACK_UP_TO
            else follow_decay(motion, kept, str(failure), time, found.searched)
        )
    free, proved = alone + proof.free, "shown" if proof.shown else "proved"
    fast = f"no motion faster than {proof.frequency:.3g} grows ({proved})"
    if not len(proof.values):
        return Linear(True, -2 * proof.decay, 2 * proof.decay, free, said=fast)
    fastest = int(np.argmax(proof.values.real))
    s, error = complex(proof.values[fastest]), float(proof.errors[fastest])
    slow = f"of {proof.slow} slower ones, known one by one, the slowest decays with D as exp({2 * s.real:.6g} t)"
    if s.real > error:
        return Linear(False, 2 * s.real, 2 * error, free, s, at_least=not proof.all_slow)
    doubt = float((proof.values.real + proof.errors).max())
    if doubt >= 0:
        why = f"of {proof.slow} slow motions the slowest has 2 Re s = {2 * s.real:.3g} with an error of {2 * error:.2g}"
        return Linear(None, 2 * s.real, 2 * error, free, s, searched=2 * doubt, reasons=(f"{fast}, but {why}",))
    more = max(error, doubt - s.real, -s.real - proof.decay, 1e-14 * proof.largest)
    return Linear(True, 2 * s.real, 2 * more, free, s, f"{fast}, and {slow}")


def _parts(motion: Motion) -> list[Motion]:
    """The motions of groups of particles that touch none of another group, the largest first.

    Many spheres that lie on a plane by themselves have the same eigenvalues, of which a block of vectors sees a few.
    """
    places = np.unique(motion.particle, return_inverse=True)[1]
    of_particle = csr_array((np.ones(len(places)), (np.arange(len(places)), places)))
    touches = of_particle.T @ (abs(motion.stiffness) + abs(motion.damping)) @ of_particle
    count, group = connected_components(touches, directed=False)
    group = group[places]
    members = np.split(np.argsort(group, kind="stable"), np.cumsum(np.bincount(group, minlength=count))[:-1])
    return [
        replace(
            motion,
            active=motion.active[rows],
            root_mass=motion.root_mass[rows],
            stiffness=csr_array(motion.stiffness[rows][:, rows]),
            damping=csr_array(motion.damping[rows][:, rows]),
        )
        for rows in sorted(members, key=len, reverse=True)
    ]


def _of_parts(parts: list[Linear]) -> Linear:
    """The verdict on motions that know nothing of each other, the largest first."""
    free = sum(each.free for each in parts)
    moves = [each for each in parts if each.s or each.growth_rate or not each.stable] or parts  # others drift
    worst = max(moves, key=lambda each: (each.stable is False, each.stable is None, each.growth_rate))
    if not worst.stable:
        return replace(worst, free=free, searched=max(each.searched for each in parts))
    more = max(each.growth_rate + each.error for each in moves) - worst.growth_rate
    said = parts[0].said
    if said and worst is not parts[0]:
        said = (
            f"{said}; of {len(parts) - 1} groups of other particles one decays with D as exp({worst.growth_rate:.6g} t)"
        )
    return replace(worst, error=max(worst.error, more), free=free, said=said)


def all_rates(motion: Motion) -> tuple[Complexes, NDArray[np.bool_], int, float]:
    """All eigenvalues s of small motion, by LAPACK.

    Returns
    -------
    values : ndarray of complex, shape (k,)
        s with Im s >= 0, the fastest growing first, 1 / time. Motions that no force opposes are left out.
    grows : ndarray of bool, shape (k,)
        Those with Re s > 0 beyond rounding.
    free : int
        Motions that no force opposes, and that drift.
    error : float
        Of Re s that is perfectly conditioned, 1 / time.
    """
    if not motion.dissipative:
        return _undamped_rates(motion, Modes.of_matrix(motion.stiffness))
    a, g, packing = motion.stiffness.toarray(), motion.damping.toarray(), motion.configuration
    size, rounding_of_a = len(a), operator_rounding(packing, motion.stiffness.data)
    free, turned = _unopposed(motion, a, rounding_of_a)
    driven = g.T @ free  # but for what forces out of balance turn these vectors by
    driven -= free @ (free.T @ driven)
    held = np.zeros((free.shape[1], 0))
    if free.shape[1]:  # those that no dashpot opposes, either: zero is double
        _, sizes, turn = svd(driven, full_matrices=False)
        held = turn[sizes <= SAFETY * unit_rounding(g) + turned * np.linalg.norm(g)].T
    others = qr(free @ held)[0][:, held.shape[1] :] if held.shape[1] else np.eye(size)
    a, g = others.T @ a @ others, others.T @ g @ others
    norm = EnergyNorm.of(csr_array(a))
    z = norm.first_order(csr_array(a), csr_array(g))
    values, rounding = eigvals(z, check_finite=False), operator_rounding(packing, z)
    grows = values.real > np.sqrt(SAFETY * rounding * np.abs(values).max(initial=0.0))  # no double one is as uncertain
    if np.any(~grows & (values.real > 0)):  # vectors take three times as long as eigenvalues
        values, left, right = eig(z, left=True, check_finite=False)
        grows = growing(values, np.abs(np.sum(left.conj() * right, axis=0)), rounding)
    # of motions that dashpots alone oppose one s is zero, once
    still = np.argsort(np.abs(values))[: free.shape[1] - held.shape[1]]
    counts = values.imag >= 0
    counts[still] = False
    order = np.flatnonzero(counts)
    order = order[np.argsort(-values[order].real, kind="stable")]
    return values[order], grows[order], free.shape[1], SAFETY * rounding


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


def _undamped_rates(motion: Motion, modes: Modes) -> tuple[Complexes, NDArray[np.bool_], int, float]:
    """From the eigenvalues of A that are known with vectors."""
    packing, rounding = motion.configuration, operator_rounding(motion.configuration, motion.stiffness.data)
    zero = zero_uncertainties(packing, rounding, motion.particle, modes.left, modes.right)
    oscillates, buckles = growing_undamped(modes.values, modes.overlap, rounding, zero)
    grows = oscillates | buckles
    free = ~grows & is_zero(modes.values, modes.overlap, zero_uncertainty(packing, rounding), zero)
    s = 1j * np.sqrt(np.where(grows, modes.values, np.abs(modes.values.real)).astype(complex))
    s = np.where(s.real < 0, -s, s)
    order = np.flatnonzero(~free & (modes.values.imag >= 0))
    order = order[np.argsort(-s[order].real, kind="stable")]
    error = SAFETY * rounding / np.sqrt(max(float(abs(motion.stiffness).sum(axis=1).max()), np.finfo(float).tiny))
    return s[order], grows[order], int(free.sum()), float(error)


def _by_lapack(motion: Motion) -> Linear:
    values, grows, free, error = all_rates(motion)
    if not len(values):
        return Linear(True, 0.0, free=free)
    fastest = int(np.argmax(np.where(grows, values.real, -np.inf))) if grows.any() else 0
    s = complex(values[fastest])
    known = grows.any() or abs(s.real) > error
    return Linear(not grows.any(), 2 * s.real if known else 0.0, 2 * error, free, s)


def _fast_growth(motion: Motion, *, final: bool) -> Linear:
    """What surely grows; `final` says whether nothing else is looked at."""
    a, g = motion.stiffness, motion.damping
    fastest, loss = (float(abs(each).sum(axis=1).max(initial=0.0)) for each in (a, g))
    if loss > LARGEST_LOSS * np.sqrt(fastest):  # nothing grows faster than K alone would have it
        return Linear(None, 0.0, searched=2 * float(np.sqrt(fastest)))
    longest = min(LONGEST_SEARCH, PERIODS_OF_LARGE / len(motion.active)) if final else FIRST_SEARCH
    damping = motion.in_blocks(g) if motion.dissipative else None
    return fastest_growing(motion.in_blocks(a), damping, (min(FIRST_SEARCH, longest), longest))


def _without_loss(motion: Motion, found: Linear) -> Linear:
    """Of a large packing without dissipation in which no fast growth was found."""
    a, packing = motion.stiffness, motion.configuration
    rounding = operator_rounding(packing, a.data)
    zero = zero_uncertainty(packing, rounding)
    if abs(a - a.T).max() <= SAFETY * rounding:
        shifts = (csc_array(0.5 * (a + a.T) + shift * eye_array(a.shape[0])) for shift in (zero, -zero))
        try:
            below, above = (symmetric_lu(each, symmetric=True).negative for each in shifts)
            if not below:
                said = "the stiffness is symmetric, and its energy positive (proved)"
                return Linear(True, 0.0, free=above, said=said)
        except SingularMatrixError:
            pass
    if len(motion.active) <= SLICES_UP_TO:
        try:
            every = all_eigenvalues(a)
        except SpectrumError as failure:
            return Linear(None, 0.0, searched=found.searched, reasons=(str(failure).rstrip("."),))
        s, grows, free, error = _undamped_rates(motion, every.marked)
        free += int(
            np.count_nonzero(np.abs(every.values) <= zero) - np.count_nonzero(np.abs(every.marked.values) <= zero)
        )
        fastest = 2 * float(s[grows].real.max(initial=0.0))
        return Linear(not grows.any(), fastest, 2 * error, free, complex(s[grows][0]) if grows.any() else 0j)
    why = (
        f"without dissipation growth of D slower than exp({found.searched:.2g} t) may not have been seen in a packing "
        f"of {len(motion.active)} coordinates: give the packing its dashpots, or search it in slices by `onset`"
    )
    return Linear(None, 0.0, searched=found.searched, reasons=(why,))


def opposed(motion: Motion) -> csr_array:
    """An orthonormal basis of all motion but that of one particle each that no force drives, shape (n, n - k).

    Whatever the other particles do, there is no force and no torque along such a vector y, as of a sphere that rolls on
    a plane or turns about the line through its two contacts: the rows of the particle have :math:`y^T A = y^T G = 0`.
    """
    matrices = (motion.stiffness, motion.damping)
    parts = (each.T / max(abs(each).max(), np.finfo(float).tiny) for each in matrices if each.nnz)
    both, particle = vstack(list(parts), format="csc"), motion.particle
    begins = np.flatnonzero(np.diff(particle, prepend=-1))
    blocks = []
    for first, last in zip(begins, [*begins[1:], len(particle)], strict=True):
        entries = slice(both.indptr[first], both.indptr[last])
        rows, row = np.unique(both.indices[entries], return_inverse=True)
        columns = np.zeros((max(len(rows), last - first), last - first))
        columns[row, np.repeat(np.arange(last - first), np.diff(both.indptr[first : last + 1]))] = both.data[entries]
        _, sizes, vectors = np.linalg.svd(columns, full_matrices=False)
        # as given where all of it is opposed, so that the matrices stay sparse
        blocks.append(np.eye(last - first) if sizes.min() > FREE_ROW else vectors[sizes > FREE_ROW].T)
    return csr_array(block_diag(blocks, format="csr"))
