r"""How hard a packing may be pushed, in any way, before one of its contacts changes: a bound for all pushes.

Mass-weighted, small motion obeys :math:`\ddot z = -(S + N) z - G \dot z` with S symmetric and N antisymmetric. Let
:math:`E = \tfrac12 |\dot z|^2 + \tfrac12 z^T S z`, and let row :math:`Y_c` be by how much a displacement, and
:math:`Z_c` by how much a velocity changes what contact c lacks to its change, :math:`m_c`. By the inequality of Cauchy
and Schwarz

.. math:: |Y_c z + Z_c \dot z|^2 \le (Y_c S^{-1} Y_c^T + Z_c Z_c^T)\, 2 E .

With N = 0 the energy does not rise, so that no contact changes after any push, of one particle or of all, whose energy
is below

.. math:: E_{max} = \min_c \frac{m_c^2}{2\, (Y_c S^{-1} Y_c^T + Z_c Z_c^T)} \Big/ \mathcal G .

:math:`\mathcal G` is the largest gain of E over time: 1 for N = 0. No random number has a part in it, and neither have
the numbers and axes of the particles.

**What a contact lacks.** An overlap lacks itself until it opens, or of Hertz's law, whose stiffness changes with the
overlap, a tenth of itself; a gap lacks itself until it closes. Coulomb's bound is a cone:
the tangential force :math:`(f_t + a, b)` along and across stays below :math:`\mu f_n + h` if for every angle
:math:`\varphi` of the plane :math:`a \cos\varphi + b \sin\varphi - h < \mu f_n - f_t \cos\varphi`, which are rows
and distances as above.

**The gain.** In coordinates whose square is 2 E the motion is :math:`e^{Zt}`. Its norm at :math:`2\tau` and
:math:`3\tau`, times its bound up to :math:`\tau`, bounds it up to :math:`4\tau`, and so on; once the norm is below one,
for ever. Without dissipation the energies of the modes of :math:`S + N` are constant, and bound E. Of more than
600 coordinates :math:`\mathcal G = e` up to the time :math:`1 / |S^{-1/2} N|` (the numerical abscissa;
Trefethen and Embree, *Spectra and Pseudospectra*, 2005, chapter 14).

**Motions that no force opposes** have no energy of their own: :math:`S + \epsilon` with :math:`\epsilon = 1/t^2` stands
for S, and the bound holds up to the time t.

The same energy of the displacement by the residual forces says from which push on these do not count.
"""

import numpy as np
from scipy.linalg import cholesky, eig, eigh, expm, solve_triangular
from scipy.sparse import csc_array, csr_array, eye_array
from scipy.sparse.linalg import LinearOperator, eigsh, svds

from ..arrays import Floats
from ..factors.sparse_lu import Factors, SingularMatrixError, symmetric_lu
from ..fields_by_name import FieldsByName
from ..progress import report_progress
from .motion import Motion
from .one_sided import OneSidedSystem
from .random_state import motion_near

FREE_TIME = 500.0
"""Up to which time a bound holds of a packing with motions that no force opposes, in stable time steps: some hundred
periods of the fastest motion, twenty of a slow one."""

OVERLAP_CHANGE = 0.1
"""Share by which an overlap of Hertz's law may change. The error of D rises in proportion: with a quarter it was up to
2.6 % after pushes of one particle and of all in twenty disks, of LAMMPS's own motion."""


