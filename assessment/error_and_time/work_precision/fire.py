"""The fast inertial relaxation engine of Bitzek et al., Phys. Rev. Lett. 97, 170201 (2006)."""

from collections.abc import Callable

import numpy as np

from ....analysis.packing.packing import Floats


def fire(
    force: Callable[[Floats], Floats], start: Floats, longest: float, tolerance: float, most: int = 20_000
) -> tuple[Floats, int]:
    """A root of F by the fast inertial relaxation engine, unit masses, with the parameters of its authors.

    Parameters
    ----------
    force : callable
        F(q), shape (n,) to (n,).
    start : ndarray, shape (n,)
        Where to begin, at rest.
    longest : float
        Longest time step; a tenth of it is the first.
    tolerance : float
        Largest component of F to end at.
    most : int
        Evaluations after which it ends in any case.

    Returns
    -------
    tuple of ndarray and int
        q, and the number of evaluations of F.
    """
    position, velocity = start.copy(), np.zeros_like(start)
    step, mixing, downhill = 0.1 * longest, 0.1, 0
    now, evaluations = force(position), 1
    while np.abs(now).max() > tolerance and evaluations < most:
        if velocity @ now > 0:
            velocity = (1 - mixing) * velocity + mixing * np.linalg.norm(velocity) / np.linalg.norm(now) * now
            downhill += 1
            if downhill > 5:
                step, mixing = min(1.1 * step, longest), 0.99 * mixing
        else:
            velocity[:], step, mixing, downhill = 0.0, 0.5 * step, 0.1, 0
        velocity = velocity + step * now
        position = position + step * velocity
        now, evaluations = force(position), evaluations + 1
    return position, evaluations
