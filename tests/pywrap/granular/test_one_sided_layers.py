"""One-sided motion, and the verdict on it, beside the motion of layers with the standard law in the plugin."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from pushes import PUSH, motion_after

from faultgouge.analysis import stability
from faultgouge.analysis.motion.pushes import random_pushes


@pytest.fixture(scope="module")
def layer():
    """The layer of README with Coulomb's slider, at 0.2 F_y of its own ramp, with dashpots of the restitution 0.9."""
    from faultgouge.pywrap import Scene, settle
    from research.laws.both_laws import as_slider, at_loads
    from research.modes.loss import with_dashpots

    found, parts = [], {"packing": {"seed": 1}, "law": {"kn": 2e5, "history": "coulomb"}, "load": {"fy": 3.0}}
    scene = Scene.from_mapping(parts | {"ramp": {"step": 3e-3, "until": 0.6}, "modes": {"fx_over_fy": [0.2]}})
    start = settle(scene)
    at_loads(scene, replace(start, packing=as_slider(start.packing)), lambda packing: found.append(packing) or {})
    return with_dashpots(found[0], 171.0)


def pushed_layer(packing, push, times, size=PUSH):
    """D over the push squared of all disks as the plugin moves them, shape (T,)."""
    from mpi4py import MPI

    from faultgouge.analysis import mean_square_displacement
    from faultgouge.pywrap import Engine
    from faultgouge.pywrap.granular.lammps_arrays import set_velocity
    from faultgouge.pywrap.runs.undamped import time_step

    dt, found = time_step(packing), []
    with Engine(packing, MPI.COMM_SELF) as engine, engine.undamped(dt) as dynamics:
        set_velocity(engine.lammps, packing.configuration, size * push)
        for time in times:
            moved = dynamics.advance(round(time / dt) - engine.steps)
            found.append(mean_square_displacement(moved.position, packing.position, packing.box_length) / size**2)
    return np.array(found)


def compared(packing, push, times, agrees):
    """D over the push squared as the plugin has it, where one-sided motion has the same; and the one-sided motion."""
    found, expected = pushed_layer(packing, push[:, 0], times), motion_after(packing, push, times)
    np.testing.assert_allclose(found, expected.mean_square_displacement, rtol=agrees)
    return found, expected


@pytest.mark.long
def test_the_standard_law_after_a_push(layer):
    """Dashpots of the plugin feel the velocity of the full step, and those of one-sided motion that of the half step:
    1 % of D."""
    here = layer.configuration
    assert 0 < here.contacts.one_sided.sum() < len(layer.contacts) - 100
    push = random_pushes(here, 1)
    push.reshape(here.axes, len(here), -1)[:, layer.rattlers] = 0.0  # the runs of this package hold rattlers
    for column in push.T:
        _, expected = compared(layer, column[:, None], np.array([0.2, 0.5, 1.0, 2.0]), 0.02)
        assert np.any(expected.slid[-1] > 0)


@pytest.fixture(scope="module")
def far_from_the_bound():
    """Thirty disks with Coulomb's slider at 0.02 F_y, whose contacts all stick, and dashpots or none."""
    from faultgouge.pywrap import Engine, Scene, equilibrate, settle

    parts = {"packing": {"disks": 30, "seed": 4, "top": 3, "width": 3.57}, "load": {"fy": 3.0}}
    parts |= {"law": {"kn": 2e5, "mu": 2.0, "history": "coulomb"}}

    @cache
    def make(cn):
        damping = {"damping": {"cn": cn, "ct": 2 / 7 * cn}} if cn else {}
        state = settle(Scene.from_mapping(parts | damping))
        with Engine(state.packing) as engine:
            for step in range(1, 16):
                state = equilibrate(engine, state, fx=4e-3 * step)
        assert not state.packing.configuration.contacts.at_bound.any()
        return state.packing

    return make


