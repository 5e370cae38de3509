"""Remote triggering in a stressed layer of frictional disks.

``faultgouge.analysis`` computes the stability operator, spectrum, onset and growth of a configuration;
``faultgouge.pywrap`` drives LAMMPS from a scene to stored configurations; ``faultgouge.studies`` computes and reports
results; ``faultgouge.assessment`` measures errors, run time and limits.
"""

import sys
from typing import Any

if "IPython" in sys.modules:
    from .notebook import show_pictures

    show_pictures()


def __getattr__(name: str) -> Any:
    if name == "relax":
        from .pywrap import relax

        return relax
    # the version when it is asked for: importlib.metadata takes as long to import as all that --help needs
    if name == "__version__":
        from importlib.metadata import version

        return version("faultgouge")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
