"""Tools of studies for a packing: its path of equilibria in this process alone, and its contacts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ..analysis import Packing
from ..pywrap import Engine, Equilibrium, Scene
from ..pywrap.load_path import LoadPath
from ..pywrap.runs.scene_path import scene_path

Start = Callable[[float], Equilibrium]
"""mu -> the settled packing of a scene with this friction coefficient."""


@contextmanager
def path_from(rest: Equilibrium, scene: Scene) -> Iterator[LoadPath[Equilibrium]]:
    """The equilibria of a scene over F_x from the settled packing on; LAMMPS closes in the end."""
    with Engine(rest.packing, MPI.COMM_SELF) as engine:
        yield scene_path(engine, rest, scene)


def unit_of_time(packing: Packing) -> float:
    """sqrt(3 m d/F_y) of the smallest and the lightest disk: 1 for m = d = 1 and the paper's F_y = 3."""
    return float(np.sqrt(3 * packing.mass.min() * 2 * packing.radius.min() / packing.fy))


def contact_pairs(packing: Packing, chosen: NDArray[np.bool_] | slice = slice(None)) -> set[tuple[int, int]]:
    """The contacts of a packing, or some of them, as (i, j)."""
    contacts = packing.contacts
    return set(zip(contacts.i[chosen].tolist(), contacts.j[chosen].tolist(), strict=True))
