r"""Shares and distributions of a sample, with intervals.

Shares have Wilson's 95 % interval. Onsets beyond the last load of a ramp are right-censored; their distribution is that
of Kaplan and Meier, in which a packing counts up to its last load. (The assumption is that packings that begin to flow
are like the others; their number is given with each result.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..analysis.arrays import Floats

Bools = NDArray[np.bool_]

DRAWS = 2000
"""Resampled packings of which an interval is made."""


def share(count: int, of: int, unknown: int = 0) -> dict[str, Any]:
    """count/of with Wilson's interval: {"count", "of", "share", "low", "high"}, the last three None for of = 0.

    Of `unknown` more of these it is not known whether they count: the interval is that of none and of all of them.
    """
    if of == 0:
        return {"count": 0, "of": 0, "share": None, "low": None, "high": None}
    from scipy.stats import binomtest  # half a second to import

    low, high = (binomtest(k, of).proportion_ci(0.95, method="wilson") for k in (count, count + unknown))
    return {"count": count, "of": of, "share": count / of, "low": float(low.low), "high": float(high.high)}


def median(values: Sequence[float] | Floats) -> list[float]:
    """Median with its 95 % interval from resampled packings: [median, low, high]; inf without a bound."""
    values = np.sort(np.asarray(values, dtype=float))
    if len(values) == 0:
        return [np.nan] * 3
    low, high = (values[place] for place in _ends_of_median(len(values)))
    return [float(each) for each in (values[len(values) // 2], low, high)]


@cache
def _ends_of_median(size: int) -> tuple[int, int]:
    """Places in a sorted sample of a size between which the medians of 95 % of the resampled samples are."""
    chosen = np.random.default_rng(0).integers(size, size=(DRAWS, size))
    middles = np.sort(np.partition(chosen, size // 2, axis=1)[:, size // 2])
    return int(middles[int(0.025 * DRAWS)]), int(middles[int(0.975 * DRAWS)])


def sign_test(strong: Mapping[str, Any], weak: Mapping[str, Any]) -> bool | None:
    """Whether the second of two ramps, "ends" and "reach", has the lower onset; None if either may have it.

    A packing that is unstable at F_x = 0 with both has no onset on the ramp, and tells nothing.
    """
    if strong["reach"] == weak["reach"] == 0:
        return None
    if weak["ends"] == "onset" and weak["reach"] < strong["reach"]:
        return True
    # the weak one has none up to there, or a later one
    return False if strong["ends"] == "onset" and strong["reach"] <= weak["reach"] else None


def distribution(reach: ArrayLike, found: ArrayLike) -> tuple[Floats, Floats]:
    """Kaplan and Meier's distribution of F_x^c.

    Parameters
    ----------
    reach : array_like, shape (M,)
        The onset, or the largest F_x up to which there is none.
    found : array_like of bool, shape (M,)
        Whether it is the onset.

    Returns
    -------
    fx, probability : ndarray, shape (n,)
        Onsets, and the share of packings up to each.
    """
    reach, found = np.asarray(reach, dtype=float), np.asarray(found, dtype=bool)
    if not found.any():
        return np.empty(0), np.empty(0)
    from scipy.stats import CensoredData, ecdf

    steps = ecdf(CensoredData.right_censored(reach, ~found)).cdf
    rises = np.diff(steps.probabilities, prepend=0.0) > 0
    return steps.quantiles[rises], steps.probabilities[rises]


def course(reach: ArrayLike, found: ArrayLike) -> tuple[Floats, Floats]:
    """The distribution as a step curve, from zero to the largest F_x in the data."""
    fx, probability = distribution(reach, found)
    levels = np.concatenate([[0.0], probability])
    return np.concatenate([[0.0], fx, [np.max(reach)]]), np.append(levels, levels[-1])


def quartiles(reach: ArrayLike, found: ArrayLike) -> list[float | None]:
    """Lower quartile, median and upper quartile of F_x^c; None if they lie beyond the last loads of the ramps."""
    fx, probability = distribution(reach, found)
    # 3/4 from products of shares may miss 3/4 by its rounding
    places = np.searchsorted(probability, np.array([0.25, 0.5, 0.75]) - 1e-12)
    return [float(fx[place]) if place < len(fx) else None for place in places]