def reach_of(system: OneSidedSystem, free: int = 0) -> FieldsByName | None:
    """The bound for all pushes of a linear motion that does not grow; None if its energy is not positive.

    No contact is at Coulomb's bound, and `free` motions no force opposes.

    Returns
    -------
    FieldsByName or None
        `energy` of a push, below which no contact changes, infinite if nothing can change; `gain`, the bound of the
        largest gain of energy; the `time` up to which this holds, infinite if for ever; `residual_energy` of the
        displacement by the residual forces; `unsettled`, the numbers of the contacts that the residual forces alone may
        take to another state, -1 for a gap that closes.
    """
    motion, step, changes = system.motion, system.stable_step, system.changes
    shift = (1 / (FREE_TIME * step)) ** 2 if free else 0.0
    symmetric = csc_array(0.5 * (motion.stiffness + motion.stiffness.T) + shift * eye_array(len(motion.active)))
    try:
        factors = symmetric_lu(symmetric, symmetric=True)
    except SingularMatrixError:
        return None
    if factors.negative:
        return None
    gain, time = _gain(motion, symmetric, factors, step, FREE_TIME * step if free else np.inf)
    moved = factors.solve(system.residual_force)
    residual = 0.5 * float(np.sum(system.residual_force * moved))
    energy, unsettled = np.inf, np.zeros(0, int)
    if system.configuration.stiffness is None:  # otherwise the bounds of contacts are not known
        energy = 0.5 * _radius(system, factors) ** 2 / gain
        # a force that begins to act displaces twice as far as one at rest
        multiples = changes.multiples(2 * moved, 0 * moved, np.zeros((0, 1)), np.abs(system.rates @ moved))
        unsettled = np.flatnonzero(np.minimum(multiples.reaches, multiples.opens).min(axis=1) < 1)
        if multiples.closes.min(initial=np.inf) < 1:
            unsettled = np.append(unsettled, -1)
    return FieldsByName(energy=energy, gain=gain, time=time, residual_energy=residual, unsettled=unsettled)


@np.errstate(divide="ignore", invalid="ignore")
def _radius(system: OneSidedSystem, factors: Factors) -> float:
    """The smallest root of 2 E with which a contact changes: only those are solved for that may be the first."""
    c, changes = system.configuration.contacts, system.changes
    count, rows, viscous = len(c), csr_array(changes.rows), csr_array(changes.viscous)
    dashpots = [viscous[i * count : (i + 1) * count] for i in range(3)]
    lost = np.array([[np.asarray(a.multiply(b).sum(axis=1)).ravel() for a in dashpots] for b in dashpots])
    slope, bound, force = (each[:, 0] for each in (changes.bound_slope, changes.bound, changes.tangential))
    coupling = np.linalg.norm(0.5 * (c.closing + c.parting), axis=1) + slope
    sticks, closed = changes.sticks[:, 0], changes.overlap[:, 0].copy()
    closed[c.normal_stiffness * c.overlap > 1.01 * c.normal_force] *= OVERLAP_CHANGE
    safe, together = 2.0, 64  # normal forces soften the stiffness of a contact alone, by less than this factor
    alone = c.tangential_stiffness + np.nan_to_num(coupling**2 / c.normal_stiffness, nan=0.0, posinf=np.inf)
    least = np.where(sticks, (bound - force) / np.sqrt(safe * alone + np.trace(lost)), np.inf)
    least = np.minimum(least, np.where(closed > 0, closed * np.sqrt(c.normal_stiffness / safe), np.inf))
    least = np.nan_to_num(least, nan=0.0, posinf=np.inf)
    order, best = np.argsort(least, kind="stable"), np.inf
    for begin in range(0, len(order), together):
        here = order[begin : begin + together]
        if least[here[0]] >= best:
            break
        report_progress(f"largest push: {begin} of {len(order)} contacts looked at")
        wanted = np.stack([rows[i * count + here].toarray().T for i in range(3)])
        solved = factors.solve(np.hstack(list(wanted))).reshape(wanted.shape[1], 3, len(here)).transpose(1, 0, 2)
        product = np.einsum("iec,jec->ijc", wanted, solved)
        opens = closed[here] / np.sqrt(product[2, 2])
        turned = np.ones((3, len(here)))
        turned[2] = slope[here]
        both = product * turned[:, None] * turned + lost[:, :, here]
        reaches = _cone_distance(both, force[here], bound[here])
        best = min(best, opens[closed[here] > 0].min(initial=np.inf), reaches[sticks[here]].min(initial=np.inf))
    for begin in range(3 * count, rows.shape[0], 3 * together):
        columns = rows[begin : begin + 3 * together].toarray().T
        size = np.sqrt(np.sum(columns * factors.solve(columns), axis=0))
        best = min(best, (changes.gap[begin - 3 * count :, 0][: len(size)] / size).min(initial=np.inf))
    return float(best)


