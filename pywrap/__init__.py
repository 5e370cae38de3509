"""The driver: from a scene to equilibria and undamped runs, with LAMMPS.

`scenes` describes a computation. `settling` brings the packing of a scene to equilibrium, `equilibria` follows the
equilibrium along F_x, and `runs` perturbs it. `runs.run_recorder` stores all results in run.h5 and continues an
interrupted run. `lammps.engine` is a LAMMPS instance with one packing. `load_path` has equilibria as a function of a
load: `scene_path` makes that of a scene, `lammps_path` that of any LAMMPS. To write a ramp of your own, loop over
`equilibrate`. The names of this package are imported when they are used.
"""

from typing import TYPE_CHECKING

from ..analysis.names_on_use import names_on_use
from .lammps.two_mpi_libraries import load_own_mpi

if TYPE_CHECKING:  # each is imported when it is used
    from ..analysis import NoEquilibriumError
    from .equilibria.quasistatic import Equilibrium, equilibrate
    from .granular.from_lammps import from_lammps
    from .granular.granular_commands import NotTakenError
    from .granular.lammps_path import lammps_path
    from .granular.look_in_a_copy import in_a_copy
    from .granular.motion_compared import MotionComparison, compare_motion
    from .granular.relax import relax
    from .lammps.dynamics import Dynamics
    from .lammps.engine import Engine
    from .lammps.instance import EngineError, lammps_instance
    from .load_path import LoadPath
    from .onset import onset_run
    from .runs.drive import DriveCheckpoint, DriveSample, DriveStep, drive, settle_for_drive
    from .runs.ramp import ramp, reach
    from .runs.ramp_loads import ramp_loads
    from .runs.run_recorder import Record
    from .runs.scene_path import scene_path
    from .runs.undamped import Checkpoint, Sample, perturb, time_step
    from .scenes.scene import Scene
    from .scenes.units import dashpot, real_units, restitution
    from .scenes.validation import SceneError
    from .settling.relax import bring_to_rest
    from .settling.settle import settle

load_own_mpi()  # before mpi4py.MPI is imported

__all__ = [
    "Checkpoint", "DriveCheckpoint", "DriveSample", "DriveStep", "Dynamics", "Engine", "EngineError", "Equilibrium",
    "LoadPath", "MotionComparison", "NoEquilibriumError", "NotTakenError", "Record", "Sample", "Scene", "SceneError",
    "bring_to_rest", "compare_motion", "dashpot", "drive", "equilibrate", "from_lammps", "in_a_copy",
    "lammps_instance", "lammps_path", "onset_run", "perturb", "ramp", "ramp_loads", "reach", "real_units", "relax",
    "restitution", "scene_path", "settle", "settle_for_drive", "time_step",
]  # fmt: skip

if not TYPE_CHECKING:
    __getattr__, __dir__ = names_on_use(__name__, __file__)
