r"""Does linear motion from a random state decay? A verdict where there is no certificate.

The state :math:`u = (\omega_0 z, \dot z)` of :math:`\ddot z + G \dot z + A z = 0` obeys :math:`\dot u = Z u`. Let l be
the unit left vector of an eigenvalue s of Z. Then

.. math:: |u(t)| \ge |l^H u(t)| = |l^H u(0)|\, e^{\mathrm{Re}\, s\, t} .

If the 2 E numbers of u(0) are independent, normal and of variance one, :math:`|l^H u(0)|` is less than :math:`\delta`
with a probability below :math:`\delta`. So once :math:`|u(t)|` has fallen below :math:`\delta`, no motion grows or
persists, except with this probability. The argument holds for eigenvectors as oblique as they may be. Until then D may
grow unseen as exp(g t) with

.. math:: g = \frac2t \ln\frac{|u(t)|}\delta .

This holds for every :math:`\omega_0`. With a low :math:`\omega_0` :math:`|u|` falls soonest, since slow motions decay
last. **One state serves best.** Of n states each may miss :math:`\delta^{1/n}`. The time until one has fallen so far is
in proportion to :math:`\ln |u(0)| + \frac1n \ln \frac1\delta`, and n states cost n times that.

Motion of one particle that no force opposes is left out, and common motion of all particles along an axis on which no
force opposes it, as in a periodic box. Any other motion that no force opposes leaves the answer open.

**Steps** are those of velocity Verlet with dashpots at the velocity of the half step. Motion without loss neither grows
nor decays in these steps; motion that grows in spite of dashpots grows faster in longer steps. So growth is measured
once more in shorter ones, and both give the rate with its error.
"""

import numpy as np
from scipy.sparse import csr_array

from ..arrays import Floats
from ..progress import report_progress
from .eigenvalues import Linear
from .motion import Motion
from .stable_timestep import stable_timestep

CHANCE = 1e-3
"""delta: the probability that a motion which grows is overlooked."""

REFERENCE = 0.1
"""omega_0 as a share of the largest frequency: about the slowest motions that are left in the end."""

STATE_WORK, OVERHEAD = 2e11, 2e4
"""Multiplications with entries of A and G, three minutes, and those that could be done in the time that a step
takes."""

GIVEN_UP, WITHIN = 0.1, 3.0
"""Share of the work after which the motion is given up that would take so many times the work to decay."""

STEP, FINER = 0.6, 4
"""Time step as a share of the largest stable one, and the part of it in which growth is measured once more. Of fifty
spheres growth at 82 of 190, the largest frequency, is 0.169 in place of 0.122, and slow decay is right to a
hundredth."""

STEPS, BETWEEN = 100, 7
"""Steps between two looks, and between two values of |u|^2 of which a look has the mean; the second divides no period
for long."""

GROWN, FOLDS = 5.0, 4.0
"""Decades of |u|^2 above its least from which growth is looked at, and e-folds for which it is measured once more."""

ALGEBRAIC = 8.0
"""Growth rate times the time below which |u|^2 may grow as the square of the time, by motion that no force opposes:
that has 3, and exponential growth by so many decades 11."""

FREE_FORCE = 1e-12
"""Force on a common displacement, as a share of the largest entry of A, that is no force."""


