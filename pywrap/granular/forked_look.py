"""Look into a LAMMPS instance without changing it.

LAMMPS hands out contacts in a run alone, and a run of zero steps sorts particles, may cut a history once more at
Coulomb's bound, and scales a rescaled one. So the look is taken in a copy of the process (`fork`), at rest and
with dumps, averages and log closed, and the instance stays as it is. A copy of one of several ranks could not speak
with the others: there, and where LAMMPS has threads, the instance itself runs zero steps, and coordinates, velocities
and forces are given back to the bit, and by fix keep/histories of the plugin the histories of contacts, too.
"""

import ctypes
import os
import pickle
import re
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

import numpy as np
from mpi4py import MPI

from ...analysis.packing.arrays import Floats
from ..lammps.instance import load_plugin
from .granular_commands import SnapshotError

Found = TypeVar("Found")
Arrays = dict[str, Any]

PER_STEP = ("ave/", "print", "vector", "halt", "balance", "adapt", "dt/reset", "record")
"""Fixes that write or change something in a run of zero steps, by the beginnings of their styles."""

KEPT = ("x", "image", "v", "omega", "f", "torque")
"""What is given back after zero steps of the instance itself, which round the coordinates in a sheared box and wrap
those that have left the box."""

DRAG = ("viscous", "langevin", "nve/limit", "overdamped")
"""Fixes that take energy away."""


def communicator(lmp: Any) -> MPI.Comm:
    """The ranks of an instance."""
    if lmp.extract_setting("world_size") == 1:
        return MPI.COMM_SELF
    return getattr(lmp, "comm", None) or MPI.COMM_WORLD


def can_copy(lmp: Any) -> bool:
    """Whether the process can be copied: one rank, one thread."""
    threads = lmp.extract_setting("nthreads")
    return hasattr(os, "fork") and MPI.COMM_WORLD.size == 1 and threads <= 1


def in_a_copy(work: Callable[[], Found]) -> Found:
    """What some work finds in a copy of this process, whose traces end with it.

    Raises
    ------
    SnapshotError
        With what went wrong in the copy.
    """
    ctypes.CDLL(None).fflush(None)  # what is buffered would be written twice
    source, sink = os.pipe()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.close(source)
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, 1)
            os.dup2(nowhere, 2)
            try:
                said = pickle.dumps((True, work()))
            except Exception as error:  # whatever it is, the parent says it
                said = pickle.dumps((False, error if isinstance(error, SnapshotError) else explain_error(error)))
            with os.fdopen(sink, "wb") as stream:
                stream.write(said)
            code = 0
        finally:
            os._exit(code)
    os.close(sink)
    with os.fdopen(source, "rb") as stream:
        said = stream.read()
    os.waitpid(child, 0)
    if not said:
        raise SnapshotError("LAMMPS ended while its packing was looked at; does the deck run on as it stands?")
    good, found = pickle.loads(said)
    if good:
        return found
    raise found if isinstance(found, SnapshotError) else SnapshotError(found)


def explain_error(error: Exception) -> str:
    """A sentence of an error that LAMMPS has raised."""
    lines = [line.strip().removeprefix("ERROR: ") for line in str(error).splitlines() if line.strip()]
    reason = re.sub(r" \(\S+:\d+\)", "", "; ".join(lines) or type(error).__name__)
    return f"LAMMPS stopped: {reason.rstrip('.')}."


def quieten(lmp: Any, *, drag: bool = False) -> None:
    """Close dumps, averages and restarts of a copy; drag too, if asked."""
    lmp.command("restart 0")
    for name in lmp.available_ids("dump"):
        lmp.command(f"undump {name}")
    for name, style in styles_of(lmp)[1].items():
        if style.startswith(PER_STEP) or (drag and style.startswith(DRAG)):
            lmp.command(f"unfix {name}")


def styles_of(lmp: Any) -> tuple[str, dict[str, str], str, str]:
    """Pair style, styles of the fixes by ID, units and atom style, as LAMMPS's `info` says them."""
    world = communicator(lmp)
    with TemporaryDirectory(prefix="faultgouge") as folder:
        path = world.bcast(f"{folder}/info", root=0)
        lmp.command(f'info fixes system out overwrite "{path}"')
        said = world.bcast(Path(path).read_text() if world.rank == 0 else None, root=0)
        world.barrier()
    fixes, values = {}, {"Pair style": "none", "Units": "lj", "Atom style": ""}
    for line in said.splitlines():
        left, _, right = line.partition("=")
        if left.strip() in values:
            values[left.strip()] = right.strip()
        if left.strip() == "Atoms":  # Atoms = N, types = T, style = that of the pairs
            values["Pair style"] = line.rpartition("style =")[2].strip()
        if line.strip().startswith("Fix["):
            # Fix[  0]: NAME,  style = STYLE,  group = GROUP
            name, style, *_ = (part.strip() for part in line.partition("]:")[2].split(","))
            fixes[name] = style.partition("=")[2].strip()
    return values["Pair style"], fixes, values["Units"], values["Atom style"]


