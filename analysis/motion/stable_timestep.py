r"""The largest stable time step of velocity Verlet.

Without dissipation it is :math:`2/\omega_{max}`. With dashpots it depends on the velocity that they feel. A step is

.. math:: q_{n+1} = q_n + dt\, u_n, \qquad u_{n+1} = u_n - dt\, M^{-1} (K q_{n+1} + C w_{n+1}),

with the velocity :math:`u_n` in the middle of step n. LAMMPS asks for forces when only this velocity is known, and w is
one of two:

- **half-step**: :math:`w_{n+1} = u_n`, in all granular styles of LAMMPS. Then

  .. math:: \begin{pmatrix} q \\ u \end{pmatrix}_{n+1} = \begin{pmatrix} 1 & dt \\ -dt\, A & 1 - dt\, G - dt^2 A
      \end{pmatrix} \begin{pmatrix} q \\ u \end{pmatrix}_n, \qquad A = M^{-1} K,\quad G = M^{-1} C .

- **extrapolated**: :math:`w_{n+1} = 2 u_n - v_n`, of fix dashpot/velocities in this package, with the velocity at the
  end of a step, :math:`v_n = \frac12 (u_{n-1} + u_n)`. Then :math:`w_{n+1} = \frac12 (3 u_n - u_{n-1})`, and

  .. math:: \begin{pmatrix} q_{n+1} \\ u_{n+1} \\ u_n \end{pmatrix} = \begin{pmatrix} 1 & dt & 0 \\
      -dt\, A & 1 - \frac32 dt\, G - dt^2 A & \frac12 dt\, G \\ 0 & 1 & 0 \end{pmatrix}
      \begin{pmatrix} q_n \\ u_n \\ u_{n-1} \end{pmatrix} .

With :math:`a = dt^2 x^H K x` and :math:`g = dt\, x^H C x` of an eigenvector, :math:`x^H M x = 1`, the factor z of a
step is a root of :math:`(z-1)^2 + g (z-1) + a z`, or of :math:`z (z-1)^2 + \frac12 g (3 z - 1)(z - 1) + a z^2`. For
symmetric K and C that are not negative, a and g are real and not negative. Then (Jury) no root is outside of the unit
circle if, and only if, the polynomial at z = -1 has the sign that it has at dt = 0: for :math:`a + 2 g < 4`, or
:math:`a + 4 g < 4`. So a motion begins to alternate in sign and to grow when :math:`4 M - 2 c\, dt\, C - dt^2 K`
becomes singular, with c = 1 for the half step and c = 2 for the extrapolated velocity. It follows that dt = 2/mu with
the largest mu of :math:`\mu^2 M - c \mu C - K`. Drag does not limit the step of this package, which lets velocities
decay by a factor.

Of many coordinates mu is found by Arnoldi's iteration (ARPACK) with :math:`M^{-1/2} (K + \mu C) M^{-1/2}`, whose
largest eigenvalue is :math:`\mu^2`. Masses are applied to vectors, and K + mu C is one matrix.

**What is guaranteed.** For symmetric K and C the residual of the iteration says how far an eigenvalue is, and not
that it is the largest. From a random start, m products with a symmetric matrix of n rows miss more than a share epsilon
of the largest eigenvalue with a probability below :math:`1.648 \sqrt n\, e^{-(2m - 1)\sqrt\epsilon}` (Kuczynski and
Wozniakowski, SIAM J. Matrix Anal. Appl. 13, 1094, 1992), which gives the error of the step of many coordinates.

No eigenvalue exceeds the largest sum of a row in absolute value (Gershgorin): with k and c these sums of
:math:`M^{-1/2} K M^{-1/2}` and :math:`M^{-1/2} C M^{-1/2}`, :math:`\mu \le \tfrac12 (c + \sqrt{c^2 + 4k})`. The step
2/mu of this bound is stable for certain, and shorter than the limit.
"""

import numpy as np
from scipy.linalg import eig
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, eigs

