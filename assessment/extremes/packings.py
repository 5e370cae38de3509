r"""The packings of the study: small, made anew by every run, and the same on every machine and number of ranks.

**Crystals.** Rows of equal disks on the floor, each row in the hollows of the one below, under a load on the upper
row. Disks of a row overlap by :math:`\epsilon = (F_y/k_n)^{2/3}`, the scale of all other overlaps, so that the crystal
is braced from side to side and stands without friction, too. The overlap of two rows follows from
:math:`2 f_n \sin\alpha = F_y`.

**Arches.** Large disks, each on two small ones.

**Beds.** Disks of several sizes that have settled from a loose start.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ...analysis import MindlinLaw, Packing, touching
from ...analysis.arrays import Floats
from ...pywrap import Engine, Equilibrium, Scene, equilibrate, settle

KN, LOAD = 2e5, 1.5e-5
"""Normal stiffness of the paper, and its F_y in units of k_n times length^(3/2)."""


def law(kn: float = KN, kt_share: float = 2 / 7, mu: float = 1.0) -> MindlinLaw:
    """A law by its k_t / k_n; the paper's by default."""
    return MindlinLaw(kn, kt_share * kn, mu)


PAPERS = law()


def crystal(
    columns: int, rows: int = 2, law: MindlinLaw = PAPERS, load: float = LOAD, compensated: bool = False
) -> Packing:
    """A crystal at rest up to rounding, with no slip yet; load is F_y / k_n."""
    reach = law.overlap_of_force(load * law.kn)
    spacing, overlap = 1.0 - reach, reach
    for _ in range(200):  # a contraction by a factor of about a tenth
        rise = np.sqrt((1.0 - overlap) ** 2 - 0.25 * spacing**2)
        overlap = law.overlap_of_force(0.5 * load * law.kn * (1.0 - overlap) / rise)
    row, column = np.divmod(np.arange(rows * columns), columns)
    position = np.column_stack([spacing * (column + 0.5 * (row % 2) + 0.25), 0.5 - reach + rise * row])
    packing = _loaded(position, np.full(rows * columns, 0.5), columns * spacing, row == rows - 1, law, load)
    return replace(packing, position_low=np.zeros_like(position)) if compensated else packing


def arches(ratio: float) -> Packing:
    """Three disks of radius 1, each on two of radius 1/ratio, which touch so that they cannot roll."""
    small, load = 1.0 / ratio, 1e-6
    reach = PAPERS.overlap_of_force(load * KN)
    half = small - 0.5 * reach
    centre = np.array([1.0, 3.05, 5.1])
    height = small - reach + np.sqrt((1.0 + small - reach) ** 2 - half**2)
    x = np.append(centre, np.repeat(centre, 2) + np.tile([-half, half], 3))
    radius = np.repeat([1.0, small], [3, 6])
    position = np.column_stack([x, np.repeat([height, small - reach], [3, 6])])
    return _loaded(position, radius, 6.15, radius == 1.0, PAPERS, load)


def _loaded(
    position: Floats, radius: Floats, box: float, top: NDArray[np.bool_], law: MindlinLaw, load: float
) -> Packing:
    """A periodic packing without slips; load is F_y / k_n."""
    contacts, fy = touching(position, radius, box), load * law.kn
    return Packing(position=position, radius=radius, contacts=contacts, law=law, box_length=box, top=top, fy=fy)


@cache
def bed(law: MindlinLaw = PAPERS, load: float = LOAD, seed: int = 1) -> Packing:
    """24 disks that have settled without friction in a box 5.95 wide, with the friction of the law from then on."""
    scene = {
        "packing": {"disks": 24, "top": 5, "width": 8.5 * 0.7, "radii": [0.5, 0.7], "seed": seed},
        "law": {"kn": law.kn, "kt": law.kt, "mu": law.mu},
        "load": {"fy": load * law.kn},
    }
    return settle(Scene.from_mapping(scene)).packing


def with_low_parts(packing: Packing) -> Packing:
    """The packing in compensated arithmetic."""
    if packing.compensated:
        return packing
    contacts = packing.contacts.slipped(packing.contacts.slip, np.zeros(len(packing.contacts)))
    return replace(packing, position_low=np.zeros_like(packing.position), contacts=contacts)


def at_rest(packing: Packing, fx: float = 0.0) -> Equilibrium:
    """The equilibrium at F_x = 0, or at a force after that."""
    with Engine(packing) as engine:
        rest = equilibrate(engine, Equilibrium.of(packing), 0.0)
        return equilibrate(engine, rest, fx) if fx else rest


def shear_packing(packing: Packing) -> Equilibrium:
    """An equilibrium far from sliding as a whole, F_x = 3e-3 F_y, or 0.3 mu F_y if that is less."""
    return at_rest(packing, min(3e-3, 0.3 * packing.law.mu) * packing.fy * packing.law.frictional)
