"""Forces in LAMMPS: how slips are counted, and K against differences; test_damping.py has the law in ten lines."""

import numpy as np
import pytest

from faultgouge.analysis import Contacts, MindlinLaw, Packing, stiffness_matrix
from faultgouge.pywrap.lammps.engine import Engine


def two_disks(distance, radius, *contacts):
    """One above the other."""
    law, position = MindlinLaw(2e5, 2e5 * 2 / 7, 100.0), [[1.0, 3.0], [1.0, 3.0 + distance]]
    return Packing(position=position, radius=radius, law=law, contacts=Contacts(*contacts))


def test_slip_is_taken_along_the_tangent_at_the_middle_of_the_step():
    packing = two_disks(1.19, [0.5, 0.7], [0], [1], [0.0])
    displacement = 1e-3 * np.random.default_rng(1).standard_normal(6)
    with Engine(packing) as engine:
        moved = engine.displace(packing, displacement)
    dx, dy, du = displacement.reshape(3, 2)
    old, step = packing.position[0] - packing.position[1], np.array([dx[0] - dx[1], dy[0] - dy[1]])
    middle = (old + old + step) / np.linalg.norm(old + old + step)
    expected = -middle[1] * step[0] + middle[0] * step[1] - du.sum()
    np.testing.assert_allclose(moved.contacts.slip, [expected], rtol=1e-12)


def test_new_contact_starts_without_slip_and_lost_one_forgets():
    packing = two_disks(1.001, [0.5, 0.5], [], [], [])
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


STEP = 2.0**-27
"""About 1e-8, and a power of two, so that coordinates move by it exactly."""


def differences(packing, sign):
    """-dF/dq to one side by differences of width h and h/2, extrapolated.

    f'' jumps at s = 0 and at the bound, so that a central difference there is off by h times the jump, which is large
    for a contact that hardly touches. The extrapolation removes what is linear in h.
    """
    size = 3 * len(packing)
    matrix = np.empty((size, size))
    with Engine(packing) as engine:

        def force(displacement):
            engine.displace(packing, displacement)
            return engine.net_force

        rest = force(np.zeros(size))
        for k, column in enumerate(sign * np.eye(size)):
            wide, narrow = ((rest - force(h * column)) / h for h in (STEP, STEP / 2))
            matrix[:, k] = sign * (2 * narrow - wide)
    return matrix


@pytest.mark.parametrize("exponent", [1.5, 1.0], ids=["Hertz", "harmonic"])
@pytest.mark.parametrize(
    ("mu", "fractions"),
    [(1.0, [0.1, -0.3, 0.02, 0.4]), (1.0, [-1.0, 0.0, 0.5, 0.99, 1.0, -0.2, 0.1]), (0.3, [1.0, -1.0])],
    ids=["sticking", "all kinds", "sliding"],
)
def test_consistent_form_is_the_derivative_of_the_forces(reference_packing, mu, fractions, exponent):
    packing = reference_packing(mu, shares=fractions, exponent=exponent)
    assert packing.contacts.floor.any()
    matrix, central = stiffness_matrix(packing).toarray(), (differences(packing, 1) + differences(packing, -1)) / 2
    # A force is rounded at K * 1e-16, which a difference divides by STEP: 1e-8 of K; a disk has several contacts, and
    # the extrapolation adds two differences. Of harmonic disks every contact is as stiff as the stiffest one.
    tolerance = 1e-7 if exponent > 1 else 2e-7
    assert np.abs(central - matrix).max() < tolerance * np.abs(matrix).max()


def rates(packing, displacement):
    """How fast each contact opens and slips on a displacement."""
    contacts, normal, tangent = packing.contacts, packing.geometry.normal, packing.geometry.tangent
    x, y, u = (part[contacts.i] for part in displacement.reshape(3, -1))
    other = np.where(contacts.floor, 0.0, displacement.reshape(3, -1)[:, contacts.j])
    branch = np.column_stack([x - other[0], y - other[1]])
    return np.sum(normal * branch, axis=1), np.sum(tangent * branch, axis=1) - (u + other[2])


KINDS = [-1.0, 0.05, 0.5, 0.99, 1.0, -0.2, 0.1]


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("mu", "law"),
    [(0.3, {"coulomb": True}), (1.0, {"coulomb": True, "exponent": 1.0})]
    + [(mu, {"rescaled": True}) for mu in (1.0, 0.3)],
    ids=["slider", "harmonic slider", "rescaled", "rescaled, mostly at the bound"],
)
def test_matrix_is_the_one_sided_derivative(reference_packing, mu, law, sign):
    """Of each contact what a displacement asks for: it closes or parts, and a slider at the bound slides or sticks."""
    packing = reference_packing(mu, shares=KINDS, **law)
    difference, law, slip = differences(packing, sign), packing.law, packing.contacts.slip
    matrix, seen = np.empty_like(difference), np.zeros(4)
    for k, column in enumerate(sign * np.eye(len(matrix))):
        opens, slips = rates(packing, column)
        branch = {"parting": opens > 0}
        if law.coulomb:
            # how fast the size of the slip nears the limit, which falls while the contact opens
            rescaled = law.rescales * np.minimum(opens, 0.0) * np.abs(slip) / (2 * packing.geometry.overlap)
            nears = np.sign(slip) * slips + rescaled + opens * law.mu * law.kn / law.kt
            at_bound = law.at_bound(packing.geometry.overlap, slip)
            seen += [np.sum(at_bound & (a * opens > 0) & (b * nears > 0)) for a in (-1, 1) for b in (-1, 1)]
            branch["sliding"] = nears > 0
        matrix[:, k] = stiffness_matrix(packing, **branch)[:, [k]].toarray()[:, 0]
    # as above; differences to one side are divided by half the width
    scale = (4e-7 if law.exponent > 1 else 8e-7) * np.abs(matrix).max()
    assert np.abs(difference - matrix).max() < scale
    assert seen.all() == law.coulomb
    others = [{}, {"sliding": True}] if law.coulomb else [{"parting": 0.0}, {"parting": 1.0}]
    for other in others:
        assert np.abs(difference - stiffness_matrix(packing, **other).toarray()).max() > 100 * scale


def test_parting_with_rescaled_slips_is_as_with_total_ones(reference_packing):
    rescaled, packing = (reference_packing(0.3, shares=KINDS, rescaled=each) for each in (True, False))
    parting, total = stiffness_matrix(rescaled, parting=1.0).toarray(), stiffness_matrix(packing).toarray()
    np.testing.assert_allclose(parting, total, rtol=0, atol=4e-16 * np.abs(total).max())  # b is summed otherwise
