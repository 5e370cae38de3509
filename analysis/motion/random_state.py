r"""Does linear motion from a random state grow, or decay? Any number of coordinates, by products with matrices alone.

The state :math:`u = (\omega_0 z, \dot z)` of :math:`\ddot z + G \dot z + A z = 0` obeys :math:`\dot u = Z u`. Let l be
the unit left vector of an eigenvalue s of Z. Then

.. math:: |u(t)| \ge |l^H u(t)| = |l^H u(0)|\, e^{\mathrm{Re}\, s\, t} .

If the 2 E numbers of u(0) are independent, normal and of variance one, :math:`|l^H u(0)|` is less than :math:`\delta`
with a probability below :math:`\delta`. So once :math:`|u(t)|` has fallen below :math:`\delta`, no motion grows or
persists, except with this probability. The argument holds for eigenvectors as oblique as they may be. Until then D may
grow unseen as exp(g t) with

.. math:: g = \frac2t \ln\frac{|u(t)|}\delta .

**Oscillations are seen sooner.** Let :math:`l = (p, q)`, :math:`s = a + ib`, and let H be the antisymmetric part of G.
Then :math:`p = (\bar s + G^T)\, q / \omega_0`. Real and imaginary part of :math:`l^H u(0)` are two normal numbers.
Their density is at most :math:`1 / 2\pi d`, with :math:`d \ge |\mathrm{Im}\, p^H q| \ge (b - |H|)\, |q|^2 / \omega_0`.
So :math:`|l^H u(0)|` is less than :math:`\delta` with a probability below :math:`\kappa\, \delta^2`,

.. math:: \kappa = \frac{\omega_0^2 + (b + |G|)^2}{2\, \omega_0\, (b - |H|)} .

(With a > 0 it is lower, as such motion has grown.) Where :math:`S > w^2` and :math:`G \ge 0`, all motion with a >= 0
oscillates, with b >= w about: :math:`b^2 = a^2 + a g + \sigma`. Both are known from the signs of pivots.

This holds for every :math:`\omega_0`. With a low :math:`\omega_0` :math:`|u|` falls soonest, since slow motions decay
last. **One state serves best.** Of n states each may miss :math:`\delta^{1/n}`. The time until one has fallen so far is
in proportion to :math:`\ln |u(0)| + \frac1n \ln \frac1\delta`, and n states cost n times that.

**Growth.** Once :math:`|u|^2` has risen by five decades, the fastest motion has left most others behind. Two states,
one after the other, span its plane nearly, and Newton's steps find its eigenvalue s and its shape z from there:

.. math:: P(s) = s^2 + s G + A, \qquad P(s)\, y = P'(s)\, z, \qquad s \to s - \frac{z^H z}{z^H y}, \quad z \to y .

If the state grows faster than that, s is a lower bound: another of many motions that grow alike is faster.

**Slow motions** are known one by one (:mod:`~faultgouge.analysis.motion.slow_motions`), and are taken out of the state:
the others alone have to decay in its time. Their l, and so the argument, stay as they are.

Motion of one particle that no force opposes is left out, and common motion of all particles along an axis on which no
force opposes it, as in a periodic box. Any other motion that no force opposes leaves the answer open.

**Steps** are those of velocity Verlet with dashpots at the velocity of the half step. Motion without loss neither grows
nor decays in these steps; motion that grows in spite of dashpots grows faster in longer steps, which s does not.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.linalg import eig, qr
from scipy.sparse import bsr_array, csc_array, csr_array, eye_array, hstack

from ..arrays import Complexes, Floats
from ..errors import BadInputError
from ..factors.sparse_lu import SingularMatrixError, general_lu, negative_pivots
from ..progress import report_progress
from .eigenvalues import Linear, exponential
from .motion import Motion
from .slow_motions import slow_motions
from .stable_timestep import stable_timestep

CHANCE = 1e-3
"""The probability that a motion which grows is overlooked."""

SEEN = 2 * np.log(CHANCE)
"""ln delta^2 where motion that grows need not oscillate."""

REFERENCE = 0.1
"""omega_0 over the highest frequency: about that of the slowest motions, which are left in the end."""

STEP = 0.8
"""Of the largest stable step. In such steps dashpots have 0.6 of their effect on the fastest motion; s confirms growth.
"""

WORK = 2e12
"""Multiplications with entries of A and G: some ten minutes."""


def follow(
    a: csr_array,
    g: csr_array,
    limit: float,
    state: Floats,
    looks: float,
    patience: float = np.inf,
    wanted: float = SEEN,
    leave: Callable[[Floats], Floats] | None = None,
) -> tuple[Linear, float, float]:
    """Follow a motion until it has decayed, or grows.

    Parameters
    ----------
    a, g : scipy.sparse.csr_array, shape (n, n)
        A, 1 / time^2, and G, 1 / time.
    limit : float
        The largest stable time step.
    state : ndarray, shape (n, 2)
        Normal random numbers, but for motion that is left out.
    looks : float
        How often a hundred steps are taken at the most.
    patience : float
        How many times that motion may need to decay: otherwise it is given up after a tenth.
    wanted : float
        ln |u|^2 at which motion has decayed.
    leave : callable, optional
        Takes motions that are known to decay out of u.

    Returns
    -------
    Linear
        Stable, unstable, or not known; D then grows no faster than as exp(`searched` t).
    float
        How long it was followed.
    float
        After which time the motion may have decayed.
    """
    reference, step, (both, block) = REFERENCE * 2 / limit, STEP * limit, _in_blocks(a, g)
    x = np.stack([state[:, 0] / reference, state[:, 1]], axis=1).reshape(-1, block, 2).transpose(0, 2, 1).copy()
    z, v, span, scale = x[:, 0], x[:, 1], 100 * step, 0.0

    def force() -> Floats:
        return np.asarray(both @ (x if g.nnz else z).ravel()).reshape(z.shape)

    def square() -> float:
        return float(reference**2 * np.vdot(z, z) + np.vdot(v, v))

    logs, needed = [float(np.log(square()))], np.inf
    while len(logs) <= max(looks, 8):
        if leave is not None:  # at each look: long steps turn them a little
            kept = leave(np.concatenate([reference * z.ravel(), v.ravel()])).reshape(2, *z.shape)
            z[:], v[:] = kept[0] / reference, kept[1]
        size = float(np.abs(v).max(initial=0.0)) or 1.0  # growth may be beyond all numbers
        x /= size
        before, squares, scale = x.copy(), [], scale + 2 * float(np.log(size))
        v -= 0.5 * step * force()
        for k in range(1, 101):
            z += step * v
            v -= (step if k < 100 else 0.5 * step) * force()
            if k % 7 == 0:  # a mean, as |u|^2 of one motion oscillates; seven steps divide no period for long
                squares.append(square())
        logs.append(scale + float(np.log(np.mean(squares))))
        now, after = span * (len(logs) - 1), np.array(logs[int(np.argmin(logs)) :])
        falls = _slope(logs, span)
        if logs[-1] <= wanted:
            said = f"motion from a random state decayed in t = {now:.4g} so far that any growth would be seen"
            return Linear(True, falls, abs(falls), said=said), now, now
        if len(after) > 8 and after[-1] - after[0] > 5 * np.log(10) and after[-1] > after.max() - 1:
            coarse = _slope(list(after), span)
            # as the square of the time, by motion that no force opposes, this is 3; by so many decades it is 11
            if coarse * now > 8:
                states = [(each[:, 0].ravel(), each[:, 1].ravel()) for each in (before, x)]
                s, _, error = motion_near(a, g, _of_plane(a, g, *states), states[1][0])
                if s.real > 10 * error:
                    at_least = coarse > 4 * s.real  # steps make up to a half of that
                    return Linear(False, 2 * s.real, 2 * error, s=s, at_least=at_least), now, np.inf
            break
        needed = now - (logs[-1] - wanted) / falls if falls * now < -1 else np.inf
        if len(logs) % 10 == 0:
            report_progress(f"motion from a random state: t = {now:.4g} of {min(needed, span * looks):.4g}")
        if len(logs) > max(0.1 * looks, 8) and needed > patience * looks * span:
            break
    return Linear(None, falls, searched=float(logs[-1] - wanted) / now), now, needed


def _in_blocks(a: csr_array, g: csr_array) -> tuple[bsr_array, int]:
    """[A G] with the columns of both side by side, block by block, and the size of a block: half the time of CSR."""
    matrices, n = ([a, g] if g.nnz else [a]), a.shape[0]
    both, entries = csr_array(hstack(matrices, format="csr")), sum(each.nnz for each in matrices)
    for block in (6, 3, 1):
        if n % block == 0:
            columns = np.arange(len(matrices) * n).reshape(len(matrices), -1, block).transpose(1, 0, 2).ravel()
            found = bsr_array(csr_array(both[:, columns]), blocksize=(block, len(matrices) * block))
            if block == 1 or found.nnz <= 1.5 * entries:
                break
    return found, block


def _of_plane(a: csr_array, g: csr_array, *states: tuple[Floats, Floats]) -> complex:
    """s of the plane of two states (z, v), in which one motion is most of both."""
    scale = float(np.linalg.norm(states[1][1]) / np.linalg.norm(states[1][0]))
    basis = qr(np.column_stack([np.concatenate([scale * z, v]) for z, v in states]), mode="economic")[0]
    z, v = np.split(basis, 2)
    image = np.vstack([scale * v, -(a @ z) / scale - g @ v])
    s, x = eig(basis.T @ image)
    residuals = np.linalg.norm(image @ x - (basis @ x) * s, axis=0)
    return complex(s[int(np.argmin(residuals))])


def motion_near(a: csr_array, g: csr_array, s: complex, shape: Floats) -> tuple[complex, Complexes, float]:
    """The motion with the eigenvalue next to a number: s, its shape z of norm 1, and the error of s by its residual."""
    identity, z = eye_array(a.shape[0]), shape.astype(complex)
    for _ in range(4):
        try:
            factors = general_lu(csc_array(s**2 * identity + s * g + a.astype(complex)))
        except SingularMatrixError:
            break
        for _ in range(3):
            y = factors.solve(2 * s * z + g @ z)
            step = np.vdot(z, z) / np.vdot(z, y)
            z = y / np.linalg.norm(y)
        s -= complex(step)
        if abs(step) < 1e-9 * abs(s):
            break
    s = s.conjugate() if s.imag < 0 else s
    left, slope = s**2 * z + s * (g @ z) + a @ z, 2 * s * z + g @ z
    rounding = 1e-14 * np.sqrt(np.abs(a.data).max(initial=0.0))
    return s, z, float(np.linalg.norm(left) / np.linalg.norm(slope) + rounding)


def fastest_growing(
    stiffness: csr_array, damping: csr_array | None = None, periods: tuple[float, float] = (30.0, 1000.0)
) -> Linear:
    """Find the fastest growing motion.

    Parameters
    ----------
    stiffness : scipy.sparse.csr_array, shape (n, n)
        A = M^(-1/2) K M^(-1/2), 1 / time^2, of the coordinates that feel a force.
    damping : scipy.sparse.csr_array, shape (n, n), optional
        G = M^(-1/2) C M^(-1/2), 1 / time.
    periods : tuple of (float, float)
        The first and the longest time that is looked at, in periods of the fastest motion, of which ten are followed.
        What grows more slowly than about 3 over the longest time is not looked for.

    Returns
    -------
    Linear
        Unstable, or not known; then nothing is likely to grow at a rate above `searched`. Stable where all motion
        decays.

    Raises
    ------
    BadInputError
        If the times are out of range, or the operator is too small to need products.

    Examples
    --------
    >>> from scipy.sparse import csr_array, diags_array
    >>> found = fastest_growing(csr_array(diags_array([-0.25, *range(1, 40)])))
    >>> found.stable, round(found.growth_rate, 6)
    (False, 1.0)
    """
    size = stiffness.shape[0]
    if not 0 < periods[0] <= periods[1]:
        raise BadInputError(f"{periods[0]:g} to {periods[1]:g} periods are not ascending: give times above zero.")
    if size <= 8:
        raise BadInputError(f"An operator of {size} coordinates is for `spectrum`: products serve more than 8.")
    g = csr_array(stiffness.shape) if damping is None else damping
    k, c = (float(abs(each).sum(axis=1).max(initial=0.0)) for each in (stiffness, g))
    limit = 4 / (c + np.sqrt(c * c + 4 * k))  # stable for certain, by the largest sums of rows
    state = np.random.Generator(np.random.PCG64(0)).standard_normal((size, 2))
    # k is twice the square of the largest frequency, or so
    return follow(stiffness, g, limit, state, 10 * periods[1] * 2 * np.pi / np.sqrt(0.5 * k) / (100 * STEP * limit))[0]


def follow_decay(
    motion: Motion, kept: csr_array, why: str, time: float | None = None, searched: float = np.inf, work: float = WORK
) -> Linear:
    """Follow the motion from a random state until it has decayed, or grows.

    The columns of `kept` (n, m) are an orthonormal basis of the motion that counts; `why` is a clause, why there is no
    certificate. The motion is followed for the `time` at the most, by default for as long as `work`, multiplications
    with entries of A and G, allows. Growth of D above the rate `searched` is known not to exist.
    """
    a, g, c, size = motion.stiffness, motion.damping, motion.configuration, len(motion.active)
    state = np.random.Generator(np.random.PCG64(0)).standard_normal((size, 2))
    state, common = kept @ (kept.T @ state), 0
    for axis in range(c.dimension):  # common motion along an axis on which no force opposes it
        along = (motion.active // len(c) == axis) * motion.root_mass
        if along.any() and np.abs(a @ along).max() <= 1e-12 * np.linalg.norm(along) * np.abs(a.data).max(initial=0.0):
            along = kept @ (kept.T @ along)  # or what is left out would come in again, and grow as the time
            along /= np.linalg.norm(along)
            state -= np.outer(along, along @ state)
            common += 1
    limit, free = float(stable_timestep(c)), common + size - kept.shape[1]
    reference = REFERENCE * 2 / limit
    stiffness, damping = (csr_array(kept.T @ each @ kept) for each in (a, g))
    report_progress("the slowest motions are looked for")
    slow = slow_motions(stiffness, damping, kept, reference, common)
    values, errors, leave = slow or (np.full(1, -np.inf + 0j), np.zeros(1), None)
    slowest = int(np.argmax(values.real))
    s, rate, error = complex(values[slowest]), 2 * float(values[slowest].real), 2 * float(errors[slowest])
    if rate > 0:
        return Linear(False, rate, error, free, s, at_least=True)
    wanted = _oscillating(stiffness, damping, common, reference)
    # a step takes the time of 2e4 multiplications at the least
    looks = work / (100 * (2e4 + a.nnz + g.nnz)) if time is None else time / (100 * STEP * limit)
    found, now, needed = follow(a, g, limit, state, looks, 1.0 if time is None else np.inf, wanted, leave)
    if found.stable and rate > found.growth_rate:
        decays = f"the slowest decays with {exponential(rate, 6)}, and other {found.said}"
        said = f"of {np.count_nonzero(values.imag >= 0)} slow motions, known one by one, {decays}"
        found = replace(found, growth_rate=rate, error=error, s=s, said=said)
    if found.stable is not None:
        return replace(found, free=free)
    bound = min(searched, found.searched)
    would = f"`time` = {needed:.2g} would do" if np.isfinite(needed) else "in which motion did not decay"
    shows = f"as motion from a random state shows within t = {now:.4g}"
    reason = f"{why}; no motion was found to grow, and D grows no faster than exp({bound:.2g} t), {shows}; {would}"
    return replace(found, free=free, searched=bound, reasons=(reason,))


def _oscillating(a: csr_array, g: csr_array, common: int, reference: float) -> float:
    """ln delta^2 at which motion has decayed: higher where all that may grow oscillates."""
    low, one = 0.1 * reference, eye_array(a.shape[0])
    stiffest, strongest, gyration = (float(abs(each).sum(axis=1).max()) for each in (a, g, 0.5 * (g - g.T)))
    if (
        gyration > 0.1 * low
        or negative_pivots(csc_array(0.5 * (a + a.T) - low**2 * one)) != common
        or negative_pivots(csc_array(0.5 * (g + g.T) + 1e-6 * strongest * one)) != 0
    ):
        return SEEN
    ends = np.array([0.9 * low, np.sqrt(stiffest) + gyration])  # the chance is convex in b
    likelier = (reference**2 + (ends + strongest) ** 2) / (2 * reference * (ends - gyration))
    return max(SEEN, float(np.log(CHANCE / likelier.max())))


def _slope(logs: list[float], between: float) -> float:
    """Rate of |u|^2 over the second half of the time, 1 / time."""
    half = logs[len(logs) // 2 :]
    return float(np.polyfit(between * np.arange(len(half)), half, 1)[0]) if len(half) > 1 else 0.0
