"""Particles, forces and contacts of a LAMMPS instance as arrays."""

from typing import Any

import numpy as np

from ...analysis.packing.arrays import Floats

Arrays = dict[str, Any]


def arrays_at_rest(lmp: Any, groups: dict[str, str], walls: tuple[str, ...], columns: str) -> Arrays:
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
        owned_array(lmp, name)[:] = 0.0
    lmp.command(f"compute faultgouge_c all pair/local {columns} cutoff radius")
    lmp.command("compute faultgouge_i all property/local patom1 patom2 cutoff radius")
    for name, group in groups.items():
        lmp.command(f"variable faultgouge_{name} atom gmask({group})")
    lmp.command("run 0 post no")
    found: dict[str, np.ndarray] = {
        name: np.array(owned_array(lmp, name)) for name in ("id", "type", "x", "f", "torque", "radius", "rmass")
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


def remove_computes(lmp: Any, groups: dict[str, str]) -> None:
    """Remove the computes and variables with which arrays were read."""
    for name in ("faultgouge_c", "faultgouge_i"):
        if lmp.has_id("compute", name):
            lmp.command(f"uncompute {name}")
    for name in groups:
        if lmp.has_id("variable", f"faultgouge_{name}"):
            lmp.command(f"variable faultgouge_{name} delete")


def owned_array(lmp: Any, name: str) -> Floats:
    """An array of the particles of this rank, as LAMMPS has it."""
    count = lmp.extract_setting("nlocal")
    values = lmp.numpy.extract_atom(name)
    return np.zeros((0, 3)) if values is None else values[:count]
