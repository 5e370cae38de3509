r"""Levels and couplings of a packing's stability operator, and the onset that the statistics of two levels predict.

In the eigenbasis X of the symmetric part at rest the operator at a small load F is

.. math:: X^T A(F) X = \mathrm{diag}(e) + F\,(V + C), \qquad V^T = V,\quad C^T = -C .

**Two levels.** The block of two neighbours is, but for its mean,

.. math:: \begin{pmatrix} u & w + a \\ w - a & -u \end{pmatrix}, \qquad D = 4\,(u^2 + w^2 - a^2) :

the pair is complex inside of the disk of radius |a| in the plane (u, w). At rest a = 0. As F grows, so does the disk,
:math:`a = C_{kl} F`, and the point (u, w) wanders, by V. If levels repel each other as those of real symmetric random
matrices do, a level has :math:`\frac{\pi^2}{12} \rho^2 S^2` others within the small distance S above it (Mehta, *Random
Matrices*, 3rd ed., sec. 7.2: :math:`R_2(s) \to \pi^2 s / 6`), :math:`\rho` being the density of levels; that is, points
(u, w) are spread evenly, :math:`q = \frac{\pi}{3} \rho^2` per level. Points enter the disk at the rate

.. math:: \frac{d\Lambda}{dF} = 2 \pi q\, |C| F\, \langle \max(0, |C| - v) \rangle,

v being the velocity along the normal, of standard deviation :math:`\sigma_V`, the typical :math:`V_{kl}` of
neighbours (for such matrices :math:`(V_{kk} - V_{ll})/2` has the same). With the couplings of neighbours normally
distributed with standard deviation :math:`\sigma_C`,

.. math:: \Lambda(F) = \Bigl(\frac{F}{F_0}\Bigr)^2, \qquad F_0^{-2} = \frac{\pi^2}{3} \sum_k \rho_k^2\, m(\sigma_C,
\sigma_V),
          \qquad m = \langle |C| \max(0, |C| - v) \rangle ,

and if windows open independently of each other, the share of packings without an onset up to F is
:math:`e^{-\Lambda(F)}`; the median onset is :math:`F_0 \sqrt{\ln 2}`. No parameter is fitted.

**Size.** With N disks :math:`\rho \propto N`. Modes that extend over all disks have amplitudes :math:`N^{-1/2}`: a
coupling is a sum over N contacts of terms of order 1/N with random signs, :math:`\sigma \propto N^{-1/2}`. Then
:math:`F_0^{-2} \propto N \cdot N^2 \cdot N^{-1}`, and :math:`F_0 \propto 1/N`. If the modes were localised on a number
of disks that does not depend on N, each would meet only those about it, whose density and coupling do not depend on N
either: :math:`F_0^{-2} \propto N`, and :math:`F_0 \propto N^{-1/2}`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_array

from faultgouge.analysis import Floats, Indices, spectrum
from faultgouge.analysis.windows import System, force_bearing
from faultgouge.pywrap import Equilibrium, Scene, ramp_loads
from faultgouge.studies.packing_tools import path_from

AVERAGED_OVER = 21
"""Levels over which local densities and couplings are averaged: some 5 % of the level's statistics in error, and few
enough that the density does not change over them."""

SMALL = 0.1
"""The small load from which V and C are taken, in increments: what bends over it is a hundredth of what bends over ten
increments, and its difference stands seven digits out of the residuals."""


@dataclass(frozen=True, eq=False)
class InterpolatedOperator:
    """diag(values) + F (symmetric + antisymmetric), the operator about rest.

    Attributes
    ----------
    values : ndarray, shape (E,)
        Levels at rest, increasing; 1 / time^2.
    symmetric, antisymmetric : ndarray, shape (E, E)
        V and C, 1 / (time^2 force).
    basis : ndarray, shape (n, E)
        X, in all coordinates.
    """

    values: Floats
    symmetric: Floats
    antisymmetric: Floats
    basis: Floats

    @classmethod
    def between(cls, rest: csr_array, there: csr_array, fx: float) -> InterpolatedOperator:
        """From the operator at rest and at a small load."""
        active: Indices = np.flatnonzero(np.diff(rest.indptr))
        dense = rest[active][:, active].toarray()
        values, inner = eigh(0.5 * (dense + dense.T), driver="evd")
        change = inner.T @ ((there - rest)[active][:, active] @ inner) / fx
        skew = inner.T @ (there[active][:, active] @ inner) / fx
        basis = np.zeros((rest.shape[0], len(values)))
        basis[active] = inner
        return cls(values, 0.5 * (change + change.T), 0.5 * (skew - skew.T), basis)

    def at(self, fx: float) -> Floats:
        """The operator at a load, 1 / time^2, shape (E, E)."""
        return np.diag(self.values) + fx * (self.symmetric + self.antisymmetric)


def pencil_of(scene: Scene, rest: Equilibrium) -> InterpolatedOperator:
    """The operator of a scene's packing about rest, from a small load."""
    step = float(ramp_loads(scene)[1])
    with path_from(rest, scene) as path:
        there = path(SMALL * step)
    return InterpolatedOperator.between(System.of(rest.packing).stiffness, System.of(there).stiffness, there.fx)


