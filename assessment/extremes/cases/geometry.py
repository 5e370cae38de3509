"""Few disks, and contacts at the edge of being one: closing, opening, grazing, at the bound, with one centre."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ....analysis import Contacts, MindlinLaw, Packing, spectrum, stiffness_matrix, touching
from ....pywrap import Engine, Scene, SceneError
from .alone import refused_by_lammps
from .case import Case, Outcome, failed_outcome, measured_outcome, refused_outcome
from .checks import balance
from .packings import KN, at_rest, bed, crystal, law, shear_packing, with_rattlers

GROUP = "geometry"

NO_CONTACTS = Contacts(np.zeros(0, int), np.zeros(0, int), np.zeros(0))


def _contact(slip: float) -> Contacts:
    """The contact of the first two disks."""
    return Contacts(np.array([0]), np.array([1]), np.array([slip]), np.zeros(1))


def _disks(position: list[tuple[float, float]], contacts: Contacts | None = None, **changes: object) -> Packing:
    """Disks of radius 1/2 with compensated coordinates."""
    radius = np.full(len(position), 0.5)
    values = {
        "position": np.array(position),
        "position_low": np.zeros((len(position), 2)),
        "radius": radius,
        "contacts": touching(np.array(position), radius, None) if contacts is None else contacts,
        "law": law(),
    }
    return Packing(**(values | changes))  # type: ignore[arg-type]  # the values of a dict have many types


def _one_disk() -> Outcome:
    """On the floor under the load: k_n delta^(3/2) = F_y."""
    packing = at_rest(_disks([(3.0, 0.4995)], top=np.array([True]), fy=3.0)).packing
    exact = packing.law.overlap_of_force(3.0)
    return measured_outcome(
        abs(packing.geometry.overlap[0] / exact - 1),
        4e-16 * 3,
        "relative error of the overlap against (F_y/k_n)^(2/3): a few roundings",
    )


def _two_disks() -> Outcome:
    """One on top of the other, upright: both contacts carry F_y."""
    top = np.array([False, True])
    packing = at_rest(_disks([(3.0, 0.4994), (3.0, 1.4988)], top=top, fy=3.0)).packing
    return measured_outcome(
        np.abs(packing.normal_force / 3.0 - 1).max(),
        1e-14,
        "relative error of the normal forces against F_y; a column is unstable, and stands because nothing pushes it",
    )


def _no_contact() -> Outcome:
    """A rattler stays where it is, and has no eigenvalues."""
    settled = bed()
    hovering = np.array([[2.0, settled.position[:, 1].max() + 3.0]])
    packing = with_rattlers(settled, hovering, top=True)
    last = len(packing) - 1
    with Engine(packing) as engine, engine.undamped(1e-4) as dynamics:
        moved = dynamics.advance(10_000).position[last] - hovering[0]
    counted = len(spectrum(packing).eigenvalues) - len(spectrum(settled).eigenvalues)
    return measured_outcome(
        np.abs(moved).max() + counted,
        0.0,
        "how far a loaded disk without contact went in 10,000 undamped steps, plus eigenvalues that it added: none",
    )


def _zero_overlap() -> Outcome:
    """Exactly touching is no contact, for the pair style as for the analysis."""
    packing = _disks([(3.0, 3.0), (4.0, 3.0)], _contact(0.0))
    with Engine(packing) as engine:
        found = engine.displace(packing, np.zeros(6))
        force = np.abs(engine.net_force).max()
    return measured_outcome(
        force + len(found.contacts) + stiffness_matrix(packing).nnz + np.abs(packing.net_force).max(),
        0.0,
        "forces, contacts and entries of K of two disks that touch exactly: none, and nothing is divided by zero",
    )


def _at_the_bound() -> Outcome:
    """|f_t| = mu f_n to the bit, and no tangential stiffness."""
    packing = _disks([(3.0, 3.999), (3.0, 3.0)], _contact(1.0))
    with Engine(packing) as engine:
        engine.displace(packing, np.zeros(6))
        force = engine.net_force.reshape(3, 2)[:, 0]
    excess = abs(abs(force[0]) - packing.law.mu * abs(force[1]))
    limit = packing.law.slip_limit(packing.geometry.overlap)
    stiffness = np.abs(packing.law.derivatives(packing.geometry.overlap, limit).slip_derivative[0])
    return measured_outcome(
        excess + stiffness, 0.0, "|f_t| - mu f_n in LAMMPS, and df_t/ds of the analysis, at the bound"
    )


def _grazing() -> Outcome:
    """A disk passes another at an overlap of 1e-12 for one step."""
    aside = _disks([(2.999, 4.0), (3.0, 3.0)], NO_CONTACTS, position_low=np.array([[0.0, -1e-12], [0.0, 0.0]]))
    step = np.array([3.0 - aside.position[0, 0], 0.0, 0.0, 0.0, 0.0, 0.0])
    with Engine(aside) as engine:
        closest = engine.displace(aside, step)
        force = engine.net_force.reshape(3, 2)
        beyond = engine.displace(closest, step)
    overlap = closest.geometry.overlap
    if len(aside.contacts) or len(beyond.contacts) or len(overlap) != 1:
        return failed_outcome(f"contacts on the way: {len(overlap)} and {len(beyond.contacts)}")
    expected = float(aside.law.normal_force(1e-12))
    return measured_outcome(
        np.abs(force[1] / expected - [1, -1]).max() + np.abs(closest.contacts.slip[0]),
        1e-10,
        "relative error of the force at an overlap of 1e-12; low parts are known to 7e-24, 1e-11 of it",
    )


def _wide(columns: int) -> Outcome:
    return balance(shear_packing(crystal(columns)))


NARROW_SCENE = {"packing": {"disks": 10, "top": 1, "width": 2.7}, "law": {"kn": KN}, "load": {"fy": 3.0}}

INVALID_GEOMETRY: dict[str, Callable[[], Outcome]] = {
    "box 2 wide": lambda: refused_outcome(lambda: crystal(2), "under two largest diameters"),
    "box under two diameters, a scene": lambda: refused_outcome(
        lambda: Scene.from_mapping(NARROW_SCENE), "widen the box", SceneError
    ),
    "one centre": lambda: refused_outcome(
        lambda: stiffness_matrix(_disks([(3.0, 3.0), (3.0, 3.0)], _contact(0.0))), "same centre"
    ),
    "one centre, LAMMPS": lambda: refused_by_lammps([(3.0, 3.0), (3.0, 3.0)], "run 0\n", "have the same centre"),
    "a centre inside of the other disk, LAMMPS": lambda: refused_by_lammps(
        [(3.0, 3.0), (3.4, 3.0)], "run 0\n", "contact law does not hold"
    ),
    "a coordinate that is no number": lambda: refused_outcome(
        lambda: _disks([(3.0, float("nan"))], NO_CONTACTS), "not finite"
    ),
    "k_n infinite": lambda: refused_outcome(lambda: MindlinLaw(float("inf"), 1.0, 1.0), "must be finite"),
}

VALID_GEOMETRY: dict[str, Callable[[], Outcome]] = {
    "one disk": _one_disk,
    "two disks": _two_disks,
    "a disk without contact": _no_contact,
    "zero overlap": _zero_overlap,
    "at Coulomb's bound": _at_the_bound,
    "grazing": _grazing,
}

CASES = [
    *(Case(GROUP, name, run, True) for name, run in VALID_GEOMETRY.items()),
    *(Case(GROUP, f"box {wide} wide", partial(_wide, wide), wide < 100) for wide in (3, 10, 100, 1000, 10_000)),
    *(Case(GROUP, name, run, "inside" not in name) for name, run in INVALID_GEOMETRY.items()),
]
