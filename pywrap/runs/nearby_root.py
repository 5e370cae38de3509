"""Find a nearby root of a function of the load: by a slope, by secants, or by bisection at a jump."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

SECANT_STEPS = 8
"""Secant steps to the onset on the other path; two or three do."""

WIDENINGS = 20
"""Factors of two between the half of an increment and the smallest step in which a jump is looked for."""

NOISE_IN_ROUNDINGS = 10
"""Rounding errors about which the last of the secant steps may still jump."""

SLOPE_TOLERANCE = 1e-3
"""Distance of a root, in half increments, up to which the slope of what vanishes is the same on all paths: both its
curvature and the paths' difference change the slope by about this share."""

SECANT_TOLERANCE = 0.02
"""Last secant step, in units of the shift, at which the shift is known: it only has to tell the size of an error."""


def nearby_root(
    function: Callable[[float], float], fx: float, rounding: float, reach: float, slope: float | None
) -> tuple[float, float | None]:
    """The load nearest to fx, known to a share of its distance, at which a function changes its sign, and its slope.

    By the slope of the function on another path, if that is known and the load is near; else by secants or, where the
    function jumps there, by halving.

    Parameters
    ----------
    function : callable
        Takes a load, force.
    fx, rounding, reach : float
        Where to begin, how uncertain the root is from rounding, and how far it may be, force.
    slope : float or None
        Of the function on another path, its unit / force.

    Returns
    -------
    tuple of float and float or None
        The load, nan beyond the reach; and the slope, None at a jump.
    """
    at = cache(function)
    if slope and abs(at(fx) / slope) < SLOPE_TOLERANCE * reach:
        return fx - at(fx) / slope, slope
    found = _secant(at, fx, rounding, reach)
    if np.isnan(found):
        return _bracket_root(at, fx, rounding, reach), None
    step = _first_step(fx, rounding)
    return found, (at(fx + step) - at(fx)) / step


def _bracket_root(function: Callable[[float], float], fx: float, rounding: float, reach: float) -> float:
    """Steps to either side of fx grow until the sign changes; the last is halved."""
    sign, near, far = np.sign(function(fx)), 0.0, max(NOISE_IN_ROUNDINGS * rounding, reach * 2.0**-WIDENINGS)
    while far <= reach:
        for side in (-1.0, 1.0):
            if np.sign(function(fx + side * far)) == sign:
                continue
            low, high = near, far
            while high - low > max(SECANT_TOLERANCE * high, rounding):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if np.sign(function(fx + side * middle)) == sign else (low, middle)
            return fx + side * high
        near, far = far, 4 * far
    return np.nan


def _first_step(fx: float, rounding: float) -> float:
    """Between the first two loads of a secant."""
    return max(30 * rounding, 1e-9 * fx)


def _secant(discriminant: Callable[[float], float], fx: float, rounding: float, reach: float) -> float:
    """The root of a smooth function near fx; nan where it is not found."""
    a, b = fx, fx + _first_step(fx, rounding)
    at_a, at_b = discriminant(a), discriminant(b)
    for _ in range(SECANT_STEPS):
        if at_b == at_a:
            return np.nan
        a, b, at_a = b, b - at_b * (b - a) / (at_b - at_a), at_b
        if not abs(b - fx) < reach:
            return np.nan
        if abs(b - a) <= max(SECANT_TOLERANCE * abs(b - fx), rounding):
            return b
        at_b = discriminant(b)
    return b if abs(b - a) <= NOISE_IN_ROUNDINGS * rounding else np.nan
