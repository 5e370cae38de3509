"""The driver: from a scene to equilibria and undamped runs, with LAMMPS.

`scene` says what is wanted. `bed` brings its packing into equilibrium, `equilibria` follows the equilibrium along F_x,
and `undamped` perturbs it; `recording` keeps all of this in run.h5 and goes on where a run was cut off. `engine` is
LAMMPS with one packing in it, and `quasistatic` takes it from equilibrium to equilibrium. A ramp of one's own is a loop
over `equilibrate`.
"""

from .lammps.two_mpi_libraries import load_own_mpi

load_own_mpi()  # before mpi4py.MPI is imported

# ruff: noqa: E402 - the imports below need it
from ..analysis import NoEquilibriumError
from .equilibria.quasistatic import Equilibrium, equilibrate
from .granular.compare_motion import MotionComparison, compare_motion
from .granular.from_lammps import from_lammps
from .granular.granular_commands import SnapshotError
from .granular.lammps_equilibrium_path import LammpsPath, lammps_path
from .lammps.engine import Engine
from .lammps.instance import EngineError
from .runs.equilibrium_path import ramp, reach
from .runs.run_recorder import Record
from .runs.undamped import Sample, perturb
from .scenes.scene import Scene
from .scenes.validation import SceneError
from .settling.settle import settle

__all__ = [
    "Engine",
    "EngineError",
    "Equilibrium",
    "LammpsPath",
    "MotionComparison",
    "NoEquilibriumError",
    "Record",
    "Sample",
    "Scene",
    "SceneError",
    "SnapshotError",
    "compare_motion",
    "equilibrate",
    "from_lammps",
    "lammps_path",
    "perturb",
    "ramp",
    "reach",
    "settle",
]
