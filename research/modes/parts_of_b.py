"""Where b matters: complex pairs with b of sticking contacts alone, of sliding contacts alone, and of none.

A tangential force that depends on the overlap, b = d f_t / d overlap, makes K non-symmetric. The equilibria are the
same; the rotation of the tangent, which is non-symmetric too, is kept. With rescaled slips b is the mean of its values
for closing and for opening contacts, and the key `while` has the pairs with either.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import csr_array

from faultgouge.analysis import Packing, stiffness_matrix
from faultgouge.pywrap import Equilibrium, Scene
from faultgouge.studies.modes import PairCounts, along_ramp, load_row

SAFETY = 50.0
"""Imaginary parts count from the bound of rounding with this many units."""


def parts_of_b(scene: Scene, rest: Equilibrium) -> dict[str, Any]:
    """The row of the task "modes", and at each load the pairs with parts of b: a task of sweeps."""
    return along_ramp(scene, rest, lambda packing: load_row(packing) | switched(packing))


def switched(packing: Packing) -> dict[str, Any]:
    """The complex pairs with parts of b."""
    slides = packing.sliding
    kept = {"sticking": ~slides, "sliding": slides, "none": np.zeros_like(slides)}
    found = {"b_of": {name: _pairs(packing, stiffness_matrix(packing, coupled=each)) for name, each in kept.items()}}
    if packing.law.rescales:
        shares = {"closing": 0.0, "parting": 1.0}
        found["while"] = {name: _pairs(packing, stiffness_matrix(packing, parting=p)) for name, p in shares.items()}
    return found


def _pairs(packing: Packing, stiffness: csr_array) -> dict[str, Any]:
    """The pairs of a K; those within the bound of rounding are made real."""
    active = np.flatnonzero(np.diff(stiffness.indptr))
    scale = 1.0 / np.sqrt(packing.coordinate_mass[active])
    dense = scale[:, None] * stiffness[active][:, active].toarray() * scale
    values = np.linalg.eigvals(dense).astype(np.complex128)
    rounding = 0.5 * np.finfo(np.float64).eps * np.linalg.norm(dense)
    surely = np.sqrt(SAFETY * rounding * np.abs(values).max(initial=0.0))
    return PairCounts.of(np.where(np.abs(values.imag) > surely, values, values.real)).as_dict()
