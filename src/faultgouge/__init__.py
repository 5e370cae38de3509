"""Stability of packings of frictional grains: whether they move, and what happens when they do.

This module offers the names that most users need, each imported when it is used. ``faultgouge.analysis`` has the
stability operator, spectrum, onset and growth of a configuration; ``faultgouge.pywrap`` drives LAMMPS from a scene to
stored configurations; ``faultgouge.studies`` computes and reports results; ``faultgouge.assessment`` measures errors,
run time and limits.
"""

import sys
from typing import TYPE_CHECKING, Any

from .analysis.names_on_use import names_on_use

if TYPE_CHECKING:  # each is imported when it is used
    from .door import draw, elastic_moduli, frames, load, pair, spectrum, stability, stress, vibrations, view
    from .pywrap import Scene, from_lammps, perturb, ramp, relax, settle
    from .pywrap.onset import onset
    from .pywrap.runs.drive import drive
    from .studies.sweep.run_sweep import sweep

    __version__: str

if "IPython" in sys.modules:
    from .notebook import show_pictures

    show_pictures()

__all__ = [
    "Scene", "__version__", "draw", "drive", "elastic_moduli", "frames", "from_lammps", "load", "onset", "pair",
    "perturb", "ramp", "relax", "settle", "spectrum", "stability", "stress", "sweep", "vibrations", "view",
]  # fmt: skip

_get, __dir__ = names_on_use(__name__, __file__)


def __getattr__(name: str) -> Any:
    if name != "__version__":
        return _get(name)
    # the version when it is asked for: importlib.metadata takes as long to import as all that --help needs
    from importlib.metadata import version

    return version("faultgouge")
