"""Steps of the linearised packing contact by contact, beside those of the assembled matrices and play operators."""

from functools import cache

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array

from faultgouge.analysis.arrays import derive_frozen
from faultgouge.analysis.motion.motion import Motion
from faultgouge.analysis.motion.one_sided import OneSidedSystem
from faultgouge.pywrap.granular.linear_steps import ContactForces, GivenForces, linear_forces, linear_steps

ROUNDING = 1e-11
"""Of ten steps of some hundred contacts, relative to the largest velocity."""

STEPS = 10


@pytest.fixture(scope="module")
def bed(beds):
    """The configuration of particles at rest on a slope, by law and dimension; taken once each."""
    from faultgouge.pywrap import from_lammps

    return cache(lambda law, d: from_lammps(beds(law, d), prove=False, balance=np.inf))


def changed(found, kind: str):
    """The packing with other contacts at Coulomb's bound, or with particles that move as one."""
    c, every = found.contacts, np.arange(len(found.contacts))
    # LAMMPS turns histories a step late: of the 1e-10 of a force along the normal both make something else
    across = c.tangential_force - c.normal * np.einsum("ca,ca->c", c.normal, c.tangential_force)[:, None]
    c, size = derive_frozen(c, tangential_force=across), np.linalg.norm(across, axis=1)
    found = derive_frozen(found, contacts=c)
    if kind == "bound":  # a third of the contacts, some of them a little below it
        below = 1 + np.where(every % 2, 0.0, 9e-7)
        return derive_frozen(found, contacts=derive_frozen(c, friction=np.where(every % 3, 10 * size, below * size)))
    if kind == "own slider":
        own = np.zeros(len(c), bool)
        return derive_frozen(found, contacts=derive_frozen(changed(found, "bound").contacts, viscous_slider=own))
    if kind == "body":  # two particles have one x, of different weights
        moves = eye_array(found.coordinates, format="lil")
        moves[1, 1], moves[1, 0] = 0.0, 0.7
        return derive_frozen(found, constraint=csr_array(moves))
    return found


def by_matrices(found, velocity, timestep, *, extrapolates):
    """The same steps by K, C and the sliders of the one-sided equations."""
    system = OneSidedSystem(Motion.of_matrices(found, *found.assembled_operators()))
    motion, c = system.motion, found.contacts
    state = system.start(velocity[:, None])
    missing = (c.friction - np.linalg.norm(c.tangential_force, axis=1))[c.one_sided, None]
    state.p += missing
    constant = (found.coordinate_force[motion.active] / motion.root_mass)[:, None] + system.sliders[0] @ missing
    system.take_steps(state, timestep, STEPS, constant=constant, extrapolates=extrapolates)
    end = velocity.copy()
    end[motion.active] = state.v[:, 0] / motion.root_mass
    return end


@pytest.mark.parametrize("extrapolates", [False, True], ids=["half step", "extrapolated"])
@pytest.mark.parametrize("kind", ["sticks", "bound", "own slider", "body"])
@pytest.mark.parametrize(
    ("law", "d"), [("mindlin", 2), ("mindlin", 3), ("mindlin_rescale", 2), ("mindlin_rescale", 3), ("coulomb", 2)]
)
def test_steps_are_those_of_the_matrices(bed, law, d, kind, extrapolates):
    """Of LAMMPS's laws with arms that end in the overlap, with two derivatives, and of ours, with walls; and of
    velocities as large as those that slide."""
    found = changed(bed(law, d), kind)
    assert found.contacts.one_sided.any() == (kind in ("bound", "own slider"))
    assert np.any(found.contacts.closing != found.contacts.parting) == (law != "mindlin")
    forces = linear_forces(found)
    timestep = 1.0 / forces.fastest_rate()
    random = np.random.default_rng(3).normal(size=found.coordinates)
    velocity = 1e-3 * np.where(found.coordinate_free, random, 0.0)
    made = linear_steps(found, forces, velocity, timestep, STEPS, extrapolates=extrapolates)
    expected = by_matrices(found, velocity, timestep, extrapolates=extrapolates)
    assert np.abs(expected - velocity).max() > 0.1 * np.abs(velocity).max()
    touches = np.tile(~np.isin(np.arange(len(found)), found.rattlers), found.axes)
    np.testing.assert_allclose(made[touches], expected[touches], rtol=0, atol=ROUNDING * np.abs(velocity).max())


@pytest.mark.parametrize("law", ["gran/hertz/history", "mindlin/force"])
def test_no_rate_is_beyond_the_bound(bed, law):
    """The largest eigenvalue of K over masses; the bound is at most three times as large, or steps would be short."""
    from faultgouge.analysis import stable_timestep

    found = bed(law, 3)
    fastest = 2 / stable_timestep(found)
    for forces in (ContactForces.of(found), GivenForces(found, *found.assembled_operators())):
        assert fastest < forces.fastest_rate() < 3 * fastest
