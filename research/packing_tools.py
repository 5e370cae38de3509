"""Packings of research: other seeds, noise, and the displacement of the disks that bear load."""

import numpy as np

from faultgouge.analysis import Packing, mean_square_displacement
from faultgouge.pywrap import Engine, Scene


def with_seed(scene: Scene, seed: int) -> Scene:
    """The scene with another packing."""
    return scene.model_copy(update={"packing": scene.packing.model_copy(update={"seed": seed})})


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
