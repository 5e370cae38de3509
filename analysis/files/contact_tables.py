r"""Spheres and contact forces of other codes, from tables, as a Configuration.

**Spheres**: any format of :mod:`.formats` that has x, y, z and radius or diameter (and id, mass or density): CSV,
YADE's ``#format x_y_z_r``, a LAMMPS or LIGGGHTS dump, LAMMPS data, a MercuryDPM .data.

**Contacts**: a table with names in the first line, a dump local, or a MercuryDPM .fstat. On the first particle of a
row act :math:`f_n \mathbf n + \mathbf f_t`, with :math:`\mathbf n` from the second to the first and :math:`f_n` of a
repulsion positive (docs/moduli.md has a picture). Names are

====================  ================================================================================================
id1, id2              the particles; of a wall 0, or below 0 in .fstat
fn                    f_n; LAMMPS's pair/local: force
ftx, fty, ftz         f_t on the first; LAMMPS's pair/local: p1, p2, p3
fx, fy, fz            in place of fn, ftx ..: the whole force on the first; LIGGGHTS's pair/gran/local: force
fnx .., fsx ..        YADE's phys.normalForce and phys.shearForce: forces on the second
px, py, pz            where a wall is touched, for rows of walls
====================  ================================================================================================

Columns of a dump local have no names but c_1[1] ...: `--columns` gives theirs, or `dump_modify colname` in the deck.
Which of two opposite signs a table has is read off the balance of forces. Where the other sign balances the forces
better it is taken, and a remark says so.

Forces are taken from the table, overlaps and stiffnesses from the forces, directions from the places: with six digits
of places a residual of 1e-5 of the forces is left, which a load balances. Friction mu f_n and |f_t| have errors of 5e-6
each, so that a contact within 1.5e-5 of Coulomb's bound is taken as one at the bound.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Floats, derive_frozen
from ..configuration import Configuration
from ..contacts import WALL
from ..elasticity.material_spheres import Material, spheres_of_material
from ..errors import BadInputError, PackingFileError
from ..motion.stability import Stability, stability
from .atomic_write import telling
from .formats.disks import Disks, choose_frame, places_of
from .formats.tables import columns_of, contact_columns, lines_of, number_of, strip_comments

HALF_A_DIGIT = 5e-6
"""Largest relative error of a number that is rounded to six digits."""

AT_REST = 1e-3
"""Residual, as a share of the mean contact force, up to which forces are those of a packing at rest: digits leave 1e-5,
and a run that nearly rests 1e-4. Measured forces of a laboratory are out of balance by a half."""

BETTER_SIGN = 0.1
"""Share of the residual that the other sign must leave to be the right one."""

ROUNDED_TABLES = 4
"""Draws of numbers within their rounding, beside the table itself, whose verdicts must agree."""

TOUCHING = 1.001
"""Distance up to which spheres of a row touch, in sums of their radii: places are rounded."""

FSTAT = ["time", "id1", "id2", "px", "py", "pz", "delta", "deltat", "fn", "ft", "nx", "ny", "nz", "tx", "ty", "tz"]
FORCES = ["fn", "fx", "fy", "fz", *(f"{name}{axis}" for name in ("ft", "fn", "fs") for axis in "xyz")]
"""Names of columns with forces."""


def material_of(text: str) -> Material:
    """A material of key=value,...; a BadInputError names the word that is wrong."""
    given: dict[str, float] = {}
    for word in text.split(","):
        key, _, value = map(str.strip, word.partition("="))
        if key not in Material._fields or not value:
            raise BadInputError(f"--material {word.strip()!r}: give {', '.join(Material._fields)}, as in young=7e10")
        given[key] = number_of(value, f"--material {key}")
    return Material(**given).checked()


def of_material(spheres: Disks, material: Material, **more: Any) -> Configuration:
    """Spheres with Hertz's contacts, or springs; in a sentence of their table where they form no packing."""
    sides, mass = spheres.periodic or [False] * 3, spheres.mass if material.density is None else None
    options: dict[str, Any] = {"box": spheres.box, "origin": spheres.origin, "periodic": sides, "mass": mass} | more
    with telling(spheres.source, "describes no possible packing", ValueError):
        return spheres_of_material(spheres.position, spheres.radius, material, **options)


