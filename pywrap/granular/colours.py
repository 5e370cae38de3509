"""Which particles are displaced together: those without a common neighbour (colours).

A particle feels only the particles that it touches, so that the number of displacements depends on the number of
neighbours, not of particles (Curtis, Powell and Reid, J. Inst. Math. Appl. 13, 117, 1974).
"""

from dataclasses import dataclass
from itertools import combinations
from itertools import count as count_from
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array
from scipy.spatial import cKDTree

from ...analysis.arrays import Floats, Indices
from .force_probe import ProbedParticles

GAP_OF_NEIGHBOURS = 1e-3
"""Gap between particles, as a share of a radius, up to which they are looked for: far beyond all displacements."""


@dataclass(frozen=True)
class Pairs:
    """Pairs of particles that LAMMPS knows as neighbours or as bonded: their indices, the gap between their surfaces,
    negative where they overlap, and whether a force acts; shape (P,) each."""

    i: Indices
    j: Indices
    gap: Floats
    acts: NDArray[np.bool_]


def neighbouring_pairs(lmp: Any, particles: ProbedParticles) -> Pairs:
    """Pairs that touch or nearly touch, and pairs of bonds and angles. The instance is a copy, and runs zero steps."""
    lmp.command("compute faultgouge_i all property/local patom1 patom2")
    try:
        lmp.command("compute faultgouge_c all pair/local dist force")
        lmp.command("run 0 post no")
        distance, force = _local(lmp, "c", 2).T
    except Exception:  # a pair style that hands out no forces of pairs: all neighbours may act
        lmp.command("uncompute faultgouge_c")
        lmp.command("run 0 post no")
        distance, force = None, None
    i, j = np.searchsorted(particles.ids, _local(lmp, "i", 2).astype(np.int64)).T
    if distance is None or force is None:
        gap, acts = np.full(len(i), np.inf), np.ones(len(i), np.bool_)
    else:
        gap, acts = distance - particles.radius[i] - particles.radius[j], force != 0
    bonded, near = _bonded(lmp, particles.ids), _nearly_touching(lmp, particles)
    return Pairs(
        np.concatenate([i, bonded[0], near.i]),
        np.concatenate([j, bonded[1], near.j]),
        np.concatenate([gap, np.full(len(bonded[0]), np.inf), near.gap]),
        np.concatenate([acts, np.ones(len(bonded[0]), np.bool_), near.acts]),
    )


def _nearly_touching(lmp: Any, particles: ProbedParticles) -> Pairs:
    """Pairs a little apart: compute pair/local hands none of them out. LAMMPS has ghosts of particles across a periodic
    boundary."""
    every = [np.array(lmp.numpy.extract_atom(name)) for name in ("id", "x", "radius")]
    count = lmp.extract_setting("nlocal") + lmp.extract_setting("nghost")
    ids, x, radius = (values[:count] for values in every)
    i, j = cKDTree(x).query_pairs(2 * float(radius.max()) * (1 + GAP_OF_NEIGHBOURS), output_type="ndarray").T
    gap = np.linalg.norm(x[i] - x[j], axis=1) - radius[i] - radius[j]
    near = (gap >= 0) & (gap < GAP_OF_NEIGHBOURS * radius[i])
    i, j = (np.searchsorted(particles.ids, ids[each[near]]) for each in (i, j))
    return Pairs(i, j, gap[near], np.zeros(len(i), np.bool_))


def _local(lmp: Any, name: str, columns: int) -> Floats:
    rows = lmp.numpy.extract_compute(f"faultgouge_{name}", 2, 2)
    return np.zeros((0, columns)) if rows is None else np.array(rows).reshape(-1, columns)


def _bonded(lmp: Any, ids: Indices) -> tuple[Indices, Indices]:
    """Pairs of particles of one bond or angle."""
    found = [np.zeros((0, 2), np.int64)]
    if lmp.extract_setting("molecule_flag"):
        for each in (lmp.numpy.gather_bonds(), lmp.numpy.gather_angles()):
            if not len(each):
                continue
            members = np.asarray(each).reshape(len(each), -1)[:, 1:]
            found += [members[:, pair] for pair in combinations(range(members.shape[1]), 2)]
    i, j = np.searchsorted(ids, np.concatenate(found)).T
    return i, j


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

    def __init__(self, particles: ProbedParticles, pairs: Pairs, near: float, reach: int = 1) -> None:
        count = len(particles.ids)
        moved = particles.constraint.tocoo()
        leads: list[set[int]] = [set() for _ in range(count)]
        for particle, leader in zip(moved.row % count, moved.col % count, strict=True):
            leads[leader].add(int(particle))
        free = np.zeros(count, np.bool_)
        free[moved.row % count] = True
        touch = pairs.acts | (pairs.gap < near)
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
