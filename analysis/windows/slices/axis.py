r"""All motions that grow at a load: discs about points of the imaginary axis, each searched by shift and invert.

Strong dashpots couple hundreds of modes. All eigenvalues take time with the cube of their number, and most of them lie
far to the left. So the imaginary axis is covered by discs, from zero to the largest frequency that an undamped mode has
(:math:`s = i \omega` with a unit vector x demands :math:`\omega^2 = x^H A_s x`, with the symmetric part of A). In each
of them Arnoldi's iteration with :math:`(Z - \sigma)^{-1}` finds the eigenvalues next to the middle :math:`\sigma`. A
disc reaches as far as these have converged.

**The whole right half-plane is covered.** Let :math:`s = p + i \omega`. The imaginary part of
:math:`x^H (s^2 + s G + A) x = 0` says that 2 p is at most the largest eigenvalue of :math:`-G - i A_a / \omega`, with
the antisymmetric part of A; this bound falls with :math:`\omega`, as G takes energy. The real part says that
:math:`p^2` is at most :math:`\omega^2` less the lowest eigenvalue of the symmetric part. Both together, with
:math:`\beta` the largest eigenvalue of :math:`i A_a`, give :math:`\omega^2 \le \max x^H A_s x + \beta^2/4\omega^2`: the
axis is covered up to this frequency. Where the discs on the axis do not reach as far to the right as the bounds,
rectangles are covered with further discs, and halved until a disc contains each. Lanczos's iteration computes both
bounds, and they are enlarged by its error.

A disc costs one sparse factorisation and `Limits.krylov` solutions in single precision, which tell eigenvalues to 1e-3
of their distance from the middle. Eigenvalues as close to the axis as this error are solved for in double precision.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array, csr_array, eye_array
from scipy.sparse.linalg import ArpackError, eigsh

from ...arrays import Floats, Indices
from ...errors import FaultgougeError
from ...factors.sparse_lu import Factors, SingularMatrixError, symmetric_lu
from ...motion.eigenvalues import Complexes, active_coordinates
from ..limits import LIMITS
from ..nearby import drop_duplicates, find_growing_near
from ..space import Space
from ..system import System


class UncoveredAxisError(FaultgougeError):
    """The imaginary axis cannot be covered with discs."""


@dataclass(frozen=True, eq=False)
class Disc:
    """The eigenvalues about a point of the imaginary axis.

    Attributes
    ----------
    middle : complex
        The point.
    radius : float
        All eigenvalues that are closer are known.
    values : ndarray of complex, shape (k,)
        These, or more.
    vectors : ndarray of complex, shape (n, k)
        Their displacements.
    residuals : ndarray, shape (k,)
        In units of the eigenvalues of the inverse.
    """

    middle: complex
    radius: float
    values: Complexes
    vectors: Complexes
    residuals: Floats

    @classmethod
    def about(cls, middle: complex, stiffness: csr_array, damping: csr_array) -> "Disc":
        """Arnoldi's iteration with (Z - middle)^(-1), Z of the state (x, s x), by s^2 + s G + A of n coordinates."""
        size, shift = stiffness.shape[0], np.complex64(middle)
        factors = _factors(csc_array(stiffness + middle * damping + middle**2 * eye_array(size)))
        most = min(LIMITS.krylov, 2 * size)
        basis = np.zeros((2 * size, most + 1), np.complex64, order="F")
        small = np.zeros((most + 1, most), complex)
        start = np.random.default_rng(0).standard_normal(2 * size)
        basis[:, 0] = start / np.linalg.norm(start)
        steps = most
        for k in range(most):
            place, speed = basis[:size, k], basis[size:, k]
            x = -factors.solve(speed + (damping @ place + shift * place))
            state, known = np.concatenate([x, place + shift * x]), basis[:, : k + 1]
            before = float(np.linalg.norm(state))
            for _ in range(2):  # twice is enough
                part = (state.conj() @ known).conj()
                state -= known @ part
                small[: k + 1, k] += part
            rest = float(np.linalg.norm(state))
            small[k + 1, k] = rest
            if not rest > 1e-5 * before:  # the space is all that the start has
                steps, small[k + 1, k] = k + 1, 0.0
                break
            basis[:, k + 1] = state / np.float32(rest)
        inverse, vectors = np.linalg.eig(small[:steps, :steps])
        order = np.argsort(-np.abs(inverse))
        inverse, vectors = inverse[order], vectors[:, order]
        residuals = small[steps, steps - 1].real * np.abs(vectors[-1]) / np.abs(inverse)
        unknown = np.flatnonzero(residuals > LIMITS.ritz_residual)
        count = int(unknown[0]) if len(unknown) else steps
        radius = np.inf
        if len(unknown):
            radius = 1 / (abs(inverse[count]) * (1 + min(1.0, float(residuals[count]))))
        values: Complexes = np.asarray(middle + 1 / inverse[:count], complex)
        displacements = basis[:size, :steps] @ vectors[:, :count]
        return cls(middle, radius, values, displacements, residuals[:count])

    @property
    def near_axis(self) -> list[int]:
        """Which of the eigenvalues may have a real part that is not negative."""
        distance = np.abs(self.values - self.middle)
        near = self.values.real > -(LIMITS.ritz_residual + self.residuals) * distance
        return np.flatnonzero(near & (self.values.imag > -LIMITS.ritz_residual * distance)).tolist()


