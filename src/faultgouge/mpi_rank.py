"""Which MPI rank this process is, known without MPI being imported.

Commands that need no MPI (``spectrum``, ``--help``) do not import mpi4py; the launchers tell the rank through the
environment.
"""

import os
import sys
from typing import Any

RANKS = ("PMI_RANK", "PMIX_RANK", "OMPI_COMM_WORLD_RANK", "SLURM_PROCID")
"""Where MPICH, PMIx, OpenMPI and Slurm tell a process its rank."""

RANK_VARIABLES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS")
"""Where launchers tell the number of ranks; SLURM_NTASKS would be that of a whole allocation."""


def rank() -> int:
    """Rank of this process in MPI's world; 0 without MPI."""
    world = _world()
    return _first(RANKS, 0) if world is None else int(world.rank)


def size() -> int:
    """Number of ranks in MPI's world; 1 without MPI."""
    world = _world()
    return _first(RANK_VARIABLES, 1) if world is None else int(world.size)


def is_root() -> bool:
    """Whether this process is the one that speaks and writes."""
    return rank() == 0


def _world() -> Any:
    """MPI's world communicator where a module has imported MPI, and MPI has not ended; None otherwise."""
    mpi = sys.modules.get("mpi4py.MPI")
    return None if mpi is None or mpi.Is_finalized() else mpi.COMM_WORLD


def _first(names: tuple[str, ...], otherwise: int) -> int:
    return next((int(os.environ[name]) for name in names if os.environ.get(name, "").isdecimal()), otherwise)
