r"""What stops the complex pairs of a packing: drag, structural loss, and dashpots, each at its critical strength.

**Drag** of the time tau makes :math:`s^2 + s/\tau + \lambda = 0` of each eigenvalue. With :math:`s = i\omega` on the
axis, :math:`\omega^2 = \mathrm{Re}\,\lambda` and :math:`\omega/\tau = |\mathrm{Im}\,\lambda|`: a pair stops growing at
:math:`1/\tau = |\mathrm{Im}\,\lambda| / (\mathrm{Re}\,\lambda)^{1/2}`, exactly.

**Structural loss** takes :math:`\omega/Q` from each mode: growth ends at the least Q (:mod:`.compute`).

**Dashpots** with :math:`C_T = \frac27 C_N` are not diagonal in the modes: all eigenvalues of the pencil
:math:`s^2 M + s C + K` are computed, as those of its dense companion matrix, for the :math:`C_N` of each restitution of
`RESTITUTIONS`, from weak loss to strong. Larger packings than `EVERY` are not looked at beyond the first restitution at
which nothing grows. The critical restitution lies between two of these and is solved for. A restitution needs a
velocity: that of the scene's [units], or `IMPACT`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import eigvals
from scipy.optimize import brentq

from faultgouge.analysis import Packing, damping_matrix, dynamical_matrix, eigenvalues, mass_weighted
from faultgouge.analysis.windows import force_bearing
from faultgouge.pywrap import Equilibrium, Scene, dashpot, real_units, restitution
from faultgouge.studies.modes import along_ramp, count_pairs

RESTITUTIONS = (0.99, 0.97, 0.9, 0.8, 0.7, 0.5)
"""From weak loss to strong."""

TANGENTIAL = 2 / 7
"""C_T/C_N."""

IMPACT = 0.093
"""Velocity of the impact where a scene has no units: 1 m/s in the units of quartz.toml."""

EVERY = 50
"""Disks up to which every restitution is looked at: growth that loss brings back would be seen there."""

GROWS = 1e-5
"""Re s from which a motion grows, 1 / time: eigenvalues of the companion matrix are uncertain by less."""

SHARP = 0.02
"""Relative error of the critical C_N."""


def loss(scene: Scene, rest: Equilibrium) -> dict[str, Any]:
    """The loss that stops the complex pairs at the loads of [modes], as a row of a sweep: the task "loss"."""
    velocity = impact_velocity(scene)
    kn = scene.law.kn
    dashpots = {each: dashpot(kn, each, 1.0, velocity) for each in RESTITUTIONS}

    def look(packing: Packing) -> dict[str, Any]:
        found = count_pairs(packing)
        squares, told = found.omega**2, found.as_dict()
        drag = squares.imag / np.sqrt(np.maximum(squares.real, np.finfo(float).tiny))
        grown = damped_growth(packing, dashpots)
        critical = restitution(kn, critical_dashpot(packing, dashpots, grown), 1.0, velocity)
        return {name: told[name] for name in ("pairs", "growth_rate", "omega")} | {
            "slowest": float(np.sqrt(max(0.0, eigenvalues(packing).real.min()))),
            "least_q": told["least_q"],
            "drag_rate": float(drag.max(initial=0.0)),
            "damped": [[each, *rate] for each, rate in grown.items()],
            "critical_restitution": min(1.0, critical),
        }

    return along_ramp(scene, rest, look)


def impact_velocity(scene: Scene) -> float:
    """1 m/s in the units of the scene."""
    real = real_units(scene)
    return IMPACT if real is None else real.time / real.length


def with_dashpots(packing: Packing, cn: float, ratio: float = TANGENTIAL) -> Packing:
    """The packing with dashpots C_N and C_T = ratio C_N, and without drag."""
    return replace(packing, law=replace(packing.law, cn=cn, ct=ratio * cn), drag_time=None)


def fastest(packing: Packing) -> complex:
    """The eigenvalue of s^2 M + s C + K with the largest real part, Im s >= 0, 1 / time."""
    bearing = force_bearing(packing)
    a, active = dynamical_matrix(bearing)
    stiffness, damping = a.toarray(), mass_weighted(damping_matrix(bearing), bearing)[active][:, active].toarray()
    size = len(stiffness)
    companion = np.block([[np.zeros((size, size)), np.eye(size)], [-stiffness, -damping]])
    rates = eigvals(companion, check_finite=False)
    found = complex(rates[np.argmax(rates.real)])
    return complex(found.real, abs(found.imag))


def damped_growth(packing: Packing, dashpots: dict[float, float]) -> dict[float, tuple[float, float]]:
    """Largest Re s, and its Im s, by restitution; larger packings are not looked at beyond the first without growth."""
    found = {}
    for each, cn in dashpots.items():
        rate = fastest(with_dashpots(packing, cn))
        found[each] = (rate.real, rate.imag)
        if rate.real <= GROWS and len(packing) > EVERY:
            break
    return found


def critical_dashpot(packing: Packing, dashpots: dict[float, float], grown: dict[float, tuple[float, float]]) -> float:
    """C_N beyond which nothing grows; 0 where the weakest is enough, the strongest where it is not."""
    growing = [each for each, rate in grown.items() if rate[0] > GROWS]
    if not growing:
        return 0.0
    last = min(growing)
    if last == min(dashpots):
        return dashpots[last]
    beyond = max(each for each in dashpots if each < last)
    low, high = dashpots[last], dashpots[beyond]
    return float(
        brentq(lambda cn: fastest(with_dashpots(packing, cn)).real - GROWS, low, high, rtol=SHARP, xtol=SHARP * low)
    )
