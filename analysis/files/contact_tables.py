r"""Spheres and contact forces of other codes, from tables, as a Configuration.

**Spheres**: CSV or blanks between columns, with names in the first line (x, y, z, radius or diameter; id, mass or
density), as YADE's ``#format x_y_z_r`` has them; a LAMMPS or LIGGGHTS dump; a MercuryDPM .data.

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

**What six digits can tell.** Forces are taken from the table, overlaps and stiffnesses from the forces, directions from
the places: with six digits of places a residual of 1e-5 of the forces is left, which a load balances. Friction mu f_n
and |f_t| have errors of 5e-6 each, so that a contact within 1.5e-5 of Coulomb's bound is taken as one at the bound.
`verdict_within_digits` gives the verdict that all of some draws within the rounding share, or says that the digits do
not tell.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Indices, derive_frozen
from ..configuration import Configuration
from ..contacts import WALL
from ..counted import counted
from ..elasticity.material_spheres import Material, spheres_of_material
from ..errors import BadInputError, PackingFileError
from ..motion.stability import Stability, stability
from .formats.lammps_dump import dump_frames
from .formats.tables import lines_of, number_of

HALF_A_DIGIT = 5e-6
"""Largest relative error of a number that is rounded to six digits."""

AT_REST = 1e-3
"""Residual, as a share of the mean contact force, up to which forces are those of a packing at rest: digits leave 1e-5,
and a run that nearly rests 1e-4. Measured forces of a laboratory are out of balance by a half."""

BETTER_SIGN = 0.1
"""Share of the residual that the other sign must leave to be the right one."""

ROUNDED_TABLES = 4
"""Draws of numbers within their rounding, beside the table itself, whose verdicts must agree."""

FSTAT = ["time", "id1", "id2", "cx", "cy", "cz", "delta", "deltat", "fn", "ft", "nx", "ny", "nz", "tx", "ty", "tz"]
DATA = {
    14: ["x", "y", "z", "vx", "vy", "vz", "radius", "q1", "q2", "q3", "wx", "wy", "wz", "info"],
    8: ["x", "y", "vx", "vy", "radius", "q", "w", "info"],
}
NAMES = {"r": "radius", "rad": "radius", "c_radius": "radius", "xu": "x", "yu": "y", "zu": "z", "force": "fn",
         "p1": "ftx", "p2": "fty", "p3": "ftz", "i": "id1", "j": "id2", "patom1": "id1", "patom2": "id2",
         "f_n": "fn", "f_t_x": "ftx", "f_t_y": "fty", "f_t_z": "ftz"}  # fmt: skip


FORCES = ["fn", "fx", "fy", "fz", *(f"{name}{axis}" for name in ("ft", "fn", "fs") for axis in "xyz")]
"""Names of columns with forces."""


@dataclass(frozen=True, eq=False)
class Spheres:
    """Spheres of a table: IDs, places (N, 2 or 3), radii, masses where they are known, and the box."""

    source: str
    id: Indices
    position: Floats
    radius: Floats
    mass: Floats | None
    box: Floats | None
    origin: Floats
    periodic: NDArray[np.bool_] | None

    def of_material(self, material: Material, **more: Any) -> Configuration:
        """The spheres with Hertz's contacts, or springs; in a sentence of their table where they form no packing."""
        if material.density is not None:
            self = replace(self, mass=None)
        options = {"box": self.box, "origin": self.origin, "mass": self.mass} | more
        options.setdefault("periodic", [False] * 3 if self.periodic is None else self.periodic)
        try:
            return spheres_of_material(self.position, self.radius, material, **options)
        except ValueError as error:
            raise PackingFileError(f"{self.source} describes no possible packing: {error}") from error


def material_of(text: str) -> Material:
    """A material of key=value,...; a BadInputError names the word that is wrong."""
    given: dict[str, float] = {}
    for word in text.split(","):
        key, equals, value = word.partition("=")
        if key.strip() not in Material._fields or not equals:
            raise BadInputError(f"--material {word.strip()!r}: give {', '.join(Material._fields)}, as in young=7e10")
        given[key.strip()] = number_of(value, f"--material {key.strip()}")
    return Material(**given).checked()


