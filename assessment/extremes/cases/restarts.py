"""Restarts in the middle: an undamped run that goes on in an empty instance of LAMMPS, from its restart file.

The layer is torn off by a force along x as large as the load, so that contacts slide, open and close. Coordinates with
their low parts, velocities, angles and the slips of all contacts must be those of the run that was not interrupted, to
the bit.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from mpi4py import MPI

from ....analysis import spectrum, stable_timestep
from ....pywrap import Engine
from ....pywrap.lammps.decks import DECKS
from ....pywrap.lammps.plain_file_names import shared_folder
from .case import Case, Outcome, measured_outcome
from .loads import Make
from .packings import arches, bed, crystal, law, with_low_parts

GROUP = "restart in the middle"

STEPS_BETWEEN = 2000
"""Time steps before and after the restart: contacts slide, open and close in them."""

LARGEST_FORCE = 1e-3
"""Largest force along x, in units of k_n: a layer that nothing holds would soon cross its radius in one step."""


def _same_after_restart(make: Make, compensated: bool) -> Outcome:
    packing = make()
    fx = min(packing.fy, LARGEST_FORCE * packing.law.kn)
    packing = replace(with_low_parts(packing) if compensated else packing, fx=fx)
    start = [
        "velocity all set 0.0 0.0 0.0",
        f"timestep {0.1 * stable_timestep(spectrum(packing).omega_max)!r}",
        f"fix move all nve/disc {packing.inertia_factor!r}{' compensated' if compensated else ''}",
        f"run {STEPS_BETWEEN}",
    ]
    with shared_folder(MPI.COMM_WORLD) as folder:
        restart = folder / "middle.restart"
        with Engine(packing) as engine:
            engine.lammps.commands_list([*start, f"write_restart {restart}", f"run {STEPS_BETWEEN}"])
            straight = _state(engine)
        with Engine(packing) as engine:
            engine.lammps.commands_list(["clear", f"variable restart index {restart}"])
            engine.lammps.file(str(DECKS / "system.in"))
            engine.lammps.commands_list(start[1:])
            resumed = _state(engine)
    differences = [
        int(np.count_nonzero(one != other)) if one.shape == other.shape else one.size
        for one, other in zip(straight, resumed, strict=True)
    ]
    return measured_outcome(
        sum(differences),
        0,
        f"numbers that differ after {STEPS_BETWEEN} more steps, of {sum(array.size for array in straight)}: "
        "coordinates, angles, velocities, contacts and their slips",
    )


def _state(engine: Engine) -> list[np.ndarray]:
    packing, columns = engine.packing, len(engine.packing) * 3
    c = packing.contacts
    velocities = [
        np.ctypeslib.as_array(engine.lammps.gather_atoms(name, 1, 3), (columns,)).copy() for name in ("v", "omega")
    ]
    low = [] if packing.position_low is None else [packing.position_low]
    slip_low = [] if c.slip_low is None else [c.slip_low]
    return [packing.position, packing.angle, c.i, c.j, c.slip, *low, *slip_low, *velocities]


RESTARTED_PACKINGS: dict[str, tuple[Make, bool]] = {
    "k_n = 1e2": (partial(bed, law(1e2)), False),
    "k_n = 1e12": (partial(bed, law(1e12)), True),
    "load 1e-12 k_n": (partial(crystal, 3, 2, law(), 1e-12), False),
    "load 0.1 k_n": (partial(crystal, 4, 2, law(), 0.1), False),
    "mu = 0": (partial(bed, law(mu=0.0)), False),
    "mu = 1e-6": (partial(bed, law(mu=1e-6)), True),
    "mu = 10": (partial(bed, law(mu=10.0)), False),
    "k_t = 10 k_n": (partial(bed, law(kt_share=10.0)), False),
    "sizes 1 : 50": (partial(arches, 50.0), True),
    "box 3 wide": (partial(crystal, 3), False),
    "box 100 wide": (partial(crystal, 100), False),
}
"""Packings by what is extreme in them, and whether they belong to the small part."""

CASES = [
    Case(GROUP, f"{name}, {arithmetic}", partial(_same_after_restart, make, arithmetic == "compensated"), quick)
    for name, (make, quick) in RESTARTED_PACKINGS.items()
    for arithmetic in ("doubles", "compensated")
]
