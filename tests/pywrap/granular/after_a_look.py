"""A look after a run that LAMMPS has ended early, and a restart after a look: python after_a_look.py THREADS."""

import sys

import numpy as np
import pytest
from granular_packings import command, instance, start, state, with_law
from mpi4py import MPI

from faultgouge.pywrap import NotTakenError, from_lammps

WORLD, THREADS = MPI.COMM_WORLD, int(sys.argv[1])
ENDS = {
    "fix halt": "variable one equal 1\nfix stop all halt 1 v_one > 0 message no\nrun 100\nunfix stop",
    "timer timeout": "timer timeout 0.2 every 10\nrun 1000000000",
}

lmp = instance(None)
if THREADS > 1:
    command(lmp, f"package omp {THREADS}\nsuffix omp")
start(lmp, 3, 18)
with_law(lmp, "gran/hertz/history", 3, "100", "100", ("", ""))
command(lmp, """
fix load all gravity 1.0 vector 0.1 0 -1
fix move all nve/sphere
fix drag all viscous 1.0
timestep 0.002
thermo 1000000000
run 3000
""")  # fmt: skip
given = [
    "pair_style gran/hertz/history 3e3 NULL 100 100 3.0 1",
    "fix floor all wall/gran hertz/history 3e3 9e2 100 100 3.0 1 zplane 0 NULL contacts",
    "fix move all nve/sphere",
]
for how, lines in ENDS.items():
    command(lmp, lines)
    step, before = lmp.extract_global("ntimestep"), state(lmp, WORLD)
    assert len(from_lammps(lmp, given, balance=np.inf).contacts) > 5, how
    assert np.array_equal(state(lmp, WORLD), before)
    lmp.command("run 10")  # which LAMMPS skips as it would without the look
    assert lmp.extract_global("ntimestep") == step
    command(lmp, "timer timeout unlimited\nrun 10")
    assert lmp.extract_global("ntimestep") == step + 10

# what zero steps would change, of which nothing is given back, is named before
CHANGES = {
    "fix shakes all langevin 1e-9 1e-9 1.0 4711 omega yes": "fix shakes langevin",
    'fix says all print 1000 "step" file says.txt screen no': "fix says print",
    "fix mean all ave/time 1 1 1 c_thermo_temp file mean.txt": "fix mean ave/time",
    "variable dice equal random(0,1,4711)": "variable dice",
}
for line, name in CHANGES.items():
    lmp.command(line)
    before = state(lmp, WORLD)
    if WORLD.size > 1 or THREADS > 1:
        with pytest.raises(NotTakenError, match=f"by which {name} may write, count or draw random numbers"):
            from_lammps(lmp, given, balance=np.inf)
    else:
        from_lammps(lmp, given, balance=np.inf)
    assert np.array_equal(state(lmp, WORLD), before)
    lmp.command(f"unfix {line.split()[1]}" if line.startswith("fix") else "variable dice delete")
command(lmp, "fix cold all langevin 0.0 0.0 1.0 4711 omega yes")
from_lammps(lmp, [*given, "fix cold all langevin 0.0 0.0 1.0 4711 omega yes"], balance=np.inf)
lmp.command("unfix cold")

# LAMMPS forgets the histories of contacts in write_restart if other lists of neighbours were asked for since the run
lmp.command("run 0")
before = state(lmp, WORLD)
from_lammps(lmp, given, balance=np.inf)
command(lmp, "write_restart packing.restart\nrun 0")
after = state(lmp, WORLD)
forces = slice(10, 16)
assert np.abs(after[:, forces] - before[:, forces]).max() < 1e-9  # roundings; a sphere weighs 0.4 to 0.8
