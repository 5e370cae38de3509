r"""Spectra that are hard: pairs about to coalesce, rattlers, stiffnesses over ten decades.

**Near-defective pairs.** The block

.. math::

    B = \begin{pmatrix} 1-d & e \\ -e & 1+d \end{pmatrix}, \qquad
    \lambda = 1 \mp \sqrt{D}/2, \quad D = 4(d-e)(d+e) ,

is hidden in an operator of 60 modes by a rotation. With e = d (1 - eps) the pair is real, with e = d (1 + eps) complex,
and its split :math:`\sqrt{|D|}` is of order :math:`\sqrt{8\epsilon}\,d`. Rounding of the operator, u |A|, changes D by
about 4 d u |A|, however small eps is; it changes the split by the root of that, if eps is small enough. So D is
what the onset is computed from, and a pair counts as complex only if its imaginary part exceeds 50 times its own
rounding (`analysis.spectrum`).

**A real onset.** D of the pair that coalesces in a packing of 100 disks goes through zero linearly, and so has opposite
values at equal distances on either side, however close.
"""

from __future__ import annotations

from functools import cache, partial
from importlib.resources import files
from pathlib import Path

import numpy as np
from scipy.linalg import eigvals

from ....analysis import Onset, spectrum
from ....analysis.motion.eigenvalues import SAFETY, unit_rounding
from ....analysis.windows import System, SystemModes
from ....pywrap import Scene
from ....pywrap.onset import onset_run
from .case import Case, Outcome, failed_outcome, measured_outcome
from .packings import bed, crystal, law, shear_packing, with_rattlers

GROUP = "eigenvalues"

SIZE, SPLIT = 60, 0.05
"""Modes of the operator, and d of the hidden block: all other eigenvalues are far from the pair."""

FX_C = 0.021833056408
"""Onset of the reference packing, by an independent code."""

DISTANCES = np.array([1e-4, 1e-6, 1e-8])
"""Distances from the onset, in units of the onset."""

CURVATURE = 10.0
"""Curvature of D(F_x), relative to its slope over F_x^c; 3.4 was measured."""

ROUNDINGS = 10.0
"""Rounding of D in units of 4 d u |A|: LAPACK's backward error is a few u |A|."""


def _near_defective(eps: float, sign: int) -> Outcome:
    coupling = SPLIT * (1 + sign * eps)
    exact = 4 * (SPLIT - coupling) * (SPLIT + coupling)
    generator = np.random.default_rng(2)
    matrix = np.diag(np.linspace(2, 30, SIZE))
    matrix[:2, :2] = [[1 - SPLIT, coupling], [-coupling, 1 + SPLIT]]
    turn = np.linalg.qr(generator.standard_normal((SIZE, SIZE)))[0]
    matrix = turn @ matrix @ turn.T
    modes = SystemModes.of_operator(0.0, matrix)
    first, second = np.argsort(np.abs(modes.values - 1))[:2]
    found = modes.space((int(first), int(second))).discriminant
    rounding = unit_rounding(matrix)
    believed = modes.partner[first] >= 0
    if believed and sign < 0:
        return failed_outcome("a real pair is reported as complex")
    values = eigvals(matrix)
    one, other = values[np.argsort(np.abs(values - 1))[:2]]
    return measured_outcome(
        abs(found - exact),
        ROUNDINGS * rounding * 4 * SPLIT,
        f"error of D = {exact:.2g}, ten times 4 d u |A| the bound; the split is {abs(exact) ** 0.5:.2g}, of LAPACK's "
        f"eigenvalues {abs(one - other):.2g}; reported as {'complex' if believed else 'real'}",
    )


@cache
def _onset() -> Onset:
    """The reference packing of 100 disks, and its equilibria close to the onset."""
    scene = Scene.from_toml(Path(str(files("faultgouge") / "scenes" / "report.toml")))
    return onset_run(scene, 1.0, near_onset=FX_C * np.outer(DISTANCES, [-1, 1]).ravel())


def _near_an_onset(distance: float) -> Outcome:
    run = _onset()
    forces = sorted(run.between, key=lambda fx: abs(abs(fx - run.fx_c) / FX_C - distance))[:2]
    discriminants, split = [], 0.0
    for fx in sorted(forces):
        modes = SystemModes.of(System.of(run.between[fx]))
        first, second = np.argsort(np.abs(modes.values - run.windows[0].eigenvalue))[:2]
        if (modes.partner[first] >= 0) != (fx > run.fx_c):
            return failed_outcome(f"the pair is real above the onset, or complex below it, at {fx!r}")
        discriminants.append(modes.space((int(first), int(second))).discriminant)
        split = abs(modes.values[first] - modes.values[second])
    below, above = discriminants
    return measured_outcome(
        abs(below + above) / abs(below - above),
        CURVATURE * distance + 2 * run.error / (distance * FX_C),
        f"D of 100 disks below and above F_x^c, {below:.3g} and {above:.3g}: difference of their sizes, in units of "
        f"their sum; the bound is the curvature of D and the error of F_x^c, {run.error:.0e}, over the distance; "
        f"the pair is real below and complex above, with a split of {split:.1e}",
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
    *(
        Case(GROUP, f"100 disks, {distance:g} F_x^c from the onset", partial(_near_an_onset, distance))
        for distance in DISTANCES.tolist()
    ),
    Case(GROUP, "30 % rattlers", _rattlers, True),
    Case(GROUP, "eigenvalues over k_n", _scales, True),
]
