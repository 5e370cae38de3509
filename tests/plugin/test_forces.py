"""The bound of the force in LAMMPS, and how slips are counted; test_damping.py has the law in ten lines."""

import numpy as np
import pytest

from faultgouge.analysis import Contacts, MindlinLaw, Packing
from faultgouge.pywrap.lammps.engine import Engine


def two_disks(distance, mu, contacts, radius=(0.5, 0.5), exponent=1.5):
    """One above the other."""
    law = MindlinLaw(2e5, 2e5 * 2 / 7, mu, exponent)
    return Packing(position=[[1.0, 3.0], [1.0, 3.0 + distance]], radius=radius, law=law, contacts=contacts)


@pytest.mark.parametrize("exponent", [1.5, 1.0], ids=["Hertz", "harmonic"])
@pytest.mark.parametrize("mu", [0.1, 1.0])
def test_coulomb_bound_is_reached_exactly(mu, exponent):
    packing = two_disks(0.999, mu, Contacts([0], [1], [1.0]), exponent=exponent)
    with Engine(packing) as engine:
        engine.displace(packing, np.zeros(6))
        force = engine.net_force.reshape(3, 2)
    assert np.array_equal(force[:2, 0], -force[:2, 1])  # momentum, exactly
    # n is along y here, so that the components are the forces themselves
    assert abs(force[2, 0]) == abs(force[0, 0]) == mu * abs(force[1, 0])


def test_slip_is_taken_along_the_tangent_at_the_middle_of_the_step():
    packing = two_disks(1.19, 100.0, Contacts([0], [1], [0.0]), radius=(0.5, 0.7))
    displacement = 1e-3 * np.random.default_rng(1).standard_normal(6)
    with Engine(packing) as engine:
        moved = engine.displace(packing, displacement)
    dx, dy, du = displacement.reshape(3, 2)
    old, step = packing.position[0] - packing.position[1], np.array([dx[0] - dx[1], dy[0] - dy[1]])
    middle = (old + old + step) / np.linalg.norm(old + old + step)
    expected = -middle[1] * step[0] + middle[0] * step[1] - du.sum()
    np.testing.assert_allclose(moved.contacts.slip, [expected], rtol=1e-12)


def test_new_contact_starts_without_slip_and_lost_one_forgets():
    packing = two_disks(1.001, 1.0, Contacts([], [], []))
    together = np.array([1e-4, 0.0, 0.0, -2e-3, 0.0, 0.0])
    with Engine(packing) as engine:
        closed = engine.displace(packing, together)
        slid = engine.displace(closed, np.array([1e-4, 0, 0, 0, 0, 0]))
        opened = engine.displace(slid, -together)
        again = engine.displace(opened, together)
    assert np.array_equal(closed.contacts.slip, [0.0])
    assert abs(slid.contacts.slip[0]) > 9e-5
    assert len(opened.contacts) == 0
    assert np.array_equal(again.contacts.slip, [0.0])
