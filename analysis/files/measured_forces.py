r"""Contact forces that a laboratory has measured, in RigidLibrary's two text files: counts and chances, and no rates.

**Files.** Numbers between commas, without names; of a contact there are often two rows, one measured at either disk.

=========  ====================================================================
particles  ``[step,] id, x, y, radius, flag``
contacts   ``step, id1, id2, f_t, f_n``; f_t along n turned by 90 degrees; walls
           have negative numbers, and are left out
=========  ====================================================================

(S. Henkes, D. A. Quint, Y. Fily and J. M. Schwarz, Phys. Rev. Lett. 116, 028001, 2016; of photoelastic disks K. Liu,
J. E. Kollmer, K. E. Daniels, J. M. Schwarz and S. Henkes, Phys. Rev. Lett. 126, 088002, 2021.) The sign of all f_t that
balances the forces better is taken.

Measured forces do not balance, and those of the two sides of a contact differ. Growth rates come from the small
asymmetric part of K, so that no rate is told. Counts are: contacts, those at Coulomb's bound, motions without
stiffness, and in how many draws of the forces from their errors the linearised packing, balanced by a load on each
disk, is unstable. The error of f_n is read off the two sides of the contacts; equal sides, or one, do not tell it.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from scipy.linalg import eigvalsh

from ..arrays import Floats, derive_frozen
from ..configuration import Configuration
from ..counted import counted
from ..elasticity.material_spheres import Material, spheres_of_material
from ..errors import PackingFileError
from ..motion.eigenvalues import active_coordinates, mass_weighted
from ..motion.stability import stability
from ..operators.stiffness import stiffness_matrix
from .atomic_write import telling
from .formats.disks import choose_frame

DRAWN_FORCES = 10
"""Draws of the forces: a chance of one half is then known within a third."""

FREE_OF_SPRINGS = 1e-9
"""Eigenvalue of the springs, over the largest, of a motion without stiffness."""

NO_RATE = "no growth rate is given: it comes from the small asymmetric part of K, which measured errors exceed"


def is_measured(contacts: Path) -> bool:
    """Whether a table of contacts has rows of five numbers between commas from its first line on."""
    with contacts.open(errors="replace") as lines:
        return bool(re.fullmatch(",".join(5 * [r"\s*(?:[-+.\deE]+|nan|inf)\s*"]), next(lines, "")))


def _rows(path: Path, *widths: int) -> Floats:
    with telling(path, "is no table of numbers between commas"):
        rows = np.loadtxt(path, delimiter=",", ndmin=2)
    if rows.shape[1] not in widths or not np.isfinite(rows).all():
        needs = "particles have [step,] id, x, y, radius, flag and its contacts step, id1, id2, ft, fn, all finite"
        raise PackingFileError(f"{path} has rows of {rows.shape[1]} numbers: RigidLibrary's {needs}.")
    return rows


def measured_forces(
    particles: Path, contacts: Path, material: Material, frame: int = -1
) -> tuple[Configuration, list[str]]:
    """A packing with measured contact forces, as one whose stability is not known, and what can be said of it.

    That are counts, rigidity, the chance of "unstable", and why there is no rate. `frame` is which of the steps of the
    table of contacts, in their order. A PackingFileError if a table is none of RigidLibrary's, or a contact names a
    disk that is not there.
    """
    disks, rows = _rows(particles, 5, 6), _rows(contacts, 5)
    steps = np.unique(rows[:, 0])
    step = steps[choose_frame(contacts, len(steps), frame)]
    disks = disks[disks[:, 0] == step][:, 1:] if disks.shape[1] == 6 else disks
    rows, ids, centre, radius = rows[rows[:, 0] == step], disks[:, 0], disks[:, 1:3], disks[:, 3]
    walls = (rows[:, 1:3] < 0).any(axis=1)  # the files do not say where these are
    rows = rows[~walls]
    for strange in np.setdiff1d(rows[:, 1:3], ids):
        raise PackingFileError(f"{contacts}: a contact names disk {strange:g}, which is not in {particles}.")
    # mean of the rows of each pair; the tangent turns with the normal, so that f_t is the same from both sides
    ends = np.sort(np.argsort(ids)[np.searchsorted(np.sort(ids), rows[:, 1:3])], axis=1)
    pairs, place, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    place = place.ravel()
    ft, fn = (np.bincount(place, rows[:, k], len(pairs)) / count for k in (3, 4))
    differ = np.abs(rows[:, 4] - fn[place]) / np.maximum(fn[place], np.finfo(float).tiny)
    twice = differ[(count[place] > 1) & (differ > 0)]
    (i, j), fn, ft = pairs[fn > 0].T, fn[fn > 0], ft[fn > 0]
    branch = np.pad(centre[i] - centre[j], ((0, 0), (0, 1)))
    along = np.cross([0.0, 0.0, 1.0], branch / np.linalg.norm(branch, axis=1)[:, None])
    mass = np.pi * radius**2 * (material.density or 1.0)

    def packing(fn: Floats, ft: Floats) -> Configuration:
        bound = material.friction * fn
        found = spheres_of_material(
            centre, radius, material._replace(density=None), mass=mass, contacts=(i, j, branch), normal_force=fn,
            tangential_force=np.clip(ft, -bound, bound)[:, None] * along,
        )  # fmt: skip
        return derive_frozen(found, inertia=0.5 * mass * radius**2)

    touches, own = (np.bincount(np.append(i, j), each, len(radius)) for each in (None, np.append(fn, fn)))
    inside = touches > 2  # fewer are rattlers, or held by a wall that the files do not have
    found, other = packing(fn, ft), packing(fn, -ft)
    forces = (np.linalg.norm(each.contact_force[inside, 0], axis=1) for each in (found, other))
    lacks, flipped = (force * touches[inside] / own[inside] for force in forces)
    if flipped.sum() < lacks.sum():
        found, ft, lacks = other, -ft, flipped
    chance = "the table has one f_n for a contact, not one from either side: its error, and a chance, are not known"
    if len(twice):
        error, rng, seen = 2 * float(np.median(twice)), np.random.default_rng(0), list[bool | None]()
        for _ in range(DRAWN_FORCES):
            drawn = fn * np.maximum(1 + error * rng.standard_normal(len(fn)), 0.1)
            seen.append(stability(packing(drawn, ft + error * fn * rng.standard_normal(len(fn)))).stable)
        words = f"unstable in {seen.count(False)} and not known in {seen.count(None)} of {DRAWN_FORCES} draws of the"
        chance = (
            f"{words} forces within an error of f_n of {error:.2g}, if a load on each disk balanced the forces drawn"
        )
    # motions of the disks in contact that stretch no spring, without translations and rotation as a whole
    c, none = found.contacts, np.zeros_like(found.contacts.normal)
    sticking = np.where(c.at_bound, 0.0, c.tangential_stiffness)
    bare = derive_frozen(c, normal_force=0 * fn, tangential_force=none, closing=none, parting=none,
                         tangential_stiffness=sticking)  # fmt: skip
    matrix = mass_weighted(stiffness_matrix(derive_frozen(found, contacts=bare)), found)
    moves = active_coordinates(matrix)
    values = eigvalsh(matrix[moves][:, moves].toarray())
    floppy = 3 * np.count_nonzero(touches) - 3 - int(np.sum(values > FREE_OF_SPRINGS * values[-1]))
    at_bound, most = int(c.at_bound.sum()), np.median(lacks) if len(lacks) else 0.0
    says = [
        f"{counted(len(fn), 'contact')} of {counted(len(np.unique(pairs)), 'disk')}, {at_bound} at Coulomb's bound; "
        f"forces on a disk are out of balance by {most:.2g} of its mean contact force (median); "
        f"{counted(int(walls.sum()), 'row')} of walls left out, whose place no file has",
        f"{floppy} motions without stiffness beside those of a free body, if contacts at the bound slide",
        chance,
        NO_RATE,
    ]
    return derive_frozen(found, slips_known=False, remarks=tuple(says)), says
