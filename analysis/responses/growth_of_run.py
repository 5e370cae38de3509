r"""Whether D of an undamped run grew, beside the growth rate that the spectrum of its start predicts.

**Noise.** All modes start with similar amplitudes, excited by the rounding of the coordinates or by the perturbation. D
stays at this level, the noise, until the fastest growing motion exceeds the noise. With n modes, this motion starts
with a share of about `NOISE_SHARE`/n. To reach `NOISE_FACTOR` times the noise, and to be followed over a decade from
there, takes a time of about
:math:`\ln(10 \cdot 10^3\, n / 0.1) / (2 |\mathrm{Im}\,\omega|)`, some 17 e-foldings for 100 disks.

**Weakening.** When friction falls with the velocity, the equilibrium of the packing changes. D jumps to the
displacement of the new equilibrium, and then grows if K with the weakened friction is unstable. Prediction and fit are
those of the weakened packing, and the fit begins at ten times the jump.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..counted import counted
from ..motion.eigenvalues import Complexes
from ..motion.linear import all_rates
from ..motion.motion import Motion
from ..motion.spectrum import spectrum
from ..packing.packing import Floats, Packing
from .growth import NOISE_FACTOR, Growth, fit_growth, growing_range

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
        """The outcome in sentences."""
        with_friction = "" if self.weakened is None else f" with the friction weakened to mu = {self.weakened:.6g}"
        unstable = f"{_in_words(self.pairs, self.negative)}{with_friction}"
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
        """Entries of JSON: growth, or null with `why`."""
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
    weaker, weakened, begin = mu < packing.law.mu, None, 0.0
    if weaker.any():
        weakened = float(mu.min())
        packing = _with_friction(packing, weakened)
        t, d = t[int(np.argmax(weaker)) :], d[int(np.argmax(weaker)) :]
        begin = float(t[0])
    disks, length = len(packing), float(t[-1]) - begin
    rate, pairs, negative, needed = None, 0, 0, None
    if packing.damped and disks <= DISKS_BY_LAPACK // 2:
        grows = unstable_rates(packing)
        rate = 2 * float(grows.real.max(initial=0.0))
        pairs, negative = int(np.count_nonzero(grows.imag > 0)), int(np.count_nonzero(grows.imag == 0))
    elif not packing.damped and disks <= DISKS_BY_LAPACK:
        modes = spectrum(packing)
        rate, pairs, negative = modes.growth_rate(dt), len(modes.pairs), len(modes.negative)
    if rate:
        needed = float(np.log(10 * NOISE_FACTOR * max(1, 3 * disks) / NOISE_SHARE) / rate)
    fitted: Growth | None = None
    if rate != 0 and len(t) > 1:
        try:
            fitted = fit_growth(t, d, *_bounds(packing, t, d, rate, jumped=weakened is not None))
        except ValueError:
            fitted = None
    now = f"at F_x = {packing.fx:g}" if weakened is None else f"with the friction weakened to mu = {weakened:.6g}"
    if fitted is not None:
        why = ""
    elif rate is None:
        less = f"for more than {DISKS_BY_LAPACK} disks the spectrum is not computed"
        why = f"D did not grow by a decade above its noise; {less}"
    elif needed is None:
        found = "no motion grows" if packing.damped else "no complex pair and no negative eigenvalue"
        loss = ", dissipation damps all motion" if packing.damped else ""
        jumps = "" if weakened is None else " jumps to the new equilibrium and"
        stays = f"D{jumps} stays bounded, however long the run"
        why = f"nothing grows: {now} the packing is linearly stable ({found}){loss}, and {stays}"
    else:
        unstable = f"{now} the packing is unstable ({_in_words(pairs, negative)}, rate {rate:.6g})"
        short = (
            f"but the run was too short to see it: {length * rate:.1f} e-foldings in t = {length:.4g}; D leaves the "
            f"noise, and can be followed over a decade, after about t = {needed:.4g}"
        )
        other = (
            f"but D did not rise by a decade above its noise at one rate: it reached {d.max():.2g} in t = {length:.4g}."
            " The motion is small compared with other motion, or has left the range in which K holds"
        )
        why = f"{unstable}, {short if length < needed else other}"
    return GrowthOfRun(fitted, rate, pairs, negative, length, needed, weakened, why)


def unstable_rates(packing: Packing) -> Complexes:
    """The eigenvalues s with Re s > 0 beyond rounding of a packing with dissipation; 1 / time."""
    values, grows, *_ = all_rates(Motion.of(packing))
    return values[grows]


def _in_words(pairs: int, negative: int) -> str:
    """What grows: complex pairs and negative eigenvalues."""
    counts = {"complex pair": pairs, "negative eigenvalue": negative}
    return " and ".join(counted(count, noun) for noun, count in counts.items() if count) or "no motion"


def _bounds(packing: Packing, time: Floats, msd: Floats, rate: float | None, jumped: bool) -> tuple[float, float]:
    """The D between which one motion grows alone, above the noise or the jump, and below where D levels off."""
    top = float(msd.max())
    if jumped:
        window = time <= time[0] + JUMP_SHARE * (time[-1] - time[0])
        return 10 * float(msd[window].max()), 0.1 * top
    ceiling = (LINEAR_RANGE * packing.smallest_overlap) ** 2
    # while it still grows in the end, it has not levelled off: the last decade is reached within the last e-foldings
    late = time[int(np.argmax(msd >= 0.1 * top))]
    grows_on = rate is not None and (time[-1] - late) * rate < 2 * np.log(10)
    return growing_range(time, msd, min(ceiling, np.nextafter(top, np.inf) if grows_on else PLATEAU_SHARE * top))


def _with_friction(packing: Packing, mu: float) -> Packing:
    """The same disks with another friction coefficient; slips are clamped to their new limits."""
    law = replace(packing.law, mu=mu)
    limit = law.slip_limit(packing.geometry.overlap)
    contacts = packing.contacts.slipped(np.clip(packing.contacts.slip, -limit, limit), None)
    return replace(packing, law=law, contacts=contacts)
