r"""Does linear motion from a random state decay? A verdict on systems whose eigenvalues are not all known.

The state :math:`u = (\omega_0 z, \dot z)` of :math:`\ddot z + G \dot z + A z = 0` obeys :math:`\dot u = Z u`. Let l be
the unit left vector of an eigenvalue s of Z. Then

.. math:: |u(t)| \ge |l^H u(t)| = |l^H u(0)|\, e^{\mathrm{Re}\, s\, t} .

If the 2 E numbers of u(0) are independent, normal and of variance one, :math:`|l^H u(0)|` is less than :math:`\delta`
with a probability below :math:`\delta`. So once :math:`|u(t)|` has fallen below :math:`\delta`, no motion grows or
persists, except with this probability. The argument holds for eigenvectors as oblique as they may be. Until then D may
grow unseen as exp(g t) with

.. math:: g = \frac2t \ln\frac{|u(t)|}\delta .

This holds for every :math:`\omega_0`. With a low :math:`\omega_0` :math:`|u|` falls soonest, since slow motions decay
last.

**One state serves best.** Of n states each may miss :math:`\delta^{1/n}`. The time until one has fallen so far is in
proportion to :math:`\ln |u(0)| + \frac1n \ln \frac1\delta`, and n states cost n times that.

**Slow motions** decay last, because dashpots take little energy from them, and motion that no force opposes never
decays. Both are first found one by one (:mod:`~faultgouge.analysis.motion.slow_motions`). The state is then followed
orthogonally to their space, so that all other eigenvalues decide how fast the state decays. For packings too large for
sparse factors the slow motions are not found. Then u(0) has no common motion of all particles along an axis on which no
force opposes this motion, as in a periodic box; any other motion that no force opposes leaves the answer open.

**Steps.** The state is followed in small explicit or in long implicit steps
(:mod:`~faultgouge.analysis.motion.decay_steps`), whichever cost less until the state has decayed. If :math:`|u|` passes
a minimum and grows, the growth rate of the state is given with its error.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..arrays import Complexes
from ..counted import counted
from ..factors.sparse_lu import SingularMatrixError
from ..progress import report_progress
from .decay_steps import DECAY_STEP, STEP_OVERHEAD, ExplicitSteps, ImplicitSteps, slope
from .fastest_growing import CHANCE
from .motion import Motion
from .slow_motions import SlowMotions, slow_motions
from .stable_timestep import stable_timestep

REFERENCE = 0.1
"""omega_0 as a share of the largest frequency: about the slowest motions that are left in the end."""

WORK_OF_DECAY = 2e11
"""Multiplications with entries of A and G: three minutes."""

FACTORED = {2: 400_000, 3: 80_000}
"""Coordinates up to which there are factors, by dimension. Of 10,000 spheres in a layer of five or six they take 3 s
and 0.2 GB, and with the vectors of slow motions 1 GB; of a cube of spheres they are larger."""

GROWN = 5.0
"""Decades of |u|^2 above its least from which growth is looked at."""


@dataclass(frozen=True, eq=False)
class Decay:
    """Fate of a random state.

    Attributes
    ----------
    grows : bool or None
        Whether motion grows; None if it has neither grown nor decayed far enough.
    growth_rate : float
        Of D, 1 / time: 2 Re s of the motion that grows, to a tenth or so; otherwise that of |u|^2 in the second half of
        the time.
    time : float
        How long it was followed.
    searched : float
        Growth rate of D, 1 / time, up to which growth may not have been seen; 0 if nothing grows.
    needed : float or None
        How long it takes to decay far enough, if |u| falls on as in the second half; None if it does not fall.
    slow : ndarray of complex
        s of slow motions that are known one by one, the slowest decay first, 1 / time.
    free : int
        Motions that no force opposes, as far as they are known.
    """

    grows: bool | None
    growth_rate: float
    time: float
    searched: float
    needed: float | None
    slow: Complexes = field(default_factory=lambda: np.zeros(0, complex))
    free: int = 0

    def __str__(self) -> str:
        """What it says."""
        known = f"{counted(len(self.slow), 'slow motion')} known one by one"
        if self.grows and not self.time:
            return f"D as exp({self.growth_rate:.6g} t), the fastest of {known}"
        if self.grows:
            return f"motion from a random state grows, D as exp({self.growth_rate:.2g} t)"
        state = f"a random state{' without these' if len(self.slow) else ''}"
        told = f"of {known} the slowest decays with D as exp({self.slowest:.6g} t); " if len(self.slow) else ""
        if self.grows is False:
            late = (
                f", at last as exp({self.growth_rate:.2g} t)"
                if len(self.slow) and self.growth_rate > self.slowest
                else ""
            )
            return (
                f"{told}motion from {state} decayed in t = {self.time:.4g} so far that any growth would be seen{late}"
            )
        told += (
            f"no motion was found to grow, and D grows no faster than exp({self.searched:.2g} t), as motion from "
            f"{state} shows within t = {self.time:.4g}"
        )
        if self.needed is None:
            return f"{told}, in which motion did not decay"
        return f"{told}; as D falls, as exp({self.growth_rate:.2g} t), `time` = {self.needed:.2g} would do"

    @property
    def slowest(self) -> float:
        """2 Re s of the slowest of the known motions, 1 / time."""
        return 2 * float(self.slow.real.max())

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return vars(self) | {"slow": len(self.slow)}


def follow_decay(motion: Motion, time: float | None = None, work: float = WORK_OF_DECAY) -> Decay:
    """Find slow motions, and follow all other motion from a random state until it has decayed, or grows.

    Parameters
    ----------
    motion : Motion
        A and G.
    time : float, optional
        How long at the most; by default as long as `work` allows.
    work : float
        Multiplications; three minutes by default.
    """
    limit = float(stable_timestep(motion.configuration))
    reference = REFERENCE * 2 / limit
    slow = _slow_motions(motion, reference, limit)
    if slow is not None and slow.grows.any():
        return Decay(True, 2 * float(slow.values[0].real), 0.0, 0.0, None, slow.values, slow.free)
    found = _follow(_steps(motion, reference, slow, limit), time, work)
    if slow is None:
        return found
    found = replace(found, slow=slow.values, free=slow.free)
    if not len(slow.values) or found.grows is not False:
        return found
    if found.slowest >= -2 * slow.error:  # it neither decays nor grows beyond its error
        return replace(found, grows=None, growth_rate=found.slowest, searched=2 * slow.error, needed=None)
    return replace(found, growth_rate=max(found.growth_rate, found.slowest))


def _slow_motions(motion: Motion, reference: float, limit: float) -> SlowMotions | None:
    """As many as pay; None without dissipation, or without factors."""
    if not motion.dissipative or len(motion.active) > FACTORED[motion.configuration.dimension]:
        return None

    def rest(found: SlowMotions) -> float:
        return 0.0 if found.grows.any() else min(_work(motion, found, limit))

    try:
        return slow_motions(motion.stiffness, motion.damping, motion.particle, reference, rest)
    except SingularMatrixError:
        return None


def _work(motion: Motion, slow: SlowMotions, limit: float) -> tuple[float, float]:
    """Multiplications until the slowest motion that is not known has decayed, in explicit and in implicit steps."""
    folds = float(np.log(np.sqrt(2 * len(motion.active)) / CHANCE))
    if not -np.inf < slow.rate_beyond < 0:
        return np.inf, np.inf
    explicit = (
        folds / -slow.rate_beyond / (DECAY_STEP * limit) * (STEP_OVERHEAD + motion.stiffness.nnz + motion.damping.nnz)
    )
    s = slow.rate_beyond + 1j * slow.radius
    implicit = folds / -np.log(abs((slow.radius + s) / (slow.radius - s))) * (STEP_OVERHEAD + slow.entries)
    return explicit, float(implicit)


def _steps(motion: Motion, reference: float, slow: SlowMotions | None, limit: float) -> ExplicitSteps | ImplicitSteps:
    """Implicit steps if these come to an end, and do so before explicit ones. If neither do, explicit steps: only they
    bound the growth that may be unseen at every frequency."""
    if slow is not None:
        explicit, implicit = _work(motion, slow, limit)
        if implicit < min(explicit, WORK_OF_DECAY):
            try:
                return ImplicitSteps.of(motion, reference, slow, limit)
            except SingularMatrixError:
                pass
    return ExplicitSteps.of(motion, reference, slow, limit)


def _follow(steps: ExplicitSteps | ImplicitSteps, time: float | None, work: float) -> Decay:
    """Follow the motion from a random state until it has decayed, or grows."""
    span = steps.time_of_look
    most = work / steps.work_of_look if time is None else time / span
    wanted, now, logs = 2 * np.log(CHANCE), 0.0, [float(np.log(steps.square))]
    for look in range(max(int(np.ceil(most)), 8)):
        logs.append(steps.look())
        now += span
        if look % 10 == 9:
            decades = (logs[-1] - wanted) / np.log(10)
            report_progress(f"decay of a random state: t = {now:.4g}, {decades:.1f} decades to go")
        if logs[-1] <= wanted:
            return Decay(False, slope(logs, span), now, 0.0, now)
        if _passes_its_least(logs):
            rate, error = steps.growth(logs)
            if rate > error:
                return Decay(True, rate, now, 0.0, None)
            break
    falls, missing = slope(logs, span), logs[-1] - wanted
    needed = now - missing / falls if falls * now < -1 else None
    return Decay(None, falls, now, steps.hides * missing / now, needed)


def _passes_its_least(logs: list[float]) -> bool:
    """Whether |u|^2 has grown by `GROWN` above its least, and is about at its largest since."""
    after = np.array(logs[int(np.argmin(logs)) :])
    return len(after) > 8 and after[-1] - after[0] > GROWN * np.log(10) and after[-1] > after.max() - 1
