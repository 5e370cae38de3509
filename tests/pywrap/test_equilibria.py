"""Where a ramp to a given load ends; what damping leaves as it is; and the other laws."""

from dataclasses import replace

import numpy as np
import pytest
from reference_layer import REFERENCE

from faultgouge.analysis import damping_matrix, largest_frequency, stable_timestep
from faultgouge.assessment.extremes.packings import at_rest
from faultgouge.pywrap import Engine, NoEquilibriumError, Scene, SceneError, equilibrate, ramp, reach
from faultgouge.pywrap.runs.undamped import time_step

SCENE = {"packing": {"file": str(REFERENCE)}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
SCENE |= {"ramp": {"step": 2e-3, "until": 0.02}}


def ramped(mapping, step, until):
    """Its equilibria with increments of a size."""
    return list(ramp(Scene.from_mapping(mapping | {"ramp": {"step": step, "until": until}})))


@pytest.mark.parametrize(("fx", "loads"), [(0.0, 1), (5e-4, 2), (2e-3, 2), (5e-3, 4)])
def test_the_last_equilibrium_is_at_the_load_also_within_the_first_increment(fx, loads):
    *before, last = reach(Scene.from_mapping(SCENE), fx)
    assert (last.fx, len(before)) == (fx, loads - 1)
    assert last.packing.residual < 1e-9


@pytest.mark.long
def test_increments_that_meet_a_contact_that_hardly_opens_reach_the_end():
    """Of seed 11, halved increments end at F_x = 0.07846, where Newton's residual falls slowly; others pass."""
    mapping = SCENE | {"precision": "compensated", "packing": {"disks": 100, "seed": 11}}
    fine, coarse = (ramped(mapping, step, 0.085) for step in (5e-4, 1e-3))
    ways = [{round(each.fx, 10): each.way for each in passed if each.way} for passed in (fine, coarse)]
    assert ways == [{0.0785: "3 increments from F_x = 0.078", 0.079: "more iterations from F_x = 0.0785"}, {}]
    assert all(last.residual < 10 * last.floor for last in (fine[-1], coarse[-1]))
    fine, coarse = fine[-1].packing, coarse[-1].packing
    assert fine.fx == coarse.fx == pytest.approx(0.085)
    bearing = np.setdiff1d([fine.contacts.i, fine.contacts.j], [-1])  # a rattler lies anywhere in its cage
    assert len(bearing) > 80
    # units in the last place of coordinates up to 12
    assert np.abs((fine.position - coarse.position)[bearing]).max() < 1e-13


class Overhanging(Engine):
    """LAMMPS with a load that Newton's method reaches from above alone."""

    def try_displacement(self, base, displacement):
        trial = super().try_displacement(base, displacement)
        from_below = trial.fx == 2e-3 and base.fx < 2e-3
        return replace(trial, force=np.full(3 * len(base), 1e3)) if from_below else trial


def test_a_load_that_is_not_reached_from_below_is_reached_from_above(reference_packing):
    with Overhanging(packing := reference_packing(1.0)) as engine:
        last = equilibrate(engine, at_rest(packing), 1e-3)
        with pytest.raises(NoEquilibriumError, match=r"beyond F_x = 0\.001999"):
            equilibrate(engine, last, 2e-3)
        found = equilibrate(engine, last, 2e-3, onward=True)
    assert found.way == "a larger increment and back from F_x = 0.001"
    assert found.fx == 2e-3
    assert found.residual < 10 * found.floor


@pytest.mark.parametrize("inside", [False, True], ids=["all_by_more_than_a_radius", "inside"])
def test_a_guess_that_lammps_would_refuse_is_passed_over(inside):
    """A second equilibrium whose displacement, in proportion to the increment, is too long; or leads the centres of two
    disks that touch into the other one."""
    *_, beside, last = ramp(Scene.from_mapping(SCENE))
    position, c = last.packing.position.copy(), last.packing.contacts
    position += (0.0 if inside else 0.55, 0.0)
    if inside:
        position[[c.i[0], c.j[0]]] += np.outer([0.45, -0.45], last.packing.geometry.normal[0])
    odd = replace(beside, packing=replace(last.packing, position=position, fx=beside.fx))
    with Engine(last.packing) as engine:
        found, plain = (equilibrate(engine, last, 0.022, beside=each) for each in (odd, beside))
    # two roundings of coordinates up to 12
    np.testing.assert_allclose(found.packing.position, plain.packing.position, rtol=0, atol=4 * np.spacing(12))


def test_a_long_increment_stays_on_the_branch_of_short_ones():
    """Where Newton's step is no small displacement the increment is halved."""
    mapping = {"packing": {"disks": 20, "width": 3.6, "seed": 10}, "law": {"kn": 2e3, "mu": 0.5}, "load": {"fy": 3.0}}
    forces = [np.sort(ramped(mapping, step, 0.8)[-1].packing.normal_force) for step in (0.2, 0.01)]
    # 0.02 by the error of the path, which falls with the increment; 0.16 on the other branch
    assert np.abs(forces[0] - forces[1]).max() < 0.05


SETTLED = SCENE | {"packing": {"disks": 20, "width": 3.6, "seed": 2}, "ramp": {"step": 1e-3, "until": 2e-3}}
DAMPING = {"damping": {"cn": 30.0, "ct": 20.0, "tau": 0.2}}


def test_equilibria_are_the_same_to_the_bit_and_time_steps_stay_below_what_dashpots_allow():
    plain, damped = (list(ramp(Scene.from_mapping(SETTLED | more))) for more in ({}, DAMPING))
    for a, b in zip(plain, damped, strict=True):
        assert a.packing == replace(b.packing, law=a.packing.law, drag_time=None)
    packing = damped[0].packing
    dense = damping_matrix(packing).toarray() - np.eye(60) / packing.drag_time  # masses and I0 are 1
    rate = np.linalg.eigvalsh(dense).max()
    longest = 20 * time_step(packing)
    # the fastest vibration and the strongest dashpots bound the limit, and are no one motion
    assert 1.0 <= rate * longest + (longest / stable_timestep(largest_frequency(packing))) ** 2 < 1.2
    with pytest.raises(SceneError, match="over the limit"):
        time_step(packing, 1.01 * longest)


@pytest.mark.parametrize(
    ("history", "precision"), [("rescaled", "double"), ("coulomb", "double"), ("coulomb", "compensated")]
)
def test_histories_climb_with_newtons_method(history, precision):
    """Increments of half the length lead to nearly the same slips; those of the total law are others."""
    law = {"law": {"kn": 2e5, "history": history}, "precision": precision}
    found = [ramped(SETTLED | law, step, 0.12)[-1] for step in (2e-2, 1e-2)]
    assert all(last.packing.law.history == history and last.residual < 10 * last.floor for last in found)
    total = ramped(SETTLED, 2e-2, 0.12)[-1]
    scale = np.abs(total.packing.tangential_force).max()
    forces = [each.packing.tangential_force for each in (*found, total)]
    apart, different = (np.abs(force - forces[0]).max() / scale for force in forces[1:])
    assert apart < 0.1 * different
    assert different > 1e-3


def test_harmonic_disks_settle_and_climb():
    scene = Scene.from_mapping(SETTLED | {"law": {"kn": 3e3, "exponent": 1}})
    assert all(each.packing.law.exponent == 1 and each.residual < 1e-10 for each in ramp(scene))
