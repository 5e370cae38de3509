r"""Growth of the mean square displacement, measured in an undamped run, beside the rate that the spectrum predicts.

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

**Noise.** All modes start with similar amplitudes, excited by the rounding of the coordinates or by the perturbation.
Of n modes the fastest growing one starts with a share of about `NOISE_SHARE`/n. To reach `NOISE_FACTOR` times the
noise, and to be followed over a decade from there, takes a time of about
:math:`\ln(10 \cdot 10^3\, n / 0.1) / (2 |\mathrm{Im}\,\omega|)`, some 17 e-foldings for 100 disks.

**Weakening.** When friction falls with the velocity, the equilibrium of the packing changes. D jumps to the
displacement of the new equilibrium, and then grows if K with the weakened friction is unstable. Prediction and fit are
those of the weakened packing, and the fit begins at ten times the jump.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Complexes, Floats
from ..counted import counted
from ..motion.linear import all_rates
from ..motion.motion import Motion
from ..motion.spectrum import spectrum
from ..packing.compensated import separation
from ..packing.packing import Packing

STRETCHES = 24
"""Stretches over which D is averaged: enough for an error, few enough to hold many periods each."""

NOISE_FACTOR = 1e3
"""Factor from the noise to the D from which on the fastest motion is followed: it has left the others behind there."""

NOISE_SHARE = 0.1
"""Share of the fastest motion in the noise, in units of the share of a mean mode. A pair near its coalescence is
excited less than others: 1/1800 was measured with 300 modes."""

PLATEAU_SHARE = 1e-3
"""Share of the largest D up to which D has not levelled off."""

LINEAR_RANGE = 0.1
"""Root of D, in units of the smallest overlap, up to which the motion may be linear. In eight runs made before this
rule D stopped at 0.7 to 31 times the square of this limit."""

JUMP_SHARE = 0.05
"""Share of the run with mu(v) that shows the jump, from the moment on at which friction weakens: 10 of 200 time units,
where the slowest modes of 100 disks have periods of 6, and the fastest pairs have just begun to stand out."""

DISKS_BY_LAPACK = 1000
"""Disks up to which all eigenvalues are computed: ten seconds; with dissipation, of a matrix of twice the size, half as
many."""


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
    slope, error, at_zero = _line(np.log(x), np.log(y))
    return PowerLaw(slope, error, float(np.exp(at_zero)))


def _line(x: Floats, y: Floats) -> tuple[float, float, float]:
    """Slope of y(x), its standard error from the scatter about the line, and the line's value at x = 0."""
    about = x - x.mean()
    slope = float(about @ y / (about @ about))
    scatter = y - y.mean() - slope * about
    error = float(np.sqrt(scatter @ scatter / (len(x) - 2) / (about @ about)))
    return slope, error, float(y.mean() - slope * x.mean())


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
    if t.ndim != 1 or t.shape != d.shape or len(t) < 2 or not np.all(np.diff(t) > 0):
        raise ValueError(f"time and msd must be lists of one length, {t.shape} and {d.shape}, and times must increase.")
    first, last = (int(np.argmax(np.append(d >= bound, True))) for bound in (lower, upper))
    if last - first < 2 * STRETCHES:
        few = f"{max(last - first, 0)} samples between {lower:g} and {upper:g}"
        raise ValueError(f"D has {few}; a fit needs {2 * STRETCHES}.")
    t, d = t[first:last], d[first:last]
    # means over stretches of equal duration, with straight lines between samples: of an exponential each gives the same
    # multiple of the value at its centre
    edges = np.linspace(t[0], t[-1], STRETCHES + 1)
    place = np.clip(np.searchsorted(t, edges, side="right") - 1, 0, len(t) - 2)
    inner = np.bincount(np.clip(np.searchsorted(edges, t, side="right") - 1, 0, STRETCHES - 1), minlength=STRETCHES)
    if inner.min() < 2:
        raise ValueError(f"D has stretches with {inner.min()} samples between its bounds; a fit needs two in each.")
    area = np.concatenate([[0.0], np.cumsum(np.diff(t) * 0.5 * (d[1:] + d[:-1]))])
    ahead, slope = edges - t[place], (d[place + 1] - d[place]) / (t[place + 1] - t[place])
    level = np.log(np.diff(area[place] + ahead * (d[place] + 0.5 * slope * ahead)) / np.diff(edges))
    rate, error, _ = _line(0.5 * (edges[1:] + edges[:-1]), level)
    decades = float((level[-1] - level[0]) / np.log(10))
    if decades < 1:
        raise ValueError(f"D grows by {decades:.2g} decades between {lower:g} and {upper:g}; a rate needs one.")
    return Growth(rate, error, decades, float(t[0]), float(t[-1]))


def growing_range(time: ArrayLike, msd: ArrayLike, upper: float) -> tuple[float, float]:
    """Bounds of D between which one motion grows alone: `NOISE_FACTOR` times the noise, the median of D over the first
    quarter of its way to `upper`, length^2; and `upper`."""
    t, d = np.asarray(time, dtype=np.float64), np.asarray(msd, dtype=np.float64)
    end = t[np.argmax(d >= upper)] if np.any(d >= upper) else t[-1]
    return NOISE_FACTOR * float(np.median(d[t <= t[0] + 0.25 * (end - t[0])])), upper


