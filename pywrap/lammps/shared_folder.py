"""A folder that all ranks know."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mpi4py import MPI


@contextmanager
def shared_folder(communicator: MPI.Comm) -> Iterator[Path]:
    """A temporary folder of rank 0 that all ranks know."""
    keeper = tempfile.TemporaryDirectory(prefix="faultgouge-") if communicator.rank == 0 else None
    try:
        yield Path(communicator.bcast(keeper.name if keeper else None))
        communicator.barrier()  # not after an error, which one rank may be alone with
    finally:
        if keeper:
            keeper.cleanup()
