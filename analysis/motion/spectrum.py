r"""Eigenvalues of the stability operator, and the test whether a complex pair is physical or rounding noise.

Small motion about an equilibrium obeys :math:`M \ddot q = -K q` with :math:`M = \mathrm{diag}(m, m, I_0 m)`
in the coordinates (x, y, R theta), so :math:`q \propto v e^{i\omega t}` with

.. math:: K v = \lambda M v, \qquad \omega = \sqrt\lambda .

All vectors here are in the mass-weighted coordinates :math:`M^{1/2} q`, in which the operator is :math:`A = M^{-1/2} K
M^{-1/2}`. A is symmetric if K is symmetric, and then every eigenvalue has condition number one.

K is not symmetric, and real eigenvalues may coalesce and leave the axis as a pair
:math:`\lambda = \lambda_R \pm i\lambda_I`. One motion of each pair grows as :math:`e^{|\mathrm{Im}\,\omega| t}`, and
the mean square displacement as the square of that: "growth rate" means :math:`2 |\mathrm{Im}\,\omega|` throughout. A
real :math:`\lambda < 0` is the classical instability (:mod:`~faultgouge.analysis.motion.buckling`). A packing is
linearly stable only if it has neither complex pairs nor negative eigenvalues.

**Noise.** A backward stable solver returns the eigenvalues of :math:`A + E` with :math:`|E| \sim u |A|`, u
the unit roundoff, and a simple eigenvalue with unit right and left vectors x, y moves by :math:`\kappa |E|`,
:math:`\kappa = 1/|y^H x|`. Close to a coalescence :math:`\kappa \to \infty` as one over the distance of the
pair, so that a double real eigenvalue turns into a spurious complex pair of size :math:`(u |A| c)^{1/2}`, far above
:math:`u |A|`; c is the difference of the couplings of the two modes. A pair is therefore accepted only if
:math:`|\lambda_I|` exceeds a safety factor times its own :math:`\kappa u |A|`; the other pairs are counted as noise.

**Time steps.** Velocity Verlet with step dt turns the frequency of a frozen K into :math:`\Omega`,

.. math::

    \cos \Omega\, dt = 1 - \tfrac12 \lambda\, dt^2, \qquad\text{or}\qquad
    \sin\tfrac12\Omega\, dt = \tfrac12 \sqrt\lambda\, dt,

exactly and for complex :math:`\lambda` too: real eigenvalues below :math:`4/dt^2` neither grow nor decay.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eig, eigvals
from scipy.sparse import csr_array
from scipy.sparse.linalg import eigs

from ..counted import counted
from ..errors import BadInputError
from ..has_configuration import HasConfiguration
from ..operators.stiffness import stiffness_matrix
from ..packing.disk_operators import Form
from ..packing.packing import Floats, Indices
from ..table_display import TableDisplay
from .all_eigenvalues import all_eigenvalues
from .eigenvalues import (
    SAFETY,
    Complexes,
    active_coordinates,
    is_negative,
    is_zero,
    mass_weighted,
    operator_rounding,
    zero_uncertainties,
    zero_uncertainty,
)
from .modes import Mode, Modes, growth_rate
from .motion import Motion
from .no_verdict import no_verdict

SLICED = 2000
"""Coordinates beyond which `spectrum` takes the eigenvalues of K in slices. Of 870 coordinates of disks LAPACK takes
0.8 of the time of slices, of 900 of spheres 0.4, and of 2,910 of disks 3.4 times as long."""

DENSE_LARGEST = 900
"""Coordinates up to which all eigenvalues are computed to know the largest: a second, as `spectrum` does it anyway."""

LIMIT = 1e-4
"""Relative error of the largest eigenvalue of more coordinates. It bounds time steps, that are far below the bound; to
resolve the fastest modes of a crystal, which lie close together, takes ten times as long."""


@dataclass(frozen=True, eq=False)
class Spectrum(TableDisplay):
    """All eigenvalues of a packing's stability operator.

    Attributes
    ----------
    eigenvalues : ndarray of complex, shape (E,)
        Sorted by real part, then imaginary part; 1 / time^2. Rattlers and other coordinates on which no force acts are
        left out.
    pairs : tuple of Mode
        The complex pairs that exceed their own rounding uncertainty, fastest growing first.
    negative : ndarray, shape (B,)
        The real negative eigenvalues beyond their own uncertainty, the most negative first, 1 / time^2.
    noise_pairs : int
        Number of computed complex pairs that do not exceed their rounding uncertainty.
    rattlers : ndarray of int
        Disks that touch nothing.
    rounding : float
        u |A|_F, 1 / time^2: uncertainty of a perfectly conditioned eigenvalue.
    free : int
        Number of eigenvalues that are zero within the uncertainty of zero, of their own modes where these are known,
        and not negative: no force opposes such a motion, which drifts.
    packing : Configuration or Packing
        Whose eigenvalues they are.
    """

    eigenvalues: Complexes
    pairs: tuple[Mode, ...]
    negative: Floats
    noise_pairs: int
    rattlers: Indices
    rounding: float
    free: int
    packing: HasConfiguration

    def __repr__(self) -> str:
        pairs, negative = counted(len(self.pairs), "complex pair"), counted(len(self.negative), "negative eigenvalue")
        counts = f"{pairs} and {negative}" if len(self.negative) else pairs
        grows = f", D as exp({self.growth_rate():.6g} t)" if len(self.unstable) else ""
        verdict = {None: "eigenvalues do not decide", True: "no motion grows", False: "unstable"}[self.is_stable]
        if doubts := "; ".join(no_verdict(self.packing.configuration)):
            verdict = f"not known whether the packing is stable: {doubts}"
        numbers = f"{counted(len(self.eigenvalues), 'eigenvalue')} of K, {counted(len(self.rattlers), 'rattler')}"
        return f"<Spectrum: {verdict} (`stability` says more); K alone has {counts}{grows}; {numbers}>"

    def _rows(self) -> dict[str, str]:
        rows = dict[str, str]()
        for pair in self.pairs:
            shares = f"participation {pair.participation:.3f}, rotation {pair.rotation:.3f}"
            value = f"{pair.eigenvalue.real:.10g} \u00b1 {pair.eigenvalue.imag:.6g} i"
            rows[value] = f"2 |Im \u03c9| = {pair.growth_rate:.6g}, {shares}"
        rows |= {f"{value:.10g}": f"2 |Im \u03c9| = {growth_rate(value):.6g}, negative" for value in self.negative}
        return rows or {"complex pairs and negative eigenvalues of K": "none"}

    @cached_property
    def is_stable(self) -> bool | None:
        """Whether no motion grows beyond rounding, with the packing's dissipation.

        Where contacts have one derivative while they close and another while they part, K has the mean of both, and
        vibration carries particles on in a packing in which no motion grows: :func:`~faultgouge.analysis.stability`
        says how far.

        None where contacts at Coulomb's bound slide on ahead and stick on the way back: no eigenvalue decides, and
        :func:`~faultgouge.analysis.stability` follows their motion. None, too, where no verdict is possible, as of a
        packing that moves.
        """
        from .linear import linear_verdict

        c = self.packing.configuration
        if any(no_verdict(c)) or c.contacts.one_sided.any():
            return None
        return linear_verdict(Motion.of(c)).stable if c.damped else not len(self.unstable)

    @property
    def least_q(self) -> float:
        """Smallest |Re omega| / (2 |Im omega|) of the pairs, or inf: a lower quality factor stops all growth."""
        return min((pair.quality for pair in self.pairs), default=np.inf)

    @property
    def omega_max(self) -> float:
        """Largest |omega|, radian / time; zero for a packing without contacts."""
        return float(np.sqrt(np.abs(self.eigenvalues).max(initial=0.0)))

    @property
    def unstable(self) -> Complexes:
        """Eigenvalues whose motion grows: one of each complex pair beyond noise, and the negative eigenvalues."""
        return np.concatenate([[pair.eigenvalue for pair in self.pairs], self.negative]).astype(np.complex128)

    def growth_rate(self, dt: float | None = None) -> float:
        """Rate at which D of an undamped run will grow, 1 / time.

        Parameters
        ----------
        dt : float, optional
            Time step of velocity Verlet, to include its dispersion; exact dynamics by default.

        Returns
        -------
        float
            The largest 2 |Im omega|; zero for a stable packing.
        """
        omega = np.sqrt(self.unstable) if dt is None else discrete_frequency(self.unstable, dt)
        return float(2 * np.abs(omega.imag).max(initial=0.0))


def dynamical_matrix(packing: HasConfiguration, form: Form = "consistent") -> tuple[csr_array, Indices]:
    """A = M^(-1/2) K M^(-1/2) without its zero rows.

    Parameters
    ----------
    packing : Packing
        The configuration.
    form : {"consistent", "paper"}
        As in :func:`~faultgouge.analysis.stiffness_matrix`.

    Returns
    -------
    matrix : scipy.sparse.csr_array, shape (E, E)
        1 / time^2.
    active : ndarray of int, shape (E,)
        The coordinates (x.., y.., R theta..) of the rows. Coordinates with a zero row of K are left out: no force acts
        on them, and their eigenvalue is zero.
    """
    matrix = mass_weighted(stiffness_matrix(packing, form), packing)
    active = active_coordinates(matrix)
    return matrix[active][:, active], active


def eigenvalues(packing: HasConfiguration, form: Form = "consistent") -> Complexes:
    """Compute every eigenvalue without vectors, by LAPACK's dense solver, in a third of the time of :func:`spectrum`.

    Without vectors it is not known which complex pairs exceed their rounding uncertainty.

    Parameters
    ----------
    packing, form
        As in :func:`spectrum`.

    Returns
    -------
    ndarray of complex, shape (E,)
        Sorted by real part, then imaginary part, 1 / time^2. Coordinates that feel no force are left out.
    """
    dense = dynamical_matrix(packing, form)[0].toarray()
    return _sorted(eigvals(dense.T, overwrite_a=True, check_finite=False))


def _sorted(values: Complexes) -> Complexes:
    return np.asarray(values[np.lexsort((values.imag, values.real))], dtype=np.complex128)


def spectrum(packing: HasConfiguration, form: Form = "consistent") -> Spectrum:
    """Compute every eigenvalue, and left and right vectors of those that are complex or negative.

    LAPACK's dense solver serves up to `SLICED` coordinates. Beyond, :mod:`~faultgouge.analysis.motion.all_eigenvalues`
    takes one slice of the spectrum after the other.

    Parameters
    ----------
    packing : Packing or Configuration
        The configuration. The result describes stability only if it is in equilibrium.
    form : {"consistent", "paper"}
        As in :func:`~faultgouge.analysis.stiffness_matrix`.

    Returns
    -------
    Spectrum

    Raises
    ------
    SpectrumError
        If the slices of a large packing are incomplete.

    Examples
    --------

    >>> start = faultgouge.settle("three_disks.toml").packing
    >>> found = faultgouge.spectrum(start)
    >>> len(found.pairs), len(found.negative), len(found.rattlers)
    (0, 0, 0)
    >>> found.eigenvalues[:3].real.round(3)
    array([ 383.589, 1188.882, 1484.786])
    """
    with np.errstate(over="ignore", invalid="ignore"):
        matrix, active = dynamical_matrix(packing, form)
        rounding = operator_rounding(packing, matrix.data)
    if not np.isfinite(rounding):
        raise BadInputError("Stiffnesses overflow, and nothing can be said: take units in which numbers are smaller.")
    alike = zero_uncertainty(packing, rounding)
    values, marked = _values_and_vectors(matrix, SAFETY * rounding, alike)
    overlap, particle = marked.overlap, active % len(packing.configuration)
    zero = zero_uncertainties(packing, rounding, particle, marked.left, marked.right)
    below = is_negative(marked.values, overlap, rounding, zero)
    resists = below | ~is_zero(marked.values, overlap, alike, zero)
    drift = np.count_nonzero(np.abs(values) <= alike) - np.count_nonzero(resists & (np.abs(marked.values) <= alike))
    below &= marked.values.imag >= 0
    negative = np.sort(np.repeat(marked.values[below].real, np.where(marked.values[below].imag > 0, 2, 1)))
    noise = int(np.count_nonzero(marked.values.imag > 0))
    grows = np.flatnonzero(marked.values.imag * overlap > SAFETY * rounding)
    growing = replace(marked.chosen(grows).placed(active, packing.coordinates), axes=packing.axes)
    numbers = growing.values, overlap[grows], growing.participation, growing.rotation
    pairs = [Mode(*each) for each in zip(*(each.tolist() for each in numbers), strict=True)]
    pairs.sort(key=lambda pair: -pair.growth_rate)
    return Spectrum(
        _sorted(values), tuple(pairs), negative, noise_pairs=noise - len(pairs),
        rattlers=packing.rattlers, rounding=rounding, free=int(drift), packing=packing,
    )  # fmt: skip


def _values_and_vectors(matrix: csr_array, rounding: float, alike: float) -> tuple[Complexes, Modes]:
    """All eigenvalues, and with vectors at least those that are complex, or negative beyond rounding, or up to `SLICED`
    coordinates zero by forces out of balance."""
    if matrix.shape[0] > SLICED:
        return all_eigenvalues(matrix)
    dense = matrix.toarray()
    # vectors take three times as long as eigenvalues: a large packing under a load has complex pairs, and needs both
    if len(dense) <= DENSE_LARGEST or (matrix != matrix.T).nnz == 0:
        values = eigvals(dense)
        doubtful = (values.imag != 0) | (values.real < -rounding) | ((values.real > rounding) & (values.real <= alike))
        if not doubtful.any():
            return values, Modes.none(len(dense))
    values, left, right = eig(dense, left=True)
    return values, Modes(values, right, left)


def discrete_frequency(eigenvalue: ArrayLike, dt: float) -> Complexes:
    """Frequency that velocity Verlet gives to a mode of a frozen operator.

    Parameters
    ----------
    eigenvalue : array_like of complex
        lambda, 1 / time^2.
    dt : float
        Time step.

    Returns
    -------
    ndarray of complex
        Omega, radian / time, with cos(Omega dt) = 1 - lambda dt^2 / 2 and Re Omega >= 0.
    """
    # By the half angle, since 1 - lambda dt^2/2 loses the digits of a small lambda dt^2.
    root = np.sqrt(np.asarray(eigenvalue, dtype=np.complex128))
    return np.asarray(2.0 / dt * np.arcsin(0.5 * dt * root), dtype=np.complex128)


def largest_frequency(packing: HasConfiguration) -> float:
    """omega_max = max sqrt|lambda|; to `LIMIT`, by Arnoldi's iteration (ARPACK), beyond `DENSE_LARGEST` coordinates.

    Returns
    -------
    float
        Radian / time; zero for a packing without contacts.

    Raises
    ------
    scipy.sparse.linalg.ArpackError
        If the iteration does not converge.
    """
    matrix, _ = dynamical_matrix(packing)
    if matrix.shape[0] <= DENSE_LARGEST:
        return spectrum(packing).omega_max
    # always the same one, for a result that is reproducible; without the symmetry that a crystal's fastest mode lacks
    start = np.random.Generator(np.random.PCG64(0)).standard_normal(matrix.shape[0])
    largest = eigs(matrix, 1, which="LM", v0=start, tol=LIMIT, return_eigenvectors=False)
    return float(np.sqrt(np.abs(largest).max()))
