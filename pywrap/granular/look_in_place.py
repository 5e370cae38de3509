"""Look into a LAMMPS instance itself, where its process cannot be copied: on several ranks, or with threads.

The instance runs zero steps, which may move particles to other ranks, wrap or round coordinates, and change histories.
Coordinates, velocities and forces are given back to the bit, and by fix keep/histories of the plugin the histories of
contacts, too.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from ..lammps.instance import load_plugin
from .instance_queries import communicator
from .lammps_arrays import owned_array, remove_computes

Found = TypeVar("Found")

ATOM_ARRAYS = ("x", "image", "v", "omega", "f", "torque")
"""What is given back after zero steps of the instance itself, which round the coordinates in a sheared box and wrap
those that have left the box."""


def in_place(lmp: Any, work: Callable[[], Found], groups: dict[str, str]) -> Found:
    """What some work finds in the instance itself; what moves, and histories, are given back, and its computes go."""
    load_plugin(lmp)
    kept = {name: np.array(owned_array(lmp, name)) for name in ("id", *ATOM_ARRAYS)}
    world = communicator(lmp)
    whole = {name: np.concatenate(world.allgather(values)) for name, values in kept.items()}
    order = np.argsort(whole["id"])
    lmp.command("fix faultgouge_h all keep/histories")
    try:
        return work()
    finally:
        place = order[np.searchsorted(whole["id"][order], owned_array(lmp, "id"))] if len(order) else order
        for name in ATOM_ARRAYS:
            owned_array(lmp, name)[:] = whole[name][place]
        lmp.command("fix_modify faultgouge_h restore")
        lmp.command("unfix faultgouge_h")
        remove_computes(lmp, groups)