def _fstat(path: Path, frame: int) -> dict[str, Floats]:
    """The contacts of MercuryDPM at one time, whose lines follow a line "# time ...", and two more comments."""
    lines = lines_of(path)
    starts = [k for k, line in enumerate(lines) if re.match(r"#\s+\d", line)]
    chosen = choose_frame(path, len(starts), frame)
    begin, end = [*starts, len(lines)][chosen : chosen + 2]
    table = columns_of(path, strip_comments(lines[begin:end], begin + 1), FSTAT, f"{len(FSTAT)} are needed")
    return table | {f"ft{axis}": table["ft"] * table[f"t{axis}"] for axis in "xyz"}


def read_contacts(
    spheres: Disks, path: Path, material: Material, columns: Sequence[str] | None = None, frame: int = -1
) -> Configuration:
    """The packing of spheres and a table of contacts with forces, under a load that balances what the digits leave.

    A PackingFileError if a column is missing, a contact names a sphere that is not there or two that do not touch, or
    forces are out of balance.
    """
    of_mercury = path.suffix == ".fstat"
    table = _fstat(path, frame) if of_mercury else contact_columns(path, "id1", "id2", frame=frame, names=columns)
    # neighbours that do not touch have rows of zeros in pair/local
    forces = [table[name] for name in FORCES if name in table]
    table = {name: column[np.any(forces, axis=0)] if forces else column for name, column in table.items()}
    ids = np.array([table["id1"], table["id2"]])
    wall = (ids[1] < 0) | ((ids[1] == 0) & (0 not in spheres.id))
    i, j = places_of(ids, spheres.id, path, np.array([np.zeros_like(wall), wall]))
    for itself in ids[0][ids[0] == ids[1]]:
        raise PackingFileError(f"{path}: sphere {itself:g} touches itself.")
    j[wall] = WALL

    # vectors from the second to the first, through the sides of the box where they do not touch otherwise
    place = np.pad(spheres.position, ((0, 0), (0, 3 - spheres.position.shape[1])))
    branch, reach = place[i] - place[j], np.where(wall, np.inf, spheres.radius[i] + spheres.radius[j])
    if wall.any():
        if "px" not in table:
            raise PackingFileError(f"{path} has contacts with walls, and no px, py, pz: where each wall is touched.")
        # a point in the middle of the overlap is on the line through the centre, whatever wall it is
        branch[wall] = (place[i] - np.column_stack([table[f"p{axis}"] for axis in "xyz"]))[wall]
    apart, told, images = np.linalg.norm(branch, axis=1) > TOUCHING * reach, spheres.periodic is not None, 0 * branch
    may = np.array(spheres.periodic if told else [True] * 3)
    if apart.any() and spheres.box is not None:
        images = np.where(may & apart[:, None], np.round(branch @ np.linalg.inv(spheres.box)), 0.0)
        branch = branch - images @ spheres.box
    periodic = may if told else images.any(axis=0)  # where the file does not say: the sides that a contact needs
    gap = np.linalg.norm(branch, axis=1) - reach
    for k in np.flatnonzero(gap > (TOUCHING - 1) * reach):
        says = f"spheres {spheres.id[i[k]]} and {spheres.id[j[k]]} have a contact and are {gap[k]:.3g} apart"
        raise PackingFileError(f"{path}: {says}: give the places of the same moment, and the box.")
    fn, ft = _forces(path, table, branch / np.linalg.norm(branch, axis=1)[:, None])

    # each contact once, though .fstat may have it from both sides
    image = np.round(branch * np.where(i < j, 1, -1)[:, None] / spheres.radius.mean(), 3)
    _, once = np.unique(np.column_stack([np.minimum(i, j), np.maximum(i, j), image]), axis=0, return_index=True)
    i, j, branch, fn, ft = (each[np.sort(once)] for each in (i, j, branch, fn, ft))
    size, bound = np.linalg.norm(ft, axis=1), material.friction * np.maximum(fn, 0.0)
    for k in np.flatnonzero(size > (1 + AT_REST) * bound):
        says = f"|f_t| of {spheres.id[i[k]]} is {size[k] / max(fn[k], 1e-300):.4g} f_n, beyond the coefficient of"
        raise PackingFileError(f"{path}: {says} friction {material.friction:g}: give --material friction=.")
    # what the digits do not tell from the bound is at the bound
    ft = ft * np.divide(bound, size, out=np.ones_like(size), where=size > (1 - 3 * HALF_A_DIGIT) * bound)[:, None]

    more = {"contacts": (i, j, branch), "normal_force": fn, "periodic": periodic}
    found, other = (of_material(spheres, material, tangential_force=sign * ft, **more) for sign in (1.0, -1.0))
    lacks, flipped, remarks = _out_of_balance(found), _out_of_balance(other), list[str]()
    if flipped < BETTER_SIGN * lacks:
        found, lacks = other, flipped
        remarks = ["tangential forces are those on the second particle: with the other sign they do not balance"]
    if lacks > AT_REST:
        cure = "it does not rest, or a contact or a wall is missing"
        raise PackingFileError(f"{path}: forces are out of balance by {lacks:.2g} of the mean contact force: {cure}.")
    remarks.append(f"forces balance to {lacks:.1g} of their mean but for gravity; a load takes what is left")
    return derive_frozen(found, remarks=tuple(remarks))


