"""Newton's matrix: K of a trial, factored.

The matrix leaves out contacts below the rounding floor, because their stiffness is noise, and coordinates that no
contact then holds. A contact that has closed since the displacement began has no slip, however long the displacement:
its tangential force does not depend on the displacement, and has no part in K. A small matrix is a band for LAPACK; a
large matrix is sparse (:mod:`~faultgouge.analysis.factors.linear_solver`).
"""

from typing import NamedTuple

import numpy as np

from ...analysis.arrays import Floats, Indices
from ...analysis.factors.linear_solver import BandSolver, Booleans, Solver, SparseSolver
from ...analysis.packing.disk_operators import assemble_stiffness, contact_terms
from ..lammps.contact_graph import ContactGraph
from ..lammps.trial_state import Trial

IDLE_FORCE_SHARE = 1e-7
"""Share of the largest contact force up to which a contact carries nothing that matters."""

HOLDING_SHARE = 0.1
"""Share of its largest stiffness that is added to a disk with none but such contacts, in all directions. Such a
disk has next to no stiffness along its contacts, and none across a contact that slides: Newton's step would throw the
disk through its cage. With this share the force on the disk, small already, falls tenfold in an iteration."""

FLOATING_SHARE = 1e-13
"""Share that is added to all others. A share of the size of its rounding keeps the solve finite where something floats,
such as the whole packing along a floor without friction; on stiff directions it changes nothing."""

SLIPLESS_SHARE = 1e-2
"""Share of its tangential stiffness that a contact keeps which has no slip, so that a disk with no other contact is
held. It reduces the error of an iteration to a hundredth at best."""

BAND_SIZE = 3000
"""Coordinates up to which a band is the faster one: 0.3 ms against 2 ms at 294 (100 disks), 11 ms against 23 ms at 2886
(1000 disks in a square)."""


class StiffnessFactors(NamedTuple):
    """The factors of K at a trial, and disks that a neighbour or two ran into and nothing else holds, shape (N,)."""

    solver: Solver
    expelled: Booleans


def factor_stiffness(trial: Trial, floor: float, since: ContactGraph | None = None) -> StiffnessFactors | None:
    """Factor K of a trial; None if nothing is held. `floor` is the force that a contact has to exceed, and `since` has
    the contacts where the displacement began, by default those of the trial."""
    graph, law = trial.graph, trial.derivatives
    loaded, old = law.normal_force > floor, None if since is None else graph.old(since)
    if old is not None:
        slip_derivative = np.where(old, law.slip_derivative, SLIPLESS_SHARE * law.slip_derivative)
        law = law._replace(slip_derivative=slip_derivative)
    normal, distance, _ = trial.branches
    terms = np.where(loaded, contact_terms(law, normal, distance, graph.pairs), 0.0)
    active = graph.per_coordinate(terms.reshape(9, -1)[::4]) != 0
    unknowns = np.count_nonzero(active)
    if unknowns == 0:
        return None
    matters = loaded & (law.normal_force > IDLE_FORCE_SHARE * law.normal_force.max(initial=0.0))
    idle = graph.per_disk(matters) == 0  # disks with none but contacts that carry nothing that matters
    # disks with one loaded contact, or with two that are both new
    count = graph.per_disk(loaded)
    expelled = count == 1
    if old is not None:
        expelled |= (count == 2) & (graph.per_disk(loaded & old) == 0)
    expelled &= ~trial.still.top

    def stiffen_idle(diagonal: Floats, disk: Indices) -> Floats:
        """The diagonal of K, larger by `HOLDING_SHARE` for idle disks and by `FLOATING_SHARE` for all others."""
        stiffest = np.zeros(len(idle))
        np.maximum.at(stiffest, disk, diagonal)
        return np.where(idle[disk], diagonal + HOLDING_SHARE * stiffest[disk], (1 + FLOATING_SHARE) * diagonal)

    if unknowns <= BAND_SIZE:
        band = graph.band(active)
        rows = band.matrix(terms)
        rows[2 * band.width] = stiffen_idle(rows[2 * band.width], band.disks)
        return StiffnessFactors(BandSolver(band, rows), expelled)
    i, j = graph.i, graph.j[: graph.pairs]
    matrix = assemble_stiffness(terms, i, j, graph.disks)
    matrix.setdiag(stiffen_idle(matrix.diagonal(), np.tile(np.arange(graph.disks), 3)))
    matrix.eliminate_zeros()
    coupled = np.flatnonzero(loaded[: graph.pairs])
    return StiffnessFactors(SparseSolver(matrix, i[coupled], j[coupled]), expelled)
