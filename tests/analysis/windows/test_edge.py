"""Edges of a pair that has a third mode close by, and of one whose equilibrium jumps."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

from faultgouge.analysis.windows import LostPairError, Space, System, SystemModes
from faultgouge.analysis.windows.edges import edge_from_inside, locate_edge, sign_change

BASIS = np.eye(12) + 0.1 * np.random.default_rng(2).normal(size=(12, 12))
INVERSE = np.linalg.inv(BASIS)


def family(onset, third):
    """A pair of discriminant onset - F about 10, of couplings 5 and (F - onset) / 20, beside a third eigenvalue."""

    def operator(f):
        inner = np.diag([10.0, 10.0, third, *np.linspace(40, 80, 9)])
        inner[0, 1], inner[1, 0] = 5.0, (onset - f) / 20
        return System(f, csr_array(BASIS @ inner @ INVERSE))

    return operator


def state(operator, fx):
    """The pair, from the columns of the basis: its planes are the same at all loads."""
    return Space(operator(fx), *(np.linalg.qr(each)[0] for each in (BASIS[:, :2], INVERSE.T[:, :2])))


def others(operator, fx, *values):
    """The two modes closest to these eigenvalues."""
    modes = SystemModes.of(operator(fx))
    first, second = (int(np.argmin(np.abs(modes.values - value))) for value in values)
    return modes.space((first, second))


@pytest.mark.parametrize("third", [10.8, 9.2, 12.0, 15.5])
@pytest.mark.parametrize("f", [-1.0, 0.9, 1.0, 1.1, 3.0])
def test_pair_is_followed_beside_a_third_eigenvalue(third, f):
    """Real, double or complex, with the third one closer than the pair's own spread of 5."""
    operator = family(1.0, third)
    found = state(operator, f + 0.05).at(operator(f))
    assert found is not None
    assert found.mean == pytest.approx(10, abs=1e-11)
    assert found.discriminant == pytest.approx(1.0 - f, abs=1e-10)


@pytest.mark.parametrize("third", [10.8, 15.5])
def test_edge_of_a_pair_that_was_followed_to_other_modes(third):
    """To one of the pair and the third mode: what is found is the edge of those that are complex beyond it."""
    operator = family(1.0, third)
    wrong, inside = others(operator, 0.0, 10.5, third), state(operator, 2.2)
    assert wrong.discriminant > 0 > inside.discriminant
    edge = edge_from_inside(operator, wrong, inside)
    assert edge.kind == "coalescence"
    assert edge.fx == pytest.approx(1.0, abs=1e-10)


def test_confusion_of_pairs_is_no_contact_change():
    """Two modes that stay real on one side, a pair that is complex on the other."""
    operator = family(1.0, 15.5)
    with pytest.raises(LostPairError, match="cannot be told from its neighbours at F_x = "):
        locate_edge(operator, others(operator, 0.0, 45, 50), state(operator, 2.2))


def test_edge_where_the_equilibrium_jumps():
    """A pair that is complex from the jump on."""

    def operator(f):
        return replace(family(1.0, 15.5)(f + 2.0 * (f > 0.37)), fx=f)

    edge = edge_from_inside(operator, state(operator, 0.0), state(operator, 0.5))
    assert edge.kind == "contact change"
    assert edge.fx == pytest.approx(0.37, abs=2 * edge.error + 1e-12)
    assert edge.error < 1e-9


def test_a_function_within_rounding_of_zero_at_an_end_has_its_root_there():
    """Loads in either order of the two values; the slope is that between the ends."""
    for small, large in ((0.0, 1.0), (1.0, 0.0)):
        root = sign_change({small: 2e-12, large: 1.0 + 2e-12}.__getitem__, 0.0, 1.0)
        assert (root.fx, root.loads, root.smooth) == (small, [small], True)
        assert root.error == pytest.approx(2e-12, rel=1e-12)


def test_forces_out_of_balance_at_random_are_an_error_of_the_load(path):
    packing = path(0.02)
    assert packing.load_error < 1e-10
    forces = 1e-6 * np.random.default_rng(1).uniform(-1, 1, (10_000, packing.top.sum()))
    off = replace(packing, fx=packing.fx + np.abs(forces).max())
    assert off.load_error == pytest.approx(np.sqrt(3) * forces.mean(axis=1).std(), rel=0.02)
