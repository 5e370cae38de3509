"""Power laws, fitted to measured series."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


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
    log_x, log_y = np.log(x), np.log(y)
    about = log_x - log_x.mean()
    slope = float(about @ log_y / (about @ about))
    scatter = log_y - log_y.mean() - slope * about
    error = float(np.sqrt(scatter @ scatter / (len(x) - 2) / (about @ about)))
    return PowerLaw(slope, error, float(np.exp(log_y.mean() - slope * log_x.mean())))