from ..arrays import derive_frozen
from ..configuration import Configuration
from ..has_configuration import HasConfiguration
from ..operators.damping import damping_matrix
from ..operators.stiffness import stiffness_matrix
from ..packing.packing import Floats

COARSE_COORDINATES, PRODUCTS = 10_000, 24
"""Coordinates from which on a time step has fewer digits, and the dimension of the space for these. Packings have many
modes near the fastest one: of 200,000 coordinates 24 products miss 0.3 % of mu^2, and 150 products miss 0.006 %. Nobody
runs so near to the limit."""

TIMESTEP_TOLERANCE = 1e-8
"""Relative error of mu^2 for a time step of fewer coordinates."""


class StableTimestep(float):
    """A time step that is the limit of stability, a float.

    Attributes
    ----------
    error : float
        How much shorter the limit may be, time.
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
    of: float | HasConfiguration, stiffness: csr_array | None = None, damping: csr_array | None = None
) -> StableTimestep:
    """The largest stable time step of velocity Verlet.

    Dashpots of this package's law feel the extrapolated velocity, all others that of the half step, as in LAMMPS.

    Parameters
    ----------
    of : float, Packing or Configuration
        omega_max, radian / time, or a configuration with its dashpots.
    stiffness, damping : scipy.sparse.csr_array, optional
        K and C of the configuration, where they are assembled already.

    Returns
    -------
    StableTimestep
        Time, infinite for a packing without contacts. `error` is 0 for a given omega_max, and the residual of Arnoldi's
        iteration for up to 10,000 coordinates. For more, and symmetric K and C, the error is a bound that holds with a
        probability of 0.999. Steps below `certain` are stable whatever the iteration has missed.

    Raises
    ------
    scipy.sparse.linalg.ArpackError
        If the iteration does not converge.
    """
    if isinstance(of, float | int | np.floating):
        return StableTimestep(2.0 / float(of))
    if stiffness is None:
        stiffness = stiffness_matrix(of)
    if not stiffness.nnz:
        return StableTimestep(np.inf)
    c = of.configuration.contacts
    if damping is None and of.damped:
        damping = damping_matrix(derive_frozen(of.configuration, drag_rate=0.0))  # drag is integrated exactly
    if damping is not None and len(c) and not c.viscous_slider.any():  # the law of this package: c = 2
        damping = 2.0 * damping
    scale = 1.0 / np.sqrt(of.coordinate_mass)
    found = _limit(scale, stiffness, damping)
    k, g = (0.0 if each is None else float(np.max(scale * (abs(each) @ scale))) for each in (stiffness, damping))
    # rounding may take the limit below the bound where the two are the same
    return StableTimestep(found, found.error, min(float(found), 4.0 / (g + float(np.sqrt(g**2 + 4 * k)))))


def rayleigh_timestep(configuration: Configuration) -> float | None:
    r"""The time step of Rayleigh's formula, of which a tenth to a third is usual in simulations of grains.

    .. math:: \frac{\pi R \sqrt{\rho/G}}{0.1631\,\nu + 0.8766}

    is the time in which a Rayleigh wave runs half around the smallest sphere (Y. Li, Y. Xu and C. Thornton, Powder
    Technol. 160, 219, 2005). The formula knows neither overlaps nor the number of contacts.

    Parameters
    ----------
    configuration : Configuration
        Spheres with Hertz's force. The shear modulus G is that of :math:`k_n' = 2 E^* \sqrt{R\delta}` of the stiffest
        contact, with equal materials, :math:`E^* = G/(1 - \nu)`, and Poisson's ratio that of
        :math:`k_t'/k_n' = 2 (1 - \nu)/(2 - \nu)`, or 0.3 where no ratio from 0 to 0.5 has this.

    Returns
    -------
    float or None
        Time; None of disks, and of contacts that are not Hertz's.
    """
    c = configuration.contacts.touching
    if configuration.dimension == 2 or not len(c) or np.any(c.normal_force <= 0):
        return None
    if np.any(np.abs(c.normal_stiffness * c.overlap / c.normal_force - 1.5) > 1e-3):  # Hertz's force has 3/2
        return None
    first, second = configuration.radius[c.i], np.where(c.wall, np.inf, configuration.radius[c.j])
    modulus = c.normal_stiffness / (2 * np.sqrt(c.overlap / (1 / first + 1 / second)))
    stiffest = int(np.argmax(modulus))
    ratio = c.tangential_stiffness[stiffest] / c.normal_stiffness[stiffest]
    nu = (2 - 2 * ratio) / (2 - ratio) if 2 / 3 <= ratio <= 1 else 0.3
    density = configuration.mass / (4 / 3 * np.pi * configuration.radius**3)
    travel = configuration.radius * np.sqrt(density / (modulus[stiffest] * (1 - nu)))
    return float(np.pi * travel[configuration.free].min() / (0.1631 * nu + 0.8766))


def _limit(scale: Floats, stiffness: csr_array, damping: csr_array | None) -> StableTimestep:
    """2/mu by the largest eigenvalue: mu^2 = lambda + c (mu - before) with the slope c; each step squares the error."""
    mu, error, change = 0.0, 0.0, np.inf
    for k in range(7):
        rough = damping is not None and k == 0  # a rough mu of K alone is where the steps begin
        matrix = stiffness if damping is None else csr_array(stiffness + mu * damping)
        value, moved, error = _largest_eigenvalue(scale, matrix, 0.1 if rough else TIMESTEP_TOLERANCE)
        slope = 0.0 if damping is None else float(moved @ (damping @ moved))
        before, mu = mu, 0.5 * (slope + float(np.sqrt(slope**2 + 4 * abs(value - slope * mu))))
        change = 0.0 if damping is None else abs(mu - before) / mu
        if not rough and change <= max(error, TIMESTEP_TOLERANCE):
            break
    return StableTimestep(2.0 / mu, 2.0 / mu * (0.5 * error + change))


def _largest_eigenvalue(scale: Floats, matrix: csr_array, tolerance: float) -> tuple[float, Floats, float]:
    """The largest eigenvalue of a matrix over the masses, its mode as displacements (of norm 1 by mass), its error."""
    size = len(scale)
    if size <= 40:  # too few for a Krylov space
        values, every = eig(np.outer(scale, scale) * matrix.toarray())
        first = int(np.argmax(np.abs(values)))
        vector = np.real(every[:, first])
        return float(abs(values[first])), scale * vector / np.linalg.norm(vector), 0.0

    def product(x: Floats) -> Floats:
        return np.asarray(scale * (matrix @ (scale * x.reshape(size))))

    start = np.random.Generator(np.random.PCG64(0)).standard_normal(size)
    # one space without restart: whatever it has found is within the tolerance
    coarse = size > COARSE_COORDINATES and tolerance == TIMESTEP_TOLERANCE
    space = {"ncv": PRODUCTS, "tol": 1.0} if coarse else {"ncv": 12, "tol": tolerance}
    operator = LinearOperator((size, size), matvec=product, dtype=np.float64)
    (value,), vectors = eigs(operator, 1, which="LM", v0=start, **space)
    real = abs(value.imag) < 1e-3 * abs(value)
    vector = np.ascontiguousarray(vectors[:, 0].real if real else vectors.sum(axis=1).real)
    if size > COARSE_COORDINATES:  # that the fastest motion is beyond the error has a probability of 1e-3
        error = (np.log(1.648 * np.sqrt(size) / 1e-3) / (2 * PRODUCTS - 1)) ** 2
    else:
        residual = product(vectors[:, 0].real) + 1j * product(vectors[:, 0].imag) - value * vectors[:, 0]
        error = np.linalg.norm(residual) / abs(value)
    return float(abs(value)), scale * vector / np.linalg.norm(vector), float(error)
