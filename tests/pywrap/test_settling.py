"""Settling: what comes out is in balance, depends on the scene alone, and a layer that sinks is refused.

Newton's method with implicit steps goes down to a minimum, and what floats does not stop it.
"""

import subprocess
import sys

import numpy as np
import pytest
from reference_layer import on_ranks
from scipy.linalg import eigvalsh

from faultgouge.analysis import MindlinLaw, Packing, stiffness_matrix, touching
from faultgouge.pywrap import NoEquilibriumError, Scene, settle
from faultgouge.pywrap.settling.minimize_energy import minimize_energy

LARGE = {"disks": 400, "width": 24.0, "seed": 1}
"""Too large for dynamics alone."""


def scene(**packing):
    return Scene.from_mapping({"packing": packing, "law": {"kn": 2e5}, "load": {"fy": 3.0}})


@pytest.mark.parametrize(
    ("keys", "most"),
    [({"seed": 9}, 2e-10), *(pytest.param(LARGE | {"seed": n}, 3e-10, marks=pytest.mark.slow) for n in (2, 3))],
)
def test_settled_packing_is_in_balance_and_ready_for_friction(keys, most):
    settled = settle(scene(**keys))
    packing = settled.packing
    assert settled.residual < 1.5 * settled.floor < most
    assert np.all(packing.contacts.slip == 0)
    matrix = stiffness_matrix(packing).toarray()
    # zero slips: no term that is not symmetric, but for the rounding of products
    assert np.abs(matrix - matrix.T).max() < 1e-15 * np.abs(matrix).max()
    # the load rests on the floor, to the residual of each disk
    assert packing.normal_force[packing.contacts.floor].sum() == pytest.approx(3.0 * packing.top.sum(), abs=1e-8)
    assert not packing.top[packing.rattlers].any()
    # the layer, a tenth, lies on the bed: of 17 disks in height it fills the upper two
    assert packing.top.sum() == len(packing) / 10
    assert packing.position[packing.top, 1].min() > 0.7 * packing.position[:, 1].max()


def test_layer_that_always_sinks_is_refused():
    with pytest.raises(NoEquilibriumError, match="sank through the bed from each of 5 loose starts"):
        settle(scene(disks=60, top=3, width=12.0))


@pytest.mark.long
@pytest.mark.slow
def test_a_seed_whose_layer_sinks_is_the_packing_of_its_next_loose_start():
    # which seed that is depends on the build, since settling is chaotic; of so thin a layer one start in eight sinks
    told, seed = [], -1
    while not told and seed < 100:
        seed += 1
        found = settle(scene(disks=60, top=7, width=12.0, seed=seed), watch=told.append)
    assert told[0] == "the upper layer sank through the bed: loose start 2 of 5"
    assert found.residual < 1.5 * found.floor
    again = settle(scene(disks=60, top=7, width=12.0, seed=seed)).packing
    assert np.array_equal(again.position, found.packing.position)


def test_spheres_rest_where_disks_of_equal_masses_do():
    equal, spheres = (settle(scene(disks=20, top=4, width=4.9, masses=each)).packing for each in ("equal", "spheres"))
    np.testing.assert_array_equal(spheres.position, equal.position)
    np.testing.assert_array_equal(equal.mass, 1.0)
    np.testing.assert_allclose(spheres.mass, (spheres.radius / 0.5) ** 3, rtol=1e-15)


def lowest(packing: Packing) -> np.ndarray:
    """Eigenvalues of K for x and y, without the zeros of rattlers."""
    size = 2 * len(packing)
    matrix = stiffness_matrix(packing).toarray()[:size, :size]
    held = np.flatnonzero(matrix.diagonal())
    return eigvalsh(matrix[np.ix_(held, held)])


def test_disk_on_top_of_another_rolls_down():
    """Balanced on a tip: a saddle at a hair's breadth, from which it goes down into the hollow."""
    radius, position = np.full(3, 0.5), np.array([[2.0, 0.4995], [3.4, 0.4995], [2.0 + 1e-3, 1.4990]])
    bed = {"law": MindlinLaw(2e5, 0.0, 0.0), "contacts": touching(position, radius, 8.0), "box_length": 8.0}
    packing = Packing(position=position, radius=radius, top=np.arange(3) == 2, fy=3.0, **bed)
    assert lowest(packing)[0] < 0
    assert not minimize_energy(packing, 2)[1]
    packing, found = minimize_energy(packing, 400)
    assert found
    # it has pushed its neighbours apart on the smooth floor and lies on it
    assert packing.position[2, 1] < 0.5
    assert packing.normal_force[packing.contacts.i == 2].sum() == pytest.approx(3.0, abs=1e-9)
    assert lowest(packing)[0] > -1e-6


@pytest.mark.ranks
@pytest.mark.long
def test_same_packing_on_two_ranks(tmp_path):
    """`tests/docs/test_examples.py` has the same of 40 disks, in `make test`."""
    script = f"""
import sys, numpy as np
from mpi4py import MPI
from faultgouge.pywrap import Scene, settle
packing = settle(Scene.from_mapping({scene(**LARGE).resolved()!r})).packing
if MPI.COMM_WORLD.rank == 0: np.save(sys.argv[1], packing.position)
"""
    command = [*on_ranks(2), sys.executable, "-c", script, tmp_path / "two.npy"]
    subprocess.run(command, check=True, timeout=300)
    assert np.array_equal(np.load(tmp_path / "two.npy"), settle(scene(**LARGE)).packing.position)