def _forces(path: Path, table: dict[str, Floats], n: Floats) -> tuple[Floats, Floats]:
    """f_n and f_t on the first partner."""
    whole, elastic, shear, tangential = (
        np.column_stack([table[f"{name}x"], table[f"{name}y"], table.get(f"{name}z", np.zeros(len(n)))])
        if {f"{name}x", f"{name}y"} <= table.keys() else None for name in ("f", "fn", "fs", "ft")
    )  # fmt: skip
    if elastic is not None and shear is not None:  # YADE, on the second
        whole = -(elastic + shear)
    if whole is not None and "fn" not in table:
        normal = np.einsum("ca,ca->c", whole, n)
        sign = -1 if np.sum(normal < 0) > 0.5 * len(normal) else 1
        return sign * normal, sign * (whole - normal[:, None] * n)
    if "fn" not in table or tangential is None:
        has = ", ".join(table)
        raise PackingFileError(f"{path} says no forces: give fn, ftx, fty, ftz, or fx, fy, fz (its columns: {has}).")
    return table["fn"], tangential - np.einsum("ca,ca->c", tangential, n)[:, None] * n


def _out_of_balance(c: Configuration) -> float:
    """The largest force or torque on a particle that is free to move, gravity taken out, over the mean f_n."""
    force, touch = c.contact_force.copy(), np.setdiff1d(np.arange(len(c)), c.rattlers)
    gravity = c.mass[touch] @ force[touch, 0] / np.sum(c.mass[touch] ** 2)
    force[:, 0] -= c.mass[:, None] * gravity
    force[:, 1] /= c.radius[:, None]
    return float(np.abs(force[touch]).max(initial=0.0) / (c.normal_force.mean() if len(c.contacts) else 1.0))


def verdict_within_digits(found: Configuration) -> tuple[Stability, str]:
    """The verdict of a packing of a table as it is, and whether all draws of forces and stiffnesses within the rounding
    of six digits have the same."""
    verdicts, c, rng = [stability(found)], found.contacts, np.random.default_rng(0)
    for _ in range(ROUNDED_TABLES):
        error = 1 + HALF_A_DIGIT * rng.uniform(-1, 1, (2, len(c)))
        across = rng.uniform(-1, 1, (len(c), 3)) * (np.arange(3) < found.dimension)
        turned = c.tangential_force + HALF_A_DIGIT * c.normal_force[:, None] * across
        turned -= np.einsum("ca,ca->c", turned, c.normal)[:, None] * c.normal
        size, most = np.linalg.norm(turned, axis=1), c.friction * error[0]
        held = np.where(c.at_bound | (size > most), most / np.maximum(size, np.finfo(float).tiny), 1.0)
        drawn = derive_frozen(
            c, normal_force=c.normal_force * error[0], friction=most, tangential_force=turned * held[:, None],
            normal_stiffness=c.normal_stiffness * error[1], tangential_stiffness=c.tangential_stiffness * error[1],
        )  # fmt: skip
        verdicts.append(stability(derive_frozen(found, contacts=drawn, load=found.load)))
    seen, words = [each.stable for each in verdicts], {True: "stable", False: "unstable", None: "not known"}
    if len(set(seen)) > 1:
        says = ", ".join(f"{words[each]} in {seen.count(each)}" for each in dict.fromkeys(seen))
        says = f"six digits do not tell: of {len(seen)} tables that round to this one the verdict is {says}"
        return verdicts[0], says
    spread = [each for v in verdicts if (each := v.growth_rate) is not None and np.isfinite(each)]
    more = f", with growth rates from {min(spread):.6g} to {max(spread):.6g}" if spread else ""
    return verdicts[0], f"six digits tell: {len(seen)} tables that round to this one have this verdict{more}"
