"""LAMMPS as the engine has it: what was done before leaves no trace, and what it cannot do is said in one sentence."""

from dataclasses import replace

import numpy as np
import pytest
from reference_layer import SMALL, toml

from faultgouge.analysis import nearest_image
from faultgouge.pywrap import Engine


@pytest.mark.parametrize("compensated", [False, True])
def test_a_displacement_does_not_depend_on_those_before(reference_packing, compensated):
    """Disks cross the periodic boundary, and neighbour lists are built in some displacements and not in others."""
    base, rng, crossed = reference_packing(1.0, compensated), np.random.default_rng(1), 0
    with Engine(base) as engine:
        for _ in range(6):
            displacement = 1e-4 * rng.standard_normal((3, len(base)))
            displacement[0] += rng.uniform(-0.2, 0.2)
            engine.displace(base, np.repeat([rng.uniform(-0.1, 0.1), 0.0, 0.0], len(base)))
            later = engine.displace(base, displacement.ravel())
            force = engine.net_force
            with Engine(base) as other:
                assert base != later == other.displace(base, displacement.ravel())
                np.testing.assert_array_equal(force, other.net_force)
            crossed += np.count_nonzero(np.abs(later.position - base.position) > 0.5 * base.box_length)
            base = later
    assert crossed > 0


def test_the_load_and_the_disks_are_free_again_after_displacements(reference_packing):
    """What stays in LAMMPS between increments is gone when something else is asked for."""
    packing = reference_packing(1.0)
    with Engine(packing) as engine:
        engine.set_fx(1e-3)
        engine.displace(packing, np.zeros(3 * len(packing)))
        pushed = engine.net_force
        engine.command("run 0 post no")
        np.testing.assert_array_equal(engine.net_force, pushed)
        engine.restore(packing)
        with engine.undamped(1e-4) as dynamics:
            still = dynamics.advance(0)
    moved = nearest_image(still.position - packing.position, packing.box_length)
    np.testing.assert_allclose(moved, 0.0, rtol=0, atol=1e-14)


def test_an_engine_goes_on_undamped(reference_packing):
    """Dashpots are on in dynamics alone: what the engine does after it is as if there had been none."""
    packing, relaxed = replace(reference_packing(1.0, cn=30.0, ct=20.0), drag_time=0.2, fx=3.0), []
    for steps in (0, 20):
        with Engine(packing) as engine:
            if steps:
                with engine.undamped(1e-3) as dynamics:
                    dynamics.advance(steps)
            engine.restore(packing)
            engine.relax(1.0)
            relaxed.append(engine.packing)
    assert packing != relaxed[0] == relaxed[1]


def test_forces_without_friction_are_zero_until_the_first_run(reference_packing):
    """LAMMPS does not set them; with MALLOC_PERTURB_ in the environment they would be numbers of any size."""
    with Engine(reference_packing(0.0)) as engine:
        assert not engine.net_force.any()


@pytest.mark.slow
def test_a_plugin_that_does_not_fit_is_refused(faultgouge, tmp_path, monkeypatch):
    """tests/plugin/test_mismatch.py has those that were compiled for another LAMMPS."""
    (tmp_path / "mindlinsmoothplugin.so").write_bytes(b"of another machine")
    (tmp_path / "scene.toml").write_text(toml(SMALL))
    monkeypatch.setenv("FAULTGOUGE_PLUGIN", str(tmp_path))
    # where the LAMMPS of an earlier test found plugins: its module tells all processes that follow
    monkeypatch.delenv("LAMMPS_PLUGIN_PATH", raising=False)
    said = faultgouge("settle", "scene.toml", "-o", "run.h5", code=1).stderr
    for words in ("another release, MPI or size of atom IDs", str(tmp_path), "build the plugin", "FAULTGOUGE_PLUGIN"):
        assert words in said
