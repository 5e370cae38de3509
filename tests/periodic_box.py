"""Disks and spheres at rest in a periodic box of LAMMPS, with friction and a shear behind them."""

from pathlib import Path

import numpy as np


def at_rest(d: int, log, count: int = 40, seed: int = 1):
    """A LAMMPS instance with gran/hertz/history: settled without friction, sheared by 0.02 with it, and at rest."""
    from mpi4py import MPI

    from faultgouge.pywrap import from_lammps
    from faultgouge.pywrap.lammps.instance import lammps_instance

    lmp, rng = lammps_instance(MPI.COMM_SELF, log), np.random.default_rng(seed)
    radius = rng.uniform(0.4, 0.6, count)
    fill = 4 / 3 * np.pi * np.sum(radius**3) / 0.74 if d == 3 else np.pi * np.sum(radius**2) / 0.95
    edge = float(fill ** (1 / d))
    height = f"0 {edge!r}" if d == 3 else "-0.5 0.5"
    place = rng.uniform(0, edge, (count, 3)) * ([1, 1, 1] if d == 3 else [1, 1, 0])
    deck, flat = (Path(__file__).parent / "periodic_box.in").read_text(), "fix flat all enforce2d" if d == 2 else ""
    box, motion = deck.format(d=d, edge=edge, height=height, flat=flat).split("# particles are created here\n")
    lmp.commands_string(box)
    lmp.create_atoms(count, list(range(1, count + 1)), [1] * count, place.ravel().tolist())
    for number, each in enumerate(radius.tolist(), 1):
        lmp.command(f"set atom {number} diameter {2 * each!r} density 1.0")
    lmp.commands_string(motion)
    for _ in range(40):
        lmp.command("run 20000")
        found = from_lammps(lmp, balance=np.inf, prove=False)
        if found.residual < 1e-11 * found.contacts.normal_force.mean():
            return lmp
    raise AssertionError(f"the packing does not rest: {found}")
