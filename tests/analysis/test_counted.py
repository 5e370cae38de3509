"""Numbers with their nouns."""

from dataclasses import replace

from scipy.sparse import csr_array

from faultgouge.analysis import stiffness_matrix
from faultgouge.analysis.counted import counted


def test_singular_and_plural():
    assert [counted(k, "complex pair") for k in (0, 1, 2)] == ["0 complex pairs", "1 complex pair", "2 complex pairs"]
    assert [counted(k, "equilibrium", "equilibria") for k in (1, 21)] == ["1 equilibrium", "21 equilibria"]


def test_a_configuration_says_one_in_the_singular(reference_packing):
    packing = reference_packing(1.0)
    one = packing.configuration
    none = csr_array((one.coordinates, one.coordinates))
    given = replace(one, stiffness=stiffness_matrix(packing), damping=none, jump=[1.0] + [0.0] * (len(packing) - 1))
    assert "forces on 1 particle one-sided" in repr(given)
    between = replace(given, contacts=one.contacts.chosen(~one.contacts.wall))
    assert "and none known with walls" in repr(between)
    assert "1 contact between them" in repr(replace(one, contacts=one.contacts.chosen([0])))
