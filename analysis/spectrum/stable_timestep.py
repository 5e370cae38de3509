r"""The largest stable time step of velocity Verlet.

Without dissipation it is :math:`2/\omega_{max}`. Dashpots use the velocity of the half step, as in all granular styles
of LAMMPS: a motion begins to alternate in sign and to grow when :math:`4 M - 2\,dt\, C - dt^2 K` becomes singular, so
that dt = 2/mu with the largest mu of :math:`\mu^2 M - \mu C - K`.

Of many coordinates mu is found by Arnoldi's iteration (ARPACK) with :math:`M^{-1/2} (K + \mu C) M^{-1/2}`, whose
largest eigenvalue is :math:`\mu^2`. Masses are applied to vectors, and K + mu C is one matrix.

**What is guaranteed.** For symmetric K and C the residual of the iteration says how far an eigenvalue is. No iteration
can prove that this eigenvalue is the largest. What is sure is that none exceeds the largest sum of a row in absolute
value (Gershgorin). With k and c these sums of :math:`M^{-1/2} K M^{-1/2}` and :math:`M^{-1/2} C M^{-1/2}`,

.. math:: \mu^2 \le k + \mu c, \qquad \mu \le \tfrac12 \left(c + \sqrt{c^2 + 4k}\right) .

The step 2/mu of this bound is stable for certain, and shorter than the limit.
"""

import numpy as np
from scipy.linalg import eigvals
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, eigs

from ..operators.damping import coordinate_mass, damping_matrix
from ..operators.stiffness import stiffness_matrix
from ..packing.packing import Floats, Packing
from ..packing.snapshot import Snapshot

FEW, MANY = 40, 10_000
"""Coordinates up to which a time step is that of all eigenvalues, and from which on it has fewer digits."""

LIMIT_OF_FEW, LIMIT_OF_MANY = 1e-8, 1e-3
"""Relative errors of mu^2 for a time step. Packings have many modes near the fastest one: among 200,000 coordinates a
digit more takes twice the time, and nobody runs within a thousandth of the limit."""

LOOKS = 6
"""Steps of the iteration for mu: each squares its error."""


class StableTimestep(float):
    """A time step that is the limit of stability, a float.

    Attributes
    ----------
    error : float
        By the residual of the iteration, time.
    certain : float
        A shorter step, time, up to which all are stable for certain.
    """

    error: float
    certain: float

    def __new__(cls, value: float, error: float = 0.0, certain: float | None = None) -> "StableTimestep":
        """The limit, its error, and the step that is certain: by default the limit itself."""
        made = super().__new__(cls, value)
        made.error, made.certain = error, value if certain is None else certain
        return made


def stable_timestep(
    of: float | Packing | Snapshot, stiffness: csr_array | None = None, damping: csr_array | None = None
) -> StableTimestep:
    r"""The largest stable time step of velocity Verlet.

    Parameters
    ----------
    of : float, Packing or Snapshot
        omega_max, radian / time, or a configuration with its dashpots.
    stiffness, damping : scipy.sparse.csr_array, optional
        K and C of the configuration, where they are assembled already.

    Returns
    -------
    StableTimestep
        Time, infinite for a packing without contacts. `error` is that of Arnoldi's iteration, an estimate, and 0 for a
        given omega_max. Steps below `certain` are stable whatever the iteration has missed.

    Raises
    ------
    scipy.sparse.linalg.ArpackError
        If the iteration does not converge.
    """
    if not isinstance(of, Packing | Snapshot):
        return StableTimestep(2.0 / of)
    if stiffness is None:
        stiffness = stiffness_matrix(of)
    if not stiffness.nnz:
        return StableTimestep(np.inf)
    if damping is None and of.damped:
        damping = damping_matrix(of)
    scale = 1.0 / np.sqrt(coordinate_mass(of))
    found = (_of_all_eigenvalues if len(scale) <= FEW else _of_arnoldi)(scale, stiffness, damping)
    # rounding may take the limit below the bound where the two are the same
    return StableTimestep(found, found.error, min(float(found), 2.0 / _largest_mu(scale, stiffness, damping)))


def _largest_mu(scale: Floats, stiffness: csr_array, damping: csr_array | None) -> float:
    """What mu does not exceed, by the largest sums of rows, 1 / time."""
    k, c = (0.0 if matrix is None else float(np.max(scale * (abs(matrix) @ scale))) for matrix in (stiffness, damping))
    return 0.5 * (c + float(np.sqrt(c * c + 4 * k)))


def _of_all_eigenvalues(scale: Floats, stiffness: csr_array, damping: csr_array | None) -> StableTimestep:
    """2/mu by LAPACK."""
    weight = np.outer(scale, scale)
    a = weight * stiffness.toarray()
    if damping is None:
        return StableTimestep(2.0 / float(np.sqrt(np.abs(eigvals(a)).max())))
    one = np.eye(len(scale))
    pencil = np.block([[weight * damping.toarray(), a], [one, np.zeros_like(one)]])
    return StableTimestep(2.0 / float(eigvals(pencil).real.max()))


def _of_arnoldi(scale: Floats, stiffness: csr_array, damping: csr_array | None) -> StableTimestep:
    """2/mu by Arnoldi's iteration, with the residual as its error."""
    size = len(scale)
    tolerance = LIMIT_OF_MANY if size > MANY else LIMIT_OF_FEW
    vector = np.random.Generator(np.random.PCG64(0)).standard_normal(size)
    mu = off = change = 0.0
    # without dashpots the first look is the last; with them it is at K alone, and rough
    for look in range(LOOKS + 1 if damping is not None else 1):
        matrix = stiffness if damping is None or look == 0 else _sum_of(stiffness, mu, damping)

        def product(x: Floats, matrix: csr_array = matrix) -> Floats:
            return np.asarray(scale * (matrix @ (scale * x.reshape(size))))

        operator = LinearOperator((size, size), matvec=product, dtype=np.float64)
        rough = damping is not None and look == 0
        (value,), vectors = eigs(operator, 1, which="LM", v0=vector, tol=0.1 if rough else tolerance, ncv=12)
        real = abs(value.imag) < 1e-3 * abs(value)
        vector = np.ascontiguousarray(vectors[:, 0].real if real else vectors.sum(axis=1).real)
        residual = product(vectors[:, 0].real) + 1j * product(vectors[:, 0].imag) - value * vectors[:, 0]
        off = float(np.linalg.norm(residual) / abs(value))
        if damping is None:
            mu = float(np.sqrt(abs(value)))
            break
        # mu^2 = lambda + c (mu - before), c being the slope of lambda in mu, but for what is not symmetric
        moved = scale * vector
        c = float(moved @ (damping @ moved)) / float(vector @ vector)
        before, mu = mu, 0.5 * (c + float(np.sqrt(c * c + 4 * abs(abs(value) - c * mu))))
        change = abs(mu - before) / mu
        if change < tolerance:
            break
    return StableTimestep(2.0 / mu, 2.0 / mu * (0.5 * off + change))


def _sum_of(stiffness: csr_array, mu: float, damping: csr_array) -> csr_array:
    """K + mu C; those of a Snapshot have their numbers in the same places, and a tenth of the time is enough."""
    if np.array_equal(stiffness.indptr, damping.indptr) and np.array_equal(stiffness.indices, damping.indices):
        data = stiffness.data + mu * damping.data
        return csr_array((data, stiffness.indices, stiffness.indptr), shape=stiffness.shape)
    return stiffness + mu * damping
