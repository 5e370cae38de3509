r"""The fastest growing motion of an operator of any size, by products with matrices alone.

The state :math:`u = (\sqrt L\, z, \dot z)`, with the largest eigenvalue L of A, obeys :math:`\dot u = Z u`. In

.. math:: e^{\tau Z} = \sum_k c_k J_k(\tau \sqrt L)\, P_k(Z/\sqrt L), \qquad P_{k+1} = 2 Z P_k / \sqrt L + P_{k-1},

with Bessel functions and :math:`c_0 = 1, c_k = 2` (Tal-Ezer and Kosloff, J. Chem. Phys. 81, 3967 (1984)), a motion is
:math:`e^{s \tau}`, of modulus 1 at the most unless it grows. Dissipation makes the terms larger than the sum, so that
:math:`\tau` is short where dissipation is strong. A Krylov space of a power of this has what grows most first; s is
that of the projection of Z on what stands out, with the residual of Z itself. The time is tripled as long as nothing
has grown enough to be seen. Memory is proportional to the number of coordinates, and the computing time to the number
of coordinates and of products.

**Without convergence.** If many motions grow nearly alike, the search may end before it has converged. That motion
grows is then certain, but the eigenvalues of a mixture of motions may be wrong by a factor of two. So the mixture is
followed for some more times t. It grows nearly as fast as its fastest motion, and never faster: its rate is a lower
bound.

**What is left out.** After j vectors a motion whose share in the random start is not below :math:`\delta / \sqrt n`
appears with an error of 1 % where :math:`e^{j\, \mathrm{Re}\, s\, t}` is :math:`200 \sqrt n / \delta`. With
:math:`\delta = 10^{-3}` nothing else grows at a rate of more than about 3/t, in the square of the amplitude. This
counts every motion as well conditioned; and a start may be unlucky with the probability :math:`\delta`. So this is no
proof.
"""

from collections.abc import Callable

import numpy as np
from scipy.linalg import eig, qr
from scipy.sparse import csr_array
from scipy.sparse.linalg import eigs

from ..arrays import Floats
from ..errors import BadInputError
from ..factors.lanczos import BlockKrylov
from ..progress import report_progress
from .eigenvalues import Linear
from .random_state import CHANCE

FIRST_VECTORS, MOST_VECTORS, MORE = 12, 30, 3
"""Vectors of the space before its eigenvalues are looked at, at the most, and between two looks."""

TRIPLE = 3.0
"""Factor from one time to the next."""

EIGENVALUE_MARGIN = 1.03
"""By how much the largest eigenvalue is taken larger, of which Arnoldi's iteration misses a hundredth."""

APPEARS = 1e-2
"""Error with which a motion appears in a space."""

CONVERGED, SURELY = 1e-5, 10.0
"""Relative residual of s with which the search ends, and growth over what a larger residual may change that is one."""

FOLLOWED = 4
"""Times t that a mixture is followed; it grows evenly after the first."""

CANCELLATION = 12.0
"""Logarithm of the largest term of the exponential over the sum: five digits are lost."""


