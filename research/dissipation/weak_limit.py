r"""The damped onset in the limit of weak damping, from the undamped pair alone.

Weak damping moves the eigenvalue :math:`s = i\sqrt\lambda` of an undamped motion to the side by
:math:`\mathrm{Re}\,s = -y^H G x / (2 y^H x)`, G the mass-weighted damping matrix. If K is symmetric, y is x and every
motion is damped, G being positive. Where two eigenvalues are about to coalesce, :math:`y^H x \to 0` with opposite
signs of the two: one of them is damped more and more, and the other one begins to grow *before* they meet. With the 2 x
2 block :math:`B = m + N` of the pair (tr N = 0, :math:`D = (\lambda_1 - \lambda_2)^2 = 2\,\mathrm{tr} N^2`) and with
:math:`G_B = (U^T V)^{-1} U^T G V` on the same bases (:mod:`~faultgouge.analysis.windows.pair_over_load`) the two rates
are

.. math:: \mathrm{Re}\,s_\pm = -\tfrac14 \left[ \mathrm{tr}\, G_B \pm \frac{2\,\mathrm{tr}(N G_B)}{\sqrt D} \right],

so that one of them vanishes at the root of

.. math:: h(F) = (\mathrm{tr}\, G_B)^2 D - 4\, [\mathrm{tr}(N G_B)]^2 ,

which is a smooth function of the load, through the coalescence and beyond. This root is the limit of the damped onset
as :math:`C \to 0` with a fixed ratio :math:`C_N : C_T`. It lies below the undamped onset, and at it for that ratio
alone for which :math:`\mathrm{tr}(N G_B) = 0` at the coalescence (`balancing_ratio`). This is Ziegler's paradox of
destabilisation by damping (Ziegler, Ing.-Arch. 20, 49 (1952)), as Bottema resolved it (Indag. Math. 18, 403 (1956);
Kirillov and Verhulst, arXiv:0906.1650; Bigoni and Kirillov, CISM 586 (2019)).

**Drag alone**, :math:`C = M/\tau`, commutes with all: :math:`s^2 + s/\tau + \lambda = 0`. On the axis, s = i omega,
:math:`\lambda = \omega^2 - i\omega/\tau`: the motion grows where
:math:`(\mathrm{Im}\,\lambda)^2 > \mathrm{Re}\,\lambda / \tau^2`, to second order in :math:`1/\omega\tau` where
:math:`2\,|\mathrm{Im}\sqrt\lambda| > 1/\tau`. In terms of the pair, :math:`-D/4 = m/\tau^2`: drag shifts the onset to
larger loads, by an amount that is quadratic in :math:`1/\tau` as long as D is linear in the load.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from faultgouge.analysis import Floats, NoEquilibriumError, Packing, Window, damping_matrix, mass_weighted
from faultgouge.analysis.windows import Motions, System, force_bearing
from faultgouge.analysis.windows.pair_over_load import Plane

DIGITS = 1e-12
"""Width to which the limit is bracketed, in units of the load."""


@dataclass(frozen=True)
class WeakLimit:
    """A pair that coalesces, with weak damping of a given ratio.

    Attributes
    ----------
    fx : float
        The limit of the damped onset, force per top disk.
    frequency : float
        sqrt(lambda) of the mode that begins to grow, radian / time.
    """

    fx: float
    frequency: float


def damping_block(packing: Packing, pair: Plane) -> Floats:
    """G_B of a packing's damping on the bases of a pair, shape (2, 2), 1 / time."""
    damping = mass_weighted(damping_matrix(force_bearing(packing)), packing)
    return np.asarray(np.linalg.solve(pair.left.T @ pair.right, pair.left.T @ (damping @ pair.right)))


def traceless(pair: Plane) -> Floats:
    """N, the block of a pair less its mean, 1 / time^2."""
    return np.asarray(pair.block - pair.mean * np.eye(2))


