"""Tools of studies for a packing: its path of equilibria in this process alone, and its contacts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ..analysis import Packing, mean_square_displacement
from ..pywrap import Engine, Equilibrium, Scene
from ..pywrap.runs.equilibrium_path import EquilibriumPath

Start = Callable[[float], Equilibrium]
"""mu -> the settled packing of a scene with this friction coefficient."""


def with_seed(scene: Scene, seed: int) -> Scene:
    """The scene with another packing."""
    return scene.model_copy(update={"packing": scene.packing.model_copy(update={"seed": seed})})


@contextmanager
def path_from(rest: Equilibrium, scene: Scene) -> Iterator[EquilibriumPath]:
    """The equilibria of a scene over F_x from the settled packing on; LAMMPS closes in the end."""
    with Engine(rest.packing, MPI.COMM_SELF) as engine:
        yield EquilibriumPath(engine, rest, scene)


def unit_of_time(packing: Packing) -> float:
    """sqrt(3 m d/F_y) of the smallest and the lightest disk: 1 for m = d = 1 and the paper's F_y = 3."""
    return float(np.sqrt(3 * packing.mass.min() * 2 * packing.radius.min() / packing.fy))


def shake_disks(engine: Engine, packing: Packing, size: float, seed: int) -> None:
    """Put a packing into LAMMPS, x and y of each disk at random about where they are, by this standard deviation."""
    noise = np.zeros(3 * len(packing))
    noise[: 2 * len(packing)] = size * np.random.default_rng(seed).standard_normal(2 * len(packing))
    engine.restore(engine.displace(packing, noise))


def distance_of_bearing_disks(first: Packing, now: Packing) -> float:
    """D of the disks that carry load at the start, length^2."""
    kept = np.ones(len(first), dtype=bool)
    kept[first.rattlers] = False
    return float(mean_square_displacement(now.position[kept], first.position[kept], first.box_length))


def contact_pairs(packing: Packing, chosen: NDArray[np.bool_] | slice = slice(None)) -> set[tuple[int, int]]:
    """The contacts of a packing, or some of them, as (i, j)."""
    contacts = packing.contacts
    return set(zip(contacts.i[chosen].tolist(), contacts.j[chosen].tolist(), strict=True))
