r"""Does linear motion from a random state decay? A verdict on systems whose eigenvalues are not all known.

The state :math:`u = (\omega_0 z, \dot z)` of :math:`\ddot z + G \dot z + A z = 0` obeys :math:`\dot u = Z u`. Let l be
the unit left vector of an eigenvalue s of Z. Then

.. math:: |u(t)| \ge |l^H u(t)| = |l^H u(0)|\, e^{\mathrm{Re}\, s\, t} .

If the 2 E numbers of u(0) are independent, normal and of variance one, :math:`|l^H u(0)|` is less than :math:`\delta`
with a probability below :math:`\delta`. So once :math:`|u(t)|` has fallen below :math:`\delta`, nothing grows, and
nothing stays, but for that probability; it does not matter how oblique eigenvectors are. Before, D may grow unseen as
exp(g t) with

.. math:: g = \frac2t \ln\frac{|u(t)|}\delta .

This holds for every :math:`\omega_0`; a low one makes :math:`|u|` fall soonest, since slow motions are the last.

**Slow motions** decay last, as dashpots take little from them, and motion that no force opposes never decays. They are
found one by one before (:mod:`~faultgouge.analysis.motion.slow_motions`), and what is followed is orthogonal to their
space, so that all other eigenvalues decide how it decays. Where a packing is too large for sparse factors, nothing is
found before; the common motion of all particles along an axis that no force opposes, as in a periodic box, is then left
out of u(0), and other motion of this kind leaves the answer open.

Steps are those of velocity Verlet with dashpots at the velocity of the half step, in which motion without loss neither
grows nor decays; in longer steps what grows in spite of dashpots grows faster. If :math:`|u|` passes its least and
grows, the motion is followed on in steps of a quarter: the error of the rate falls as the square of the step, so that
two rates say the true one and its error. A step takes one product with A and one with G, so that time and memory are
proportional to the number of coordinates.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.sparse import bsr_array

from ..arrays import Complexes, Floats
from ..counted import counted
from ..factors.sparse_lu import SingularMatrixError
from ..progress import report_progress
from .fastest_growing import CHANCE
from .motion import Motion
from .slow_motions import SlowMotions, slow_motions
from .stable_timestep import stable_timestep

DECAY_STEP = 0.6
"""Time step as a share of the largest stable one. Of fifty spheres growth at 82 of 190, the largest frequency, is 0.169
in place of 0.122, and slow decay is right to a hundredth."""

REFERENCE = 0.1
"""omega_0 as a share of the largest frequency: about the slowest motions that are left in the end."""

STEPS_OF_LOOK = 100
"""Steps between two looks."""

STEPS_BETWEEN_SQUARES = 7
"""Steps between two values of |u|^2 of which a look has the mean; the number divides no period of a motion for long."""

WORK_OF_DECAY = 2e11
"""Multiplications with entries of A and G: three minutes."""

STEP = 2e4
"""Multiplications that could be done in the time that a step takes besides its own."""

FACTORED = {2: 400_000, 3: 80_000}
"""Coordinates up to which there are factors, by dimension. Of 10,000 spheres in a layer of five or six they take 3 s
and 0.2 GB, and with the vectors of slow motions 1 GB; of a cube of spheres they are larger."""

GROWN = 5.0
"""Decades of |u|^2 above its least from which growth is looked at."""

FINER_STEP = 4
"""Share of the steps in which growth is measured once more."""

FOLDS = 4.0
"""For how many e-folds of |u|^2 this is done."""

FREE_FORCE = 1e-12
"""Force on a common displacement, as a share of the largest entry of A, that is no force."""


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
            return f"{told}motion from {state} decayed in t = {self.time:.4g} so far that any growth would be seen"
        told += (
            f"no motion was found to grow, and D that grows more slowly than exp({self.searched:.2g} t) would not have "
            f"been seen within t = {self.time:.4g}"
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


def follow_decay(motion: Motion, time: float | None = None) -> Decay:
    """Find slow motions, and follow all other motion from a random state until it has decayed, or grows.

    Parameters
    ----------
    motion : Motion
        A and G.
    time : float, optional
        How long at the most; some minutes by default.
    """
    limit = float(stable_timestep(motion.configuration))
    reference, dt = REFERENCE * 2 / limit, DECAY_STEP * limit
    slow = _slow_motions(motion, reference, dt)
    if slow is not None and slow.grows.any():
        return Decay(True, 2 * float(slow.values[0].real), 0.0, 0.0, None, slow.values, slow.free)
    found = _follow(_State.of(motion, reference, slow), dt, time)
    if slow is None:
        return found
    found = replace(found, slow=slow.values, free=slow.free)
    if not len(slow.values) or found.grows is not False:
        return found
    if found.slowest >= -2 * slow.error:  # it neither decays nor grows beyond its error
        return replace(found, grows=None, growth_rate=found.slowest, searched=2 * slow.error, needed=None)
    return replace(found, growth_rate=max(found.growth_rate, found.slowest))


def _slow_motions(motion: Motion, reference: float, dt: float) -> SlowMotions | None:
    """As many as pay; None without dissipation, or without factors."""
    if not motion.dissipative or len(motion.active) > FACTORED[motion.configuration.dimension]:
        return None
    entries = motion.stiffness.nnz + motion.damping.nnz + STEP
    folds = float(np.log(np.sqrt(2 * len(motion.active)) / CHANCE))

    def rest(found: SlowMotions) -> float:
        rate = -found.rate_beyond
        return 0.0 if found.grows.any() else folds / rate / dt * entries if 0 < rate < np.inf else np.inf

    try:
        return slow_motions(motion.stiffness, motion.damping, motion.particle, reference, rest)
    except SingularMatrixError:
        return None


def _follow(state: "_State", dt: float, time: float | None) -> Decay:
    """Follow the motion from a random state until it has decayed, or grows."""
    most = WORK_OF_DECAY / state.entries if time is None else time / dt
    wanted, now, logs = 2 * np.log(CHANCE), 0.0, [float(np.log(state.square))]
    for look in range(max(int(np.ceil(most / STEPS_OF_LOOK)), 8)):
        logs.append(state.look(dt))
        now += STEPS_OF_LOOK * dt
        if look % 10 == 9:
            decades = (logs[-1] - wanted) / np.log(10)
            report_progress(f"decay of a random state: t = {now:.4g}, {decades:.1f} decades to go")
        if logs[-1] <= wanted:
            return Decay(False, _slope(logs, STEPS_OF_LOOK * dt), now, 0.0, now)
        if _passes_its_least(logs):
            rate, error = _growth(state, logs, dt)
            if rate > error:
                return Decay(True, rate, now, 0.0, None)
            break
    slope, missing = _slope(logs, STEPS_OF_LOOK * dt), logs[-1] - wanted
    return Decay(None, slope, now, missing / now, now - missing / slope if slope * now < -1 else None)


@dataclass
class _State:
    """z and the velocity at one time, and the operators; changes in place."""

    stiffness: bsr_array
    damping: bsr_array | None
    reference: float
    slow: SlowMotions | None
    z: Floats
    v: Floats

    @classmethod
    def of(cls, motion: Motion, reference: float, slow: SlowMotions | None) -> "_State":
        """At random, without slow motions."""
        z, v = _random_state(motion)
        damping = motion.in_blocks(motion.damping) if motion.dissipative else None
        made = cls(motion.in_blocks(motion.stiffness), damping, reference, slow, z / reference, v)
        made._leave_slow_motions()
        return made

    @property
    def entries(self) -> int:
        """Multiplications of a step, and what takes as long."""
        return int(STEP) + self.stiffness.nnz + (0 if self.damping is None else self.damping.nnz)

    @property
    def square(self) -> float:
        """|u|^2."""
        return float(self.reference**2 * (self.z @ self.z) + self.v @ self.v)

    def look(self, dt: float) -> float:
        """Take `STEPS_OF_LOOK` steps: the logarithm of the mean |u|^2 on the way, as |u|^2 of one motion oscillates."""
        squares = []
        self._push(0.5 * dt)
        for step in range(STEPS_OF_LOOK):
            self.z += dt * self.v
            self._push(dt if step < STEPS_OF_LOOK - 1 else 0.5 * dt)
            if step % STEPS_BETWEEN_SQUARES == STEPS_BETWEEN_SQUARES - 1:
                squares.append(self.square)
        self._leave_slow_motions()
        return float(np.log(np.mean(squares)))

    def _push(self, dt: float) -> None:
        force = self.stiffness @ self.z
        if self.damping is not None:
            force += self.damping @ self.v
        self.v -= dt * force

    def _leave_slow_motions(self) -> None:
        """Steps are not exact, so that a little of the slow motions comes back."""
        if self.slow is not None:
            state = self.slow.without(np.concatenate([self.reference * self.z, self.v]))
            self.z, self.v = state[: len(self.z)] / self.reference, state[len(self.z) :].copy()


def _random_state(motion: Motion) -> tuple[Floats, Floats]:
    """Two vectors of normal random numbers without common motion along axes that no force opposes."""
    state = np.random.Generator(np.random.PCG64(0)).standard_normal((len(motion.active), 2))
    for common in free_translations(motion):
        state -= np.outer(common, common @ state)
    return state[:, 0].copy(), state[:, 1].copy()


def free_translations(motion: Motion) -> list[Floats]:
    """Unit vectors of the common motions along an axis that no force opposes, mass-weighted."""
    configuration, count = motion.configuration, len(motion.configuration)
    largest = np.abs(motion.stiffness.data).max(initial=0.0)
    found = []
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


def _passes_its_least(logs: list[float]) -> bool:
    """Whether |u|^2 has grown by `GROWN` above its least, and is about at its largest since."""
    after = np.array(logs[int(np.argmin(logs)) :])
    return len(after) > 8 and after[-1] - after[0] > GROWN * np.log(10) and after[-1] > after.max() - 1


def _growth(state: _State, logs: list[float], dt: float) -> tuple[float, float]:
    """2 Re s of what grows, and its error: by the rate so far, and by that of shorter steps, from where it has come."""
    coarse = _slope(logs[int(np.argmin(logs)) :], STEPS_OF_LOOK * dt)
    short = dt / FINER_STEP
    count = int(np.ceil(FOLDS / max(coarse, 1 / (STEPS_OF_LOOK * dt * len(logs))) / short / STEPS_OF_LOOK)) + 1
    finer = []
    for _ in range(2 * count):
        finer.append(state.look(short))
    fine = _slope(finer, STEPS_OF_LOOK * short)
    error = (fine - coarse) / (FINER_STEP**2 - 1)
    return fine + error, abs(error)