def levels(scene: Scene, rest: Equilibrium) -> dict[str, Any]:
    """The task "levels": spacing, couplings and the predicted scale F_0 of a packing's onset.

    Returns
    -------
    dict
        modes : E; spacing : median of the local mean spacing, 1 / time^2; ratio : mean ratio of successive spacings,
        the smaller over the larger (0.386 for independent levels, 0.531 for real symmetric random matrices; Atas et
        al., PRL 110, 084101 (2013)); coupling, speed : medians of the local rms of C and of V between neighbours, in
        local spacings per force; participation : median number of disks in a mode; f0 : F_0, force per disk of the
        layer.
    """
    pencil = pencil_of(scene, rest)
    gaps = np.diff(pencil.values)
    spacing = local_mean(gaps)
    neighbours = np.arange(len(gaps)), np.arange(1, len(gaps) + 1)
    coupling = np.sqrt(local_mean(pencil.antisymmetric[neighbours] ** 2)) / spacing
    speed = np.sqrt(local_mean(pencil.symmetric[neighbours] ** 2)) / spacing
    ratios = np.minimum(gaps[1:], gaps[:-1]) / np.maximum(gaps[1:], gaps[:-1])
    weight = np.sum(pencil.basis.reshape(3, -1, len(pencil.values)) ** 2, axis=0)
    return {
        "modes": len(pencil.values),
        "spacing": float(np.median(spacing)),
        "ratio": float(np.mean(ratios)),
        "coupling": float(np.median(coupling)),
        "speed": float(np.median(speed)),
        "participation": float(np.median(1 / np.sum(weight**2, axis=0))),
        "f0": onset_scale(coupling, speed),
    }


def onset_scale(coupling: Floats, speed: Floats) -> float:
    """F_0 from the standard deviations of C and V between neighbours, in local spacings per force, shape (E - 1,)."""
    return float((np.pi**2 / 3 * np.sum(coupling**2 * entry_factor(speed / coupling))) ** -0.5)


def entry_factor(ratio: Floats) -> Floats:
    r"""m / sigma_C^2 for r = sigma_V / sigma_C: 1 where levels stand still, r / pi where they are fast.

    With c and v normally distributed :math:`\langle c^2 \Phi(|c|/r) + r |c| \varphi(c/r) \rangle = \frac12 +
    \frac1\pi (r + \arctan \frac1r)`.
    """
    return np.asarray(0.5 + (ratio + np.arctan2(1.0, ratio)) / np.pi)


def local_mean(values: Floats) -> Floats:
    """The mean over neighbouring levels."""
    from scipy.ndimage import uniform_filter1d  # slow to import

    return uniform_filter1d(values, AVERAGED_OVER, mode="reflect")


def growth(scene: Scene, rest: Equilibrium) -> dict[str, Any]:
    """The task "growth": complex pairs and the largest growth rate of D at every increment of a ramp.

    Returns
    -------
    dict
        fx, pairs, rate : lists, one entry an equilibrium; rate in 1 / time, 0 where all eigenvalues are real. They end
        where the packing flows.
    """
    row: dict[str, Any] = {"fx": [], "pairs": [], "rate": []}
    with path_from(rest, scene) as path:
        for equilibrium in path.climb(ramp_loads(scene)[1:]):
            modes = spectrum(force_bearing(equilibrium.packing))
            row["fx"].append(equilibrium.fx)
            row["pairs"].append(len(modes.pairs))
            row["rate"].append(max((pair.growth_rate for pair in modes.pairs), default=0.0))
    return row
