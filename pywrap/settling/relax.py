"""Bring the disks of another code to rest under this law and load.

Disks without slips first come to rest without friction, and friction then starts with zero slips. K is therefore
symmetric at F_x = 0, as in a generated packing. Disks with slips keep friction and come to rest by overdamped dynamics.
Dynamics starts from the given positions and makes the rearrangements; Newton's method gives the last digits.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...analysis import BadInputError, NoEquilibriumError, Packing, nearest_image
from ...analysis.progress import Watch, show_progress
from ..equilibria.quasistatic import Equilibrium, equilibrate, idle_disks
from ..equilibria.rattlers import clear_rattlers
from ..lammps.engine import Engine
from .minimize_energy import finest_tolerance, largest_force, settle_loose


def bring_to_rest(packing: Packing, watch: Watch | None = None) -> tuple[Equilibrium, str]:
    """Bring a packing to rest under its law and load.

    Parameters
    ----------
    packing : Packing
        Disks as another code left them.
    watch : callable, optional
        Told in words what begins.

    Returns
    -------
    Equilibrium
        At rest.
    str
        What moved, and by how much.

    Raises
    ------
    BadInputError
        If a packing without slips is under a shear force, which nothing holds without friction.
    NoEquilibriumError
        If it does not come to rest.
    """
    slipped = packing.law.frictional and bool(np.any(packing.contacts.slip))
    if not slipped and packing.fx != 0:
        pushes = f"and F_x = {packing.fx:g} would push them along for ever"
        cure = "leave --fx out, and raise F_x by `faultgouge ramp`."
        raise BadInputError(f"without slips the disks rest without friction first, {pushes}: {cure}")
    with show_progress(watch):
        if slipped:
            with Engine(packing) as engine:
                engine.relax(finest_tolerance(packing))
                resting = engine.packing
        else:
            # where disks rest does not depend on their masses, and the time step of dynamics is that of masses of one
            law = replace(packing.law, mu=0.0, ct=0.0)
            smooth = replace(packing, law=law, mass=np.ones(len(packing)))
            with Engine(smooth) as engine:
                resting = settle_loose(engine, smooth, bed=False)
            resting = clear_rattlers(resting, idle_disks(resting))
            resting = replace(resting, law=packing.law, angle=packing.angle, mass=packing.mass)
    idle = len(idle_disks(resting))
    if idle > 0.5 * len(resting):
        says = f"the upper layer sank through the bed, and {idle} of {len(resting)} disks carry nothing"
        raise NoEquilibriumError(f"{says}: choose a layer that closes the box (--top), or a lower load (--fy)")
    with Engine(resting) as engine:
        found = equilibrate(engine, Equilibrium.of(resting), resting.fx)
    after = found.packing
    moved = np.hypot(*nearest_image(after.position - packing.position, after.box_length).T).max()
    forces = f"the largest force on a disk was {largest_force(packing):.3g} and is {found.residual:.2g}"
    return found, f"brought to rest: {forces}; the farthest disk moved by {moved:.3g}"
