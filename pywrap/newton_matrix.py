"""Newton's matrix: K of a trial, factored.

Contacts below the rounding floor are left out, since their stiffness is noise, and so are the coordinates that nothing
holds then. A contact that has closed since the displacement began has no slip, however long the displacement: its
tangential force is no function of it, and has no part in K. A small matrix is a band and goes to LAPACK, a large one is
sparse and goes to SuperLU.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgbtrf, dgbtrs

from ..analysis.stiffness import assembled, contact_terms
from .band import Band
from .contact_graph import ContactGraph
from .sparse_solver import SparseSolver
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

SLIPLESS = 1e-2
"""Share of its tangential stiffness that a contact keeps which has no slip, so that a disk with no other contact is
held. It reduces the error of an iteration to a hundredth at best."""

BANDED = 3000
"""Coordinates up to which a band is the faster one: 0.3 ms against 2 ms at 294 (100 disks), 11 ms against 23 ms at 2886
(1000 disks in a square)."""


class Factors(NamedTuple):
    """The factors of K at a trial.

    Attributes
    ----------
    solve : callable
        The solution of K dq = F as a function of F, on the coordinates that K knows; None if it is not finite.
    expelled : ndarray of bool, shape (N,)
        Disks that a neighbour or two ran into and nothing else holds.
    sparse : SparseSolver, or None
        What solves it in a large packing.
    """

    solve: Solve
    expelled: Booleans
    sparse: SparseSolver | None = None


def factored(
    trial: Trial, floor: float, since: ContactGraph | None = None, nearby: Factors | None = None
) -> Factors | None:
    """Factor K; None if it is singular, or nothing is held.

    Parameters
    ----------
    trial : Trial
        Where K is taken.
    floor : float
        Force that a contact has to exceed.
    since : ContactGraph, optional
        The contacts where the displacement began; by default they are those of the trial.
    nearby : Factors, optional
        Those of another trial nearby, which a large packing is solved with.
    """
    graph, law = trial.graph, trial.derivatives
    loaded, old = law.normal_force > floor, None if since is None else graph.old(since)
    if old is not None:
        slip_derivative = np.where(old, law.slip_derivative, SLIPLESS * law.slip_derivative)
        law = law._replace(slip_derivative=slip_derivative)
    normal, distance, _ = trial.branches
    terms = contact_terms(law, normal, distance, graph.pairs)
    if not loaded.all():
        terms = np.where(loaded, terms, 0.0)
    active = graph.per_coordinate(terms.reshape(9, -1)[::4]) != 0
    unknowns = np.count_nonzero(active)
    if unknowns == 0:
        return None
    idle = _idle(graph, law.normal_force, loaded)
    expelled = _expelled(graph, loaded, old) & ~trial.still.top
    if unknowns > BANDED:
        sparse = _sparse(graph, loaded, terms, idle, None if nearby is None else nearby.sparse)
        return Factors(sparse.solve, expelled, sparse)
    solve = _banded(graph.band(active), terms, idle)
    return None if solve is None else Factors(solve, expelled)


def _expelled(graph: ContactGraph, loaded: Booleans, old: Booleans | None) -> Booleans:
    """Disks with one loaded contact, or with two that are both new, shape (N,)."""
    count = graph.count(loaded)
    if old is None:
        return count == 1
    return (count == 1) | ((count == 2) & (graph.per_disk(loaded & old) == 0))


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


def _sparse(
    graph: ContactGraph, loaded: Booleans, terms: Floats, idle: Booleans, nearby: SparseSolver | None
) -> SparseSolver:
    """The solution by SuperLU and GMRES."""
    i, j, disks = graph.i, graph.j[: graph.pairs], len(graph.radius)
    matrix = assembled(terms, i, j, disks)
    matrix.setdiag(_held(matrix.diagonal(), np.tile(np.arange(disks), 3), idle))
    matrix.eliminate_zeros()
    coupled = np.flatnonzero(loaded[: graph.pairs])
    return SparseSolver(matrix, i[coupled], j[coupled], nearby)
