r"""Spectra that are hard: pairs about to coalesce, rattlers, stiffnesses over ten decades.

**Near-defective pairs.** The block

.. math::

    B = \begin{pmatrix} 1-d & e \\ -e & 1+d \end{pmatrix}, \qquad
    \lambda = 1 \mp \sqrt{D}/2, \quad D = 4(d-e)(d+e) ,

is hidden in an operator of 60 modes by a rotation. With e = d (1 - eps) the pair is real, with e = d (1 + eps) complex,
and its split :math:`\sqrt{|D|}` is of order :math:`\sqrt{8\epsilon}\,d`. Rounding of the operator, u |A|, changes the
split by its own root, but D, a smooth function of the operator, by about 4 d u |A|, however small eps is: so D is what
the onset is computed from.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy.linalg import eigvals

from ....analysis import spectrum
from ....analysis.motion.eigenvalues import SAFETY, unit_rounding
from .case import Case, Outcome, failed_outcome, measured_outcome
from .packings import bed, crystal, law, shear_packing, with_rattlers

GROUP = "eigenvalues"

SIZE, SPLIT = 60, 0.05
"""Modes of the operator, and d of the hidden block: all other eigenvalues are far from the pair."""

ROUNDINGS = 10.0
"""Rounding of D in units of 4 d u |A|: LAPACK's backward error is a few u |A|."""


def _near_defective(eps: float, sign: int) -> Outcome:
    coupling = SPLIT * (1 + sign * eps)
    exact = 4 * (SPLIT - coupling) * (SPLIT + coupling)
    matrix = np.diag(np.linspace(2, 30, SIZE))
    matrix[:2, :2] = [[1 - SPLIT, coupling], [-coupling, 1 + SPLIT]]
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((SIZE, SIZE)))[0]
    matrix = turn @ matrix @ turn.T
    values = eigvals(matrix)
    one, other = values[np.argsort(np.abs(values - 1))[:2]]
    return measured_outcome(
        abs((one - other) ** 2 - exact),
        ROUNDINGS * unit_rounding(matrix) * 4 * SPLIT,
        f"error of D = {exact:.2g}, the squared split of LAPACK's two eigenvalues, ten times 4 d u |A| the bound; "
        f"the split is {abs(exact) ** 0.5:.2g}, of LAPACK's eigenvalues {abs(one - other):.2g}",
    )


def _rattlers() -> Outcome:
    """30 % of the disks touch nothing: the eigenvalues of the others do not change."""
    settled = shear_packing(bed()).packing
    extra = round(len(settled) * 3 / 7)
    height = settled.position[:, 1].max() + 2.0 + 1.5 * np.arange(extra)
    hovering = np.column_stack([np.linspace(0.0, 5.0, extra), height])
    both = with_rattlers(settled, hovering, top=False)
    alone, found = spectrum(settled), spectrum(both)
    if len(found.eigenvalues) != len(alone.eigenvalues):
        return failed_outcome(f"{len(found.eigenvalues)} eigenvalues instead of {len(alone.eigenvalues)}")
    return measured_outcome(
        np.abs(found.eigenvalues - alone.eigenvalues).max() / alone.rounding,
        0.0,
        f"eigenvalues with {len(found.rattlers)} rattlers of {len(both)} disks against those without the disks that "
        "were added, in units of u |A|: the same to the bit",
    )


def _scales() -> Outcome:
    """Eigenvalues over k_n are the same for all k_n at the same load over k_n."""
    scaled = [
        np.sort(spectrum(crystal(3, 2, law(kn))).eigenvalues.real) / kn for kn in (1e2, 1e4, 1e6, 1e8, 1e10, 1e12)
    ]
    return measured_outcome(
        np.abs(np.array(scaled) - scaled[0]).max() / scaled[0].max(),
        SAFETY * np.finfo(float).eps,
        "eigenvalues / k_n of a crystal for k_n from 1e2 to 1e12, in units of the largest: 50 roundings",
    )


CASES = [
    *(
        Case(
            GROUP,
            f"pair at eps = {sign * 10.0**-exponent:+.0e}, {'complex' if sign > 0 else 'real'}",
            partial(_near_defective, 10.0**-exponent, sign),
            exponent in (4, 10, 16),
        )
        for exponent in (4, 6, 8, 10, 12, 14, 16)
        for sign in (-1, 1)
    ),
    Case(GROUP, "30 % rattlers", _rattlers, True),
    Case(GROUP, "eigenvalues over k_n", _scales, True),
]
