"""The driver: from a scene to equilibria and undamped runs, with LAMMPS.

`scenes` describes a computation. `settling` brings the packing of a scene to equilibrium, `equilibria` follows the
equilibrium along F_x, and `runs` perturbs it. `runs.run_recorder` stores all results in run.h5 and continues an
interrupted run. `lammps.engine` is a LAMMPS instance with one packing. To write a ramp of your own, loop over
`equilibrate`.
"""

from .lammps.two_mpi_libraries import load_own_mpi

load_own_mpi()  # before mpi4py.MPI is imported

# ruff: noqa: E402 - the imports below need it
from ..analysis import NoEquilibriumError
from .equilibria.quasistatic import Equilibrium, equilibrate
from .granular.compare_motion import MotionComparison, compare_motion
from .granular.from_lammps import from_lammps
from .granular.granular_commands import NotTakenError
from .granular.lammps_equilibrium_path import LammpsPath, lammps_path
from .granular.relax import relax
from .lammps.engine import Engine
from .lammps.instance import EngineError
from .runs.equilibrium_path import ramp, reach
from .runs.run_recorder import Record
from .runs.undamped import Sample, perturb
from .scenes.scene import Scene
from .scenes.validation import SceneError
from .settling.relax import bring_to_rest
from .settling.settle import settle

__all__ = [
    "Engine",
    "EngineError",
    "Equilibrium",
    "LammpsPath",
    "MotionComparison",
    "NoEquilibriumError",
    "NotTakenError",
    "Record",
    "Sample",
    "Scene",
    "SceneError",
    "bring_to_rest",
    "compare_motion",
    "equilibrate",
    "from_lammps",
    "lammps_path",
    "perturb",
    "ramp",
    "reach",
    "relax",
    "settle",
]
