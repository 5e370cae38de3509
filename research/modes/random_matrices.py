r"""Complex modes of random matrices with the levels and couplings of a packing: no fitted number.

At a load the operator is :math:`K = S + A` in mass-weighted coordinates, S symmetric and A antisymmetric. In the
eigenbasis of S, with the levels :math:`e_k`, A couples the levels k and l by :math:`A_{kl}`. Spacings are permuted
among neighbouring levels, and elements of A within blocks of levels, with random signs
(:func:`~research.genericity.surrogates.randomise_pencil`): the band of A stays as measured.

**Weak non-symmetry.** To a large real symmetric random matrix with the local spacing :math:`\Delta` an antisymmetric
one is added whose elements have the standard deviation :math:`\sigma`. The share of its eigenvalues that are real is

.. math:: \frac{\sqrt\pi}{2y}\,\mathrm{erf}\,y = \int_0^1 e^{-y^2 s^2} ds, \qquad y = \sqrt2\,\pi\,\frac\sigma\Delta

(the weakly non-symmetric limit of the real elliptic ensemble: Forrester and Nagao, J. Phys. A 41, 375003 (2008)). It
is applied to each level with its local spacing and coupling, and averaged. It depends on :math:`\sigma/\Delta` alone:
A grows with the load, and the spacing falls with the number of disks.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import eigh, eigvals
from scipy.special import erf

from faultgouge.analysis import Floats, Packing, dynamical_matrix
from faultgouge.pywrap import Equilibrium, Scene
from faultgouge.studies.modes import PairCounts, along_ramp
from research.genericity.levels import InterpolatedOperator, local_mean
from research.genericity.surrogates import randomise_pencil

SEED = 35
"""Of the generator that draws the random matrices."""

DRAWS = 2
"""Random matrices for each packing and load: packings differ by more than draws do."""


def weak_share(coupling: Floats, spacing: Floats) -> Floats:
    """Share of complex eigenvalues about levels with local couplings and spacings, 1 / time^2, shape (E,)."""
    y = np.maximum(np.sqrt(2) * np.pi * coupling / spacing, 1e-6)
    return np.asarray(1 - np.sqrt(np.pi) * erf(y) / (2 * y))


def predict_shares(packing: Packing) -> dict[str, Any]:
    """Shares expected from the levels and couplings of a packing.

    Parameters
    ----------
    packing : Packing
        In equilibrium.

    Returns
    -------
    dict
        ratio : mean ratio of successive spacings of S, the smaller over the larger; coupling : median of the local rms
        coupling of neighbours over the local spacing; weak : share by the formula; share, growth_rate, least_q : means
        over random matrices.
    """
    dense = dynamical_matrix(packing)[0].toarray()
    values, basis = eigh(0.5 * (dense + dense.T), driver="evd")
    couplings = basis.T @ (0.5 * (dense - dense.T)) @ basis
    gaps = np.diff(values)
    spacing = local_mean(gaps)
    near = np.sqrt(local_mean(np.diag(couplings, 1) ** 2))
    ratios = np.minimum(gaps[1:], gaps[:-1]) / np.maximum(gaps[1:], gaps[:-1])
    pencil = InterpolatedOperator(values, np.zeros_like(couplings), couplings, basis)
    generator = np.random.default_rng(SEED)
    drawn = [PairCounts.of(eigvals(randomise_pencil(pencil, generator).at(1.0))).as_dict() for _ in range(DRAWS)]
    least = [each["least_q"] for each in drawn if each["least_q"] is not None]
    return {
        "ratio": float(np.mean(ratios)),
        "coupling": float(np.median(near / spacing)),
        "weak": float(np.mean(weak_share(near, spacing))),
        "share": float(np.mean([each["share"] for each in drawn])),
        "growth_rate": float(np.mean([each["growth_rate"] for each in drawn])),
        "least_q": float(np.mean(least)) if least else None,
    }


def random_matrices(scene: Scene, rest: Equilibrium) -> dict[str, Any]:
    """The task "random matrices": what levels and couplings make expect at each load of [modes]."""
    return along_ramp(scene, rest, predict_shares)
