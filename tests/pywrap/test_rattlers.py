"""Rattlers: in the middle of their cages, and out of the way of their neighbours."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faultgouge.analysis import Contacts, MindlinLaw, Packing, nearest_image, touching
from faultgouge.assessment.extremes.packings import at_rest
from faultgouge.pywrap import Engine, equilibrate
from faultgouge.pywrap.equilibria.rattlers import clear_rattlers, highest_corner, middle_of_cage


def packing(position, radius, box_length=None):
    law, none = MindlinLaw(2e5, 1e5, 1.0), Contacts([], [], [])
    return Packing(position=position, radius=radius, contacts=none, law=law, box_length=box_length)


def narrowest_gap(cage, disk, place):
    others = np.delete(np.arange(len(cage)), disk)
    branch = nearest_image(place - cage.position[others], cage.box_length)
    gaps = np.hypot(branch[:, 0], branch[:, 1]) - cage.radius[others] - cage.radius[disk]
    return min(gaps.min(), place[1] - cage.radius[disk])


@pytest.mark.parametrize("width", [0.1, 1e-3, 1e-6])
@pytest.mark.parametrize("angles", [(0, 120, 240), (20, -117, -171), (154, -38, 83)])
def test_middle_of_three(width, angles):
    """Three disks about a point, all as far: it is the middle, however narrow the cage and oblique its walls."""
    middle = np.array([3.0, 5.0])
    towards = np.column_stack([np.cos(np.radians(angles)), np.sin(np.radians(angles))])
    start = middle + 0.4 * width * np.array([0.6, -0.8])
    cage = packing(np.vstack([start, middle + (1.2 + width) * towards]), [0.5, 0.7, 0.7, 0.7])
    (place,) = middle_of_cage(cage, np.array([0]))
    # the linear programs stop where they gain a twentieth
    assert narrowest_gap(cage, 0, place) > 0.94 * width
    assert narrowest_gap(cage, 0, start) < 0.84 * width


def test_a_move_is_that_of_a_solver_of_linear_programs():
    """SciPy's, which knows a solution to 1e-7, on cages of random neighbours."""
    from scipy.optimize import linprog

    rng = np.random.default_rng(0)
    for _ in range(20):
        angles = rng.uniform(0, 2 * np.pi, 8)
        sides = np.column_stack([np.cos(angles), np.sin(angles), np.ones(8)])
        sides, bounds = np.vstack([sides, np.eye(3), -np.eye(3)]), np.append(rng.uniform(0.01, 0.4, 8), 6 * [0.3])
        corner = highest_corner(sides, bounds)
        expected = linprog([0.0, 0.0, -1.0], sides, bounds, bounds=(None, None)).x
        np.testing.assert_allclose(corner, expected, rtol=0, atol=1e-6)
        assert np.all(sides @ corner <= bounds + 1e-11)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000), st.sampled_from([None, 4.0]))
def test_the_narrowest_gap_of_a_lone_mover_is_never_narrower(seed, box_length):
    rng = np.random.default_rng(seed)
    cage = packing(rng.uniform(0.5, 3.5, (9, 2)), rng.uniform(0.2, 0.5, 9), box_length)
    (place,) = middle_of_cage(cage, np.array([4]))
    # Disks are looked at that are up to 1.2 of the largest radius away, of which the move takes 0.42 at the most: gaps
    # wider than 0.7 radii may become narrower. Each program may be beyond its bounds by 1e-12.
    least = min(narrowest_gap(cage, 4, cage.position[4]), 0.7 * cage.radius[4])
    assert narrowest_gap(cage, 4, place) >= least - 1e-10


def beside(packing, rank, gap):
    """A rattler, and the packing in which it lies so far from one of its neighbours."""
    rattler, position = packing.rattlers[0], packing.position.copy()
    branch = position - position[rattler]
    distance = np.hypot(*branch.T)
    gaps = distance - packing.radius - packing.radius[rattler]
    near = np.argsort(gaps)[1 + rank]  # the first is itself
    position[rattler] += (gaps[near] - gap) * branch[near] / distance[near]
    contacts = touching(position, packing.radius, packing.box_length)
    return rattler, replace(packing, position=position, contacts=contacts)


def test_rattlers_are_moved_clear_and_nothing_else_is(reference_packing):
    packing = reference_packing(1.0)
    rattler, pushed = beside(packing, rank=0, gap=-1e-9)
    assert rattler not in pushed.rattlers
    cleared = clear_rattlers(pushed, pushed.loaded(1e-6).rattlers)
    assert rattler in cleared.rattlers
    loaded = np.setdiff1d(np.arange(len(packing)), packing.rattlers)
    assert np.array_equal(cleared.position[loaded], packing.position[loaded])
    assert len(cleared.contacts) == len(packing.contacts)


def test_a_rattler_that_a_neighbour_runs_into_is_moved_out_of_the_way(reference_packing):
    rattler, packing = beside(reference_packing(1.0), 2, 1e-9)
    with Engine(packing) as engine:
        found = equilibrate(engine, at_rest(packing), 1e-2)
    assert rattler in found.packing.rattlers
