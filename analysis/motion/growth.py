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

**Noise.** All modes start with similar amplitudes, excited by the rounding of the coordinates or by the perturbation. D
stays at this level, the noise, until the fastest growing motion exceeds the noise. With n modes, this motion starts
with a share of about `NOISE_SHARE`/n. To reach `ABOVE` times the noise, and to be followed over a decade from there,
takes a time of about
:math:`\ln(10 \cdot 10^3\, n / 0.1) / (2 |\mathrm{Im}\,\omega|)`, some 17 e-foldings for 100 disks.

**Weakening.** When friction falls with the velocity, the equilibrium of the packing changes. D jumps to the
displacement of the new equilibrium, and then grows if K with the weakened friction is unstable. Prediction and fit are
those of the weakened packing, and the fit begins at ten times the jump.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..packing.compensated import separation
from ..packing.packing import Floats, Packing
from .eigenvalues import Complexes
from .motion import Motion
from .power_law import fit_line
from .spectrum import spectrum

STRETCHES = 24
"""Stretches over which D is averaged: enough for an error, few enough to hold many periods each."""

ABOVE = 1e3
"""Factor from the noise to the D from which on the fastest motion is followed: it has left the others behind there."""

NOISE_SHARE = 0.1
"""Of the fastest motion in the noise, in units of that of a mean mode: 1/1800 of 300 modes was measured, since a pair
near its coalescence is excited less than others are."""

BELOW_TOP = 1e-3
"""Share of the largest D up to which D has not levelled off."""

LINEAR = 0.1
"""Root of D, in units of the smallest overlap, up to which the motion may be linear: of eight runs that were made
before the rule, D stopped at 0.7 to 31 times the square of that."""

JUMP_SHARE = 0.05
"""Share of the run with mu(v) that shows the jump, from the moment on at which friction weakens: 10 of 200 time units,
where the slowest modes of 100 disks have periods of 6, and the fastest pairs have just begun to stand out."""

DISKS_BY_LAPACK = 1000
"""Disks up to which all eigenvalues are computed: ten seconds; with dissipation, of a matrix of twice the size, half as
many."""


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


@dataclass(frozen=True)
class GrowthOfRun:
    """Whether D of an undamped run grew, and what the spectrum of its start says.

    Attributes
    ----------
    measured : Growth or None
        The exponential fitted to D; None if there is none.
    predicted : float or None
        Growth rate of D from the spectrum, 1 / time: 0 of a stable packing, None where it was not computed.
    pairs, negative : int
        Complex pairs and negative eigenvalues of the start, with dissipation the motions that grow and oscillate, and
        those that grow and do not.
    time : float
        Length of the run.
    needed : float or None
        About how long a run has to be for D to leave the noise and be followed, time; None where nothing grows.
    weakened : float or None
        The smallest friction coefficient of the run, if friction weakened.
    why : str
        Why there is no measured rate; empty if there is one.
    """

    measured: Growth | None
    predicted: float | None
    pairs: int
    negative: int
    time: float
    needed: float | None
    weakened: float | None
    why: str

    @property
    def says(self) -> str:
        """What happened, in sentences."""
        with_friction = "" if self.weakened is None else f" with the friction weakened to mu = {self.weakened:.6g}"
        unstable = f"{_take_samples(self.pairs, self.negative)}{with_friction}"
        if self.measured is None:
            return f"{self.why[:1].upper()}{self.why[1:]}."
        fit = self.measured
        told = (
            f"D grew at the rate {fit.rate:.6g} +- {fit.error:.1g}, fitted over {fit.decades:.1f} decades, from "
            f"t = {fit.start:.6g} to {fit.end:.6g}"
        )
        if self.predicted is None:
            return f"{told}; of more than {DISKS_BY_LAPACK} disks no spectrum was computed beside."
        off = 100 * (fit.rate / self.predicted - 1)
        return f"{told}; the spectrum, {unstable}, predicts {self.predicted:.6g}: a difference of {off:+.2g} %."

    def as_dict(self) -> dict[str, object]:
        """What JSON has: growth, or null with `why`."""
        fit = self.measured
        growth = None
        if fit is not None:
            growth = {"measured": fit.rate, "error": fit.error, "predicted": self.predicted}
            growth |= {"from": fit.start, "to": fit.end, "decades": fit.decades}
        return {
            "growth": growth,
            "says": self.says,
            "predicted_rate": self.predicted,
            "pairs": self.pairs,
            "negative": self.negative,
            "time_enough": self.enough,
            "time_needed": self.needed,
        }

    @property
    def enough(self) -> bool | None:
        """Whether the time was enough to see growth; None where nothing grows, or nobody knows."""
        return None if self.needed is None else self.measured is not None or self.time >= self.needed