def follow_decay(
    motion: Motion,
    kept: csr_array,
    why: str,
    time: float | None = None,
    searched: float = np.inf,
    work: float = STATE_WORK,
) -> Linear:
    """Follow the motion from a random state until it has decayed, or grows.

    Parameters
    ----------
    motion : Motion
        A and G.
    kept : scipy.sparse.csr_array, shape (n, m)
        Orthonormal basis of the motion that counts.
    why : str
        Why there is no certificate: a clause.
    time : float, optional
        How long at the most; by default as long as `work` allows.
    searched : float
        Growth rate of D, 1 / time, above which nothing grows, as is known already.
    work : float
        Multiplications.
    """
    a, g = motion.in_blocks(motion.stiffness), motion.in_blocks(motion.damping)
    limit = float(stable_timestep(motion.configuration))
    reference, dt = REFERENCE * 2 / limit, STEP * limit
    state = np.random.Generator(np.random.PCG64(0)).standard_normal((len(motion.active), 2))
    state = kept @ (kept.T @ state)
    drifts = _free_translations(motion)
    for common in drifts:
        state -= np.outer(common, common @ state)
    z, v = state[:, 0] / reference, state[:, 1].copy()
    free = len(motion.active) - kept.shape[1] + len(drifts)

    def look(step: float) -> float:
        """Take some steps: the logarithm of the mean |u|^2 on the way, as that of one motion oscillates."""
        nonlocal z, v
        squares = []
        v -= 0.5 * step * (a @ z + g @ v)
        for k in range(STEPS):
            z += step * v
            v -= (step if k < STEPS - 1 else 0.5 * step) * (a @ z + g @ v)
            if k % BETWEEN == BETWEEN - 1:
                squares.append(reference**2 * (z @ z) + v @ v)
        return float(np.log(np.mean(squares)))

    span, wanted = STEPS * dt, 2 * np.log(CHANCE)
    most = work / (STEPS * (OVERHEAD + a.nnz + g.nnz)) if time is None else time / span
    logs = [float(np.log(reference**2 * (z @ z) + v @ v))]
    while len(logs) <= max(most, 8):
        logs.append(look(dt))
        now, after = span * (len(logs) - 1), np.array(logs[int(np.argmin(logs)) :])
        falls = _slope(logs, span)
        if logs[-1] <= wanted:
            said = f"motion from a random state decayed in t = {now:.4g} so far that any growth would be seen"
            return Linear(True, falls, abs(falls), free, said=said)
        if len(after) > 8 and after[-1] - after[0] > GROWN * np.log(10) and after[-1] > after.max() - 1:
            coarse = _slope(list(after), span)
            count = int(np.ceil(FOLDS / max(coarse, 1 / now) / span * FINER)) + 1
            fine = _slope([look(dt / FINER) for _ in range(2 * count)], span / FINER)
            rate, error = fine + (fine - coarse) / (FINER**2 - 1), abs(fine - coarse)
            if rate > error and rate * now > ALGEBRAIC:
                return Linear(False, rate, error, free, said="motion from a random state grows")
            break
        needed = now - (logs[-1] - wanted) / falls if falls * now < -1 else np.inf
        if len(logs) % 10 == 0:
            report_progress(f"decay of a random state: t = {now:.4g} of {needed:.4g}")
        if time is None and len(logs) > max(GIVEN_UP * most, 8) and needed > WITHIN * most * span:
            break
    bound = min(searched, (logs[-1] - wanted) / now)
    would = f"`time` = {needed:.2g} would do" if np.isfinite(needed) else "in which motion did not decay"
    reason = (
        f"{why}; no motion was found to grow, and D grows no faster than exp({bound:.2g} t), as motion from a random "
        f"state shows within t = {now:.4g}; {would}"
    )
    return Linear(None, falls, free=free, searched=bound, reasons=(reason,))


def _free_translations(motion: Motion) -> list[Floats]:
    """Unit vectors of the common motions along an axis that no force opposes, mass-weighted."""
    configuration, count = motion.configuration, len(motion.configuration)
    largest, found = np.abs(motion.stiffness.data).max(initial=0.0), []
    for axis in range(configuration.dimension):
        along = (motion.active // count == axis) * motion.root_mass
        if along.any():
            common = along / np.linalg.norm(along)
            if np.abs(motion.stiffness @ common).max() <= FREE_FORCE * largest:
                found.append(common)
    return found


def _slope(logs: list[float], between: float) -> float:
    """Rate of |u|^2 over the second half of the time, 1 / time."""
    half = logs[len(logs) // 2 :]
    return float(np.polyfit(between * np.arange(len(half)), half, 1)[0]) if len(half) > 1 else 0.0
