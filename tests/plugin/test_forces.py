"""Forces and torques in LAMMPS against the law written down once more, in ten lines."""

import itertools

import numpy as np
import pytest

from faultgouge.analysis import Contacts, MindlinLaw, Packing
from faultgouge.pywrap.lammps.engine import Engine

KN, KT = 2e5, 2e5 * 2 / 7
OVERLAPS = [1e-7, 1e-3, 0.1]
SLIPS = [-3.0, -1.0, -0.4, 0.0, 0.2, 0.999, 1.0, 2.0]  # in units of the slip limit
RADII = [(0.5, 0.5), (0.5, 0.7), (0.02, 1.0)]
FRICTIONS = [0.0, 1e-6, 0.8, 10.0]


def law(mu, overlap, slip, exponent=1.5):
    """(f_n, f_t) of physics: Hertz or harmonic, and Mindlin smoothed to the Coulomb limit."""
    normal = KN * overlap**exponent
    if mu == 0:
        return normal, 0.0
    limit = mu * KN / KT * overlap
    slip = max(-limit, min(slip, limit))
    x = abs(slip) / limit
    return normal, -KT * overlap ** (exponent - 1) * (1 + x - x**2) * slip


def close(measured, expected):
    # Both sides evaluate the law in a dozen roundings; the overlap is given to the law as the pair style has it.
    np.testing.assert_allclose(measured, expected, rtol=1e-13, atol=1e-13 * np.abs(expected).max())


def single_contact(position, radius, contacts, mu, compensated=False, exponent=1.5):
    low = np.zeros_like(position) if compensated else None
    law = MindlinLaw(kn=KN, kt=KT, mu=mu, exponent=exponent)
    return Packing(position=position, radius=radius, law=law, contacts=contacts, position_low=low)


def net_forces(packings):
    """Forces of packings of the same disks, in one LAMMPS."""
    with Engine(packings[0]) as engine:
        for packing in packings:
            engine.displace(packing, np.zeros(3 * len(packing)))
            yield engine.net_force


@pytest.mark.parametrize("exponent", [1.5, 1.0], ids=["Hertz", "harmonic"])
@pytest.mark.parametrize("compensated", [False, True], ids=["double", "compensated"])
@pytest.mark.parametrize(("overlap", "radii", "mu"), [*itertools.product(OVERLAPS, RADII, FRICTIONS)])
def test_two_disks(overlap, radii, mu, compensated, exponent):
    # the size ratio bounds the overlap that leaves the smaller centre outside of the other disk
    overlap = overlap * min(radii)
    angle = 0.3
    distance = sum(radii) - overlap
    normal = np.array([np.cos(angle), np.sin(angle)])
    centre = np.array([1.0, 3.0])
    position = np.array([centre + distance * normal, centre])
    slips = [fraction * mu * KN / KT * overlap for fraction in (SLIPS if mu else [0.0])]
    packings = [
        single_contact(position, np.array(radii), Contacts([0], [1], [slip]), mu, compensated, exponent)
        for slip in slips
    ]
    for slip, packing, force in zip(slips, packings, net_forces(packings), strict=True):
        force = force.reshape(3, 2)
        n, tau = packing.geometry.normal[0], packing.geometry.tangent[0]
        branch = position[0] - position[1]
        in_doubles = sum(radii) - np.sqrt(branch @ branch)
        f_n, f_t = law(mu, packing.geometry.overlap[0] if compensated else in_doubles, slip, exponent)
        close(force[:2, 0], f_n * n + f_t * tau)
        close(force[2], [-f_t, -f_t])
        assert np.array_equal(force[:2, 0], -force[:2, 1])  # momentum, exactly
        assert np.hypot(*force[:2, 0]) <= f_n * np.sqrt(1 + mu**2) * (1 + 1e-15)


@pytest.mark.parametrize("exponent", [1.5, 1.0], ids=["Hertz", "harmonic"])
@pytest.mark.parametrize(("overlap", "radius", "mu"), [*itertools.product(OVERLAPS, [0.5, 0.7], FRICTIONS)])
def test_disk_on_floor(overlap, radius, mu, exponent):
    position = np.array([[2.0, radius - overlap]])
    slips = [fraction * mu * KN / KT * overlap for fraction in (SLIPS if mu else [0.0])]
    packings = [
        single_contact(position, np.array([radius]), Contacts([0], [-1], [slip]), mu, exponent=exponent)
        for slip in slips
    ]
    for slip, packing, force in zip(slips, packings, net_forces(packings), strict=True):
        f_n, f_t = law(mu, packing.geometry.overlap[0], slip, exponent)
        close(force, [-f_t, f_n, -f_t])
        assert abs(force[0]) <= mu * f_n


@pytest.mark.parametrize("exponent", [1.5, 1.0], ids=["Hertz", "harmonic"])
@pytest.mark.parametrize("mu", [0.1, 1.0])
def test_coulomb_bound_is_reached_exactly(mu, exponent):
    position = np.array([[1.0, 3.0], [1.0, 3.999]])
    packing = single_contact(position, np.array([0.5, 0.5]), Contacts([0], [1], [1.0]), mu, exponent=exponent)
    with Engine(packing) as engine:
        engine.displace(packing, np.zeros(6))
        force = engine.net_force.reshape(3, 2)
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
