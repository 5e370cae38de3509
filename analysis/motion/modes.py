r"""Modes: eigenvalues with their right and left vectors.

Vectors are in mass-weighted coordinates :math:`M^{1/2} q`, in which the stability operator is
:math:`A = M^{-1/2} K M^{-1/2}`. A mode has :math:`A x = \lambda x` and :math:`y^H A = \lambda y^H` with unit vectors;
:math:`\kappa = 1/|y^H x|` is the condition of its eigenvalue. `normal_modes` has all modes of a packing by LAPACK,
:mod:`~faultgouge.analysis.motion.buckling` those nearest to a shift by ARPACK, and
:mod:`~faultgouge.analysis.motion.all_eigenvalues` those in slices of a large spectrum that are complex or negative.
Each solver has its own rounding, so that the same mode differs in its last digits.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig
from scipy.sparse import csr_array

from ..arrays import Complexes, Floats, Indices
from ..has_configuration import HasConfiguration
from ..operators.stiffness import stiffness_matrix
from .eigenvalues import SAFETY, active_coordinates, mass_weighted, unit_rounding


@dataclass(frozen=True)
class Mode:
    """One mode of a packing. A complex pair has one Mode, with the positive imaginary part.

    Attributes
    ----------
    eigenvalue : complex
        lambda, 1 / time^2.
    overlap : float
        |y^H x| of the unit left and right vectors; zero at the coalescence of a pair.
    participation : float
        Participation ratio of the mode, from 1/N for one disk that moves alone to 1 for disks that move alike.
    rotation : float
        Share of rotation in the mode's kinetic energy, from 0 to 1.
    """

    eigenvalue: complex
    overlap: float
    participation: float
    rotation: float

    @property
    def condition(self) -> float:
        """kappa = 1 / |y^H x|: change of the eigenvalue per change of the operator."""
        return 1.0 / self.overlap if self.overlap > 0 else np.inf

    @property
    def frequency(self) -> float:
        """|Re omega|, radian / time."""
        return float(abs(np.sqrt(self.eigenvalue).real))

    @property
    def quality(self) -> float:
        """|Re omega| / (2 |Im omega|): dissipation with a lower quality factor stops the growth."""
        return self.frequency / self.growth_rate if self.growth_rate > 0 else np.inf

    @property
    def growth_rate(self) -> float:
        """2 |Im omega|, 1 / time: the mean square displacement grows as exp(growth_rate t)."""
        return growth_rate(self.eigenvalue)


@dataclass(frozen=True, eq=False)
class Modes:
    """Some modes, in mass-weighted coordinates M^(1/2) q.

    Attributes
    ----------
    values : ndarray of complex, shape (k,)
        Eigenvalues, 1 / time^2.
    right, left : ndarray of complex, shape (n, k)
        Unit vectors A x = lambda x and y^H A = lambda y^H in columns; of a packing in the order (x.., y.., R theta..),
        and zero for coordinates on which no force acts.
    axes : int
        Coordinates per particle: 3 for disks, 6 for spheres.
    """

    values: Complexes
    right: Complexes
    left: Complexes
    axes: int = 3

    @classmethod
    def none(cls, size: int) -> "Modes":
        """No mode of an operator of so many coordinates."""
        return cls(np.zeros(0, complex), np.zeros((size, 0), complex), np.zeros((size, 0), complex))

    @classmethod
    def of_matrix(cls, matrix: csr_array, axes: int = 3) -> "Modes":
        """All modes by LAPACK, sorted by real part, then imaginary part, without coordinates that feel no force."""
        active = active_coordinates(matrix)
        inner = matrix[active][:, active].toarray()
        values, left, right = eig(inner, left=True, overwrite_a=True, check_finite=False)
        modes = cls(values, right, left, axes).chosen(np.lexsort((values.imag, values.real)))
        return modes.placed(active, matrix.shape[0])

    @classmethod
    def joined(cls, parts: Sequence["Modes"]) -> "Modes":
        """Modes of one operator, those of the first part first."""
        right, left = (np.concatenate([getattr(part, side) for part in parts], axis=1) for side in ("right", "left"))
        return cls(np.concatenate([part.values for part in parts]), right, left, parts[0].axes)

    def placed(self, places: Indices, size: int) -> "Modes":
        """As modes of an operator of more coordinates, or in another order: with those at given places."""
        right, left = np.zeros((2, size, len(self)), dtype=np.complex128)
        right[places], left[places] = self.right, self.left
        return Modes(self.values, right, left, self.axes)

    def chosen(self, which: NDArray) -> "Modes":
        """Some of them, by a mask or by numbers."""
        return Modes(self.values[which], self.right[:, which], self.left[:, which], self.axes)

    def __len__(self) -> int:
        return len(self.values)

    @cached_property
    def overlap(self) -> Floats:
        """|y^H x| of each eigenvalue, shape (k,)."""
        return np.abs(np.sum(self.left.conj() * self.right, axis=0))

    @property
    def participation(self) -> Floats:
        """Participation ratio of each mode, shape (k,)."""
        return participation_ratio(self.right, self.axes)

    @property
    def rotation(self) -> Floats:
        """Share of rotation in the kinetic energy of each mode, shape (k,)."""
        energy = (np.abs(self.right) ** 2).reshape(self.axes, len(self.right) // self.axes, len(self)).sum(axis=1)
        return np.asarray(energy[self.axes // 2 + self.axes % 2 :].sum(axis=0) / energy.sum(axis=0))


def normal_modes(packing: HasConfiguration) -> Modes:
    """Compute every mode with its left and right vectors, by LAPACK's dense solver.

    Parameters
    ----------
    packing : Packing
        The configuration.

    Returns
    -------
    Modes
        Sorted by real part, then imaginary part, as in :func:`~faultgouge.analysis.spectrum`.
    """
    return Modes.of_matrix(mass_weighted(stiffness_matrix(packing), packing), packing.axes)


def closest_to_meeting(modes: Modes) -> tuple[int, int, float]:
    r"""Find the two real modes that are closest to a coalescence.

    At a coalescence of two real eigenvalues the vectors become one. In the normal form of two modes the cosine between
    the right vectors is :math:`\eta/\delta = 1 - \epsilon`, and :math:`\epsilon` is the distance from the coalescence.
    The two modes are therefore the real modes whose mass-weighted right vectors are most nearly parallel. Motions
    that no force opposes, whose eigenvalue is zero within rounding, do not count: LAPACK's vectors of several of them
    may be parallel by rounding alone.

    Parameters
    ----------
    modes : Modes
        All modes of a packing, from :func:`normal_modes`.

    Returns
    -------
    tuple of (int, int, float)
        Indices of the two modes, the lower eigenvalue first, and the cosine. The cosine is 0, up to rounding, for the
        modes of a symmetric operator.

    Raises
    ------
    ValueError
        If there are fewer than two such modes.
    """
    zero = np.abs(modes.values) <= SAFETY * unit_rounding(modes.values)
    real = np.flatnonzero((modes.values.imag == 0) & ~zero)
    if len(real) < 2:
        raise ValueError(f"There are {len(real)} real modes that a force opposes; two are needed to meet.")
    cosine = np.abs(modes.right[:, real].real.T @ modes.right[:, real].real)
    np.fill_diagonal(cosine, 0.0)
    first, second = sorted(np.unravel_index(np.argmax(cosine), cosine.shape))
    return int(real[first]), int(real[second]), float(cosine[first, second])


def growth_rate(eigenvalue: complex) -> float:
    """2 |Im sqrt(lambda)|, 1 / time: the mean square displacement D grows as exp(growth_rate t)."""
    return float(2 * abs(np.sqrt(complex(eigenvalue)).imag))


def participation_ratio(right: Complexes | Floats, axes: int = 3) -> Floats:
    r"""How many of the disks take part in modes, whose mass-weighted vectors are columns, as a share, shape (k,).

    With :math:`e_i` the kinetic energy of disk i, rotation included, a mean over a period, the ratio is
    :math:`(\sum_i e_i)^2 / (N \sum_i e_i^2)`: 1/N for one disk that moves alone, 1 for disks that move alike.
    """
    energy = (np.abs(right) ** 2).reshape(axes, len(right) // axes, right.shape[1]).sum(axis=0)
    return energy.sum(axis=0) ** 2 / (len(energy) * (energy**2).sum(axis=0))
