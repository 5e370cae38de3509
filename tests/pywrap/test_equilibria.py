"""Where a ramp to a given load ends."""

from dataclasses import replace

import numpy as np
import pytest
from reference_layer import REFERENCE

from faultgouge.assessment.stability.cases.packings import at_rest
from faultgouge.pywrap import Engine, NoEquilibriumError, Scene, equilibrate, ramp, reach

SCENE = {
    "packing": {"file": str(REFERENCE)},
    "law": {"kn": 2e5},
    "load": {"fy": 3.0},
    "ramp": {"step": 2e-3, "until": 0.02},
}


@pytest.mark.parametrize(("fx", "count"), [(0.0, 1), (5e-4, 2), (2e-3, 2), (5e-3, 4)])
def test_the_last_equilibrium_is_at_the_load_also_within_the_first_increment(fx, count):
    found = list(reach(Scene.from_mapping(SCENE), fx))
    assert found[-1].fx == fx
    assert len(found) == count
    assert found[-1].packing.residual < 1e-9


@pytest.mark.parametrize(
    ("step", "loads"), [(7e-4, [0.0, 7e-4, 1.4e-3, 3 * 7e-4, 2.8e-3, 3e-3]), (1e-3, [0.0, 1e-3, 2e-3, 3e-3])]
)
def test_a_ramp_ends_at_until_with_a_shorter_increment(step, loads):
    scene = Scene.from_mapping(SCENE | {"ramp": {"step": step, "until": 3e-3}})
    assert [each.fx for each in ramp(scene)] == loads


@pytest.mark.slow
def test_increments_that_meet_a_contact_that_hardly_opens_reach_the_end():
    """Of seed 11, halved increments end at F_x = 0.07846, where Newton's residual falls slowly; others pass."""
    reached, ways = [], []
    for step in (5e-4, 1e-3):
        mapping = {"precision": "compensated", "packing": {"disks": 100, "seed": 11}, "law": {"kn": 2e5}}
        scene = Scene.from_mapping(mapping | {"load": {"fy": 3.0}, "ramp": {"step": step, "until": 0.085}})
        *_, last = passed = list(ramp(scene))
        ways.append({round(each.fx, 10): each.way for each in passed if each.way})
        assert last.residual < 10 * last.floor
        reached.append(last.packing)
    assert ways == [{0.0785: "3 increments from F_x = 0.078", 0.079: "more iterations from F_x = 0.0785"}, {}]
    fine, coarse = reached
    assert fine.fx == coarse.fx == pytest.approx(0.085)
    bearing = np.setdiff1d([fine.contacts.i, fine.contacts.j], [-1])  # a rattler lies anywhere in its cage
    assert len(bearing) > 80
    # units in the last place of coordinates up to 12
    assert np.abs((fine.position - coarse.position)[bearing]).max() < 1e-13


class Overhanging(Engine):
    """LAMMPS with a load that Newton's method reaches from above alone."""

    def displaced(self, base, displacement):
        trial = super().displaced(base, displacement)
        from_below = trial.fx == 2e-3 and base.fx < 2e-3
        return replace(trial, force=np.full(3 * len(base), 1e3)) if from_below else trial


def test_a_load_that_is_not_reached_from_below_is_reached_from_above(reference_packing):
    packing = reference_packing(1.0)
    with Overhanging(packing) as engine:
        last = equilibrate(engine, at_rest(packing), 1e-3)
        with pytest.raises(NoEquilibriumError, match=r"beyond F_x = 0\.001999"):
            equilibrate(engine, last, 2e-3)
        found = equilibrate(engine, last, 2e-3, onward=True)
    assert found.way == "a larger increment and back from F_x = 0.001"
    assert found.fx == 2e-3
    assert found.residual < 10 * found.floor
