r"""Criteria that several cases share.

**Balance.** Newton's method ends where the force on a disk no longer falls. In an equilibrium this force is at most ten
times the estimated effect of the rounding of coordinates (`pywrap.equilibria.quasistatic`).

**Derivative.** Along a random direction q the forces of LAMMPS, slips advanced on the way, have the derivative -K q.
Central differences of widths h and h/2 are extrapolated, since f'' jumps at s = 0 and at Coulomb's bound. h is far
below every overlap and every slip limit, and coordinates are compensated; what is left is the rounding of net forces, u
F against a change k h, and the curvature of the law, :math:`(h/\delta)^2`. Slips have all states, also at the bound;
the packing need not be in balance.
"""

from __future__ import annotations

import numpy as np

from ....analysis import Packing, stiffness_matrix
from ....pywrap import Engine, Equilibrium
from .case import Outcome, measured_outcome
from .packings import with_low_parts, with_slips

FLOORS = 10.0
"""Newton's own limit, in units of the rounding floor."""

DIRECTIONS = 4
"""Random directions of a derivative: each has all coordinates."""

SLIP_SHARES = (0.1, -0.4, 1.0, 0.02, -0.99, 0.7, -1.0)
"""Slips at which K is examined, in units of their limits."""


def balance(equilibrium: Equilibrium) -> Outcome:
    """Whether an equilibrium is one."""
    overlap = equilibrium.packing.geometry.overlap
    return measured_outcome(
        equilibrium.residual / equilibrium.floor,
        FLOORS,
        f"largest force on a disk, {equilibrium.residual:.1e}, in units of what rounding leaves, "
        f"{equilibrium.floor:.1e}; overlaps are from {overlap.min():.1e} to {overlap.max():.1e}",
    )


def derivative(packing: Packing) -> Outcome:
    """Whether K is the derivative of the forces in LAMMPS."""
    packing = with_low_parts(with_slips(packing, SLIP_SHARES))
    law, overlap = packing.law, packing.geometry.overlap
    share = min(1.0, law.mu * law.kn / law.kt) if law.frictional else 1.0
    width = 2.0 ** np.floor(np.log2(1e-5 * share * overlap.min()))
    matrix = stiffness_matrix(packing)
    generator = np.random.default_rng(1)
    worst = 0.0
    with Engine(packing) as engine:

        def force(step: np.ndarray) -> np.ndarray:
            engine.displace(packing, step)
            return engine.net_force

        for _ in range(DIRECTIONS):
            q = generator.choice([-1.0, 1.0], 3 * len(packing))
            wide, narrow = ((force(-h * q) - force(h * q)) / (2 * h) for h in (width, width / 2))
            worst = max(worst, float(np.abs(2 * narrow - wide - matrix @ q).max()))
    # Net forces are rounded once, coordinates known to their low parts; six differences over h, of six contacts.
    scale = np.abs(matrix).max()
    rounding = (
        40 * (np.finfo(float).eps * np.abs(packing.net_force).max() / scale + packing.coordinate_rounding) / width
    )
    return measured_outcome(
        worst / scale,
        1e-8 + rounding,
        f"largest difference of -dF/dq and K q, in units of max |K|, {DIRECTIONS} directions q, h = {width:.0e}; "
        "the bound is the rounding of forces over h, and 1e-8 of curvature",
    )