def log_path(lmp: Any) -> Path | None:
    """An instance's log, which is closed by the question; None without a log."""
    before = _open_logs()
    lmp.command("log none")
    closed = [path for descriptor, path in before.items() if descriptor not in _open_logs()]
    return Path(closed[0]) if len(closed) == 1 else None


def log_of(lmp: Any) -> list[str] | None:
    """The lines of an instance's log, which is closed by the question; None without a log."""
    path = log_path(lmp)
    return None if path is None else path.read_text(errors="replace").splitlines()


def only_log() -> list[str] | None:
    """The lines of the only open log of this process; None if there is none, or there are several."""
    found = set(_open_logs().values())
    return Path(found.pop()).read_text(errors="replace").splitlines() if len(found) == 1 else None


def _open_logs() -> dict[str, str]:
    """Open files that begin as a log of LAMMPS does, by their descriptors."""
    ctypes.CDLL(None).fflush(None)
    found, listed = {}, Path("/proc/self/fd")
    for each in listed.iterdir() if listed.is_dir() else ():
        try:
            path = os.readlink(each)
            with open(path, "rb") as stream:
                if path.startswith("/") and os.path.isfile(path) and stream.read(8) == b"LAMMPS (":
                    found[each.name] = path
        except OSError:
            continue
    return found


def at_rest(lmp: Any, groups: dict[str, str], walls: tuple[str, ...], columns: str) -> Arrays:
    """Particles, forces and contacts of this rank after zero steps at rest.

    Parameters
    ----------
    groups : dict
        Names of what is to be found, and groups of particles.
    walls : tuple of str
        Fixes whose contacts are handed out.
    columns : str
        What compute pair/local is to give.
    """
    for name in ("v", "omega"):
        _owned_array(lmp, name)[:] = 0.0
    lmp.command(f"compute faultgouge_c all pair/local {columns} cutoff radius")
    lmp.command("compute faultgouge_i all property/local patom1 patom2 cutoff radius")
    for name, group in groups.items():
        lmp.command(f"variable faultgouge_{name} atom gmask({group})")
    lmp.command("run 0 post no")
    found: dict[str, np.ndarray] = {
        name: np.array(_owned_array(lmp, name)) for name in ("id", "type", "x", "f", "torque", "radius", "rmass")
    }
    for name, key in (("c", "contacts"), ("i", "partners")):
        local = lmp.numpy.extract_compute(f"faultgouge_{name}", 2, 2)
        found[key] = np.zeros((0, 1)) if local is None else np.array(local)
    count = len(found["id"])
    for name in groups:
        members = np.array(lmp.numpy.extract_variable(f"faultgouge_{name}", "all", 1))[:count]
        found[name] = members > 0
    for wall in walls:
        rows = lmp.numpy.extract_fix(wall, 1, 2)
        found[f"wall {wall}"] = np.zeros((0, 8)) if count == 0 else np.array(rows)[:count]
    return found


def _owned_array(lmp: Any, name: str) -> Floats:
    """An array of the particles of this rank, as LAMMPS has it."""
    count = lmp.extract_setting("nlocal")
    values = lmp.numpy.extract_atom(name)
    return np.zeros((0, 3)) if values is None else values[:count]


def in_place(lmp: Any, work: Callable[[], Found], groups: dict[str, str]) -> Found:
    """What some work finds in the instance itself; what moves, and histories, are given back, and its computes go."""
    load_plugin(lmp)
    kept = {name: np.array(_owned_array(lmp, name)) for name in ("id", *KEPT)}
    world = communicator(lmp)
    whole = {name: np.concatenate(world.allgather(values)) for name, values in kept.items()}
    order = np.argsort(whole["id"])
    lmp.command("fix faultgouge_h all keep/histories")
    try:
        return work()
    finally:
        place = order[np.searchsorted(whole["id"][order], _owned_array(lmp, "id"))] if len(order) else order
        for name in KEPT:
            _owned_array(lmp, name)[:] = whole[name][place]
        lmp.command("fix_modify faultgouge_h restore")
        lmp.command("unfix faultgouge_h")
        for name in ("faultgouge_c", "faultgouge_i"):
            if lmp.has_id("compute", name):
                lmp.command(f"uncompute {name}")
        for name in groups:
            if lmp.has_id("variable", f"faultgouge_{name}"):
                lmp.command(f"variable faultgouge_{name} delete")
