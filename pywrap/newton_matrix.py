"""Newton's matrix: K of a trial, factored.

Contacts below the rounding floor are left out, since their stiffness is noise, and so are the coordinates that nothing
holds then. A small matrix is a band and goes to LAPACK, a large one is sparse and goes to SuperLU.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgbtrf, dgbtrs
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from ..analysis import Packing, stiffness_matrix
from ..analysis.stiffness import contact_terms
from .band import Band
from .contact_graph import ContactGraph
from .elimination import elimination_order
from .trial import Trial

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Indices = NDArray[np.int64]
Solve = Callable[[Floats], Floats | None]

IDLE = 1e-7
"""Share of the largest contact force up to which a contact carries nothing that matters."""

CREEP = 0.1
"""Share of its largest stiffness that is added to a disk with none but such contacts, in all directions. One that is
leant upon by a breath has next to no stiffness along the contact, and none across where that slides: it would be thrown
through its cage. As it is, its force falls tenfold in an iteration, from a value that is small already."""

AFLOAT = 1e-13
"""Share that is added to all others. A share of the size of its rounding keeps the solve finite where something floats,
such as the whole packing along a floor without friction; on stiff directions it changes nothing."""

BANDED = 3000
"""Coordinates up to which a band is the faster one: 0.3 ms against 2 ms at 294 (100 disks), 11 ms against 23 ms at 2886
(1000 disks in a square)."""


class Factors(NamedTuple):
    """The factors of K at a trial.

    Attributes
    ----------
    solve : callable
        The solution of K dq = F as a function of F, on the coordinates that K knows; None if it is not finite.
    hit : ndarray of bool, shape (N,)
        Disks with one contact that carries something: rattlers that a neighbour ran into.
    """

    solve: Solve
    hit: Booleans


def factored(trial: Trial, floor: float) -> Factors | None:
    """Factor K; None if it is singular, or nothing is held.

    Parameters
    ----------
    trial : Trial
        Where K is taken.
    floor : float
        Force that a contact has to exceed.
    """
    graph, law = trial.graph, trial.derivatives
    normal, distance, _ = trial.branches
    terms = contact_terms(law, normal, distance, graph.pairs)
    loaded = law.normal_force > floor
    if not loaded.all():
        terms = np.where(loaded, terms, 0.0)
    hit = (graph.count(loaded) == 1) & ~trial.still.top
    active = graph.per_coordinate(terms.reshape(9, -1)[::4]) != 0
    unknowns = np.count_nonzero(active)
    if unknowns == 0:
        return None
    if unknowns > BANDED:
        solve = sparse_solution(trial.packing.loaded(floor))
    else:
        solve = _banded(graph.band(active), terms, _idle(graph, law.normal_force, loaded))
    return None if solve is None else Factors(solve, hit)


def _banded(band: Band, terms: Floats, idle: Booleans) -> Solve | None:
    """The solution by LAPACK."""
    matrix, width = band.matrix(terms), band.width
    matrix[2 * width] = _held(matrix[2 * width], band.disks, idle)
    factors, pivots, singular = dgbtrf(matrix, width, width, overwrite_ab=True)
    if singular:
        return None

    def solve(force: Floats) -> Floats | None:
        solution, _ = dgbtrs(factors, width, width, force.take(band.coordinates), pivots)
        step = np.zeros(len(force))
        step[band.coordinates] = solution
        return step if np.isfinite(solution).all() else None

    return solve


def _idle(graph: ContactGraph, carried: Floats, loaded: Booleans) -> Booleans:
    """Disks with none but contacts that carry nothing that matters, shape (N,)."""
    matters = loaded & (carried > IDLE * carried.max(initial=0.0))
    return graph.count(matters) == 0


def _held(diagonal: Floats, disk: Indices, idle: Booleans) -> Floats:
    """The diagonal of K with a little more stiffness for idle disks, and next to nothing more for all others."""
    held = (1 + AFLOAT) * diagonal
    creeping = idle[disk]
    if creeping.any():
        stiffest = np.zeros(len(idle))
        np.maximum.at(stiffest, disk, diagonal)
        held[creeping] = diagonal[creeping] + CREEP * stiffest[disk[creeping]]
    return held


def sparse_solution(packing: Packing) -> Solve | None:
    """The solution of K dq = F by SuperLU, all contacts counted; None if K is singular.

    Parameters
    ----------
    packing : Packing
        Where K is taken.
    """
    matrix = stiffness_matrix(packing)
    contacts = packing.contacts
    graph = ContactGraph(contacts, packing.radius)
    idle = _idle(graph, packing.normal_force, np.ones(len(contacts), np.bool_))
    diagonal = matrix.diagonal()
    active = np.flatnonzero(diagonal)
    active = active[elimination_order(packing, active)]
    block = matrix[active][:, active]
    block.setdiag(_held(diagonal[active], active % len(packing), idle))
    try:
        # nearly symmetric: pivots on the diagonal where good
        factors = splu(csc_array(block), permc_spec="NATURAL", diag_pivot_thresh=0.01, options={"SymmetricMode": True})
    except RuntimeError:
        return None

    def solve(force: Floats) -> Floats | None:
        step = np.zeros_like(force)
        step[active] = factors.solve(force[active])
        return step if np.all(np.isfinite(step)) else None

    return solve