def test_vibration_carries_particles_on_whose_contacts_wear_down(far_from_the_bound):
    """Without loss D grows as the square of the time; the mean of both derivatives has D below 1e-3."""
    packing = far_from_the_bound(0.0)
    here, verdict = packing.configuration, stability(packing)
    assert str(verdict).startswith("stable but for creep: no motion grows exponentially\n")
    found, _ = compared(packing, random_pushes(here, 1)[:, :1], np.array([4.0, 12.0]), 0.02)
    assert np.sqrt(found[-1]) / 12 == pytest.approx(verdict.creep.velocity, rel=0.3)


@pytest.mark.long
def test_with_loss_particles_stay_displaced(far_from_the_bound):
    """Every linear motion decays, and D rises."""
    packing = far_from_the_bound(20.0)
    here, verdict = packing.configuration, stability(packing)
    assert verdict.stable is (verdict.growth_rate < 0) is True
    assert "they stay displaced, by D up to" in str(verdict)
    found, _ = compared(packing, random_pushes(here, 1)[:, :1], np.array([1.0, 10.0]), 0.03)
    assert found[1] > 2 * found[0]
    assert stability(packing, time=10.0).creep.amplification == pytest.approx(found[1], rel=0.5)


@pytest.mark.long
def test_a_push_beyond_the_stated_size_moves_otherwise(far_from_the_bound):
    """The size does not depend on when the motion is looked at, as contacts go farthest at the beginning."""
    packing = far_from_the_bound(20.0)
    here, times = packing.configuration, np.array([0.5, 1.0, 2.0])
    push = random_pushes(here, 1)[:, :1]
    expected = motion_after(packing, push, times)
    most, d = expected.scales[1], expected.mean_square_displacement
    assert motion_after(packing, push, np.linspace(0.0, 2.0, 4001)).scales[1] == pytest.approx(most, 0.05)
    assert stability(packing).largest_energy < 0.5 * np.sum(here.coordinate_mass * (most * push[:, 0]) ** 2)
    small, large = (pushed_layer(packing, push[:, 0], times, size=share * most) for share in (0.1, 20))
    np.testing.assert_allclose(small, d, rtol=0.1)
    assert np.any(np.abs(large / d - 1) > 0.5)


@pytest.mark.long
def test_a_longer_run_knows_no_less():
    """Sliders at rest slide again where vibration wears contacts down; the packing rests all the same."""
    from faultgouge.pywrap import Scene, ramp

    parts = {"packing": {"seed": 2, "disks": 40, "width": 7.7}, "law": {"kn": 2e5, "mu": 0.5, "history": "coulomb"}}
    more = {"load": {"fy": 3.0}, "ramp": {"step": 0.05, "until": 0.6}, "damping": {"cn": 60.0, "ct": 17.0}}
    *_, last = ramp(Scene.from_mapping(parts | more))
    short, longer = stability(last.packing), stability(last.packing, time=20.0)
    assert (short.one_sided.slip_left, short.one_sided.time < 10) == (0, True)
    assert short.stable is longer.stable is True
    assert longer.one_sided.amplification > 1.5 * short.one_sided.amplification
    assert "contacts may slide again, and D may rise further" in str(short)


@pytest.mark.long
def test_the_standard_law_under_a_load_that_rises(layer):
    """The layer vibrates for ever in proportion to the rate: as one-sided motion says, and not with more friction."""
    from research.rising.windows import Windows, drift_and_vibration, rise_in_plugin

    def in_lammps(packing, rate, rising):
        windows = Windows.of(packing.configuration, rising)
        parts = rise_in_plugin(packing, rate, windows, spins=True)[-windows.span :]
        return drift_and_vibration(parts, windows.length, rate)

    told = stability(layer, rise="fx")
    assert told.stable is told.rising.steady is True
    assert told.rising.vibration > 0.05 * told.rising.drift
    for rate in (1e-5, 1e-6):
        found = in_lammps(layer, rate, told.rising)
        assert found["vibration"] == pytest.approx(told.rising.vibration, rel=0.2)
        assert found["drift"] == pytest.approx(told.rising.drift, rel=0.05)
    sticks = replace(layer, law=replace(layer.law, mu=100.0))
    rising = stability(sticks, rise="fx").rising
    for each in (rising, in_lammps(sticks, 1e-5, rising)):
        assert each["vibration"] < 0.01 * each["drift"]
