"""Small motion at one load: A and G on all coordinates, and the matrix whose eigenvalues a search follows."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar, cast

import numpy as np
from scipy.sparse import csr_array

from ..arrays import Floats, Indices
from ..has_configuration import HasConfiguration
from ..motion.eigenvalues import mass_weighted, unit_rounding
from ..operators.damping import damping_matrix
from ..operators.stiffness import stiffness_matrix

AnyConfiguration = TypeVar("AnyConfiguration", bound=HasConfiguration)


@dataclass(frozen=True, eq=False)
class System:
    """Small motion at one load, on n coordinates that do not depend on the load.

    Attributes
    ----------
    fx : float
        The load, force per top disk.
    stiffness : scipy.sparse.csr_array or ndarray, shape (n, n)
        A = M^(-1/2) K M^(-1/2), 1 / time^2, with its zero rows.
    damping : scipy.sparse.csr_array, ndarray or None, shape (n, n)
        G, 1 / time; None without dissipation.
    balance : float
        Error of fx that goes with the packing's residual, force.
    states : bytes
        What A is smooth with: where it changes, A bends.
    """

    fx: float
    stiffness: Any = field(repr=False)
    damping: Any = field(default=None, repr=False)
    balance: float = field(default=0.0, kw_only=True)
    states: bytes = field(default=b"", repr=False, kw_only=True)

    @classmethod
    def of(cls, packing: HasConfiguration, dissipation: bool = False) -> "System":
        """The system of a packing, without the contacts whose force is unknown."""
        bearing = force_bearing(packing)
        stiffness = mass_weighted(stiffness_matrix(bearing), bearing)
        damping = mass_weighted(damping_matrix(bearing), bearing) if dissipation else None
        return cls(packing.fx, stiffness, damping, balance=packing.load_error, states=bearing.contact_states)

    @property
    def dissipative(self) -> bool:
        """Whether there is dissipation."""
        return self.damping is not None

    @property
    def damping_or_zero(self) -> Any:
        """G, or a matrix of zeros."""
        return csr_array(self.stiffness.shape) if self.damping is None else self.damping

    @cached_property
    def active(self) -> Indices:
        """Coordinates that feel a force: the rows of A that are not zero."""
        if isinstance(self.stiffness, np.ndarray):
            return np.flatnonzero(self.stiffness.any(axis=1))
        return np.flatnonzero(np.diff(self.stiffness.indptr))

    @cached_property
    def frequency(self) -> float:
        """The root of the largest diagonal element of A, radian / time."""
        return float(np.sqrt(np.abs(self.stiffness.diagonal()).max(initial=0.0))) or 1.0

    @property
    def first_order(self) -> Floats:
        """A or, with dissipation, Z of displacements and velocities, dense, on the active coordinates."""
        a = _dense(self.stiffness, self.active)
        if self.damping is None:
            return a
        size, unit = len(a), self.frequency
        z = np.zeros((2 * size, 2 * size))
        z[:size, size:] = unit * np.eye(size)
        z[size:, :size], z[size:, size:] = -a / unit, -_dense(self.damping, self.active)
        return z

    @cached_property
    def rounding(self) -> float:
        """u |A|_F, or u |Z|_F: the uncertainty of a perfectly conditioned eigenvalue."""
        parts = [_entries(self.stiffness)]
        if self.damping is not None:
            parts = [parts[0] / self.frequency, _entries(self.damping), self.frequency * np.ones(len(self.active))]
        return unit_rounding(np.concatenate([np.ravel(each) for each in parts]))


def _dense(matrix: Any, active: Indices) -> Floats:
    inner = matrix[active][:, active]
    return inner if isinstance(inner, np.ndarray) else inner.toarray()


def _entries(matrix: Any) -> Any:
    return matrix if isinstance(matrix, np.ndarray) else matrix.data


def full_operator(packing: HasConfiguration) -> csr_array:
    """A = M^(-1/2) K M^(-1/2) of the contacts that bear a force, of all coordinates, with its zero rows; 1 / time^2."""
    return System.of(packing).stiffness


def force_bearing(packing: AnyConfiguration) -> AnyConfiguration:
    """The packing without the contacts whose force is no more than the packing's own imbalance.

    A disk that only such contacts hold comes to rest just about touching. Its overlap is rounding noise, and with the
    overlap its stiffness, of order (residual / k_n)^(1/3): it differs from one equilibrium to the next, and would open
    and shut windows at random. Ten times the imbalance, as a disk may rest between two contacts without force whose
    forces cancel in part; and no more than 1e-6 of the largest force, so that a packing out of balance keeps contacts.
    """
    largest = packing.normal_force.max(initial=0.0)
    return cast(AnyConfiguration, packing.loaded(min(10 * packing.residual, 1e-6 * largest)))