@dataclass(frozen=True, eq=False)
class _Scaled:
    """A system in units of its largest undamped frequency, without the coordinates that feel no force.

    `stiffness` is A, `feed` is i times its antisymmetric part, `loss` is G. The lowest eigenvalue of the symmetric part
    of A lies no farther below zero than `softening`.
    """

    system: System
    active: Indices
    unit: float
    stiffness: csr_array
    feed: csr_array
    loss: csr_array
    softening: float

    @classmethod
    def of(cls, system: System, active: Indices) -> "_Scaled":
        a, g = (csr_array(each[active][:, active]) for each in system.matrices)
        unit = float(np.sqrt(_largest_eigenvalue(csr_array(0.5 * (a + a.T)))))  # no frequency is larger
        softening = _largest_eigenvalue(csr_array(eye_array(len(active)) - 0.5 * (a + a.T) / unit**2)) - 1
        feed = csr_array(0.5j * (a - a.T) / unit**2)
        return cls(system, active, unit, csr_array(a / unit**2), feed, csr_array(g / unit), softening)

    @cached_property
    def single_precision(self) -> tuple[csr_array, csr_array]:
        """A and G."""
        return csr_array(self.stiffness.astype(np.float32)), csr_array(self.loss.astype(np.float32))

    @property
    def largest_frequency(self) -> float:
        """A bound of the frequency of motions that grow: the largest undamped frequency, raised by the feed."""
        return float(np.sqrt(1 + 0.25 * np.abs(self.feed).sum(axis=1).max() ** 2))

    def fastest_growth(self, low: float, high: float) -> float:
        """An upper bound of Re s between two frequencies."""
        fastest = float(np.sqrt(high**2 + max(0.0, self.softening)))
        if not low:
            return fastest
        most_taken = float(np.abs(self.loss).sum(axis=1).max())
        form = csr_array(most_taken * eye_array(len(self.active)) - self.loss - self.feed / low)
        return min(fastest, 0.5 * (_largest_eigenvalue(form) - most_taken))

    def look(self, middle: complex) -> tuple[float, list[Space]]:
        """The radius about a point within which all growing motions are found, and these motions."""
        disc, system = Disc.about(middle, *self.single_precision), self.system
        if disc.radius < LIMITS.smallest_disc:
            raise UncoveredAxisError(f"motions at F_x = {system.fx:.10g} lie too close to be told from each other")
        found = []
        for k in disc.near_axis:
            x = np.zeros(system.stiffness.shape[0], complex)
            x[self.active] = disc.vectors[:, k] / np.linalg.norm(disc.vectors[:, k])
            distance = abs(disc.values[k] - middle)
            found += _solve(system, x, complex(disc.values[k]) * self.unit, distance * self.unit)
        return disc.radius, found


