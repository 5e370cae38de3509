r"""Growth of the mean square displacement, measured in an undamped run.

The prediction for comparison is :meth:`~faultgouge.analysis.Spectrum.growth_rate`.

.. math:: D(t) = \frac1N \sum_i \left[\Delta x_i^2(t) + \Delta y_i^2(t)\right]

from the equilibrium. Above onset one complex pair takes over and
:math:`q = \mathrm{Re}\, c\, v e^{i\omega t}`, so that

.. math::

    D(t) = e^{2 |\mathrm{Im}\,\omega| t} \left[A + B \cos(2\, \mathrm{Re}\,\omega\, t + \varphi)\right],
    \qquad |B| \le A .

Close to an exceptional point v is nearly real, the motion is a standing wave, and B is nearly A: D touches zero twice a
period, and these dips would spoil a straight line through log D. The mean of D over intervals of several periods keeps
the exponential and removes the modulation, whatever its frequency: the rate is the slope of the logarithm of these
means, over intervals of equal duration.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..packing.compensated import separation
from ..packing.packing import Floats
from .power_law import fit_line

STRETCHES = 24
"""Stretches over which D is averaged: enough for an error, few enough to hold many periods each."""

NOISE_FACTOR = 1e3
"""Factor from the noise to the D from which on the fastest motion is followed: it has left the others behind there."""


@dataclass(frozen=True)
class Growth:
    """An exponential fitted to D(t).

    Attributes
    ----------
    rate : float
        Growth rate 2 |Im omega|, 1 / time.
    error : float
        Standard error of the rate from the scatter about the line.
    decades : float
        Decades of D between the first and the last stretch.
    start, end : float
        First and last time of the fit.
    """

    rate: float
    error: float
    decades: float
    start: float
    end: float


def mean_square_displacement(
    position: ArrayLike,
    reference: ArrayLike,
    box_length: float | None = None,
    low: ArrayLike | None = None,
    reference_low: ArrayLike | None = None,
) -> Floats:
    """D of one or more configurations.

    Parameters
    ----------
    position : array_like, shape (..., N, 2)
        Centres, length.
    reference : array_like, shape (N, 2)
        Centres in the equilibrium.
    box_length : float, optional
        Period along x: differences are taken to the nearest image.
    low, reference_low : array_like, optional
        Low parts of the coordinates, of the same shapes.

    Returns
    -------
    ndarray, shape (...)
        Mean over disks of dx^2 + dy^2, length^2.
    """
    arrays = [None if each is None else np.asarray(each, dtype=np.float64) for each in (low, reference_low)]
    moved, _ = separation(np.asarray(position), arrays[0], np.asarray(reference), arrays[1], box_length)
    return np.mean(np.sum(moved**2, axis=-1), axis=-1)


def fit_growth(time: ArrayLike, msd: ArrayLike, lower: float, upper: float) -> Growth:
    """Fit the rate of exponential growth of D between a noise floor and a nonlinear ceiling.

    Parameters
    ----------
    time : array_like, shape (T,)
        Increasing times with any spacing: the times of `faultgouge perturb` are dense at first.
    msd : array_like, shape (T,)
        D at these times, length^2.
    lower, upper : float
        The fit begins when D first reaches `lower`, well above the noise, and ends when D first reaches `upper`, well
        below the square of the overlaps.

    Returns
    -------
    Growth

    Raises
    ------
    ValueError
        If the arrays do not fit, the times do not increase, or D has fewer than two samples in a stretch, or less
        than a decade, between the bounds.
    """
    t, d = np.asarray(time, dtype=np.float64), np.asarray(msd, dtype=np.float64)
    if t.ndim != 1 or t.shape != d.shape:
        raise ValueError(f"time and msd must be lists of one length; their shapes are {t.shape} and {d.shape}.")
    if len(t) < 2 or not np.all(np.diff(t) > 0):
        raise ValueError("The times of a growth fit must increase.")
    above = np.flatnonzero(d >= lower)
    first = int(above[0]) if len(above) else len(d)
    over = np.flatnonzero(d >= upper)
    last = int(over[0]) if len(over) else len(d)
    if last - first < 2 * STRETCHES:
        raise ValueError(
            f"D has {max(last - first, 0)} samples between {lower:g} and {upper:g}; a fit needs {2 * STRETCHES}."
        )
    centre, level = _stretches(t[first:last], d[first:last])
    rate, error, _ = fit_line(centre, level)
    decades = float((level[-1] - level[0]) / np.log(10))
    if decades < 1:
        raise ValueError(f"D grows by {decades:.2g} decades between {lower:g} and {upper:g}; a rate needs one.")
    return Growth(
        rate=rate,
        error=error,
        decades=decades,
        start=float(t[first]),
        end=float(t[last - 1]),
    )


def _stretches(time: Floats, msd: Floats) -> tuple[Floats, Floats]:
    """Centres of `STRETCHES` stretches of equal duration, and the logarithm of the mean of D over each.

    D is integrated as straight lines between its samples. Of an exponential, every stretch gives the same multiple of
    the value at its centre.
    """
    edges = np.linspace(time[0], time[-1], STRETCHES + 1)
    place = np.clip(np.searchsorted(time, edges, side="right") - 1, 0, len(time) - 2)
    inner = np.bincount(np.clip(np.searchsorted(edges, time, side="right") - 1, 0, STRETCHES - 1), minlength=STRETCHES)
    if inner.min() < 2:
        raise ValueError(f"D has stretches with {inner.min()} samples between its bounds; a fit needs two in each.")
    area = np.concatenate([[0.0], np.cumsum(np.diff(time) * 0.5 * (msd[1:] + msd[:-1]))])
    ahead = edges - time[place]
    slope = (msd[place + 1] - msd[place]) / (time[place + 1] - time[place])
    up_to = area[place] + ahead * (msd[place] + 0.5 * slope * ahead)
    return 0.5 * (edges[1:] + edges[:-1]), np.log(np.diff(up_to) / np.diff(edges))


def growing_range(time: ArrayLike, msd: ArrayLike, upper: float) -> tuple[float, float]:
    """Bounds of D between which one motion grows alone.

    Parameters
    ----------
    time, msd : array_like, shape (T,)
        D(t).
    upper : float
        Where it ceases to be exponential at the latest, length^2.

    Returns
    -------
    tuple of float
        `NOISE_FACTOR` times the noise, the median of D over the first quarter of its way to `upper`; and `upper`.
    """
    t, d = np.asarray(time, dtype=np.float64), np.asarray(msd, dtype=np.float64)
    reached = np.flatnonzero(d >= upper)
    end = t[reached[0]] if len(reached) else t[-1]
    noise = d[t <= t[0] + 0.25 * (end - t[0])]
    return NOISE_FACTOR * float(np.median(noise)), upper
