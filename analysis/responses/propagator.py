"""The propagator of small motion from its modes, and the times at which it is large (:mod:`.transient`)."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.linalg import eigh
from scipy.sparse.linalg import svds

from ..errors import FaultgougeError
from ..has_configuration import HasConfiguration
from ..motion.eigenvalues import Complexes
from ..motion.linear import all_rates
from ..motion.motion import Motion
from ..packing.packing import Floats, Indices
from .matrix_functions import LONE_COSINE, BlockDiagonal, Function, second_order
from .oscillator import Oscillator, released_motion
from .response import LinearMotion

Norm = Literal["displacement", "energy"]

LEAST_OBLIQUITY = 1.1
"""Modes with a larger |x| |l| have a part in the sampling: 1 is what a mode of a symmetric matrix has."""

OBLIQUITY_SHARE = 0.05
"""Modes whose |x| |l| is at least this share of the largest have a part in the sampling."""

FEWEST_MODES, MOST_MODES = 4, 16
"""The fewest and the most modes that are sampled; with dissipation a motion is two of them."""

LONE_PERIODS = 100
"""Length of the window, in periods, where the most oblique mode has no partner among these."""

TIMES_A_PERIOD = 8
"""Times a period: a phase between two of them is off by no more than pi/8, which costs 8 % and is refined away."""

BEATS = 10
"""Length of the window, in beats of the most oblique pair; for long beats fewer, see `MOST_PERIODS`. With dissipation
the window ends where the bound, which falls with the slowest mode, leaves no gain."""

MOST_PERIODS = 20_000
"""The window of more than 1.5 beats has no more periods of the most oblique mode than these."""

RATE_NOISE = 1e-7
"""Growth rates and differences of frequencies below this share of the largest frequency are rounding where two modes
are about to coalesce: the root of the rounding of a well-conditioned eigenvalue."""

NORM_ACCURACY = 1e-9
"""Relative error of the largest singular value."""

CANDIDATES = 6
"""Maxima of the sampled modes at which the whole propagator is looked at, and besides the largest of each of so many
octaves of time: at t = 0 the whole propagator is one, but some of its modes alone make an oblique projector."""

TIMES_AT_ONCE = 4096
"""Times that are sampled at once."""


class NoGainError(FaultgougeError):
    """The packing has no transient gain: it is unstable, or has no energy."""


def stable_motion(packing: HasConfiguration) -> LinearMotion:
    """The motion of a packing; NoGainError if the packing is unstable."""
    if all_rates(Motion.of(packing))[1].any():
        raise NoGainError("the packing is unstable: some motion grows for ever, and no gain is the largest")
    return LinearMotion.of(packing)


@dataclass(frozen=True, eq=False)
class Propagator:
    """P(t) = O f(t) I of modes: I takes starts to amplitudes, and O takes amplitudes to the measured quantities."""

    modes: BlockDiagonal
    outward: Complexes
    inward: Complexes
    function: Function
    twofold: bool = False
    """Whether each motion is the sum of two mirror images, of half its size."""
    is_mirrored: bool = False
    """Whether the second half of the modes has the mirror images of the first."""

    @classmethod
    def of(cls, motion: LinearMotion, norm: Norm) -> "Propagator":
        """Propagator of a packing in one of the norms."""
        system, modes = motion.system, motion.modes
        root, size, energy = system.root_mass, len(system.active), system.energy_norm
        if not motion.dissipative and norm == "displacement":
            outward, inward = modes.basis / root[:, None], modes.inverse * root
            return cls(modes, outward, inward, Oscillator().free_motion)
        if not motion.dissipative:
            modes = modes.oscillation_modes()
            outward = np.concatenate([energy.weight @ modes.basis[:size], modes.basis[size:]])
            inward = np.concatenate([modes.inverse[:, :size] @ energy.unweight, modes.inverse[:, size:]], axis=1)
            return cls(modes, outward, inward, released_motion, is_mirrored=True)
        outward, inward = modes.basis, modes.inverse
        if norm == "displacement":
            outward = (energy.unweight / root[:, None]) @ outward[:size]
            inward = inward[:, :size] @ (energy.weight * root)
        return cls(modes, outward, inward, released_motion, norm == "displacement")

    @property
    def frequency(self) -> Floats:
        """Frequency of each mode, radian / time."""
        values = self.modes.values
        return np.abs(np.sqrt(values).real) if self.modes.reach is second_order else np.abs(values.imag)

    def sampled_modes(self) -> Indices:
        """The columns of the modes that are sampled: the most oblique ones, and pairs that are kept together."""
        weight = np.linalg.norm(self.outward, axis=0) * np.linalg.norm(self.inward, axis=1)
        weight *= 2 if self.twofold else 1
        for column in self.modes.blocks:
            weight[[column, column + 1]] = np.inf
        finite = weight[np.isfinite(weight)].max(initial=1.0)
        least = max(LEAST_OBLIQUITY, OBLIQUITY_SHARE * (finite if np.all(np.isfinite(weight)) else LONE_COSINE**-1))
        order = np.argsort(-weight, kind="stable")[:MOST_MODES]
        return np.sort(order[(weight[order] > least) | (np.arange(len(order)) < FEWEST_MODES)])

    def window(self, columns: Indices) -> float:
        """Some beats of the most oblique pair, time."""
        frequency = self.frequency[columns]
        shape = self.outward[:, columns] / np.linalg.norm(self.outward[:, columns], axis=0)
        parallel = np.abs(shape.conj().T @ shape)
        gap = np.abs(frequency[:, None] - frequency[None])
        for column in set(self.modes.blocks) & set(columns.tolist()):
            # a block has a basis that is not oblique: its two modes are nearly parallel
            place = int(np.searchsorted(columns, column))
            parallel[place, place + 1] = 1 + frequency.max() / max(gap[place, place + 1], 1e-300)
        parallel[gap <= RATE_NOISE * frequency.max(initial=0.0)] = 0.0  # itself, and its mirror image
        a, b = np.unravel_index(np.argmax(parallel), parallel.shape)
        if parallel[a, b] == 0.0:
            return float(LONE_PERIODS * 2 * np.pi / frequency[a]) if frequency[a] else 1.0
        beat, period = np.pi / gap[a, b], 2 * np.pi / frequency[a]
        return float(max(1.5 * beat, min(BEATS * beat, MOST_PERIODS * period)))

    def end(self, bound: float) -> float:
        """A time beyond which the dissipation leaves no gain, time; inf without dissipation."""
        slowest = 0.0 if self.modes.reach is second_order else -float(self.modes.values.real.max(initial=-np.inf))
        return 0.5 * float(np.log(bound)) / slowest if slowest > 0 else np.inf

    def candidates(self, columns: Indices, window: float) -> list[tuple[float, float]]:
        """The times between which P of some modes has its largest maxima."""
        left, right = (np.linalg.qr(part)[1] for part in (self.outward[:, columns], self.inward[columns].conj().T))
        step = 2 * np.pi / max(self.frequency[columns].max(initial=0.0), 1e-300) / TIMES_A_PERIOD
        time = np.linspace(0.0, window, max(2, int(np.ceil(window / step)) + 1))
        some, back = self.modes.some(columns), right.conj().T
        size = np.concatenate(
            [
                np.linalg.norm(some.between(self.function, part, left, back), 2, (1, 2))
                for part in np.array_split(time, len(time) // TIMES_AT_ONCE + 1)
            ]
        )
        inner = np.flatnonzero((size[1:-1] >= size[:-2]) & (size[1:-1] > size[2:])) + 1
        peaks = np.concatenate([inner, [0, len(time) - 1]])
        peaks = peaks[np.argsort(-size[peaks], kind="stable")]
        shortest = window * 2.0**-CANDIDATES or 1.0  # an octave of its own below it; any number if all times are 0
        octave = np.log2(max(window, shortest) / np.maximum(time[peaks], shortest)).astype(int)
        best = np.union1d(peaks[:CANDIDATES], peaks[np.unique(octave, return_index=True)[1]])
        return [(float(time[max(k - 1, 0)]), float(time[min(k + 1, len(time) - 1)])) for k in best]

    def largest(self, time: float, accuracy: float = NORM_ACCURACY) -> tuple[float, Floats, Floats]:
        """Norm of the whole P(t), what reaches it and the start of norm 1 that does; real."""
        matrix = self.at(np.array([time]))[0]
        if min(matrix.shape) < 3:
            left, size, right = np.linalg.svd(matrix)
        else:
            left, size, right = svds(matrix, k=1, v0=np.ones(min(matrix.shape)), tol=accuracy)
        sign = np.sign(right[0, np.argmax(np.abs(right[0]))])
        return float(size[0]), sign * left[:, 0], sign * right[0]

    def at(self, time: Floats) -> Floats:
        """P(t), shape (T, a, b)."""
        first = np.arange(len(self.modes.values) // (1 + self.is_mirrored))
        modes, outward, inward = self.modes.some(first), self.outward[:, first], self.inward[first]
        part = modes.between(self.function, time, outward, inward).real
        return np.ascontiguousarray(2 * part if self.is_mirrored else part)

    def on(self, left: Floats, right: Floats) -> "Propagator":
        """L^T P(t) R of the columns L and R."""
        return replace(self, outward=left.T @ self.outward, inward=self.inward @ right)

    def bound(self) -> float:
        """Bound of the norm squared of every P(t): that of the modes with balanced sizes."""
        outward, inward = self.outward.copy(), self.inward.copy()
        for column, block in self.modes.blocks.items():
            pair = [column, column + 1]
            _, vectors = np.linalg.eig(block)
            if abs(np.linalg.det(vectors)) < np.finfo(float).eps:
                return np.inf
            outward[:, pair], inward[pair] = outward[:, pair] @ vectors, np.linalg.solve(vectors, inward[pair])
        scale = np.sqrt(np.linalg.norm(inward, axis=1) / np.linalg.norm(outward, axis=0))
        outward, inward = outward * scale, inward / scale[:, None]
        return _norm_squared(outward) * _norm_squared(inward.T)


def _norm_squared(matrix: Complexes) -> float:
    """The 2-norm squared of a matrix, from the smaller of its products with itself."""
    size = matrix.shape[1]
    if matrix.shape[0] < size:
        return _norm_squared(matrix.T)
    return float(eigh(matrix.conj().T @ matrix, eigvals_only=True, subset_by_index=(size - 1, size - 1))[0])
