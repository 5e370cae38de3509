r"""Growth of the mean square displacement, measured on an undamped run.

The prediction to compare it with is :meth:`~faultgouge.analysis.Spectrum.growth_rate`.

.. math:: D(t) = \frac1N \sum_i \left[\Delta x_i^2(t) + \Delta y_i^2(t)\right]

from the equilibrium. Above onset one complex pair takes over and
:math:`q = \mathrm{Re}\, c\, v e^{i\omega t}`, so that

.. math::

    D(t) = e^{2 |\mathrm{Im}\,\omega| t} \left[A + B \cos(2\, \mathrm{Re}\,\omega\, t + \varphi)\right],
    \qquad |B| \le A .

Close to an exceptional point v is nearly real, the motion a standing wave, and B nearly A: D touches zero
twice a period and a straight line through log D is at the mercy of those dips. The mean of D over stretches
of several periods keeps the exponential and loses the modulation, whatever its frequency: the rate is the
slope of the logarithm of these means.

A signal that is one growing oscillation, such as the velocity of the upper layer once the pair has taken over, obeys
at equal steps h a recursion of two terms, :math:`s_{n+1} = a s_n + b s_{n-1}`, whose roots are
:math:`e^{\pm i \mathrm{Re}\,\omega h + |\mathrm{Im}\,\omega| h}`: `fit_oscillation` solves for a and b.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .compensated import separation
from .packing import Floats

BLOCKS = 24
"""Stretches over which D is averaged: enough for an error, few enough to hold many periods each."""


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
        Times between which D was used.
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
    """Rate of exponential growth of D between a noise floor and a nonlinear ceiling.

    Parameters
    ----------
    time : array_like, shape (T,)
        Equally spaced times.
    msd : array_like, shape (T,)
        D at these times, length^2.
    lower, upper : float
        D is used from when it first reaches `lower`, well above the noise, until it first reaches `upper`,
        well below the square of the overlaps.

    Returns
    -------
    Growth

    Raises
    ------
    ValueError
        If the arrays do not fit, the times are not equally spaced, or D spends fewer than two samples a
        stretch, or less than a decade, between the bounds.
    """
    t, d = np.asarray(time, dtype=np.float64), np.asarray(msd, dtype=np.float64)
    if t.ndim != 1 or t.shape != d.shape:
        raise ValueError(f"time and msd must be lists of one length; their shapes are {t.shape} and {d.shape}.")
    step = np.diff(t)
    # Times of a run are multiples of dt, printed or summed: a part in a million is far above their rounding.
    if len(t) < 2 or step.min() <= 0 or np.ptp(step) > 1e-6 * step.mean():
        raise ValueError("The times of a growth fit must be equally spaced and increasing.")
    above = np.flatnonzero(d >= lower)
    first = int(above[0]) if len(above) else len(d)
    over = np.flatnonzero(d >= upper)
    last = int(over[0]) if len(over) else len(d)
    size = (last - first) // BLOCKS
    if size < 2:
        raise ValueError(
            f"D has {max(last - first, 0)} samples between {lower:g} and {upper:g}; a fit needs {2 * BLOCKS}."
        )
    last = first + size * BLOCKS
    centre = t[first:last].reshape(BLOCKS, size).mean(axis=1)
    level = np.log(d[first:last].reshape(BLOCKS, size).mean(axis=1))
    x = centre - centre.mean()
    rate = float(x @ level / (x @ x))
    scatter = level - level.mean() - rate * x
    decades = float((level[-1] - level[0]) / np.log(10))
    if decades < 1:
        raise ValueError(f"D grows by {decades:.2g} decades between {lower:g} and {upper:g}; a rate needs one.")
    return Growth(
        rate=rate,
        error=float(np.sqrt(scatter @ scatter / (BLOCKS - 2) / (x @ x))),
        decades=decades,
        start=float(t[first]),
        end=float(t[last - 1]),
    )


def fit_oscillation(time: ArrayLike, signal: ArrayLike) -> complex:
    """Frequency and growth of one oscillation, from equally spaced samples.

    Parameters
    ----------
    time : array_like, shape (T,)
        Equally spaced times, more than two a period.
    signal : array_like, shape (T,)
        Samples of Re c exp((i omega_r + sigma) t), on which the growth over the stretch may be large: equations are
        weighted by the signal's own size.

    Returns
    -------
    complex
        omega_r - i sigma: the frequency, and the growth rate of the amplitude (half of that of D) with a minus sign. A
        second oscillation or noise of relative size r changes omega_r by a share of r and biases sigma by r omega_r.

    Raises
    ------
    ValueError
        If there are fewer than eight samples, times are not equally spaced, or the signal does not oscillate.
    """
    t, s = np.asarray(time, dtype=np.float64), np.asarray(signal, dtype=np.float64)
    step = np.diff(t)
    # as in fit_growth
    if t.ndim != 1 or t.shape != s.shape or len(t) < 8 or step.min() <= 0 or np.ptp(step) > 1e-6 * step.mean():
        raise ValueError("An oscillation is fitted to at least eight equally spaced samples.")
    size = np.abs(s[:-2]) + np.abs(s[1:-1]) + np.abs(s[2:])
    rows = np.column_stack([s[1:-1], s[:-2]]) / size[:, None]
    a, b = np.linalg.lstsq(rows, s[2:] / size, rcond=None)[0]
    root = 0.5 * (a + np.sqrt(complex(a * a + 4 * b)))
    if root.imag == 0:
        raise ValueError("The signal does not oscillate at these samples: take more of them a period.")
    exponent = np.log(root) / step.mean()
    return complex(abs(exponent.imag), -exponent.real)
