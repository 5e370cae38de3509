r"""Fits to onsets of which some lie beyond what a ramp reached.

The share of packings without an onset up to F is taken to be :math:`\exp(-(F/F_0)^k)`, Weibull's distribution; windows
that open independently at a rate that grows linearly with the load have k = 2. Over the number of disks
:math:`F_0 = c N^{-p}`. Parameters have the largest likelihood; an onset contributes its density and a packing without
one the share beyond its reach. Intervals are those of 95 % of fits to packings drawn again, with replacement, within
each size.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from faultgouge.analysis import Floats
from faultgouge.studies.statistics import Bools
from research.statistics import bootstrap_interval, resample

DRAWS = 300
"""Fits to resampled packings: the ends of an interval are then known to a tenth of its width."""


def size_law(disks: Floats, reach: Floats, found: Bools) -> dict[str, Any]:
    """The exponent p of F_0 = c N^-p and the shape k, each with its interval; N of each packing is in `disks`, (M,)."""
    (_, slope, log_shape), draws = _fits(np.log(disks), reach, found)
    exponent, k = bootstrap_interval(-slope, -draws[:, 1]), bootstrap_interval(np.exp(log_shape), np.exp(draws[:, 2]))
    return {"exponent": exponent, "shape": k, "packings": len(reach)}


def shape(reach: Floats, found: Bools) -> dict[str, Any]:
    """F_0 and k of one size, each with its interval."""
    best, draws = _fits(np.zeros(len(reach)), reach, found)
    f0, k = (bootstrap_interval(np.exp(best[column]), np.exp(draws[:, column])) for column in (0, 2))
    return {"f0": f0, "shape": k, "packings": len(reach)}


def _fits(logs: Floats, reach: Floats, found: Bools) -> tuple[Floats, Floats]:
    """The parameters of `_fit`, shape (3,), and those of resampled packings, shape (draws, 3)."""
    best = _fit(logs, reach, found)
    groups = [np.flatnonzero(logs == value) for value in np.unique(logs)]
    chosen = map(np.concatenate, resample(groups, DRAWS))
    return best, np.array([_fit(logs[c], reach[c], found[c], best) for c in chosen if found[c].sum() > len(groups)])


def _fit(logs: Floats, reach: Floats, found: Bools, start: Floats | None = None) -> Floats:
    """(ln c, slope, ln k) of the largest likelihood, ln F_0 = ln c + slope ln N; the slope is 0 for one size.

    In k, k ln c and k slope the likelihood is concave: there is one maximum.
    """
    from scipy.optimize import minimize  # slow to import

    log_reach = np.log(np.maximum(reach, np.finfo(float).tiny))
    columns = np.column_stack([log_reach, -np.ones(len(logs)), -(logs - logs.mean())])
    if np.ptp(logs) == 0:
        columns = columns[:, :2]

    def loss(parameters: Floats) -> tuple[float, Floats]:
        if parameters[0] <= 0:
            return np.inf, np.zeros(len(parameters))
        z = np.minimum(columns @ parameters, 500.0)
        slope = columns.T @ (np.exp(z) - found)
        slope[0] -= found.sum() / parameters[0]
        return float(np.exp(z).sum() - z[found].sum() - found.sum() * np.log(parameters[0])), slope

    if start is None:
        first = np.array([1.0, float(np.mean(log_reach)), 0.0])
    else:
        first = np.exp(start[2]) * np.array([1.0, start[0] + start[1] * logs.mean(), start[1]])
    k, scale, slope = [*minimize(loss, first[: columns.shape[1]], jac=True, method="BFGS").x, 0.0][:3]
    return np.array([(scale - slope * logs.mean()) / k, slope / k, np.log(k)])