Rectangle = tuple[complex, complex]
"""Lower left and upper right corners."""


def growing_modes(system: System) -> list[Space]:
    """The motions that grow at a load, each once; see the module.

    Parameters
    ----------
    system : System
        Of any size; the time grows with the square of the number of coordinates.

    Raises
    ------
    UncoveredAxisError
        If discs become too small, or an eigenvalue next to the axis cannot be told from its neighbours.
    """
    active = active_coordinates(system.stiffness)
    if not len(active):
        return []
    scaled = _Scaled.of(system, active)
    found, beside = _cover_axis(scaled)
    while beside:
        low, high = beside.pop()
        size = high - low
        reach, more = scaled.look(0.5 * (low + high))
        found += more
        if reach < 0.5 * abs(size):
            half = 0.5 * size.real if size.real > size.imag else 0.5j * size.imag
            beside += [(low, high - half), (low + half, high)]
    return drop_duplicates([mode for mode in found if mode.grows and mode.mean.imag >= 0])


def _cover_axis(scaled: _Scaled) -> tuple[list[Space], list[Rectangle]]:
    """Modes in discs along the axis, and the rectangles of the right half-plane that these discs leave uncovered."""
    found: list[Space] = []
    beside: list[Rectangle] = []
    covered, radius, end = 0.0, 0.05, scaled.largest_frequency
    while covered < end:
        middle = covered + LIMITS.next_disc * radius
        reach, more = scaled.look(1j * middle)
        found += more
        if middle - LIMITS.covered_share * reach > covered:
            radius = min(reach, 0.8 * radius)
            continue
        begin, covered, radius = covered, middle + LIMITS.covered_share * reach, min(reach, 1.0)
        height, fastest = float(np.sqrt(1 - LIMITS.covered_share**2) * reach), scaled.fastest_growth(begin, covered)
        if height < fastest:
            beside.append((complex(height, begin), complex(fastest, covered)))
    return found, beside


def _solve(system: System, x: Complexes, s: complex, distance: float) -> list[Space]:
    """The mode of a nearly known eigenvalue; if the iteration strays, the growing modes next to the eigenvalue."""
    mode = Space.of(system, x, x.conj(), s).refine(s)
    if mode is not None and abs(mode.mean - s) < LIMITS.stray_share * distance:
        return [mode]
    try:
        return find_growing_near(system, s, 1)
    except ArpackError as error:
        raise UncoveredAxisError(f"a motion at F_x = {system.fx:.10g} cannot be told from its neighbours") from error


def _largest_eigenvalue(matrix: csr_array) -> float:
    """The largest eigenvalue of a Hermitian matrix, positive: much less than the largest sum of a row."""
    if matrix.shape[0] < 3:
        return float(np.linalg.eigvalsh(matrix.toarray())[-1])
    start = np.random.default_rng(0).standard_normal(matrix.shape[0]).astype(matrix.dtype)
    largest = eigsh(matrix, k=1, which="LA", v0=start, tol=LIMITS.norm_error, return_eigenvectors=False)[0]
    return float((1 + LIMITS.norm_error) * largest)


def _factors(matrix: csc_array) -> Factors:
    """Factors in single precision; if a pivot is zero, the factors of a matrix that differs by a rounding."""
    single = csc_array(matrix.astype(np.complex64))
    try:
        return symmetric_lu(single, pivoting=LIMITS.pivot)
    except SingularMatrixError:
        rounding = np.finfo(np.float32).eps * np.abs(single.data).max()
        return symmetric_lu(csc_array(single + rounding * eye_array(single.shape[0], dtype=np.complex64)))
