r"""Eigenvalues of small motion with dissipation, all of them or one that is followed.

Small motion :math:`\propto e^{st}` is an eigenvector of :math:`T(s) = s^2 + s G + A` with the mass-weighted matrices
A, G of :mod:`~faultgouge.analysis.motion.state_space`: right vectors :math:`T(s) x = 0`, left ones :math:`y^H T(s) =
0`. It grows if Re s > 0. Matrices that change by dA and dG move an eigenvalue by

.. math:: \mathrm ds = - \frac{y^H (\mathrm dA + s\, \mathrm dG)\, x}{y^H (2 s + G)\, x} ,

so that weak damping of an undamped motion, :math:`s = i\sqrt\lambda`, gives it
:math:`\mathrm{Re}\, s = -y^H G x / (2 y^H x)`.

**All of them** (`DampedModes`) are LAPACK's for the first-order matrix Z in coordinates of the energy. A perfectly
conditioned one is uncertain by the unit roundoff times :math:`|Z|_F`; one with unit vectors l, r of Z by
:math:`1/|l^H r|` of that. Re s > 0 is believed from `SAFETY` times as much.

**One of them** (`DampedMode.at`) is followed to a neighbouring load by inverse iteration of both vectors,
:math:`x \leftarrow T(\sigma)^{-1} T'(\sigma) x` and the same for y, with s the root of :math:`y^H T(s) x` next to the
shift. Then the factors of the shift serve on, :math:`x \leftarrow x - T(\sigma)^{-1} T(s) x` (residual inverse
iteration: Neumaier, SIAM J. Numer. Anal. 22, 914 (1985)). Each step divides the errors of both vectors by
:math:`\mathrm{gap}/|s - \sigma|`, and that of s by its square.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig
from scipy.sparse import csc_array, csr_array, eye_array
from scipy.sparse.linalg import LinearOperator, eigs

from ..factors.sparse_lu import SingularMatrixError, SuperLUFactors, general_lu
from ..motion.eigenvalues import SAFETY, Complexes, active_coordinates, growing, mass_weighted, unit_rounding
from ..motion.state_space import StateSpace
from ..onset import force_bearing
from ..onset.modes import assign_columns
from ..onset.search import unit_of
from ..operators.damping import damping_matrix
from ..operators.stiffness import stiffness_matrix
from ..packing.packing import Floats, Indices, Packing

NEGLIGIBLE = 1e-3
"""Digits of an eigenvalue smaller than this share of |Z|_F are not asked for."""

STEPS = 12
"""Factorisations: one or two are enough."""

NEARER = 6
"""Inverse iterations from random vectors: each takes others away by the ratio of their distances."""

CORRECTIONS = 8
"""Corrections with the same factors, as long as each brings a digit at least."""


@dataclass(frozen=True, eq=False)
class Pencil:
    """s^2 + s G + A of a packing at one load.

    Attributes
    ----------
    fx : float
        The load, force per top disk.
    stiffness, damping : scipy.sparse.csr_array, shape (3N, 3N)
        A, 1 / time^2, and G, 1 / time, of the packing without contacts whose force is unknown, on all coordinates.
    balance : float
        Error of fx that goes with the packing's residual, see :class:`~faultgouge.analysis.Window`.
    """

    fx: float
    stiffness: csr_array
    damping: csr_array
    balance: float = 0.0

    @classmethod
    def of(cls, packing: Packing) -> "Pencil":
        """That of a packing with dashpots or drag."""
        bearing = force_bearing(packing)
        a, g = (mass_weighted(each(bearing), bearing) for each in (stiffness_matrix, damping_matrix))
        return cls(packing.fx, a, g, packing.load_error)

    @property
    def matrices(self) -> tuple[csr_array, csr_array]:
        """All that describes it."""
        return self.stiffness, self.damping

    @cached_property
    def modes(self) -> "DampedModes":
        """All modes, by LAPACK."""
        # of a copy: a pencil and modes that know each other would be freed late
        return DampedModes.of(replace(self))

    def towards(self, other: "Pencil", share: float) -> "Pencil":
        """The pencil at a share of the straight line to another one."""
        pairs = zip(self.matrices, other.matrices, strict=True)
        a, g = (csr_array((1 - share) * one + share * another) for one, another in pairs)
        return Pencil((1 - share) * self.fx + share * other.fx, a, g, max(self.balance, other.balance))

    @cached_property
    def system(self) -> StateSpace:
        """The first-order system on these coordinates."""
        return StateSpace.of_matrices(self.stiffness, self.damping, np.ones(self.stiffness.shape[0]))

    @cached_property
    def rounding(self) -> float:
        """u |Z|_F, 1 / time: uncertainty of a perfectly conditioned s. W has the norm (tr A)^(1/2)."""
        squares = 2 * np.abs(self.stiffness.diagonal()).sum() + np.sum(self.damping.data**2)
        return unit_rounding(np.sqrt(squares))


def in_own_time(pencil: Callable[[float], Pencil], fx: float) -> tuple[Callable[[float], Pencil], float]:
    """Pencils of s / unit, and the unit: a power of two of the size of s at a load, which changes no digit.

    Searches take these, as what is rough in a search multiplies matrices in single precision, which goes from 1e-38 to
    1e38.
    """
    unit = 2.0 ** (np.log2(unit_of(pencil(fx).stiffness)) // 2)

    def over_masses(fx: float) -> Pencil:
        place = pencil(fx)
        return Pencil(place.fx, place.stiffness / unit**2, place.damping / unit, place.balance)

    return over_masses, float(unit)


@dataclass(frozen=True, eq=False)
class DampedMode:
    """One eigenvalue with its vectors.

    Attributes
    ----------
    pencil : Pencil
        To which it belongs.
    rate : complex
        s, 1 / time.
    right, left : ndarray of complex, shape (3N,)
        Unit vectors x and y; zero on coordinates that feel no force.
    """

    pencil: Pencil
    rate: complex
    right: Complexes
    left: Complexes

    @property
    def fx(self) -> float:
        return self.pencil.fx

    @property
    def overlap(self) -> float:
        """|y^H (2 s + G) x| / |2 s|: it vanishes where two eigenvalues coalesce."""
        return abs(self._slant) / abs(2 * self.rate)

    @property
    def _slant(self) -> complex:
        return complex(np.vdot(self.left, 2 * self.rate * self.right + self.pencil.damping @ self.right))

    @property
    def grows(self) -> bool:
        """Whether Re s > 0 beyond its uncertainty."""
        return bool(growing(self.rate, self.overlap, self.pencil.rounding))

    def change(self, other: Pencil) -> complex:
        """First-order change of s on the way to another pencil."""
        force = (other.stiffness - self.pencil.stiffness) @ self.right
        force = force + self.rate * ((other.damping - self.pencil.damping) @ self.right)
        return complex(-np.vdot(self.left, force) / self._slant)

    def at(self, pencil: Pencil, guess: complex | None = None) -> "DampedMode | None":
        """The same mode in a neighbouring pencil; None if no mode of about the same shape is found there.

        Parameters
        ----------
        pencil : Pencil
            The neighbour.
        guess : complex, optional
            Where to begin; the first-order change by default.
        """
        found = refine_mode(pencil, self.right, self.left, self.rate + self.change(pencil) if guess is None else guess)
        if found is None:
            return None
        alike = abs(np.vdot(self.right, found.right)), abs(np.vdot(self.left, found.left))
        return found if min(alike) > 0.5 else None

    def same(self, other: "DampedMode") -> bool:
        """Whether two modes of one pencil are one and the same: their eigenvalues agree to half of the digits."""
        return abs(self.rate - other.rate) * min(self.overlap, other.overlap) < 1e-8 * abs(self.rate)


@dataclass(frozen=True, eq=False)
class DampedModes:
    """All eigenvalues at one load with Im s >= 0; the others are their mirror images.

    Attributes
    ----------
    pencil : Pencil
        To which they belong.
    rates : ndarray of complex, shape (m,)
        s by increasing imaginary part, 1 / time.
    right, left : ndarray of complex, shape (3N, m)
        Unit vectors in columns.
    uncertainty : ndarray, shape (m,)
        Re s counts as positive from here.
    """

    pencil: Pencil
    rates: Complexes
    right: Complexes
    left: Complexes
    uncertainty: Floats

    @classmethod
    def of(cls, pencil: Pencil) -> "DampedModes":
        """Solve the dense first-order eigenproblem."""
        system, size = pencil.system, len(pencil.system.active)
        z = system.matrix
        values, left, right = eig(z, left=True, check_finite=False)
        kept = np.flatnonzero(values.imag >= 0)
        kept = kept[np.lexsort((values[kept].real, values[kept].imag))]
        overlap = np.abs(np.sum(left[:, kept].conj() * right[:, kept], axis=0))
        x, y = np.zeros((2, pencil.stiffness.shape[0], len(kept)), complex)
        x[system.active] = _normalise(system.unweight @ right[:size, kept])
        y[system.active] = _normalise(left[size:, kept])
        with np.errstate(divide="ignore"):
            uncertainty = SAFETY * pencil.rounding / overlap
        return cls(pencil, np.asarray(values[kept], complex), x, y, uncertainty)

    def __len__(self) -> int:
        return len(self.rates)

    @property
    def fx(self) -> float:
        return self.pencil.fx

    @property
    def grows(self) -> Indices:
        """Which of them have Re s > 0 beyond their uncertainty."""
        return np.flatnonzero(self.rates.real > self.uncertainty)

    def mode(self, index: int) -> DampedMode:
        """One of them."""
        return DampedMode(self.pencil, complex(self.rates[index]), self.right[:, index], self.left[:, index])

    def changes(self, other: Pencil) -> Complexes:
        """First-order changes of all s on the way to another pencil, shape (m,)."""
        y, x, s = self.left.conj(), self.right, self.rates
        force = (other.stiffness - self.pencil.stiffness) @ x + ((other.damping - self.pencil.damping) @ x) * s
        slant = np.sum(y * (2 * s * x + self.pencil.damping @ x), axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(-np.sum(y * force, axis=0) / slant)

    def assign_to(self, other: "DampedModes") -> Indices:
        """Which mode of a neighbouring load each mode here has become, shape (m,); -1 where there is none.

        Shapes decide, |x^H x'| |y^H y'|, and for shapes that two overdamped motions share, the eigenvalues.
        """
        weight = np.abs(self.right.conj().T @ other.right) * np.abs(self.left.conj().T @ other.left)
        a, b = self.rates[:, None], other.rates[None]
        return assign_columns(weight * (1 - np.abs(a - b) / (np.abs(a) + np.abs(b) + np.finfo(float).tiny)))


def nearest_mode(pencil: Pencil, frequency: float) -> DampedMode | None:
    """The mode whose s is nearest to a point of the imaginary axis, by inverse iteration; None if none is near enough.

    Parameters
    ----------
    pencil : Pencil
        Of any size.
    frequency : float
        The point, 1 / time. The mode should be closer to it than others by far, as at a crossing that is known.
    """
    size, shift = pencil.stiffness.shape[0], 1j * frequency * (1 + 1e-9)  # no eigenvalue to the last digit
    factors = _factors(csc_array(pencil.stiffness + shift * pencil.damping + shift**2 * eye_array(size)))
    active = active_coordinates(pencil.stiffness)
    x, y = np.zeros((2, size), complex)
    x[active] = y[active] = np.random.default_rng(0).standard_normal(len(active))
    for _ in range(NEARER):
        x, y = _normalise(factors.solve(x)), _normalise(factors.solve(y, trans="H"))
    return refine_mode(pencil, x, y, shift)


def find_growing_near(pencil: Pencil, point: complex, count: int) -> list[DampedMode]:
    """Those of the modes nearest to a point of the complex plane that grow, by shift and invert with ARPACK.

    Parameters
    ----------
    pencil : Pencil
        Of any size.
    point : complex
        On the imaginary axis or beyond, 1 / time; not zero, where the disks that touch nothing have theirs.
    count : int
        How many of the nearest modes are looked at.

    Raises
    ------
    ArpackError
        If they do not converge.
    """
    size, shift = pencil.stiffness.shape[0], point * (1 + 1e-9)  # no eigenvalue to the last digit
    factors = _factors(csc_array(pencil.stiffness + shift * pencil.damping + shift**2 * eye_array(size)))

    def inverse(state: Complexes) -> Complexes:
        """(Z - shift)^(-1) of the state (x, s x)."""
        place, speed = state[:size], state[size:]
        x = -factors.solve(speed + pencil.damping @ place + shift * place)
        return np.concatenate([x, place + shift * x])

    start = np.random.default_rng(0).standard_normal(2 * size).astype(complex)
    operator = LinearOperator((2 * size, 2 * size), matvec=inverse, dtype=complex)
    values, states = eigs(operator, k=count, v0=start, tol=1e-9)
    found: list[DampedMode] = []
    for s, x in zip(shift + 1 / values, states[:size].T, strict=True):
        if s.real > -1e-6 * abs(s):  # else it surely loses energy
            mode = refine_mode(pencil, _normalise(x), _normalise(x.conj()), s)
            if mode is not None and mode.grows and mode.rate.imag >= 0:
                found.append(mode)
    return found


def refine_mode(pencil: Pencil, x: Complexes, y: Complexes, s: complex) -> DampedMode | None:
    """The mode nearest to some vectors and an eigenvalue, by the two-sided iteration; None if it does not converge."""
    a, g, unit = pencil.stiffness, pencil.damping, eye_array(len(x))
    mirror = a.T, g.T
    floor = pencil.rounding / np.finfo(float).eps * NEGLIGIBLE  # of a steady mode s is zero
    for _ in range(STEPS):
        factors = _factors(csc_array(a + s * g + s * s * unit))
        x = _normalise(factors.solve(2 * s * x + g @ x))
        y = _normalise(factors.solve(2 * np.conj(s) * y + g @ y, trans="H"))
        last = np.inf
        for _ in range(CORRECTIONS):
            forces = a @ x, g @ x
            before, s = s, _quotient(s, *(complex(np.vdot(y, each)) for each in (*forces, x)))
            if not np.isfinite(s):
                return None
            step, size = abs(s - before), abs(s) + floor
            if step <= 4 * np.finfo(float).eps * size or (step < 1e-9 * size and step >= last):
                return DampedMode(pencil, s, x, y)
            if step > 0.1 * last:
                break
            last = step
            x = _normalise(x - factors.solve(forces[0] + s * forces[1] + s * s * x))
            z = np.conj(s)
            y = _normalise(y - factors.solve(mirror[0] @ y + z * (mirror[1] @ y) + z * z * y, trans="H"))
    return None


def _quotient(s: complex, stiffness: complex, damping: complex, mass: complex) -> complex:
    """The root of y^H T(s) x next to s: the Rayleigh quotient of two vectors."""
    for _ in range(3):
        s = s - (stiffness + s * (damping + s * mass)) / (damping + 2 * s * mass)
    return s


def _factors(matrix: csc_array) -> SuperLUFactors:
    """LU factors; where s is an eigenvalue to the last bit, a shift by rounding stands for a pivot that is zero."""
    try:
        return general_lu(matrix)
    except SingularMatrixError:
        rounding = np.finfo(float).eps * np.abs(matrix.data).max()
        return general_lu(csc_array(matrix + rounding * eye_array(matrix.shape[0])))


def _normalise(vectors: NDArray) -> Complexes:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=0))
