"""Stability of packings of frictional grains: whether they move, and what happens when they do.

This module offers the names that most users need, each imported when it is used. ``faultgouge.analysis`` has the
stability operator, spectrum, onset and growth of a configuration; ``faultgouge.pywrap`` drives LAMMPS from a scene to
stored configurations; ``faultgouge.studies`` computes and reports results; ``faultgouge.assessment`` measures errors,
run time and limits.
"""

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # what `OFFERS` imports when it is used
    from .browser_view import view
    from .drawing import draw
    from .pywrap import Scene, from_lammps, perturb, ramp, relax, settle
    from .pywrap.onset import onset
    from .pywrap.runs.drive import drive
    from .stored_files import load, spectrum, stability
    from .studies.sweep.run_sweep import sweep

    __version__: str

if "IPython" in sys.modules:
    from .notebook import show_pictures

    show_pictures()

OFFERS = {
    "Scene": "pywrap", "settle": "pywrap", "ramp": "pywrap", "perturb": "pywrap", "drive": "pywrap.runs.drive",
    "onset": "pywrap.onset", "from_lammps": "pywrap", "relax": "pywrap", "load": "stored_files",
    "stability": "stored_files", "spectrum": "stored_files", "draw": "drawing", "view": "browser_view",
    "sweep": "studies.sweep.run_sweep",
}  # fmt: skip
"""Names of this package, and the modules that have them."""

__all__ = [
    "Scene", "__version__", "draw", "drive", "from_lammps", "load", "onset", "perturb", "ramp", "relax", "settle",
    "spectrum", "stability", "sweep", "view",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name in OFFERS:
        return getattr(import_module(f"{__name__}.{OFFERS[name]}"), name)
    # the version when it is asked for: importlib.metadata takes as long to import as all that --help needs
    if name == "__version__":
        from importlib.metadata import version

        return version("faultgouge")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *OFFERS, "__version__"])
