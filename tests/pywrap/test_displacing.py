"""Displacements in turn, without LAMMPS's set-up in between: each as if it were the first."""

from dataclasses import replace

import numpy as np
import pytest

from faultgouge.analysis import nearest_image
from faultgouge.pywrap import Engine


@pytest.mark.parametrize("compensated", [False, True])
def test_a_displacement_does_not_depend_on_those_before(reference_packing, compensated):
    """Disks cross the periodic boundary, and neighbour lists are built in some displacements and not in others."""
    base = reference_packing(1.0)
    if compensated:
        base = replace(base, position_low=np.zeros_like(base.position))
    rng = np.random.default_rng(1)
    crossed = 0
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
            moved = later.position[:, 0] - base.position[:, 0]
            crossed += np.count_nonzero(np.abs(moved) > 0.5 * base.box_length)
            base = later
    assert crossed > 0


def test_the_load_and_the_disks_are_free_again_after_displacements(reference_packing):
    """What stays in LAMMPS between increments is gone when something else is asked for."""
    packing = reference_packing(1.0)
    with Engine(packing) as engine:
        engine.displace(packing, np.zeros(3 * len(packing)))
        engine.set_fx(1e-3)
        engine.displace(packing, np.zeros(3 * len(packing)))
        pushed = engine.net_force
        instance = engine.lammps
        assert not instance.has_id("fix", "move")
        assert not instance.has_id("variable", "load")
        instance.command("run 0 post no")
        np.testing.assert_array_equal(engine.net_force, pushed)
        engine.restore(packing)
        with engine.undamped(1e-4) as dynamics:
            still = dynamics.advance(0)
        moved = nearest_image(still.position - packing.position, packing.box_length)
        np.testing.assert_allclose(moved, 0.0, atol=1e-14)
