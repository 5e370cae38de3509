"""Which particles are displaced together: those without a common neighbour (colours).

A particle feels only the particles that it touches, so that the number of displacements depends on the number of
neighbours, not of particles (Curtis, Powell and Reid, J. Inst. Math. Appl. 13, 117, 1974).
"""

from itertools import combinations
from itertools import count as count_from
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array, eye_array

from ...analysis import Configuration
from ...analysis.arrays import Floats, Indices

GAP_OF_NEIGHBOURS = 1e-3
"""Gap between particles, as a share of the largest diameter, up to which they are looked for: far beyond all
displacements."""


class Pairs(NamedTuple):
    """Pairs of particles that may feel each other: their indices, and the gap between their surfaces, negative where
    they overlap and minus infinity where something else may act between them; shape (P,) each."""

    i: Indices
    j: Indices
    gap: Floats


def neighbouring_pairs(lmp: Any, c: Configuration) -> Pairs:
    """Pairs that touch or nearly touch, others of LAMMPS's neighbours between which a force acts, and pairs of bonds
    and angles. The instance is a copy, which has been set up."""
    from scipy.spatial import cKDTree  # which takes as long to import as all of `scipy.sparse`

    # LAMMPS has ghosts of particles across a periodic boundary
    every = [np.array(lmp.numpy.extract_atom(name)) for name in ("id", "x", "radius")]
    ids, x, radius = (each[: lmp.extract_setting("nlocal") + lmp.extract_setting("nghost")] for each in every)
    reach = 2 * float(radius.max()) * (1 + GAP_OF_NEIGHBOURS)
    i, j = cKDTree(x).query_pairs(reach, output_type="ndarray").T
    gap = np.linalg.norm(x[i] - x[j], axis=1) - radius[i] - radius[j]
    others = _acting(lmp)
    if lmp.extract_setting("molecule_flag"):
        for each in filter(len, (lmp.numpy.gather_bonds(), lmp.numpy.gather_angles())):
            members = np.asarray(each).reshape(len(each), -1)[:, 1:]
            others += [members[:, pair] for pair in combinations(range(members.shape[1]), 2)]
    bonded = np.concatenate(others)
    pairs = np.searchsorted(c.ids, np.concatenate([ids[np.column_stack([i, j])], bonded]))
    return Pairs(pairs[:, 0], pairs[:, 1], np.concatenate([gap, np.full(len(bonded), -np.inf)]))


def _acting(lmp: Any) -> list[Indices]:
    """IDs of the neighbours between which a force acts, or of all where a pair style hands out no forces of pairs."""
    lmp.command("compute faultgouge_i all property/local patom1 patom2")
    try:
        lmp.command("compute faultgouge_c all pair/local force")
        lmp.command("run 0 post no")
        acts = np.array(lmp.numpy.extract_compute("faultgouge_c", 2, 1)).ravel() != 0
    except Exception:
        lmp.command("uncompute faultgouge_c")
        lmp.command("run 0 post no")
        acts = None
    rows = lmp.numpy.extract_compute("faultgouge_i", 2, 2)
    pairs = np.zeros((0, 2), int) if rows is None else np.array(rows).reshape(-1, 2).astype(np.int64)
    return [pairs if acts is None else pairs[acts[: len(pairs)]]]


class Colours:
    """Which bodies are displaced together: no particle feels two of them.

    A particle feels its neighbours; with a `reach` of 2, their neighbours, too.

    Attributes
    ----------
    members : list of ndarray of int
        Bodies of each colour, by the particle that leads each.
    owner : list of ndarray of int, shape (N,)
        The body that each particle feels, -1 if it feels none.
    """

    def __init__(self, c: Configuration, constraint: csr_array, pairs: Pairs, near: float, reach: int = 1) -> None:
        count, moved = len(c), constraint.tocoo()
        leads: list[set[int]] = [set() for _ in range(count)]
        for particle, leader in zip(moved.row % count, moved.col % count, strict=True):
            leads[leader].add(int(particle))
        free = np.zeros(count, np.bool_)
        free[moved.row % count] = True
        touch = pairs.gap < near
        one, other = np.concatenate([pairs.i[touch], pairs.j[touch]]), np.concatenate([pairs.j[touch], pairs.i[touch]])
        neighbours = csr_array((np.ones(len(one)), (one, other)), shape=(count, count)) + eye_array(count, format="csr")
        reached = neighbours
        for _ in range(reach - 1):
            reached = reached @ neighbours
        feels = [set(row[free[row]].tolist()) for row in np.split(reached.indices, reached.indptr[1:-1])]
        taken: list[set[int]] = [set() for _ in range(count)]
        self.members: list[list[int]] = []
        self.owner: list[Indices] = []
        for leader in range(count):
            around = sorted(set().union(*(feels[each] for each in leads[leader])))
            if not around:
                continue
            used = set().union(*(taken[each] for each in around))
            colour = next(k for k in count_from(0) if k not in used)
            if colour == len(self.members):
                self.members.append([])
                self.owner.append(np.full(count, -1))
            self.members[colour].append(leader)
            self.owner[colour][around] = leader
            for each in around:
                taken[each].add(colour)
