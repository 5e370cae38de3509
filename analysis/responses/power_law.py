"""Straight lines and power laws, fitted to measured series."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..packing.packing import Floats


@dataclass(frozen=True)
class PowerLaw:
    """A straight line through logarithms.

    Attributes
    ----------
    exponent : float
        Its slope.
    error : float
        Standard error of the slope from the scatter about the line.
    factor : float
        Value at 1.
    """

    exponent: float
    error: float
    factor: float


def fit_power_law(x: ArrayLike, y: ArrayLike) -> PowerLaw:
    """Exponent of y(x) by least squares in the logarithms.

    Parameters
    ----------
    x, y : array_like, shape (n,)
        Positive numbers, at least three.

    Returns
    -------
    PowerLaw

    Raises
    ------
    ValueError
        If there are fewer than three points, all at one x, or a number is not positive.
    """
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if x.ndim != 1 or x.shape != y.shape or len(x) < 3 or not (np.all(x > 0) and np.all(y > 0)) or np.ptp(x) == 0:
        raise ValueError("A power law needs at least three points of positive numbers, not all at one x.")
    slope, error, at_zero = fit_line(np.log(x), np.log(y))
    return PowerLaw(slope, error, float(np.exp(at_zero)))


def fit_line(x: Floats, y: Floats) -> tuple[float, float, float]:
    """Slope of y(x), its standard error from the scatter about the line, and the line's value at x = 0."""
    about = x - x.mean()
    slope = float(about @ y / (about @ about))
    scatter = y - y.mean() - slope * about
    error = float(np.sqrt(scatter @ scatter / (len(x) - 2) / (about @ about)))
    return slope, error, float(y.mean() - slope * x.mean())
