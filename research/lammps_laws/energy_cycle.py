r"""Energy that one contact creates on a closed cycle of its state, for each law of LAMMPS.

Two spheres touch. One of them turns, so that the contact slips; or moves along the line of centres, so that the overlap
changes. No contact slides. Two cycles, each a rectangle of overlap and tangential force:

- *closing under load*: slip at the overlap `SHALLOW`, press to `DEEP`, slip back until there is no tangential force,
  part;
- *parting under load*: slip at `DEEP`, part to `SHALLOW`, slip back until there is no tangential force, press.

The work of the contact is that of the normal force along the overlap and of the tangential force along the slip. With
the tangential stiffness k(delta), of which `DEEP` has twice that of `SHALLOW` (a root of four) unless the law is
linear, the slip s stores k s^2/2. What the cycle creates, over this, is with q = k(deep)/k(shallow)

====================================  ====================  =====================
tangential force                      closing under load    parting under load
====================================  ====================  =====================
k constant                            0                     0
follows k: -k s                       q - 1                 1/q - 1
stays                                 1/q - 1               q - 1
stays closing, follows k parting      1/q - 1               1/q - 1
follows k closing, k^2 parting        q - 1                 1/q^3 - 1
====================================  ====================  =====================

A positive number is energy from nowhere.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from mpi4py import MPI

from faultgouge.pywrap import lammps_instance
from research.lammps_laws.compute import HOOKE, KT, LAWS, NONE

SHALLOW, DEEP, SLIP, RADIUS = 1e-3, 4e-3, 1e-4, 0.5
"""Overlaps, slip (an eighteenth of that at which the shallow contact slides) and radius, length."""

STEPS = 1000
"""Of each side of the rectangle, in a unit of time. Forces are linear in the slip, so that the work along a side is
exact; along the overlap the work of the way back is that of the way there to the same error."""

EXPONENTS = {
    "gran/hooke/history": (0, 0),
    "granular hooke, linear_history": (0, 0),
    "gran/hertz/history": (1, 1),
    "granular hertz, mindlin": (1, 1),
    "granular hertz, mindlin/force": (0, 0),
    "granular hertz, mindlin_rescale": (1, 2),
    "granular hertz, mindlin_rescale/force": (0, 1),
}
"""Powers of k with which the tangential force follows it while the contact closes and while it parts."""


def energy_cycle(law: str) -> dict[str, Any]:
    """Energy created on both cycles over that stored by the slip: in LAMMPS, and by the formula."""
    q = 1.0 if "hook" in law else np.sqrt(DEEP / SHALLOW)
    row: dict[str, Any] = {"law": law}
    for name, (first, second), power in (
        ("closing", (SHALLOW, DEEP), EXPONENTS[law][0]),
        ("parting", (DEEP, SHALLOW), EXPONENTS[law][1]),
    ):
        ratio = q if name == "closing" else 1 / q  # k at the second overlap over that at the first
        released = ratio ** (power - 1)  # slip back over slip
        work, left = _work(law, first, second, released * SLIP)
        stiffness = HOOKE * KT if "hook" in law else KT * np.sqrt(RADIUS / 2 * first)
        row[name] = work / (stiffness * SLIP**2 / 2)
        row[f"{name}_formula"] = float(ratio ** (2 * power - 1) - 1)
        row[f"{name}_left"] = left / (stiffness * SLIP)
    return row


def _work(law: str, first: float, second: float, back: float) -> tuple[float, float]:
    """Work of the contact on the rectangle, and the tangential force that is left."""
    with TemporaryDirectory() as folder:
        lmp = lammps_instance(MPI.COMM_SELF, None)
        lmp.commands_list(
            [
                "units lj", "dimension 3", "atom_style sphere", "atom_modify map array", "boundary f f f",
                "comm_modify vel yes", "region box block -3 3 -3 3 -3 3 units box", "create_box 1 box",
                "create_atoms 1 single 0 0 0 units box", f"create_atoms 1 single {2 * RADIUS - first:.17g} 0 0",
                f"set group all diameter {2 * RADIUS}", "set group all density 1", "group moves id 2",
                *LAWS[law].lines(gamma=NONE)[0].splitlines(), f"timestep {1 / STEPS}", "thermo 1000000",
            ]
        )  # fmt: skip
        work = 0.0
        for slip, press in ((SLIP, 0.0), (0.0, second - first), (-back, 0.0), (0.0, first - second)):
            if press:
                lmp.command(f"fix go moves move linear {-press:.17g} 0 0 units box")
                power = f"{-press:.17g}*fx[2]"
            else:  # turned about its own centre: a positive slip is a turn to the right
                x = lmp.numpy.extract_atom("x")[1]
                period, axis = 2 * np.pi * RADIUS / abs(slip), -np.sign(slip)
                lmp.command(f"fix go moves move rotate {x[0]:.17g} 0 0 0 0 {axis} {period:.17g} units box")
                power = f"{slip:.17g}*fy[2]"
            path = Path(folder) / "power"
            lmp.command(f'variable power equal "{power}"')
            lmp.command(f"fix record all ave/time 1 1 1 v_power file {path} format ' %.17g'")
            lmp.command(f"run {STEPS} post no")
            lmp.command("unfix record")
            lmp.command("unfix go")
            lmp.commands_list(["velocity all set 0 0 0", "set group all omega 0 0 0"])
            work += float(np.trapezoid(np.loadtxt(path)[:, 1], dx=1 / STEPS))
        left = float(lmp.numpy.extract_atom("f")[1, 1])
        lmp.close()
    return work, left