def weak_limit(
    equilibrium: Callable[[float], Packing], forces: ArrayLike, window: Window, cn: float = 0.0, ct: float = 0.0
) -> WeakLimit | None:
    """The limit of the damped onset as the dissipation tends to zero, from one undamped pair.

    Parameters
    ----------
    equilibrium : callable
        fx -> Packing in equilibrium, as in :func:`~faultgouge.analysis.find_onset`.
    forces : array_like, shape (S,)
        The increasing loads of the ramp.
    window : Window
        The undamped window of the pair, as of :func:`~faultgouge.analysis.find_onset`.
    cn, ct : float
        Dashpots, of which the ratio alone counts.

    Returns
    -------
    WeakLimit or None
        None if the pair grows at the smallest load already, or cannot be followed down to where it does not.
    """
    from scipy.optimize import brentq

    pair_at, loads = _follow_pair(equilibrium, window), np.asarray(forces, dtype=np.float64)
    above = window.fx_onset

    def h(fx: float) -> float:
        """Positive as long as weak damping damps both modes of the pair."""
        pair = pair_at(fx)
        g, n = damping_block(equilibrium(fx).with_dissipation(cn, ct), pair), traceless(pair)
        return float(np.trace(g) ** 2 * pair.discriminant - 4 * np.trace(n @ g) ** 2)

    try:
        for below in loads[loads < window.fx_onset][::-1]:
            if h(float(below)) > 0:
                break
            above = float(below)
        else:
            return None
        # of a balanced pair h at the coalescence is rounding noise of either sign
        fx = above if h(above) >= 0 else float(brentq(h, float(below), above, xtol=DIGITS * abs(above)))
        pair, packing = pair_at(fx), equilibrium(fx)
    except NoEquilibriumError:
        return None
    g = damping_block(packing.with_dissipation(cn, ct), pair)
    sign = -np.sign(np.trace(traceless(pair) @ g))  # the mode in which the two terms cancel
    value = pair.mean + sign * 0.5 * np.sqrt(max(0.0, pair.discriminant))
    return WeakLimit(fx, float(np.sqrt(value)))


def drag_onset(
    equilibrium: Callable[[float], Packing],
    forces: ArrayLike,
    window: Window,
    drag_time: float,
) -> float | None:
    """Load at which an undamped pair begins to grow in spite of a drag: 2 |Im omega| = 1/tau, and exactly.

    Parameters
    ----------
    equilibrium, forces, window
        As in :func:`weak_limit`.
    drag_time : float
        tau, time.

    Returns
    -------
    float or None
        Force per top disk; None if the drag holds the pair down to the window's end or the ramp's.
    """
    from scipy.optimize import brentq

    pair_at, loads = _follow_pair(equilibrium, window), np.asarray(forces, dtype=np.float64)
    last = loads[-1] if window.fx_end is None else min(window.fx_end, loads[-1])
    below = window.fx_onset

    def excess(fx: float) -> float:
        """-D/4 - m/tau^2, 1 / time^4: positive where the pair grows."""
        pair = pair_at(fx)
        return -0.25 * pair.discriminant - pair.mean / drag_time**2

    for above in [*loads[(loads > below) & (loads < last)], last]:
        if excess(float(above)) > 0:
            return float(brentq(excess, below, float(above), xtol=DIGITS * abs(last)))
        below = float(above)
    return None


def balancing_ratio(packing: Packing, window: Window) -> float:
    """C_T / C_N for which weak dashpots leave the onset of a pair where it is.

    Parameters
    ----------
    packing : Packing
        The equilibrium at the undamped onset.
    window : Window
        The undamped window of the pair.

    Returns
    -------
    float
        -tr(N G_N) / tr(N G_T) of unit dashpots of either kind; negative if both destabilise on the same side, so that
        no ratio balances the pair.
    """
    pair = _follow_pair(lambda fx: packing, window)(window.fx_onset)
    along, across = (
        np.trace(traceless(pair) @ damping_block(replace(packing, law=replace(packing.law, cn=n, ct=t)), pair))
        for n, t in ((1.0, 0.0), (0.0, 1.0))
    )
    return float(-along / across) if across else np.inf


def _follow_pair(equilibrium: Callable[[float], Packing], window: Window) -> Callable[[float], Plane]:
    """The undamped pair at any load, from its coalescence: the plane of two parallel vectors, made invariant."""

    def system(fx: float) -> System:
        return System.of(equilibrium(fx))

    known = {window.fx_onset: Plane.about(Motions.of(system(window.fx_onset)), window.eigenvalue)}

    def at(fx: float) -> Plane:
        if fx not in known:
            known[fx] = known[min(known, key=lambda load: abs(load - fx))].at(system(fx))
        return known[fx]

    return at
