"""The largest stable time step with dashpots, by the amplification matrices and in LAMMPS, on both sides of it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigvals

from faultgouge.analysis import damping_matrix, stable_timestep, stiffness_matrix
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.pywrap import Engine, Scene, settle
from faultgouge.pywrap.runs.undamped import ACCURATE_SHARE, time_step

SCENE = {"packing": {"disks": 60, "width": 8.5, "top": 6, "seed": 1}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
SCENE |= {"damping": {"cn": 1000.0, "ct": 1000.0, "tau": 1e-3}}
"""Dashpots that halve the limit, and a drag of less than a time step, which does not limit it."""


@pytest.fixture(scope="module")
def packing():
    return settle(Scene.from_mapping(SCENE)).packing


def as_in_lammps(packing):
    """Its configuration with dashpots that feel the velocity of the half step, as those of LAMMPS's own styles."""
    c = packing.configuration
    sliders = np.ones(len(c.contacts), bool)
    return derive_frozen(c, contacts=derive_frozen(c.contacts, viscous_slider=sliders))


def largest_factor(packing, dt, dashpot_velocity):
    """By how much the fastest growing motion grows a step: of the matrices in the module's docstring."""
    elastic = replace(packing, drag_time=None)
    a, g, one = stiffness_matrix(packing).toarray(), damping_matrix(elastic).toarray(), np.eye(packing.coordinates)
    none = np.zeros_like(one)
    if dashpot_velocity == "half-step":
        step = np.block([[one, dt * one], [-dt * a, one - dt * g - dt**2 * a]])
    else:
        middle = one - 1.5 * dt * g - dt**2 * a
        step = np.block([[one, dt * one, none], [-dt * a, middle, 0.5 * dt * g], [none, one, none]])
    return np.abs(eigvals(step)).max()  # masses and I0 are 1


@pytest.mark.slow
@pytest.mark.parametrize("dashpot_velocity", ["half-step", "extrapolated"])
def test_the_limit_is_that_of_the_amplification_matrix(packing, dashpot_velocity):
    limit = stable_timestep(packing if dashpot_velocity == "extrapolated" else as_in_lammps(packing))
    # a factor of one has rounding, of the root of 1e-16 where two of them meet: motion that no contact feels
    assert largest_factor(packing, 0.999 * limit, dashpot_velocity) < 1 + 1e-6
    assert largest_factor(packing, 1.001 * limit, dashpot_velocity) > 1 + 5e-4
    assert limit.certain <= limit


def test_a_packing_takes_the_step_of_its_own_dashpots(packing):
    limit = stable_timestep(packing)
    assert limit < 0.7 * stable_timestep(as_in_lammps(packing))
    assert time_step(packing) == ACCURATE_SHARE * limit


@pytest.mark.slow
@pytest.mark.parametrize(("share", "rests"), [(0.98, True), (1.05, False)])
def test_lammps_with_our_dashpots_rests_below_the_limit_and_blows_up_above(packing, share, rests):
    shift = 1e-9 * np.random.default_rng(0).standard_normal(packing.position.shape)
    moved = replace(packing, position=packing.position + shift, drag_time=None)
    with Engine(moved) as engine, engine.undamped(share * stable_timestep(packing)) as dynamics:
        first, *_, last = (dynamics.advance(steps).kinetic_energy(moved) for steps in (10, 200, 200))
    assert (last < 1e-2 * first) is rests
    assert (last > 1e3 * first) is not rests
