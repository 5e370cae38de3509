"""Settling by Newton's method with implicit steps: what floats does not stop it, and it goes down to a minimum."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigvalsh

from faultgouge.analysis import MindlinLaw, Packing, spectrum, stiffness_matrix, touching
from faultgouge.pywrap import NoEquilibriumError, Scene, settle
from faultgouge.pywrap.equilibria.quasistatic import rounding_floor
from faultgouge.pywrap.runs.undamped import ACCURATE_SHARE, time_step
from faultgouge.pywrap.settling import settling
from faultgouge.pywrap.settling.settling import minimized

BIN = Path(sys.executable).parent
SCENE = {"packing": {"disks": 400, "width": 24.0, "seed": 1}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}


@pytest.fixture
def frictionless(reference_packing):
    """The reference packing without friction: all of it may slide along the floor."""
    packing = reference_packing(1.0)
    return replace(packing, law=MindlinLaw(packing.law.kn, packing.law.kt, 0.0))


def displaced(packing: Packing, by: float) -> Packing:
    position = packing.position + by * np.random.default_rng(0).standard_normal(packing.position.shape)
    return replace(packing, position=position, contacts=touching(position, packing.radius, packing.box_length))


def lowest(packing: Packing) -> np.ndarray:
    """Eigenvalues of K for x and y, without the zeros of rattlers."""
    size = 2 * len(packing)
    matrix = stiffness_matrix(packing).toarray()[:size, :size]
    held = np.flatnonzero(matrix.diagonal())
    return eigvalsh(matrix[np.ix_(held, held)])


def test_floating_packing_goes_down_to_the_floor(frictionless):
    # it may slide: a mode without stiffness, on which K is singular
    assert abs(lowest(frictionless)[0]) < 1e-6
    start = displaced(frictionless, 1e-4)
    assert start.residual > 1
    packing, found = minimized(start)
    assert found
    assert packing.residual < 3 * rounding_floor(packing)


def test_disk_on_top_of_another_rolls_down():
    """Balanced on a tip: a saddle at a hair's breadth, from which it goes down into the hollow."""
    radius = np.full(3, 0.5)
    position = np.array([[2.0, 0.4995], [3.4, 0.4995], [2.0 + 1e-3, 1.4990]])
    law = MindlinLaw(2e5, 0.0, 0.0)
    top = np.array([False, False, True])
    contacts = touching(position, radius, 8.0)
    packing = Packing(position=position, radius=radius, contacts=contacts, law=law, box_length=8.0, top=top, fy=3.0)
    assert lowest(packing)[0] < 0
    packing, found = minimized(packing, 400)
    assert found
    # it has pushed its neighbours apart on the smooth floor and lies on it
    assert packing.position[2, 1] < 0.5
    assert packing.normal_force[packing.contacts.i == 2].sum() == pytest.approx(3.0, abs=1e-9)
    assert lowest(packing)[0] > -1e-6


@pytest.fixture(scope="module")
def settled():
    """A packing that is too large for dynamics alone."""
    return settle(Scene.from_mapping(SCENE))


@pytest.mark.slow
def test_larger_packing_settles_to_the_floor(settled):
    assert settled.residual < 1.5 * settled.floor < 3e-10
    assert np.abs(settled.packing.contacts.slip).max() < 1e-9
    assert not settled.packing.top[settled.packing.rattlers].any()


@pytest.mark.parametrize("seed", [2, 3])
@pytest.mark.slow
def test_layer_of_a_tenth_comes_to_rest(seed):
    packing = settle(Scene.from_mapping(SCENE | {"packing": SCENE["packing"] | {"seed": seed}})).packing
    assert packing.top.sum() == 40
    # it lies on the bed: of 17 disks in height it fills the upper two
    assert packing.position[packing.top, 1].min() > 0.7 * packing.position[:, 1].max()


@pytest.mark.slow
def test_layer_that_still_sinks_when_steps_run_out_is_refused(monkeypatch):
    monkeypatch.setattr(settling, "STEPS", 5000)
    scene = Scene.from_mapping(SCENE | {"packing": SCENE["packing"] | {"top": 8}})
    with pytest.raises(NoEquilibriumError, match=r"leave packing\.top out"):
        settle(scene)


@pytest.mark.slow
def test_time_step_of_a_large_packing_is_that_of_all_eigenvalues(settled):
    # the root of an eigenvalue that is known to 1e-4
    assert time_step(settled.packing) == pytest.approx(
        ACCURATE_SHARE * 2 / spectrum(settled.packing).omega_max, rel=5e-5
    )


@pytest.mark.ranks
@pytest.mark.slow
def test_same_packing_on_two_ranks(settled, tmp_path):
    script = (
        "import sys, numpy as np\n"
        "from mpi4py import MPI\n"
        "from faultgouge.pywrap import Scene, settle\n"
        f"packing = settle(Scene.from_mapping({SCENE!r})).packing\n"
        "if MPI.COMM_WORLD.rank == 0: np.save(sys.argv[1], packing.position)\n"
    )
    command = [BIN / "mpiexec", "-n", "2", sys.executable, "-c", script, tmp_path / "two.npy"]
    subprocess.run(command, check=True, timeout=300)
    assert np.array_equal(np.load(tmp_path / "two.npy"), settled.packing.position)