def _cone_distance(product: Floats, force: Floats, bound: Floats) -> Floats:
    """The smallest (mu f_n - f_t cos phi) / |n| of each contact, n = (cos phi, sin phi, -1), in the norms of products
    of shape (3, 3, C)."""
    angle = np.linspace(-np.pi, np.pi, 4097)  # half of the way from one to the next counts for 1e-6
    n = np.stack([np.cos(angle), np.sin(angle), -np.ones_like(angle)])
    size = np.sqrt(np.maximum(np.einsum("ia,ijc,ja->ca", n, product, n, optimize=True), 0.0))
    distance = (bound[:, None] - force[:, None] * n[0]) / size
    return np.asarray(np.nan_to_num(distance, nan=np.inf, posinf=np.inf).min(axis=1))


def _gain(motion: Motion, symmetric: csc_array, factors: Factors, step: float, end: float) -> tuple[float, float]:
    """A bound of the gain of energy, and up to which time it holds: up to the end, if it can."""
    skew = csr_array(motion.stiffness - symmetric)  # N, and the shift of free motions
    largest = float(np.abs(symmetric.data).max(initial=0.0))
    if float(np.abs(skew.data).max(initial=0.0)) <= 1e-12 * largest:
        return 1.0, end
    size = symmetric.shape[0]
    if size > 600:  # two seconds
        twice = LinearOperator((size, size), lambda x: skew.T @ factors.solve(skew @ x), dtype=float)
        # of a crystal many are equal, and a start of ones has no part of them; two digits do
        start = np.random.default_rng(0).standard_normal(size)
        found = eigsh(twice, 1, v0=start, tol=1e-2, return_eigenvectors=False)
        return float(np.exp(1.0)), min(end, float(1 / np.sqrt(1.02 * found[0])))
    root, stiffness = cholesky(symmetric.toarray()), motion.stiffness.toarray()  # R with R^T R = S: p = R z
    if not motion.dissipative and np.isinf(end):
        # the energies of the modes of A are constant, each by itself, and their sum is E but for two factors, with
        # weights with which left and right vectors are as long
        values, x = eig(stiffness)
        inverse = np.linalg.inv(x)
        weight = np.sqrt(np.linalg.norm(inverse, axis=1) / np.linalg.norm(x, axis=0))
        outward, inward, omega = x / weight, weight[:, None] * inverse, np.sqrt(np.abs(values))
        back = solve_triangular(root, inward.T, trans="T").T
        larger = max(np.linalg.norm(outward, 2), np.linalg.norm(root @ outward / omega, 2))
        smaller = max(np.linalg.norm(inward, 2), np.linalg.norm(omega[:, None] * back, 2))
        return float((larger * smaller) ** 2), end
    push = -solve_triangular(root, stiffness.T, trans="T").T
    z = np.block([[np.zeros((size, size)), root], [push, -motion.damping.toarray()]])
    fastest = float(eigh(0.5 * (z + z.T), eigvals_only=True, subset_by_index=(2 * size - 1, 2 * size - 1))[0])
    time, one = 0.25 * step, expm(0.25 * step * z)
    two = one @ one
    before, after = np.exp(fastest * time), np.exp(2 * fastest * time)  # up to time, and to 2 time
    for _ in range(22):  # doublings until the norm is to fall below one
        how = {"v0": np.ones(2 * size), "tol": 1e-3, "return_singular_vectors": False}
        sizes = [svds(each, 1, **how)[0] for each in (two, one @ two)]
        before, after = after, max(after, max(sizes) * before)
        if min(sizes) <= 1:
            return float(after**2), end
        if after**2 > 1e4 or 4 * time >= end:
            break
        time, one, two = 2 * time, two, two @ two
    return float(after**2), min(end, 4 * time)


def change_of_growing(system: OneSidedSystem, s: complex) -> float | None:
    """D at which the linear motion with the eigenvalue s takes the first contact to another state; None if none is
    known that changes."""
    if system.configuration.stiffness is not None:
        return None
    motion = system.motion
    start = np.random.default_rng(0).standard_normal(len(motion.active))
    s, shape, _ = motion_near(motion.stiffness, motion.damping, s * (1 + 1e-7), start)
    turned = shape[:, None] * np.exp(2j * np.pi * np.arange(64) / 64)
    slid, paths = (np.zeros((matrix.shape[0], 64)) for matrix in (system.excess, system.rates))
    first = system.changes.first(turned.real, (s * turned).real, slid, paths)
    at = int(first.argmin())
    found = float(first[at] ** 2 * system.mean_square_displacement(turned.real)[at])
    return found if np.isfinite(found) else None