def growth_of_run(
    packing: Packing, time: ArrayLike, msd: ArrayLike, friction: ArrayLike | None = None, dt: float | None = None
) -> GrowthOfRun:
    """Compare the growth of D, in a run from rest at an equilibrium, with the prediction of the spectrum.

    No rate is fitted if nothing grows according to the spectrum.

    Parameters
    ----------
    packing : Packing
        The equilibrium, with its dashpots and drag.
    time, msd : array_like, shape (T,)
        D(t) of the run.
    friction : array_like, shape (T,), optional
        Friction coefficient at these times; constant by default.
    dt : float, optional
        Time step of velocity Verlet, to include its dispersion.
    """
    t, d = np.asarray(time, dtype=np.float64), np.asarray(msd, dtype=np.float64)
    mu = np.full(len(t), packing.law.mu) if friction is None else np.asarray(friction, dtype=np.float64)
    weaker = mu < packing.law.mu
    weakened = float(mu.min()) if weaker.any() else None
    if weakened is not None:
        packing = _with_friction(packing, weakened)
        begin = int(np.argmax(weaker))
        t, d = t[begin:], d[begin:]
    damped = packing.damped
    rate, pairs, negative = None, 0, 0
    if len(packing) <= (DISKS_BY_LAPACK // 2 if damped else DISKS_BY_LAPACK):
        rate, pairs, negative = _damped_growth(packing) if damped else _undamped_growth(packing, dt)
    length = float(t[-1] - (t[0] if weakened is not None else 0.0))
    needed = float(np.log(10 * ABOVE * max(1, 3 * len(packing)) / NOISE_SHARE) / rate) if rate else None
    fitted: Growth | None = None
    if rate != 0 and len(t) > 1:
        try:
            fitted = fit_growth(t, d, *_bounds(packing, t, d, rate, jumped=weakened is not None))
        except ValueError:
            fitted = None
    why = "" if fitted is not None else _why_not(packing, d, rate, pairs, negative, length, needed, weakened, damped)
    return GrowthOfRun(fitted, rate, pairs, negative, length, needed, weakened, why)


def _why_not(
    packing: Packing,
    msd: Floats,
    rate: float | None,
    pairs: int,
    negative: int,
    length: float,
    needed: float | None,
    weakened: float | None,
    damped: bool,
) -> str:
    """Why a run shows no growth, in a sentence without its full stop."""
    now = f"with the friction weakened to mu = {weakened:.6g}" if weakened is not None else f"at F_x = {packing.fx:g}"
    if rate is None:
        return (
            f"D did not grow by a decade above its noise; for more than {DISKS_BY_LAPACK} disks the spectrum is not "
            "computed"
        )
    if rate == 0 or needed is None:
        loss = ", dissipation damps all motion" if damped else ""
        found = "no motion grows" if damped else "no complex pair and no negative eigenvalue"
        bounded = "D jumps to the new equilibrium and stays bounded" if weakened is not None else "D stays bounded"
        return (
            f"nothing grows: {now} the packing is linearly stable ({found}){loss}, and {bounded}, however long the run"
        )
    unstable = f"{now} the packing is unstable ({_take_samples(pairs, negative)}, rate {rate:.6g})"
    if length < needed:
        return (
            f"{unstable}, but the run was too short to see it: {length * rate:.1f} e-foldings in t = {length:.4g}; D "
            f"leaves the noise, and can be followed over a decade, after about t = {needed:.4g}"
        )
    return (
        f"{unstable}, but D did not rise by a decade above its noise at one rate: it reached {msd.max():.2g} in "
        f"t = {length:.4g}. The motion is small compared with other motion, or has left the range in which K holds"
    )


def _take_samples(pairs: int, negative: int) -> str:
    found = [(pairs, "complex pair"), (negative, "negative eigenvalue")]
    return " and ".join(f"{count} {what}{'s' if count > 1 else ''}" for count, what in found if count) or "no motion"


def _bounds(packing: Packing, time: Floats, msd: Floats, rate: float | None, jumped: bool) -> tuple[float, float]:
    """The D between which one motion grows alone, above the noise or the jump, and below where D levels off."""
    top = float(msd.max())
    if jumped:
        window = time <= time[0] + JUMP_SHARE * (time[-1] - time[0])
        return 10 * float(msd[window].max()), 0.1 * top
    ceiling = (LINEAR * packing.smallest_overlap) ** 2
    # while it still grows in the end, it has not levelled off: the last decade is reached within the last e-foldings
    late = time[int(np.argmax(msd >= 0.1 * top))]
    grows_on = rate is not None and (time[-1] - late) * rate < 2 * np.log(10)
    return growing_range(time, msd, min(ceiling, np.nextafter(top, np.inf) if grows_on else BELOW_TOP * top))


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
        `ABOVE` times the noise, which is the median of D over the first quarter of its way to `upper`, and `upper`.
    """
    t, d = np.asarray(time, dtype=np.float64), np.asarray(msd, dtype=np.float64)
    reached = np.flatnonzero(d >= upper)
    end = t[reached[0]] if len(reached) else t[-1]
    noise = d[t <= t[0] + 0.25 * (end - t[0])]
    return ABOVE * float(np.median(noise)), upper


def _undamped_growth(packing: Packing, dt: float | None) -> tuple[float, int, int]:
    """Growth rate of D, complex pairs and negative eigenvalues."""
    modes = spectrum(packing)
    return modes.growth_rate(dt), len(modes.pairs), len(modes.negative)


def unstable_rates(packing: Packing) -> Complexes:
    """The eigenvalues s with Re s > 0 beyond rounding of a packing with dissipation; 1 / time."""
    rates = Motion.of(packing).rates
    return rates.values[rates.grows]


def _damped_growth(packing: Packing) -> tuple[float, int, int]:
    """Growth rate of D, and the motions that grow: with and without oscillation."""
    grows = unstable_rates(packing)
    fastest = 2 * float(grows.real.max(initial=0.0))
    return fastest, int(np.count_nonzero(grows.imag > 0)), int(np.count_nonzero(grows.imag == 0))


def _with_friction(packing: Packing, mu: float) -> Packing:
    """The same disks with another friction coefficient; slips are clamped to their new limits."""
    law = replace(packing.law, mu=mu)
    limit = law.slip_limit(packing.geometry.overlap)
    contacts = packing.contacts.slipped(np.clip(packing.contacts.slip, -limit, limit), None)
    return replace(packing, law=law, contacts=contacts)
