r"""A settled packing under another load, reached quasi-statically.

Settling is chaotic: the last digit of the load decides where disks come to rest. A packing that has settled under one
load and is then carried to another keeps its neighbours, but for what the change of load itself rearranges. Only the
ratio of k_n to F_y matters: a stiffness that rises at a given load is a load that falls at a given stiffness.

F_y changes by increments of the same factor, counted from the load of settling, at :math:`F_x = 0`. Loads on the way to
one load are therefore those on the way to any load beyond, and both have the same packings there. After each increment
Newton's method (:mod:`~faultgouge.pywrap.equilibria`) finds the next equilibrium from the last one, with friction if
the packing has settled with friction. Contacts close as F_y rises and open as it falls.

Without friction the equilibrium has to be a minimum of the energy. Where the minimum disappears, Newton's method finds
nothing or a saddle. The packing then goes downhill to the next minimum
(:func:`~faultgouge.pywrap.settling.minimize_energy.minimize_energy`), as in athermal quasi-static deformation (C.
Maloney and A. Lemaitre, Phys. Rev. E 74, 016118 (2006)). That is a rearrangement, after which some disks have other
neighbours. With friction overdamped dynamics take the place of the way downhill.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mpi4py import MPI

from ...analysis import NoEquilibriumError, Packing
from ...analysis.progress import report_progress
from ..equilibria.quasistatic import Equilibrium, equilibrate
from ..lammps.engine import Engine
from .minimize_energy import finest_tolerance, is_minimum, minimize_energy, settle_loose

LOAD_FACTOR = 1.05
"""Factor of F_y from one equilibrium to the next. Up to 25 times the load of the paper's packing, factors
of 1.005 to 1.3 lead to the same packing within 1e-14."""

FORCE_OF_MOTION = 1e-6
"""Force on a disk, in units of F_y, above which a packing is not at rest: all ways to rest end far below."""


def change_load(packing: Packing, fy: float, communicator: MPI.Comm | None = None) -> Packing:
    """Carry a packing that rests at its own F_y, with F_x = 0, to another F_y; the same packing if that is its own.

    Raises NoEquilibriumError if the packing does not come to rest at some F_y on the way.
    """
    here = packing
    for load in loads_between(packing.fy, fy):
        report_progress(f"settled at F_y = {packing.fy:.6g}, carried to {load:.6g}")
        start = replace(here, fy=load)
        with Engine(start, communicator) as engine:
            try:
                here, found = equilibrate(engine, Equilibrium.of(start), start.fx).packing, True
            except NoEquilibriumError:
                found = False
            if not found and start.law.frictional:  # overdamped dynamics until forces are down at rounding
                engine.restore(start)
                engine.relax(finest_tolerance(start))
                here = engine.packing
            elif not start.law.frictional and not (found and is_minimum(here)):
                here, found = minimize_energy(start)
                here = here if found else settle_loose(engine, start, bed=False)
        if here.residual > FORCE_OF_MOTION * load:
            says = f"the packing that settled at F_y = {packing.fy:.6g} does not come to rest on the way to {fy:.6g}"
            cure = "choose packing.settle_at nearer to the load, or another seed"
            raise NoEquilibriumError(f"{says}, at {load:.6g}: {cure}")
    return here


def loads_between(first: float, last: float) -> list[float]:
    """Loads between two loads, without the first, on a grid that depends on the first load alone; and the last load.

    >>> loads_between(1.0, 1.06)
    [1.05, 1.06]
    """
    if last == first:
        return []
    factor = LOAD_FACTOR if last > first else 1 / LOAD_FACTOR
    whole = int(np.ceil(np.log(last / first) / np.log(factor) - 1e-9))
    return [*(first * factor**k for k in range(1, whole)), last]
