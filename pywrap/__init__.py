"""The driver: from a scene to equilibria and undamped runs, with LAMMPS.

`scene` says what is wanted, `stages` runs it, `engine` is LAMMPS with one packing in it, and `quasistatic` takes
it from equilibrium to equilibrium. A ramp of one's own is a loop over `equilibrate`.
"""

from .engine import Engine, EngineError
from .quasistatic import Equilibrium, NoEquilibriumError, equilibrate
from .scene import Scene, SceneError
from .stages import Record, Sample, perturb, ramp, reach, settle

__all__ = [
    "Engine",
    "EngineError",
    "Equilibrium",
    "NoEquilibriumError",
    "Record",
    "Sample",
    "Scene",
    "SceneError",
    "equilibrate",
    "perturb",
    "ramp",
    "reach",
    "settle",
]
