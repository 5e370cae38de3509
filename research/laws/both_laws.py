r"""One packing under both laws of friction, at the same equilibria and on the way of each: the task "both laws".

A packing that has settled without friction is loaded with the smoothed law. At each load of [modes] three packings are
looked at:

- *smooth*: the equilibrium of the smoothed law, with its own K;
- *same*: the same disks with the same contact forces, whose contacts are springs behind Coulomb's slider
  (`as_slider`). What differs is what a contact does next, and nothing else;
- *loaded*: the equilibrium to which the settled packing comes when it is loaded with the slider from the beginning.

K of the slider is that of contacts that have been shaken down (:mod:`faultgouge.analysis.packing.law`). At the same
equilibria the rates of its other branches are kept, too: all contacts close, all part, those at the bound slide on.

Loss is that of :mod:`research.modes.loss`: dashpots of a restitution with C_T = 2/7 C_N, all eigenvalues of the pencil
:math:`s^2 M + s C + K`. A contact that sticks has its tangential dashpot, and one that is at the bound of the smoothed
law has none. So that this is not what decides, the strongest loss is looked at without tangential dashpots as well.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import isclose
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy.linalg import eigvals

from faultgouge.analysis import NoEquilibriumError, Packing, mass_weighted, negative_eigenvalues, stiffness_matrix
from faultgouge.pywrap import Equilibrium, Scene, dashpot, ramp
from faultgouge.studies.modes import count_pairs
from research.modes.loss import fastest, impact_velocity, with_dashpots

RESTITUTIONS = (0.99, 0.97, 0.9)
"""From weak loss to strong."""

EVERY = 100
"""Disks up to which every restitution is looked at. A pencil of 200 disks takes four seconds, one of 400 half a minute:
of more than these `FEWER` have to do."""

FEWER = {200: (0.97, 0.9), 400: (0.9,)}

BRANCHES: dict[str, dict[str, Any]] = {
    "close": {"parting": 0.0},
    "part": {"parting": 1.0},
    "slide_on": {"sliding": True},
}


def both_laws(scene: Scene, rest: Equilibrium) -> dict[str, Any]:
    """The row of a scene with the smoothed law, whose section [modes] has the loads."""
    strengths = {each: dashpot(scene.law.kn, each, 1.0, impact_velocity(scene)) for each in RESTITUTIONS}

    def look(packing: Packing) -> dict[str, Any]:
        other = as_slider(packing)
        return {
            "smooth": motion(packing, strengths),
            "same": motion(other, strengths)
            | {name: largest_rate(other, **branch) for name, branch in BRANCHES.items()},
        }

    found = at_loads(scene, rest, look)
    law = scene.law.model_copy(update={"history": "coulomb"})
    start = replace(rest, packing=as_slider(rest.packing))
    own = at_loads(scene.model_copy(update={"law": law}), start, lambda packing: {"loaded": motion(packing, strengths)})
    loads: dict[float, dict[str, Any]] = {}
    for each in found["loads"] + own["loads"]:
        loads.setdefault(each["fx_over_fy"], {}).update(each)
    return {
        "ends": found["ends"],
        "reach": found["reach"],
        "ends_loaded": own["ends"],
        "reach_loaded": own["reach"],
        "loads": [loads[share] for share in sorted(loads)],
    }


def at_loads(scene: Scene, rest: Equilibrium, look: Callable[[Packing], dict[str, Any]]) -> dict[str, Any]:
    """Numbers at the loads of [modes], which are loads of the ramp, too.

    Where Newton's branch ends the layer goes on by other ways, overdamped dynamics the last of them, as in `faultgouge
    ramp`: `moved` says how many of its increments up to a load did. It ends where nothing leads on, or where an
    equilibrium is unstable without any coupling (a negative eigenvalue).
    """
    section: Any = getattr(scene, "modes")  # noqa: B009  # a section that its study registers
    row: dict[str, Any] = {"ends": "until", "reach": rest.fx, "loads": []}
    wanted, moved = sorted(section.fx_over_fy), 0
    try:
        for each in ramp(scene, rest, MPI.COMM_SELF):
            moved += each.way is not None
            row["reach"] = each.fx
            if wanted and isclose(each.fx, wanted[0] * scene.load.fy, rel_tol=1e-9):
                if len(negative_eigenvalues(each.packing)):
                    return row | {"ends": "turning point"}
                load = {"fx_over_fy": wanted.pop(0), "fx": each.fx}
                row["loads"].append(load | {name: seen | {"moved": moved} for name, seen in look(each.packing).items()})
            if not wanted:
                break
    except NoEquilibriumError:
        row["ends"] = "no equilibrium"
    return row


def as_slider(packing: Packing) -> Packing:
    """The packing with the same forces, whose contacts are springs behind Coulomb's slider.

    The stretch of each spring follows from its force, s = -f_t/(k_t overlap^(p-1)).
    """
    overlap = packing.geometry.overlap
    force = packing.law.tangential_force(overlap, packing.contacts.slip)
    stretch = -force / (packing.law.kt * packing.law.growth(overlap))
    return replace(packing, law=replace(packing.law, coulomb=True), contacts=packing.contacts.slipped(stretch))


def motion(packing: Packing, strengths: dict[float, float]) -> dict[str, Any]:
    """Motion that grows about an equilibrium, undamped and with loss; rates in 1 / time."""
    found = count_pairs(packing)
    squares, told = found.omega**2, found.as_dict()
    drag = squares.imag / np.sqrt(np.maximum(squares.real, np.finfo(float).tiny))
    looked_at = RESTITUTIONS if len(packing) <= EVERY else FEWER[len(packing)]
    row = {name: told[name] for name in ("pairs", "share", "negative", "growth_rate", "least_q")} | {
        "at_bound": int(np.count_nonzero(packing.law.at_bound(packing.geometry.overlap, packing.contacts.slip))),
        "contacts": len(packing.contacts),
        "drag_rate": float(drag.max(initial=0.0)),
        "damped": [[each, fastest(with_dashpots(packing, strengths[each])).real] for each in looked_at],
    }
    if len(packing) <= EVERY:
        row["normal_dashpots"] = fastest(with_dashpots(packing, strengths[min(RESTITUTIONS)], 0.0)).real
    return row


def largest_rate(packing: Packing, **branch: Any) -> float:
    """Largest growth rate of D that a branch of K has, 2 max |Im omega|, 1 / time."""
    matrix = mass_weighted(stiffness_matrix(packing, **branch), packing)
    active = np.flatnonzero(np.diff(matrix.indptr))
    return float(2 * np.sqrt(eigvals(matrix[active][:, active].toarray()).astype(complex)).imag.max())
