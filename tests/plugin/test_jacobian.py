"""The stiffness matrix against central differences of the forces that LAMMPS computes, slips advanced on the way."""

from dataclasses import replace

import numpy as np
import pytest

from faultgouge.analysis import Contacts, stiffness_matrix
from faultgouge.pywrap.lammps.engine import Engine

STEP = 2.0**-27
"""About 1e-8, and a power of two, so that coordinates move by it exactly."""


def central_differences(packing):
    """-dF/dq by differences of width h and h/2, extrapolated.

    f'' jumps at s = 0 and at the bound, so that a central difference there is off by h times the jump, which is large
    for a contact that hardly touches. The extrapolation removes what is linear in h.
    """
    size = 3 * len(packing)
    matrix = np.empty((size, size))
    with Engine(packing) as engine:

        def force(k, step):
            displacement = np.zeros(size)
            displacement[k] = step
            engine.displace(packing, displacement)
            return engine.net_force

        for k in range(size):
            wide, narrow = ((force(k, -h) - force(k, h)) / (2 * h) for h in (STEP, STEP / 2))
            matrix[:, k] = 2 * narrow - wide
    return matrix


def with_slips(packing, fractions):
    """The packing with slips that are the given fractions of the Coulomb limit in turn."""
    contacts = packing.contacts
    slip = np.resize(fractions, len(contacts)) * packing.law.slip_limit(packing.geometry.overlap)
    return replace(packing, contacts=Contacts(contacts.i, contacts.j, slip))


@pytest.mark.parametrize("exponent", [1.5, 1.0], ids=["Hertz", "harmonic"])
@pytest.mark.parametrize(
    ("mu", "fractions"),
    [(1.0, [0.1, -0.3, 0.02, 0.4]), (1.0, [-1.0, 0.0, 0.5, 0.99, 1.0, -0.2, 0.1]), (0.3, [1.0, -1.0])],
    ids=["sticking", "all kinds", "sliding"],
)
def test_consistent_form_is_the_derivative_of_the_forces(reference_packing, mu, fractions, exponent):
    packing = reference_packing(mu)
    packing = with_slips(replace(packing, law=replace(packing.law, exponent=exponent)), fractions)
    assert packing.contacts.floor.any()
    matrix = stiffness_matrix(packing).toarray()
    # A force is rounded at K * 1e-16, which a difference divides by STEP: 1e-8 of K; a disk has several contacts, and
    # the extrapolation adds two differences. Of harmonic disks every contact is as stiff as the stiffest one.
    tolerance = 1e-7 if exponent > 1 else 2e-7
    assert np.abs(central_differences(packing) - matrix).max() < tolerance * np.abs(matrix).max()