def fastest_growing(
    stiffness: csr_array, damping: csr_array | None = None, periods: tuple[float, float] = (30.0, 1000.0)
) -> Linear:
    """Find the fastest growing motion.

    Parameters
    ----------
    stiffness : scipy.sparse.csr_array or bsr_array, shape (n, n)
        A = M^(-1/2) K M^(-1/2), 1 / time^2, of the coordinates that feel a force.
    damping : scipy.sparse.csr_array or bsr_array, shape (n, n), optional
        G = M^(-1/2) C M^(-1/2), 1 / time.
    periods : tuple of (float, float)
        The first and the longest time that is looked at, in periods of the fastest motion. What grows more slowly than
        about 3 over the longest time is not looked for.

    Returns
    -------
    Linear
        Unstable, or not known; then nothing is likely to grow at a rate above `searched`.

    Raises
    ------
    BadInputError
        If the times are out of range, or the operator is too small to need products.

    Examples
    --------
    >>> from scipy.sparse import csr_array, diags_array
    >>> found = fastest_growing(csr_array(diags_array([-0.25, *range(1, 40)])))
    >>> found.stable, round(found.growth_rate, 6)
    (False, 1.0)
    """
    size = stiffness.shape[0]
    if not 0 < periods[0] <= periods[1]:
        raise BadInputError(f"{periods[0]:g} to {periods[1]:g} periods are not ascending: give times above zero.")
    if size <= 8:
        raise BadInputError(f"An operator of {size} coordinates is for `spectrum`: products serve more than 8.")
    start = np.random.default_rng(0).standard_normal(size)
    largest = eigs(stiffness, 1, which="LM", v0=start, tol=1e-2, ncv=min(24, size), return_eigenvectors=False)
    frequency = float(np.sqrt(EIGENVALUE_MARGIN * abs(largest[0])))
    # no motion loses more than the largest sum of a row
    loss = 0.0 if damping is None else float(abs(damping).sum(axis=1).max()) / frequency

    def product(u: Floats) -> Floats:
        force = stiffness @ u[:size]
        force *= -1 / frequency
        if damping is not None:
            force -= damping @ u[size:]
        return np.concatenate([frequency * u[size:], force])

    length, first = periods[0], np.random.default_rng(0).standard_normal(2 * size)
    while True:
        time = 2 * np.pi * length / frequency
        report_progress(f"what grows within {length:.0f} periods of the fastest motion")
        onward = _exponential(product, frequency, loss, time)
        krylov = BlockKrylov(onward, first[None], MOST_VECTORS)
        wanted = FIRST_VECTORS
        while True:
            krylov.extend(wanted)
            theta, small = eig(krylov.square)
            # the rate, over the amplitude, of a motion that stands out
            visible = float(np.log(2 * np.sqrt(2 * size) / (CHANCE * APPEARS))) / krylov.used / time
            out = np.flatnonzero(np.abs(theta) > np.exp(visible * time))
            out = out[np.argsort(-np.abs(theta[out]))][:8]
            basis = krylov.basis[: krylov.used].T @ _real_basis(small[:, out])
            image = product(basis) if len(out) else basis
            s, x = eig(basis.T @ image) if len(out) else (np.zeros(0, complex), np.zeros((0, 0), complex))
            residuals = np.linalg.norm(image @ x - (basis @ x) * s, axis=0)
            grows = np.flatnonzero((s.real > visible) & (s.imag >= 0) & (s.real > SURELY * residuals))
            grows = grows[np.argsort(-s[grows].real)]
            found = len(grows) and residuals[grows[0]] <= CONVERGED * abs(s[grows[0]])
            if found or krylov.full or not len(out):
                break
            wanted = krylov.used + MORE
        if found:
            fastest = grows[0]
            return Linear(False, 2 * float(s[fastest].real), 2 * float(residuals[fastest]), s=complex(s[fastest]))
        if length == periods[1]:
            break
        length = min(TRIPLE * length, periods[1])
        if len(out):  # what has grown most so far is where the longer time begins
            first = np.sqrt(2 * size) * basis[:, 0] + np.random.default_rng(1).standard_normal(2 * size)
    if not len(grows):
        return Linear(None, 0.0, searched=2 * visible)
    mixture, sizes = basis @ x[:, grows[0]], []
    columns = np.column_stack([mixture.real, mixture.imag])
    for _ in range(FOLLOWED):
        columns = onward(columns / np.linalg.norm(columns))
        sizes.append(float(np.linalg.norm(columns)))
    least = 2 * np.log(min(sizes[1:])) / time
    if least <= 0:
        return Linear(None, 0.0, searched=2 * visible)
    s = complex(0.5 * least, s[grows[0]].imag)
    return Linear(False, least, least, s=s, at_least=True, searched=2 * visible)


def _exponential(
    product: Callable[[Floats], Floats], frequency: float, loss: float, time: float
) -> Callable[[Floats], Floats]:
    """exp(t Z) of columns, with the loss as a share of the largest frequency."""
    from scipy.special import jv

    # the terms of one sum go up to exp(loss tau sqrt(L)), as the generating function of J_k says
    steps = int(np.ceil(time * frequency / min(30.0, CANCELLATION / max(loss, 1e-3))))
    argument = time * frequency / steps
    order = np.arange(int(4 * (1 + loss) * argument) + 60)
    weight = 2 * jv(order, argument)
    weight[0] /= 2
    # an eigenvalue of Z / sqrt(L) of modulus 1 or `loss` makes a term so much larger
    ellipse = np.exp(np.minimum(order * np.arcsinh(loss), 600.0))
    weight = weight[: int(np.flatnonzero(np.abs(weight) * ellipse > 1e-15)[-1]) + 1]

    def apply(columns: Floats) -> Floats:
        for _ in range(steps):
            before, now = columns, product(columns) / frequency
            total = weight[0] * before + weight[1] * now
            for each in weight[2:]:
                before, now = now, (2 / frequency) * product(now) + before
                total += each * now
            columns = total
        return columns

    return apply


def _real_basis(vectors: Floats) -> Floats:
    """An orthonormal basis of the real and the imaginary parts of vectors."""
    if vectors.shape[1] == 0:
        return np.zeros(vectors.shape)
    basis, triangle, _ = qr(np.concatenate([vectors.real, vectors.imag], axis=1), mode="economic", pivoting=True)
    return np.asarray(basis[:, np.abs(np.diag(triangle)) > 1e-10 * abs(triangle[0, 0])])
