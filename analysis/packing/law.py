r"""The contact law: a repulsion, a tangential force that approaches Coulomb's bound smoothly, and dashpots.

Two disks overlap by :math:`\delta > 0` and have slid by :math:`s` along the contact since they first touched.

.. math::

    f_n &= k_n \delta^p \\
    f_t &= -k_t \delta^{p-1} (1 + x - x^2)\, s, \qquad
    x = |s| / t^*, \quad t^* = \mu \frac{k_n}{k_t} \delta

The exponent p is 3/2, that of Hertz and Mindlin, or 1: harmonic disks, common in the literature. The slip is clamped to
:math:`[-t^*, t^*]`, where :math:`|f_t| = \mu f_n` exactly. The derivatives that the stability operator needs are

.. math::

    \frac{\partial f_n}{\partial \delta} &= p\, k_n \delta^{p-1} \\
    a = \frac{\partial f_t}{\partial s} &= -k_t \delta^{p-1} (1 + 2x - 3x^2) \\
    b = \frac{\partial f_t}{\partial \delta} &= (p - 1) \frac{f_t}{\delta} - k_t \delta^{p-1} s\,
    \frac{2x^2 - x}{\delta}

The tangential stiffness :math:`-a` first rises, to :math:`\tfrac43 k_t \delta^{p-1}` at :math:`x = 1/3`, and falls to
zero at :math:`x = 1`. There :math:`b = p f_t / \delta`, which is also the derivative of the clamped branch :math:`f_t =
\mp \mu k_n \delta^p`: the force is once continuously differentiable at the bound, so that the clamp needs no separate
case in the derivatives.

Dashpots resist the velocities of overlap and slip,

.. math:: f_n' = C_N \delta^{p-1}\, \dot\delta, \qquad f_t' = -C_T \delta^{p-1}\, \dot s,

as physics requires for p = 3/2 (no jump when a contact opens); for p = 1 the dashpots are constant while the contact
lasts. The sum of :math:`f_t` and :math:`f_t'` is clamped to :math:`[-\mu f_n, \mu f_n]`, where :math:`f_n` is the
elastic force. A contact at the bound therefore has no tangential dashpot in the direction in which it slides; in the
linear operator (`dashpots`) it has no tangential dashpot at all.

**Does the force create energy?** The energy that a contact returns at constant overlap is

.. math:: W(\delta, s) = \int_0^{|s|} |f_t|\, \mathrm ds = k_t \delta^{p-1} s^2
    \left(\tfrac12 + \tfrac x3 - \tfrac{x^2}4\right).

The normal force is a function of the overlap alone, and does no work on a cycle. A cycle that begins without slip
therefore creates no energy if W does not grow while the overlap changes without slip, :math:`\mathrm dW \le 0` at
:math:`\mathrm ds = 0`; the energy supplied by slip is then at least :math:`\mathrm dW`. For p = 3/2:

.. math::

    \frac{\partial \ln W}{\partial \ln \delta}\Big|_{s} &= \frac12 - g(x) \ge 0.4, \qquad
    g = \frac{x/3 - x^2/2}{1/2 + x/3 - x^2/4} \\
    \frac{\partial \ln W}{\partial \ln \delta}\Big|_{s \sqrt\delta} &= -\frac12 - \frac32 g(x) \le -0.07

At constant slip W falls while the overlap falls and grows while the overlap grows: the law above creates energy if a
contact slips out, is compressed, and slips back (Elata and Berryman, Mech. Mater. 24, 229 (1996)). At constant
:math:`s\sqrt\delta` W falls while the overlap grows. The history is therefore either

- *total*: s is the whole slip, the paper's law, which creates energy; or
- *rescaled*: s is counted as above, and while the overlap grows, s also falls so that :math:`s \sqrt\delta` is
  constant,

  .. math:: \mathrm ds = T \cdot \mathrm dq - \frac{s}{2 \delta} \max(\mathrm d\delta, 0),

  which creates no energy.

For any p > 1 it is :math:`s\,\delta^{p-1}` that stays constant, and W then changes as :math:`-(p - 1) - p\,g(x)`, where
:math:`g \ge -2/7`: no energy is created from p = 7/5 on.

**Coulomb's slider.** Without the smoothing,

.. math:: f_t = -k_t \delta^{p-1} s, \qquad |s| \le t^*,

the contact is a spring in series with a slider that slides at :math:`\mu f_n` and sticks as soon as the motion
reverses: the standard law of granular simulations (Cundall and Strack, Geotechnique 29, 47 (1979)). The history
*coulomb* is this force with rescaled slips. The contact remembers its force, :math:`s = -f_t/(k_t \delta^{p-1})` is the
stretch of the spring, :math:`W = k_t \delta^{p-1} s^2/2`, and no path creates energy. (The same holds for p = 1,
without any rescaling.) With p = 3/2 the law is LAMMPS's mindlin_rescale/force (Thornton, Cummins and Cleary, Powder
Technol. 233, 30 (2013)), except that the stiffnesses of LAMMPS have an additional factor, the square root of an
effective radius. While contact radii fall, LAMMPS reduces the force by their ratio, :math:`\sim \sqrt\delta`; this
keeps the slip. While contact radii grow, LAMMPS does not change the force; this rescales the slip. LAMMPS's
mindlin/force, without the rescaling, creates energy when a contact is unloaded; its mindlin_rescale, which rescales a
slip and not the force, creates energy when a contact is loaded. Harmonic disks have a constant stiffness and no
rescaling, and only the smoothing makes their forces depend on the overlap.

**Two derivatives.** For a rescaled force, b differs between a growing and a falling overlap,

.. math:: b_+ = \frac32 k_t \sqrt\delta\, s\, \frac{x - 2x^2}{\delta}, \qquad b_- = b \text{ of above},

and both are :math:`p f_t / \delta` at the bound. For small x, :math:`b_+ \to 0`: compression of a sticking contact does
not change its tangential force. K therefore depends on which contacts open. Every method takes the weight of
:math:`b_-`: 0 is the derivative while all overlaps grow; 1 is the derivative while all fall, which is that of the total
law; and 1/2 (the default) is the first harmonic of a small vibration: the rate of the force is
:math:`a \dot s + \tfrac12 (b_+ + b_-) \dot\delta + \tfrac12 (b_+ - b_-) |\dot\delta|`, and the last term has no
component at the frequency of :math:`\dot\delta`. The last term makes the force fall a little with each period, so that
no linear operator is exact: in LAMMPS D(t) grows more slowly than the mean of both predicts, by 5 % in the median of
ten packings, at most by 35 % (4.60 for 4.74 in one with 5.57 and 3.77 to either side, tests/plugin/test_history.py). As
no contact creates energy, the energy of the growing motion comes from the energy stored in contacts and load. A contact
of elastic bodies (Mindlin and Deresiewicz) that is loaded a little and unloaded again follows :math:`b_+` in both
directions, because the separating annulus carries no shear yet.

Coulomb's slider has, while it sticks,

.. math:: a = -k_t \delta^{p-1}, \qquad b_+ = 0, \qquad b_- = (p - 1) f_t/\delta,

and a = 0, :math:`b = p f_t/\delta` while it continues to slide. At the bound either case occurs, depending on the
motion. The operator of small vibrations treats all contacts as sticking, with the mean :math:`b = f_t/(4\delta)` for p
= 3/2. A contact at the bound may yield in the first periods until the vibration no longer reaches the bound
(*shakedown*), or slide for ever: :mod:`~faultgouge.analysis.motion.one_sided` follows the contact. The weight of
:math:`b_-`, and the contacts at the bound that continue to slide, may be given. Newton's method treats each contact
according to its displacement: contacts that reach the bound slide.

:math:`k_n, k_t, C_N` and :math:`C_T` are constants per length\ :sup:`p-1`; no effective radius enters. :math:`\mu = 0`
or :math:`k_t = 0` means no tangential force at all, and no history of the slip.

Only this module and mindlin_law.h contain the law. See docs/howto_law.md for how to add another.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import LARGEST, Booleans, Floats, ratio, set_frozen

AT_THE_BOUND = 1 - 1e-8
"""Share of its limit from which on a slip is at Coulomb's bound. A slip that LAMMPS has clamped differs from the limit
of an overlap that is computed again by rounding: 2e-15 for coordinates of 10, of overlaps from 2e-7 on."""

EXPONENTS = (1.5, 1.0)
"""Exponents of the repulsion of the plugin, in the order of its list; the formulas here hold for any from 1 on."""

LEAST_RESCALED = 1.4
"""Exponent from which rescaled slips create no energy with the smoothed force: 7/5, see above."""


class Derivatives(NamedTuple):
    """Forces of contacts and what the stability operator needs of them; arrays over contacts.

    Attributes
    ----------
    normal_force, tangential_force : ndarray
        f_n and f_t, force.
    normal_stiffness, slip_derivative, overlap_derivative : ndarray
        d f_n / d overlap, a = d f_t / d slip, and b = d f_t / d overlap, force / length.
    """

    normal_force: Floats
    tangential_force: Floats
    normal_stiffness: Floats
    slip_derivative: Floats
    overlap_derivative: Floats


@dataclass(frozen=True)
class MindlinLaw:
    """The smooth Mindlin law; every method is vectorised over contacts.

    A contact whose overlap is not positive is open and exerts no force.

    Parameters
    ----------
    kn : float
        Normal stiffness, force / length^p, positive.
    kt : float
        Tangential stiffness, force / length^p, not negative.
    mu : float
        Coulomb's coefficient of friction, not negative.
    exponent : float
        p, one of `EXPONENTS`: 3/2 (Hertz) or 1 (harmonic).
    cn, ct : float
        Normal and tangential dashpots, force time / length^p, not negative; none by default.
    rescaled : bool
        Whether slips are rescaled while overlaps grow, which needs p = 7/5 or more.
    coulomb : bool
        Whether the tangential force is a spring in series with Coulomb's slider, not smoothed, with rescaled slips.

    Raises
    ------
    ValueError
        If a parameter is not finite or has the wrong sign, the plugin does not have the exponent, slips cannot be
        rescaled, or two histories are given.
    """

    kn: float
    kt: float
    mu: float
    exponent: float = 1.5
    cn: float = 0.0
    ct: float = 0.0
    rescaled: bool = False
    coulomb: bool = False

    def __post_init__(self) -> None:
        for name in ("kn", "kt", "mu", "exponent", "cn", "ct"):
            value = float(getattr(self, name))
            set_frozen(self, **{name: value})
            if not 0 <= value <= LARGEST or (name == "kn" and value == 0):
                sign = "positive" if name == "kn" else "not negative"
                raise ValueError(f"{name} = {value} must be {sign}, and {LARGEST:g} at the most.")
        if self.exponent not in EXPONENTS:
            raise ValueError(f"exponent = {self.exponent:g} must be {known_exponents()}.")
        set_frozen(self, rescaled=bool(self.rescaled), coulomb=bool(self.coulomb))
        if self.rescaled and self.coulomb:
            raise ValueError("rescaled and coulomb are two histories: a law has one of them.")
        if self.rescaled and self.exponent < LEAST_RESCALED:
            raise ValueError(f"a rescaled history needs an exponent from {LEAST_RESCALED} on: it would create energy.")

    @property
    def frictional(self) -> bool:
        """Whether there is a tangential force at all."""
        return self.kt > 0 and self.mu > 0

    @property
    def history(self) -> str:
        """Rule for the slip: "total", "rescaled" or "coulomb"."""
        return "coulomb" if self.coulomb else "rescaled" if self.rescaled else "total"

    @property
    def rescales(self) -> bool:
        """Whether slips fall while overlaps grow, so that b depends on whether a contact closes or opens."""
        return (self.rescaled or self.coulomb) and self.exponent > 1

    @property
    def damped(self) -> bool:
        """Whether contacts have dashpots."""
        return self.cn > 0 or (self.ct > 0 and self.frictional)

    def slip_limit(self, overlap: ArrayLike) -> Floats:
        """Slip t* = mu kn overlap / kt at which the tangential force reaches Coulomb's bound, length; zero without
        friction."""
        overlap = _closed_overlap(overlap)
        return overlap * self.mu * self.kn / self.kt if self.frictional else np.zeros_like(overlap)

    def at_bound(self, overlap: ArrayLike, slip: ArrayLike) -> Booleans:
        """Which contacts have reached Coulomb's bound, within rounding; none without friction."""
        limit = self.slip_limit(overlap)
        return (np.abs(slip) >= AT_THE_BOUND * limit) & (limit > 0)

    def clamped(self, overlap: ArrayLike, slip: ArrayLike) -> Floats:
        """Slip limited to [-t*, t*], length: the slip that a contact stores after an increment."""
        limit = self.slip_limit(overlap)
        return np.clip(np.asarray(slip, dtype=np.result_type(slip, np.float64)), -limit, limit)

    def remembered(self, slip: ArrayLike, before: ArrayLike, after: ArrayLike) -> Floats:
        """Slip of a contact after a monotonic change of its overlap, both positive, without slipping; length."""
        kept = np.asarray(slip, dtype=np.result_type(slip, np.float64))
        if self.rescales:
            kept = kept * self.growth(np.minimum(np.divide(before, after), 1.0))
        return self.clamped(after, kept)

    def normal_force(self, overlap: ArrayLike) -> Floats:
        """Repulsion f_n = kn overlap^p, force."""
        overlap = _closed_overlap(overlap)
        return self.kn * overlap * self.growth(overlap)

    def normal_stiffness(self, overlap: ArrayLike) -> Floats:
        """d f_n / d overlap = p kn overlap^(p-1), force / length."""
        return self.exponent * self.kn * self.growth(_closed_overlap(overlap))

    def overlap_of_force(self, force: float) -> float:
        """The inverse of `normal_force`: overlap (force / kn)^(1/p) of a contact that carries a force, length."""
        return float((force / self.kn) ** (1 / self.exponent))

    def tangential_force(self, overlap: ArrayLike, slip: ArrayLike) -> Floats:
        """Tangential force f_t along tau of overlaps and slips, which opposes the slip; beyond the slip limit it is
        Coulomb's bound."""
        overlap = _closed_overlap(overlap)
        slip = self.clamped(overlap, slip)
        spring = -self.kt * self.growth(overlap)
        if self.coulomb:
            return spring * slip
        x = ratio(np.abs(slip), self.slip_limit(overlap))
        return spring * (1 + x - x * x) * slip

    def derivatives(
        self, overlap: Floats, slip: Floats, parting: ArrayLike = 0.5, sliding: ArrayLike = False
    ) -> Derivatives:
        """Forces and their derivatives; overlaps that are not positive give zeros. `parting` is the weight in b of the
        derivative for a falling overlap, `sliding` says which contacts at Coulomb's bound continue to slide, of
        Coulomb's slider."""
        overlap, p = np.maximum(overlap, 0.0), self.exponent
        root = self.growth(overlap)
        rest_power = root if p == 1.5 else np.power(overlap, 2 - p)
        normal_force, normal_stiffness = self.kn * overlap * root, p * self.kn * root
        if not self.frictional:
            zero = np.zeros_like(root)
            return Derivatives(normal_force, zero, normal_stiffness, zero, zero)
        limit = overlap * (self.mu * self.kn / self.kt)
        slip = np.minimum(np.maximum(slip, -limit), limit)
        if limit.all():
            x, steep = np.abs(slip) / limit, slip / rest_power
        else:  # an open contact has no slip either
            x, steep = ratio(np.abs(slip), limit), ratio(slip, rest_power)
        rest, triple, soft = 1 - x, 3 * x, -self.kt * root
        if self.coulomb:
            slides = np.logical_and(sliding, x >= AT_THE_BOUND)
            b = np.where(slides, p, (p - 1) * np.asarray(parting, dtype=np.float64)) * (-self.kt * steep)
            return Derivatives(normal_force, soft * slip, normal_stiffness, soft * ~slides, b)
        # (p-1) f_t/overlap and the term of d x/d overlap = -x/overlap, joined
        factor = (p - 1) + x * ((3 - p) * x - (2 - p))
        if self.rescaled:
            growing = p * x * (2 * x - 1)
            factor = growing + np.asarray(parting, dtype=np.float64) * (factor - growing)
        a = soft * (rest * (1 + triple))  # vanishes at the bound to the last bit
        return Derivatives(normal_force, soft * (1 + x * rest) * slip, normal_stiffness, a, factor * (-self.kt * steep))

    def dashpots(self, overlap: ArrayLike, slip: ArrayLike, sliding: ArrayLike = False) -> tuple[Floats, Floats]:
        """Coefficients cn overlap^(p-1) and ct overlap^(p-1) of the dashpots, force time / length. The tangential one
        is zero without friction, and where a contact is at Coulomb's bound, unless Coulomb's slider sticks there."""
        overlap = _closed_overlap(overlap)
        power = self.growth(overlap)
        slides = self.at_bound(overlap, slip)
        if self.coulomb:
            slides &= np.asarray(sliding, dtype=np.bool_)
        return self.cn * power, self.ct * power * (self.frictional & ~slides)

    def growth(self, overlap: Floats) -> Floats:
        """overlap^(p-1), proportional to stiffnesses and dashpots; overlaps may be complex, but not negative."""
        if self.exponent == 1.5:
            return np.sqrt(overlap)
        if self.exponent == 1:
            return np.asarray(overlap != 0, dtype=overlap.dtype)
        return np.power(overlap, self.exponent - 1)


def known_exponents() -> str:
    """The exponents of the plugin, for a sentence: "1.5 or 1"."""
    return " or ".join(f"{each:g}" for each in EXPONENTS)


def _closed_overlap(overlap: ArrayLike) -> Floats:
    """Overlaps, zero for open contacts; long doubles remain long doubles."""
    return np.maximum(np.asarray(overlap, dtype=np.result_type(overlap, np.float64)), 0.0)
