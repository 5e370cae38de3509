"""Runs with looks at a packing between them, and the same without: python next_run.py LAW THREADS, on some ranks."""

import sys
from dataclasses import fields
from pathlib import Path

import numpy as np
from granular_packings import SMOOTH, command, instance, start, state, with_law
from mpi4py import MPI

from faultgouge.analysis import Configuration, LinearisedContacts
from faultgouge.pywrap import from_lammps

WORLD = MPI.COMM_WORLD
LAW, THREADS = sys.argv[1], int(sys.argv[2])


def owned(lmp) -> set[int]:
    """IDs of the particles of this rank."""
    return set(lmp.numpy.extract_atom("id")[: lmp.extract_setting("nlocal")])


def run(steps: int, looks: int, drag: float) -> tuple[np.ndarray, list[Configuration], int, Configuration]:
    """Six runs with looks before each.

    Returns their ends, what was seen, the number of particles that changed their rank in a look, and the last state.
    """
    d = 2 if LAW in SMOOTH else 3
    lmp = instance(Path("log"))
    if THREADS > 1:
        command(lmp, f"package omp {THREADS}\nsuffix omp")
    start(lmp, d, 18)
    with_law(lmp, LAW, d, "100", "100", ("", ""), "3.0" if drag else "0.3")
    slope = f"{0.1 if drag else 0.8} 0 -1" if d == 3 else "0.8 -1 0"
    command(lmp, f"""
fix load all gravity 1.0 vector {slope}
fix move all nve/sphere
fix drag all viscous {drag}
timestep 0.002
thermo 10000
neighbor 0.45 bin
run {steps}
""")  # fmt: skip
    found: list[Configuration] = []
    states, moved = [], 0
    for _ in range(6):
        before, there = state(lmp, WORLD), owned(lmp)
        found += [from_lammps(lmp, balance=np.inf) for _ in range(looks)]
        moved += WORLD.allreduce(len(there - owned(lmp)))
        assert np.array_equal(state(lmp, WORLD), before)
        lmp.command("run 53")
        states.append(state(lmp, WORLD))
    last = from_lammps(lmp, balance=np.inf)
    assert lmp.extract_setting("nthreads") == THREADS
    assert THREADS == 1 or f"pair {LAW}/omp" in Path("log").read_text()
    lmp.close()
    return np.array(states), found, moved, last


def equal(one: LinearisedContacts, other: LinearisedContacts) -> bool:
    return all(np.array_equal(getattr(one, each.name), getattr(other, each.name)) for each in fields(one))


# particles that collide and slide; some of them change their rank in a look
(there, found, moved, last), (other, _, _, end) = (run(1950, looks, 0.0) for looks in (1, 0))
assert sum(each.contacts.at_bound.any() for each in found) > 1
assert (moved > 0) == (WORLD.size > 1)
assert np.array_equal(there, other)
assert equal(last.contacts, end.contacts)
if LAW not in SMOOTH:
    # particles that do not slide: in a sheared box zero steps round coordinates, which are given back
    (there, found, *_), (other, *_) = (run(3000, looks, 1.5) for looks in (2, 0))
    assert len(found[0].contacts) > 5
    assert found[0].contacts.wall.any()
    one, two = (np.sort(each.contacts.overlap) for each in found[:2])
    assert np.abs(one - two).max() < 1e-14  # LAMMPS may list them in another order, and round images otherwise
    assert np.array_equal(there, other)
    # what is left of the forces without those of all contacts is the weight
    slope = np.array([0.1, 0, -1]) / np.hypot(0.1, 1)
    assert np.abs(found[0].load[:, 0] - found[0].mass[:, None] * slope).max() < 1e-9
    assert np.abs(found[0].load[:, 1]).max() < 1e-9
