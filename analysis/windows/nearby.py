"""The modes next to a point of the complex plane, with dissipation, without all the others."""

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigs

from ..motion.eigenvalues import active_coordinates
from .limits import LIMITS
from .space import Space
from .system import System


def nearest_mode(system: System, frequency: float) -> Space | None:
    """The mode whose s is nearest to a point of the imaginary axis, by inverse iteration; None if none is near enough.

    Parameters
    ----------
    system : System
        With dissipation, of any size.
    frequency : float
        The point, 1 / time. The mode should be closer to it than others by far, as at a crossing that is known.
    """
    shift = 1j * frequency * (1 + LIMITS.off_eigenvalue)
    inverse, active = system.inverse(shift), active_coordinates(system.stiffness)
    if inverse is None:
        return None
    start = np.zeros((system.stiffness.shape[0], 1))
    start[active, 0] = np.random.default_rng(0).standard_normal(len(active))
    guess = Space.of(system, start, start, shift)
    right, left = guess.right, guess.left
    for _ in range(LIMITS.inverse_steps):
        right, left = (inverse.solve(each, adjoint) for each, adjoint in ((right, False), (left, True)))
        right, left = right / np.linalg.norm(right), left / np.linalg.norm(left)
    return Space(system, right, left).refine(shift)


def find_growing_near(system: System, point: complex, count: int) -> list[Space]:
    """The modes that grow among those nearest to a point of the complex plane, by shift and invert with ARPACK.

    Parameters
    ----------
    system : System
        With dissipation, of any size.
    point : complex
        On the imaginary axis or beyond, 1 / time; not zero, where the disks that touch nothing have theirs.
    count : int
        How many of the nearest modes are looked at.

    Raises
    ------
    ArpackError
        If they do not converge.
    """
    shift = point * (1 + LIMITS.off_eigenvalue)
    inverse = system.inverse(shift)
    if inverse is None:
        return []
    start = np.random.default_rng(0).standard_normal(system.size).astype(complex)
    operator = LinearOperator(
        (system.size, system.size), matvec=lambda state: inverse.solve(state.reshape(-1), False), dtype=complex
    )
    values, states = eigs(operator, k=count, v0=start, tol=1e-9)
    found: list[Space] = []
    for s, x in zip(shift + 1 / values, states[: system.size // 2].T, strict=True):
        if s.real > -1e-6 * abs(s):  # else it surely loses energy
            mode = Space.of(system, x, x.conj(), s).refine(s)
            if mode is not None and mode.grows and mode.mean.imag >= 0:
                found.append(mode)
    return found


def drop_duplicates(modes: list[Space]) -> list[Space]:
    """Modes of one system, each of them once."""
    found: list[Space] = []
    for mode in modes:
        if not any(mode.equals(each) for each in found):
            found.append(mode)
    return found
