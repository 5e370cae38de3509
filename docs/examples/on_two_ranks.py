"""A ramp on the ranks of MPI: mpiexec -n 2 python on_two_ranks.py

The ranks share the disks in LAMMPS. Every rank gets the whole packing, with the same bits on any number of ranks.
"""

import hashlib

from mpi4py import MPI

from faultgouge.analysis import spectrum
from faultgouge.pywrap import Engine, Scene, equilibrate, settle

scene = Scene.from_mapping({"packing": {"seed": 4, "disks": 40, "width": 7.5}, "law": {"kn": 2e5}, "load": {"fy": 3.0}})
state = settle(scene)  # collective: every rank makes the call
with Engine(state.packing) as engine:
    for fx in (0.01, 0.02, 0.03, 0.04):
        state = equilibrate(engine, state, fx=fx)
if MPI.COMM_WORLD.rank == 0:
    digest = hashlib.sha256(state.packing.position.tobytes()).hexdigest()[:16]
    pairs = spectrum(state.packing).pairs
    print(f"{MPI.COMM_WORLD.size} ranks: positions {digest}, growth rate {pairs[0].growth_rate:.6f}")