def _table(path: Path, columns: Sequence[str] | None, frame: int = -1) -> tuple[dict[str, Floats], dict[str, Any]]:
    """Columns by name and, of a dump, its box."""
    lines, about = lines_of(path), dict[str, Any]()
    if not any(line.strip() for line in lines):
        raise PackingFileError(f"{path} is empty.")
    if lines[0].startswith("ITEM:"):
        shown = list(dump_frames(path))[frame]
        names, rows = list(shown.columns), shown.rows
        low, high = shown.bounds[:, :2].T.copy()
        xy, xz, yz = shown.bounds[:, 2] if shown.bounds.shape[1] > 2 else (0.0, 0.0, 0.0)
        low -= [min(0.0, xy, xz, xy + xz), min(0.0, yz), 0.0]  # the bounds are those of a box around the tilted one
        high -= [max(0.0, xy, xz, xy + xz), max(0.0, yz), 0.0]
        box = np.diag(high - low)
        box[1, 0], box[2, :2] = xy, (xz, yz)
        about = {"box": box, "origin": low, "periodic": np.array([each == "pp" for each in shown.boundary])}
        if len(about["periodic"]) != 3:
            about["periodic"] = None
    else:
        # the names stand in the first line, as of YADE behind a #, or in the first line that is no comment
        plain = next((k for k, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")), 0)
        begin = plain if lines[plain].lstrip()[:1].isalpha() else 0
        head = lines[begin].lstrip("#/ \t")
        kept = [
            (k, line)
            for k, line in enumerate(lines[begin + 1 :], begin + 2)
            if line.strip() and not line.lstrip().startswith("#")
        ]
        if head.split()[0] == "format":  # YADE: #format x_y_z_r
            head, about = head.split()[-1].replace("_", " "), {"first": 0.0}  # O.bodies counts from 0
        split = (lambda text: [each.strip() for each in text.split(",")]) if "," in head else str.split
        names, rows = split(head), _rows(path, kept, split, len(split(head)))
    if columns is not None:
        if len(columns) != len(names):
            raise BadInputError(f"--columns names {len(columns)} columns, and {path} has {len(names)}.")
        names = list(columns)
    found = {NAMES.get(name.lower(), name.lower()): column for name, column in zip(names, rows.T, strict=True)}
    return found, about


def _rows(path: Path, lines: Sequence[tuple[int, str]], split: Callable[[str], list[str]], width: int) -> Floats:
    for number, line in lines:
        if len(split(line)) != width:
            raise PackingFileError(f"{path}, line {number}: it has {len(split(line))} columns, and the first {width}.")
    rows = [[number_of(word, f"{path}, line {number}") for word in split(line)] for number, line in lines]
    found = np.array(rows, dtype=np.float64).reshape(-1, width)
    odd = np.flatnonzero(~np.isfinite(found).all(axis=1))
    if len(odd):
        raise PackingFileError(f"{path}, line {lines[odd[0]][0]}: it has a number that is not finite.")
    return found


def _blocks(path: Path, header: Callable[[list[str]], int | None], width: int | None, frame: int) -> tuple[Any, Any]:
    """The header and the rows of a block of MercuryDPM's files."""
    lines = lines_of(path)
    starts = [k for k, line in enumerate(lines) if line.strip() and header(line.split()) is not None]
    if not starts:
        raise PackingFileError(f"{path} has no line that begins a block of MercuryDPM's.")
    begin = starts[frame]
    end = next((k for k in starts if k > begin), len(lines))
    kept = [(k + 1, lines[k]) for k in range(begin + 1, end) if lines[k].strip() and not lines[k].startswith("#")]
    count = header(lines[begin].split())
    if count and len(kept) < count:
        raise PackingFileError(f"{path} breaks off: {count} particles are announced, and {len(kept)} follow.")
    return lines[begin].split(), _rows(path, kept, str.split, width or (len(kept[0][1].split()) if kept else 1))


def read_spheres(path: Path, frame: int = -1, columns: Sequence[str] | None = None) -> Spheres:
    """Read the spheres of a table.

    Raises
    ------
    PackingFileError
        If a column is missing, or a number is none that a sphere can have.
    """
    about: dict[str, Any] = {}
    if path.suffix == ".data":
        head, rows = _blocks(path, lambda w: int(w[0]) if w[0].isdecimal() and len(w) in (6, 8) else None, None, frame)
        if rows.shape[1] not in DATA:
            raise PackingFileError(f"{path} has rows of {rows.shape[1]} columns: a .data of MercuryDPM has 14, or 8.")
        table = dict(zip(DATA[rows.shape[1]], rows.T, strict=True)) | {"id": np.arange(len(rows), dtype=float)}
        bounds = np.array([float(each) for each in head[2:]]).reshape(2, -1)
        low, high = (
            np.pad(each, (0, 3 - len(each)), constant_values=c) for each, c in zip(bounds, (0, 1), strict=True)
        )
        about = {"box": np.diag(high - low), "origin": low}
    else:
        table, about = _table(path, columns, frame)
    if "diameter" in table:
        table.setdefault("radius", table["diameter"] / 2)
    for name in ("x", "y", "radius"):
        if name not in table:
            raise PackingFileError(f"{path} has no column {name} (its columns: {', '.join(table)}).")
    radius = table["radius"]
    if not len(radius):
        raise PackingFileError(f"{path} has no spheres.")
    for name in {"radius", "mass", "density"} & table.keys():
        if np.any(table[name] <= 0):
            k = int(np.argmin(table[name]))
            raise PackingFileError(f"{path}: {name} of sphere {k + 1} is {table[name][k]:g}: it must be above 0.")
    ids = table.get("id", np.arange(len(radius)) + about.get("first", 1.0))
    twice = np.sort(ids)[1:][np.diff(np.sort(ids)) == 0]
    if len(twice):
        raise PackingFileError(f"{path} has sphere {twice[0]:g} twice: give each an ID of its own.")
    mass = table.get("mass")
    if mass is None and "density" in table:
        mass = 4 / 3 * np.pi * radius**3 * table["density"]
    in_plane = "z" not in table or not np.ptp(table["z"])
    position = np.column_stack([table[name] for name in ("x", "y", "z")[: 2 if in_plane else 3]])
    return Spheres(
        str(path), ids.astype(np.int64), position, radius, mass, about.get("box"),
        np.asarray(about.get("origin", np.zeros(3)), float), about.get("periodic"),
    )  # fmt: skip


def read_contacts(
    spheres: Spheres, path: Path, material: Material, columns: Sequence[str] | None = None, frame: int = -1
) -> Configuration:
    """The packing of spheres and a table of contacts with forces, under a load that balances what the digits leave.

    Raises
    ------
    PackingFileError
        If a column is missing, a contact names a sphere that is not there or two that do not touch, or forces are out
        of balance.
    """
    if path.suffix == ".fstat":
        _, rows = _blocks(path, lambda w: 0 if w[0] == "#" and len(w) > 1 and w[1][0].isdigit() else None, 16, frame)
        table = dict(zip(FSTAT, rows.T, strict=True))
        table |= {f"ft{axis}": table["ft"] * table[f"t{axis}"] for axis in "xyz"}
        table |= {f"p{axis}": table[f"c{axis}"] for axis in "xyz"}
    else:
        table, _ = _table(path, columns, frame)
    for name in ("id1", "id2"):
        if name not in table:
            raise PackingFileError(
                f"{path} has no column {name} (its columns: {', '.join(table)}); --columns names those of a dump local."
            )
    # neighbours that do not touch have rows of zeros in pair/local
    bears = np.any([table[name] != 0 for name in FORCES if name in table] or [np.ones(len(table["id1"]), bool)], axis=0)
    table = {name: column[bears] for name, column in table.items()}
    where = {int(each): k for k, each in enumerate(spheres.id)}
    i = np.array([where.get(int(each), -2) for each in table["id1"]], dtype=np.int64)
    walls = (table["id2"] < 0) | ((table["id2"] == 0) & (0 not in where))
    j = np.where(walls, WALL, [where.get(int(each), -2) for each in table["id2"]])
    strange = np.where(i == -2, table["id1"], table["id2"])[(i == -2) | (j == -2)]
    if len(strange):
        raise PackingFileError(f"{path}: a contact names sphere {strange[0]:g}, which is not in {spheres.source}.")
    if np.any(i == j):
        raise PackingFileError(f"{path}: sphere {spheres.id[i[i == j][0]]} touches itself.")
    branch, periodic = _branches(spheres, path, table, i, j)
    n = branch / np.linalg.norm(branch, axis=1)[:, None]
    fn, ft = _forces(path, table, n)
    # each contact once, though .fstat may have it from both sides
    low, high = np.minimum(i, j), np.maximum(i, j)
    place = np.round(branch * np.where(i < j, 1, -1)[:, None] / spheres.radius.mean(), 3)
    _, once = np.unique(np.column_stack([low, high, place]), axis=0, return_index=True)
    kept = np.sort(once)
    i, j, branch, fn, ft = i[kept], j[kept], branch[kept], fn[kept], ft[kept]

    def packing(normal: Floats, tangential: Floats) -> Configuration:
        size, bound = np.linalg.norm(tangential, axis=1), material.friction * np.maximum(normal, 0.0)
        scale = np.divide(bound, size, out=np.ones_like(size), where=size > (1 - 3 * HALF_A_DIGIT) * bound)
        over = size > (1 + AT_REST) * bound
        if over.any():
            worst = int(np.argmax(size / np.maximum(bound, np.finfo(float).tiny)))
            raise PackingFileError(
                f"{path}: |f_t| of {spheres.id[i[worst]]} is {size[worst] / max(normal[worst], 1e-300):.4g} f_n, "
                f"beyond the coefficient of friction {material.friction:g}: give --material friction=."
            )
        return spheres.of_material(
            material, contacts=(i, j, branch), normal_force=normal, tangential_force=tangential * scale[:, None],
            periodic=periodic,
        )  # fmt: skip

    found, other = packing(fn, ft), packing(fn, -ft)
    lacks, flipped = (_out_of_balance(each) for each in (found, other))
    remarks = []
    if flipped < BETTER_SIGN * lacks:
        found, lacks = other, flipped
        remarks.append("tangential forces are those on the second particle: with the other sign they do not balance")
    if lacks > AT_REST:
        raise PackingFileError(
            f"{path}: forces are out of balance by {lacks:.2g} of the mean contact force, whatever gravity is: this is "
            "no packing at rest, or a contact or a wall is missing."
        )
    remarks.append(f"forces balance to {lacks:.1g} of their mean but for gravity; a load takes what is left")
    return derive_frozen(found, remarks=tuple(remarks))


def _branches(
    spheres: Spheres, path: Path, table: Mapping[str, Floats], i: Indices, j: Indices
) -> tuple[Floats, NDArray[np.bool_]]:
    """Vectors from the second partner to the first, through the sides of the box where they do not touch otherwise."""
    place = np.column_stack([spheres.position, np.zeros((len(spheres.id), 3 - spheres.position.shape[1]))])
    wall = j < 0
    branch = place[i] - place[np.maximum(j, 0)]
    if wall.any():
        if "px" not in table:
            raise PackingFileError(f"{path} has contacts with walls, and no px, py, pz: where each wall is touched.")
        touch = np.column_stack([table[f"p{axis}"] for axis in "xyz"])
        # a point in the middle of the overlap is on the line through the centre, whatever wall it is
        branch[wall] = (place[i] - touch)[wall]
    reach = np.where(wall, np.inf, spheres.radius[i] + spheres.radius[np.maximum(j, 0)])
    near = np.linalg.norm(branch, axis=1) <= 1.001 * reach
    sides = np.zeros(3, bool) if spheres.periodic is None else spheres.periodic.copy()
    if not near.all() and spheres.box is not None and spheres.periodic is None:
        sides[:] = True  # the file does not say: those that a contact needs
    if not near.all() and spheres.box is not None:
        images = np.where(sides, np.round(branch @ np.linalg.inv(spheres.box)), 0.0) * ~near[:, None]
        branch = branch - images @ spheres.box
        sides = sides if spheres.periodic is not None else images.any(axis=0)
        near = np.linalg.norm(branch, axis=1) <= 1.001 * reach
    if not near.all():
        k = int(np.argmin(near))
        raise PackingFileError(
            f"{path}: spheres {spheres.id[i[k]]} and {spheres.id[j[k]]} have a contact and are "
            f"{np.linalg.norm(branch[k]) - reach[k]:.3g} apart: give the places of the same moment, and the box."
        )
    return branch, sides


def _forces(path: Path, table: Mapping[str, Floats], n: Floats) -> tuple[Floats, Floats]:
    """f_n and f_t on the first partner."""

    def vectors(name: str) -> Floats | None:
        parts = [table.get(f"{name}{axis}") for axis in "xyz"]
        if parts[0] is None or parts[1] is None:
            return None
        return np.column_stack([np.zeros(len(n)) if each is None else each for each in parts])

    whole, elastic, shear, tangential = (vectors(name) for name in ("f", "fn", "fs", "ft"))
    if elastic is not None and shear is not None:  # YADE, on the second
        whole = -(elastic + shear)
    if whole is not None and "fn" not in table:
        normal = np.einsum("ca,ca->c", whole, n)
        if np.sum(normal < 0) > 0.5 * len(normal):
            whole, normal = -whole, -normal
        return normal, whole - normal[:, None] * n
    if "fn" not in table or tangential is None:
        raise PackingFileError(
            f"{path} says no forces: it needs fn, ftx, fty, ftz, or fx, fy, fz (its columns: {', '.join(table)})."
        )
    return table["fn"], tangential - np.einsum("ca,ca->c", tangential, n)[:, None] * n


def _out_of_balance(c: Configuration) -> float:
    """The largest force or torque on a particle that is free to move, gravity taken out, over the mean f_n."""
    force, weight = c.contact_force.copy(), c.mass / np.sum(c.mass**2)
    touch = np.setdiff1d(np.arange(len(c)), c.rattlers)
    gravity = (weight[:, None] * force[:, 0])[touch].sum(axis=0) * np.sum(c.mass**2) / np.sum(c.mass[touch] ** 2)
    force[:, 0] -= c.mass[:, None] * gravity
    force[:, 1] /= c.radius[:, None]
    return float(np.abs(force[touch]).max(initial=0.0) / (c.normal_force.mean() if len(c.contacts) else 1.0))


def verdict_within_digits(found: Configuration, draws: int = ROUNDED_TABLES) -> tuple[Stability, str]:
    """The verdict of a packing of a table, and what its digits tell of it.

    Returns
    -------
    verdict : Stability
        Of the numbers as they are.
    says : str
        Whether all draws of forces and stiffnesses within the rounding of six digits have the same verdict.
    """
    verdict = stability(found)
    rng, seen, rates = np.random.default_rng(0), [verdict.stable], [verdict.growth_rate]
    c = found.contacts
    for _ in range(draws):
        error = 1 + HALF_A_DIGIT * rng.uniform(-1, 1, (2, len(c)))
        turned = c.tangential_force + HALF_A_DIGIT * c.normal_force[:, None] * rng.uniform(-1, 1, (len(c), 3))
        turned -= np.einsum("ca,ca->c", turned, c.normal)[:, None] * c.normal
        if found.dimension == 2:
            turned[:, 2] = 0.0
        size, most = np.linalg.norm(turned, axis=1), c.friction * error[0]
        held = np.where(c.at_bound | (size > most), most / np.maximum(size, np.finfo(float).tiny), 1.0)
        drawn = derive_frozen(
            c, normal_force=c.normal_force * error[0], friction=most, tangential_force=turned * held[:, None],
            normal_stiffness=c.normal_stiffness * error[1], tangential_stiffness=c.tangential_stiffness * error[1],
        )  # fmt: skip
        other = stability(derive_frozen(found, contacts=drawn, load=found.load))
        seen.append(other.stable)
        rates.append(other.growth_rate)
    if len(set(seen)) > 1:
        words = {True: "stable", False: "unstable", None: "not known"}
        says = ", ".join(f"{words[each]} in {seen.count(each)}" for each in dict.fromkeys(seen))
        return verdict, f"six digits do not tell: of {len(seen)} tables that round to this one the verdict is {says}"
    spread = [each for each in rates if each is not None and np.isfinite(each)]
    more = f", with growth rates from {min(spread):.6g} to {max(spread):.6g}" if spread else ""
    return verdict, f"six digits tell: {counted(len(seen), 'table')} that round to this one have this verdict{more}"
