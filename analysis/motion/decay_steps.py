r"""Steps in which the motion of a random state is followed, with what each costs.

**Explicit steps** are those of velocity Verlet with dashpots at the velocity of the half step. Motion without loss
neither grows nor decays in these steps; motion that grows in spite of dashpots grows faster in longer steps. A step
takes one product with A and one with G, so that time and memory are proportional to the number of coordinates.

**Implicit steps** are those of the midpoint rule, with one solution of a sparse system each,

.. math:: u \leftarrow \frac{\sigma + Z}{\sigma - Z}\, u = 2 \sigma (\sigma - Z)^{-1} u - u, \qquad \sigma = \frac2h .

An eigenvalue s becomes :math:`r = (\sigma + s)/(\sigma - s)`: |r| > 1 if, and only if, Re s > 0, however long the step
h is (Cayley's transform). A motion of the frequency :math:`\omega` decays, or grows, by
:math:`\ln |r| = \mathrm{Re}\, s\, h / (1 + (\omega h/2)^2)` in a step. So :math:`\sigma` is the frequency of the
slowest motions that are left. If these decay as :math:`\omega^2`, all others decay at least as fast. An implicit step
is hundreds of times as long as an explicit one.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import bsr_array, csc_array, eye_array

from ..arrays import Floats
from ..factors.sparse_lu import Factors, general_lu
from .motion import Motion
from .slow_motions import SlowMotions

DECAY_STEP = 0.6
"""Explicit time step as a share of the largest stable one. Of fifty spheres growth at 82 of 190, the largest frequency,
is 0.169 in place of 0.122, and slow decay is right to a hundredth."""

STEPS_OF_LOOK, SOLVES_OF_LOOK = 100, 10
"""Explicit and implicit steps between two looks."""

STEPS_BETWEEN_SQUARES = 7
"""Explicit steps between two values of |u|^2 of which a look has the mean; the number divides no period of a motion for
long."""

STEP_OVERHEAD = 2e4
"""Multiplications that could be done in the time that a step takes besides its own."""

FINER_STEP = 4
"""Share of the explicit steps in which growth is measured once more."""

E_FOLDS = 4.0
"""E-folds of |u|^2 for which growth is measured once more."""

FREE_FORCE = 1e-12
"""Force on a common displacement, as a share of the largest entry of A, that is no force."""


@dataclass
class ExplicitSteps:
    """z and the velocity at one time, and the operators; changes in place.

    Attributes
    ----------
    dt : float
        Time step.
    """

    stiffness: bsr_array
    damping: bsr_array | None
    reference: float
    slow: SlowMotions | None
    z: Floats
    v: Floats
    dt: float

    @classmethod
    def of(cls, motion: Motion, reference: float, slow: SlowMotions | None, limit: float) -> "ExplicitSteps":
        """At random, without slow motions; `limit` is the largest stable time step."""
        z, v = random_state(motion)
        damping = motion.in_blocks(motion.damping) if motion.dissipative else None
        made = cls(motion.in_blocks(motion.stiffness), damping, reference, slow, z / reference, v, DECAY_STEP * limit)
        made._leave_slow_motions()
        return made

    @property
    def time_of_look(self) -> float:
        """Time between two looks."""
        return STEPS_OF_LOOK * self.dt

    @property
    def work_of_look(self) -> float:
        """Multiplications, and what takes as long."""
        return STEPS_OF_LOOK * (STEP_OVERHEAD + self.stiffness.nnz + (0 if self.damping is None else self.damping.nnz))

    @property
    def hides(self) -> float:
        """Growth rate of a motion over that which it has in these steps, at the most."""
        return 1.0

    @property
    def square(self) -> float:
        """|u|^2."""
        return float(self.reference**2 * (self.z @ self.z) + self.v @ self.v)

    def look(self, share: float = 1.0) -> float:
        """Take `STEPS_OF_LOOK` steps, or as many shares of steps: the logarithm of the mean |u|^2 on the way, as |u|^2
        of one motion oscillates."""
        squares, dt = [], share * self.dt
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

    def growth(self, logs: list[float]) -> tuple[float, float]:
        """2 Re s of the motion that grows, and its error: by the rate so far, and by shorter steps from the present
        state."""
        coarse = slope(logs[int(np.argmin(logs)) :], self.time_of_look)
        short = self.time_of_look / FINER_STEP
        count = int(np.ceil(E_FOLDS / max(coarse, 1 / (self.time_of_look * len(logs))) / short)) + 1
        fine = slope([self.look(1 / FINER_STEP) for _ in range(2 * count)], short)
        error = (fine - coarse) / (FINER_STEP**2 - 1)
        return fine + error, abs(error)


@dataclass
class ImplicitSteps:
    """The state u at one time, and the factors; changes in place.

    Attributes
    ----------
    sigma : float
        2 / h, 1 / time.
    largest : float
        The largest frequency, 1 / time.
    """

    motion: Motion
    factors: Factors
    reference: float
    slow: SlowMotions
    sigma: float
    largest: float
    u: Floats

    @classmethod
    def of(cls, motion: Motion, reference: float, slow: SlowMotions, limit: float) -> "ImplicitSteps":
        """At random, without slow motions.

        Raises
        ------
        SingularMatrixError
            If there are no factors.
        """
        sigma, size = slow.radius, len(motion.active)
        shifted = motion.stiffness + sigma * motion.damping + sigma**2 * eye_array(size)
        u = slow.without(np.concatenate(random_state(motion)))
        return cls(motion, general_lu(csc_array(shifted)), reference, slow, sigma, 2 / limit, u)

    @property
    def time_of_look(self) -> float:
        """Time between two looks."""
        return SOLVES_OF_LOOK * 2 / self.sigma

    @property
    def work_of_look(self) -> float:
        """Multiplications, and what takes as long."""
        return SOLVES_OF_LOOK * (STEP_OVERHEAD + self.slow.entries + self.motion.damping.nnz)

    @property
    def hides(self) -> float:
        """Growth rate of a motion over that which it has in these steps, at the most."""
        return float(1 + (self.largest / self.sigma) ** 2)

    @property
    def square(self) -> float:
        """|u|^2."""
        return float(self.u @ self.u)

    def look(self) -> float:
        """Take `SOLVES_OF_LOOK` steps: the logarithm of the mean |u|^2 on the way."""
        squares = []
        for _ in range(SOLVES_OF_LOOK):
            self.u = self._stepped(self.u)
            squares.append(self.square)
        self.u = self.slow.without(self.u)
        return float(np.log(np.mean(squares)))

    def _stepped(self, u: Floats) -> Floats:
        p, w = np.split(u, 2)
        a = self.factors.solve(self.reference * w + self.motion.damping @ p + self.sigma * p)
        return 2 * self.sigma * np.concatenate([a, (self.sigma * a - p) / self.reference]) - u

    def growth(self, logs: list[float]) -> tuple[float, float]:
        """2 Re s of what grows, and its error: of the plane of two states, in which it alone is left."""
        basis = np.linalg.qr(np.column_stack([self.u, self._stepped(self.u)]))[0]
        p, w = np.split(basis, 2)
        force = self.motion.stiffness @ p / self.reference + self.motion.damping @ w
        image = np.concatenate([self.reference * w, -force])
        small = basis.T @ image
        error = float(np.linalg.norm(image - basis @ small, axis=0).max())
        return 2 * float(np.linalg.eigvals(small).real.max()), error


def random_state(motion: Motion) -> tuple[Floats, Floats]:
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


def slope(logs: list[float], between: float) -> float:
    """Rate of |u|^2 over the second half of the time, 1 / time."""
    half = logs[len(logs) // 2 :]
    return float(np.polyfit(between * np.arange(len(half)), half, 1)[0]) if len(half) > 1 else 0.0