@dataclass(frozen=True)
class GrowthOfRun:
    """Whether D of an undamped run grew, and what the spectrum of its start says.

    `measured` is the exponential fitted to D, None if there is none; `predicted` the growth rate of D from the
    spectrum, 0 of a stable packing, None where it was not computed. `pairs` and `negative` count complex pairs and
    negative eigenvalues of the start, with dissipation the motions that grow and oscillate, and those that grow and do
    not. `enough` says whether the time was enough to see growth, and `needed` about how long a run has to be for D to
    leave the noise and be followed; both are None where nothing grows, `enough` also where nobody knows. `weakened` is
    the smallest friction coefficient of the run, if friction weakened. `says` is the outcome in a sentence, or why
    there is no measured rate.
    """

    measured: Growth | None
    predicted: float | None
    pairs: int
    negative: int
    enough: bool | None
    needed: float | None
    weakened: float | None
    says: str

    def as_dict(self) -> dict[str, Any]:
        """Entries of JSON: growth, or null with the reason in `says`."""
        growth, fit = None, self.measured
        if fit is not None:
            growth = {"measured": fit.rate, "error": fit.error, "predicted": self.predicted}
            growth |= {"from": fit.start, "to": fit.end, "decades": fit.decades}
        own = {"predicted_rate": self.predicted, "pairs": self.pairs, "negative": self.negative}
        return {"growth": growth, "says": self.says} | own | {"time_enough": self.enough, "time_needed": self.needed}


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
    weakened, length, now = None, float(t[-1]), f"at F_x = {packing.fx:g}"
    if np.any(mu < packing.law.mu):
        first, weakened = int(np.argmax(mu < packing.law.mu)), float(mu.min())
        law = replace(packing.law, mu=weakened)
        slips = packing.contacts.slipped(law.clamped(packing.geometry.overlap, packing.contacts.slip))
        packing = replace(packing, law=law, contacts=slips)
        t, d = t[first:], d[first:]
        length, now = float(t[-1] - t[0]), f"with the friction weakened to mu = {weakened:.6g}"
    rate, pairs, negative = _predicted(packing, dt)
    needed = float(np.log(10 * NOISE_FACTOR * max(1, 3 * len(packing)) / NOISE_SHARE) / rate) if rate else None
    fit = _measured(packing, t, d, rate, weakened is not None) if rate != 0 and len(t) > 1 else None
    enough = None if needed is None else fit is not None or length >= needed
    counts = {"complex pair": pairs, "negative eigenvalue": negative}
    found = " and ".join(counted(count, noun) for noun, count in counts.items() if count) or "no motion"
    unknown = f"of more than {DISKS_BY_LAPACK} disks the spectrum is not computed."
    if fit is not None:
        span = f"fitted over {fit.decades:.1f} decades, from t = {fit.start:.6g} to {fit.end:.6g}"
        says = f"D grew at the rate {fit.rate:.6g} +- {fit.error:.1g}, {span}; "
        if rate is None:
            says += unknown
        else:
            weak, off = "" if weakened is None else f" {now}", 100 * (fit.rate / rate - 1)
            says += f"the spectrum, {found}{weak}, predicts {rate:.6g}: a difference of {off:+.2g} %."
    elif rate is None:
        says = f"D did not grow by a decade above its noise; {unknown}"
    elif needed is None:
        none = "no motion grows" if packing.damped else "no complex pair and no negative eigenvalue"
        loss = ", dissipation damps all motion" if packing.damped else ""
        jumps = "" if weakened is None else " jumps to the new equilibrium and"
        says = f"Nothing grows: {now} the packing is linearly stable ({none}){loss}, and D{jumps} stays bounded, "
        says += "however long the run."
    else:
        says = f"{now[0].upper()}{now[1:]} the packing is unstable ({found}, rate {rate:.6g}), but "
        if length < needed:
            says += f"the run was too short to see it: {length * rate:.1f} e-foldings in t = {length:.4g}; D leaves "
            says += f"the noise, and can be followed over a decade, after about t = {needed:.4g}."
        else:
            says += f"D did not rise by a decade above its noise at one rate: it reached {d.max():.2g} in t = "
            says += f"{length:.4g}. The motion is small compared with other motion, or has left the range in which K "
            says += "holds."
    return GrowthOfRun(fit, rate, pairs, negative, enough, needed, weakened, says)


def _predicted(packing: Packing, dt: float | None) -> tuple[float | None, int, int]:
    """Growth rate of D, complex pairs and negative eigenvalues, or with dissipation the motions that grow."""
    if packing.damped and len(packing) <= DISKS_BY_LAPACK // 2:
        grows = unstable_rates(packing)
        return 2 * float(grows.real.max(initial=0.0)), int(np.sum(grows.imag > 0)), int(np.sum(grows.imag == 0))
    if not packing.damped and len(packing) <= DISKS_BY_LAPACK:
        modes = spectrum(packing)
        return modes.growth_rate(dt), len(modes.pairs), len(modes.negative)
    return None, 0, 0


def _measured(packing: Packing, t: Floats, d: Floats, rate: float | None, weakened: bool) -> Growth | None:
    """The fit within the bounds between which one motion grows alone; None if there is none."""
    top = float(d.max())
    if weakened:
        bounds = 10 * float(d[t <= t[0] + JUMP_SHARE * (t[-1] - t[0])].max()), 0.1 * top
    else:
        # while it still grows in the end, it has not levelled off: the last decade is within the last e-foldings
        late = t[int(np.argmax(d >= 0.1 * top))]
        grows_on = rate is not None and (t[-1] - late) * rate < 2 * np.log(10)
        level = float(np.nextafter(top, np.inf)) if grows_on else PLATEAU_SHARE * top
        bounds = growing_range(t, d, min((LINEAR_RANGE * packing.smallest_overlap) ** 2, level))
    try:
        return fit_growth(t, d, *bounds)
    except ValueError:
        return None


def unstable_rates(packing: Packing) -> Complexes:
    """The eigenvalues s with Re s > 0 beyond rounding of a packing with dissipation; 1 / time."""
    values, grows, *_ = all_rates(Motion.of(packing))
    return values[grows]
