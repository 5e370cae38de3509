"""The bound of the force in LAMMPS, and how slips are counted; test_damping.py has the law in ten lines."""

import numpy as np
import pytest

from faultgouge.analysis import Contacts, MindlinLaw, Packing
from faultgouge.pywrap.lammps.engine import Engine

KN, KT = 2e5, 2e5 * 2 / 7


def single_contact(position, radius, contacts, mu, compensated=False, exponent=1.5):
    low = np.zeros_like(position) if compensated else None
    law = MindlinLaw(kn=KN, kt=KT, mu=mu, exponent=exponent)
    return Packing(position=position, radius=radius, law=law, contacts=contacts, position_low=low)


@pytest.mark.parametrize("exponent", [1.5, 1.0], ids=["Hertz", "harmonic"])
@pytest.mark.parametrize("mu", [0.1, 1.0])
def test_coulomb_bound_is_reached_exactly(mu, exponent):
    position = np.array([[1.0, 3.0], [1.0, 3.999]])
    packing = single_contact(position, np.array([0.5, 0.5]), Contacts([0], [1], [1.0]), mu, exponent=exponent)
    with Engine(packing) as engine:
        engine.displace(packing, np.zeros(6))
        force = engine.net_force.reshape(3, 2)
    assert np.array_equal(force[:2, 0], -force[:2, 1])  # momentum, exactly
    # n is along y here, so that the components are the forces themselves
    assert abs(force[2, 0]) == abs(force[0, 0]) == mu * abs(force[1, 0])


def test_slip_is_taken_along_the_tangent_at_the_middle_of_the_step():
    radius = np.array([0.5, 0.7])
    position = np.array([[1.0, 3.0], [1.0, 4.19]])
    packing = single_contact(position, radius, Contacts([0], [1], [0.0]), 100.0)
    rng = np.random.default_rng(1)
    displacement = 1e-3 * rng.standard_normal(6)
    with Engine(packing) as engine:
        moved = engine.displace(packing, displacement)
    dx, dy, du = displacement.reshape(3, 2)
    old = position[0] - position[1]
    step = np.array([dx[0] - dx[1], dy[0] - dy[1]])
    middle = (old + old + step) / np.linalg.norm(old + old + step)
    expected = -middle[1] * step[0] + middle[0] * step[1] - du.sum()
    np.testing.assert_allclose(moved.contacts.slip, [expected], rtol=1e-12)


def test_slip_on_a_closed_path_is_second_order():
    """A disk carried around another without rolling: the sum of slips is the arc, to second order in the step."""
    reach, errors = 0.999, []
    for steps in (20, 40):
        packing = single_contact(
            np.array([[1.0, 3.0], [1.0, 3.0 + reach]]), np.array([0.5, 0.5]), Contacts([0], [1], [0.0]), 1e6
        )
        with Engine(packing) as engine:
            for k in range(1, steps + 1):
                phi = 0.5 * k / steps
                target = np.array([[1.0, 3.0], [1.0 + reach * np.sin(phi), 3.0 + reach * np.cos(phi)]])
                step = target - packing.position
                packing = engine.displace(packing, np.concatenate([step[:, 0], step[:, 1], np.zeros(2)]))
        errors.append(abs(abs(packing.contacts.slip[0]) - 0.5 * reach))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.05)  # the next order is 1/steps^2 smaller


def test_new_contact_starts_without_slip_and_lost_one_forgets():
    apart = np.array([[1.0, 3.0], [1.0, 4.001]])
    packing = single_contact(apart, np.array([0.5, 0.5]), Contacts([], [], []), 1.0)
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
