"""A packing that has settled at one load and is carried to another."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from reference_layer import SMALL

from faultgouge.analysis import nearest_image
from faultgouge.pywrap import Scene, settle
from faultgouge.pywrap.settling.change_load import LOAD_FACTOR, change_load, loads_between
from faultgouge.pywrap.settling.settle import settle_bed


def scene(fy=3.0, kn=2e5, **packing):
    changed = {"packing": SMALL["packing"] | packing, "law": {"kn": kn, "mu": 0.5}, "load": {"fy": fy}}
    return Scene.from_mapping(SMALL | changed, command="settle")


def farthest(one, other):
    """How far apart the disks that carry load are in two packings; the whole may float along the smooth floor."""
    apart = nearest_image(one.position - other.position, one.box_length)
    bearing = np.setdiff1d(np.arange(len(one)), np.union1d(one.rattlers, other.rattlers))
    apart[:, 0] -= np.median(apart[bearing, 0])
    return np.hypot(*apart[bearing].T).max()


@given(st.floats(1e-6, 1e6), st.floats(-3, 3), st.floats(-3, 3))
def test_loads_lie_on_one_grid(first, here, there):
    """The loads on the way to one load are loads on the way to any beyond it."""
    near, far = (first * 10**power for power in sorted((here, there), key=abs))
    assume((near - first) * (far - first) > 0)
    nearer, farther = loads_between(first, near), loads_between(first, far)
    assert (nearer[-1], farther[-1]) == (near, far)
    assert farther[: len(nearer) - 1] == nearer[:-1]
    steps = np.abs(np.diff(np.log([first, *farther])))
    assert steps.max() <= np.log(LOAD_FACTOR) * (1 + 1e-6)


def test_a_packing_at_the_load_of_settling_is_the_settled_one():
    assert np.array_equal(settle_bed(scene()).position, settle_bed(scene(settle_at={"fy": 3.0})).position)
    assert loads_between(3.0, 3.0) == []


@pytest.mark.slow
def test_a_seed_is_one_packing_over_loads():
    settled = settle(scene())
    for fy in (3.001, 3.1):
        carried = settle(scene(fy, settle_at={"fy": 3.0}))
        assert carried.residual < 1e-9
        assert carried.packing.fy == fy
        # the overlaps of a column of some five disks grow by 2/3 of the share that the load does
        assert farthest(carried.packing, settled.packing) < 0.02 * (fy - 3.0)
        assert not carried.packing.contacts.slip.any()


@pytest.mark.slow
def test_other_increments_lead_to_the_same_packing(monkeypatch):
    bed = settle_bed(scene())
    bed = replace(bed, law=replace(bed.law, mu=0.0))
    found = change_load(bed, 4.5)
    monkeypatch.setattr("faultgouge.pywrap.settling.change_load.LOAD_FACTOR", 1.02)
    assert farthest(change_load(bed, 4.5), found) < 1e-11  # rounding of coordinates, over soft modes


@pytest.mark.slow
def test_a_stiffness_that_rises_is_a_load_that_falls():
    at = {"fy": 3.0, "kn": 2e5}
    stiff, low = settle_bed(scene(3.0, 4e5, settle_at=at)), settle_bed(scene(1.5, 2e5, settle_at=at))
    assert np.array_equal(stiff.position, low.position)
    assert stiff.residual == pytest.approx(2 * low.residual, rel=0.1, abs=1e-9)
    assert (stiff.fy, stiff.law.kn, low.fy, low.law.kn) == (3.0, 4e5, 1.5, 2e5)


@pytest.mark.long
def test_a_packing_settled_with_friction_keeps_its_slips_on_the_way():
    settled, carried = (settle(scene(fy, settle_friction=True, settle_at={"fy": 3.0})).packing for fy in (3.0, 3.3))
    assert settled.contacts.slip.any()
    assert farthest(carried, settled) < 0.02 * 0.3
    contacts = [each.contacts for each in (settled, carried)]
    one, other = ({(i, j): s for i, j, s in zip(c.i, c.j, c.slip, strict=True)} for c in contacts)
    both = np.array([(one[pair], other[pair]) for pair in one.keys() & other.keys()])
    assert np.corrcoef(both.T)[0, 1] > 0.9
    assert not np.array_equal(*both.T)
