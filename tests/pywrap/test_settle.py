"""Settling: what comes out is in balance, depends on the scene alone, and a layer that sinks is refused."""

from dataclasses import replace

import numpy as np
import pytest

from faultgouge.analysis import stiffness_matrix, touching
from faultgouge.pywrap import NoEquilibriumError, Scene, settle
from faultgouge.pywrap.equilibria.rattlers import clear_rattlers


def scene(**packing):
    return Scene.from_mapping({"packing": packing, "law": {"kn": 2e5}, "load": {"fy": 3.0}})


@pytest.fixture(scope="module")
def settled():
    return settle(scene(seed=9))


def test_settled_packing_is_in_balance_and_ready_for_friction(settled):
    packing = settled.packing
    assert settled.residual < 1.5 * settled.floor < 2e-10
    assert np.all(packing.contacts.slip == 0)
    matrix = stiffness_matrix(packing).toarray()
    # zero slips: no term that is not symmetric, but for the rounding of products
    assert np.abs(matrix - matrix.T).max() < 1e-15 * np.abs(matrix).max()
    # the load rests on the floor, to the residual of each disk
    floor = packing.contacts.floor
    assert packing.normal_force[floor].sum() == pytest.approx(3.0 * packing.top.sum(), abs=1e-8)
    assert not packing.top[packing.rattlers].any()


def test_the_same_scene_settles_to_the_same_packing(settled):
    again = settle(scene(seed=9)).packing
    assert np.array_equal(again.position, settled.packing.position)
    assert np.array_equal(again.contacts.i, settled.packing.contacts.i)


def test_rattlers_are_moved_clear_and_nothing_else_is(settled):
    packing = settled.packing
    rattler = packing.rattlers[0]
    # push it against its nearest neighbour
    others = np.delete(np.arange(len(packing)), rattler)
    branch = packing.position[others] - packing.position[rattler]
    gap = np.hypot(*branch.T) - packing.radius[others] - packing.radius[rattler]
    nearest = np.argmin(gap)
    position = packing.position.copy()
    position[rattler] += (gap[nearest] + 1e-9) * branch[nearest] / np.hypot(*branch[nearest])
    pushed = replace(packing, position=position, contacts=touching(position, packing.radius, packing.box_length))
    assert rattler not in pushed.rattlers
    cleared = clear_rattlers(pushed, least=1e-6)
    assert rattler in cleared.rattlers
    loaded = np.setdiff1d(np.arange(len(packing)), packing.rattlers)
    assert np.array_equal(cleared.position[loaded], packing.position[loaded])
    assert len(cleared.contacts) == len(packing.contacts)


def test_layer_that_always_sinks_is_refused():
    with pytest.raises(NoEquilibriumError, match="sank through the bed from each of 5 loose starts"):
        settle(scene(disks=60, top=3, width=12.0))


@pytest.mark.slow
def test_a_seed_whose_layer_sinks_is_the_packing_of_its_next_loose_start():
    # which seed that is depends on the build, since settling is chaotic; of so thin a layer one start in eight sinks
    for seed in range(100):
        told = []
        found = settle(scene(disks=60, top=7, width=12.0, seed=seed), watch=told.append)
        if told:
            break
    assert told[0] == "the upper layer sank through the bed: loose start 2 of 5"
    assert found.residual < 1.5 * found.floor
    again = settle(scene(disks=60, top=7, width=12.0, seed=seed)).packing
    assert np.array_equal(again.position, found.packing.position)


@pytest.mark.slow
def test_settling_with_friction_leaves_slips(settled):
    packing = settle(scene(disks=20, top=4, width=4.9, settle_friction=True)).packing
    assert np.abs(packing.contacts.slip).max() > 0
    assert packing.residual < 1e-9


def test_spheres_rest_where_disks_of_equal_masses_do():
    equal, spheres = (settle(scene(disks=20, top=4, width=4.9, masses=each)).packing for each in ("equal", "spheres"))
    np.testing.assert_array_equal(spheres.position, equal.position)
    np.testing.assert_array_equal(equal.mass, 1.0)
    np.testing.assert_allclose(spheres.mass, (spheres.radius / 0.5) ** 3, rtol=1e-15)
