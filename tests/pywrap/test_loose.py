"""A loose start touches nothing, keeps to its box and its shares, and is the same for one seed."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from faultgouge.analysis.files.formats import Disks
from faultgouge.pywrap.scenes.random_start import random_start


def smallest_gap(start: Disks) -> float:
    """Distance between the surfaces of the closest pair, or of the closest disk and the floor."""
    images = [] if start.box_length is None else [(-start.box_length, 0.0), (start.box_length, 0.0)]
    position = np.concatenate([start.position + shift for shift in [(0.0, 0.0), *images]])
    radius = np.resize(start.radius, len(position))
    i, j = cKDTree(position).query_pairs(2.01 * radius.max(), output_type="ndarray").T
    pairs = np.hypot(*(position[i] - position[j]).T) - radius[i] - radius[j]
    return min((start.position[:, 1] - start.radius).min(), pairs.min(initial=np.inf))


@given(
    disks=st.integers(1, 200),
    radii=st.lists(st.floats(0.1, 2.0), min_size=1, max_size=4),
    top=st.floats(0, 1),
    width=st.floats(8.0, 30.0),
    seed=st.integers(0, 2**32),
    periodic=st.booleans(),
)
def test_nothing_overlaps_and_the_upper_layer_lies_above(disks, radii, top, width, seed, periodic):
    """Radii have equal shares; those of the upper layer take turns, in equal steps along x."""
    top = int(top * disks)
    start = random_start(disks, tuple(radii), top, width, seed, periodic=periodic)
    # Places are sums of a few numbers below 1000, each rounded once: 1e-12 is ten times that.
    assert smallest_gap(start) > -1e-12
    assert start.box_length == (width if periodic else None)
    x = start.position[:, 0]
    assert np.all((x >= 0) & (x < width))
    assert np.array_equal(start.top, np.arange(disks) >= disks - top)
    shares = np.resize(sorted(radii), disks)
    assert np.array_equal(np.sort(start.radius), np.sort(shares))
    assert np.array_equal(start.radius[start.top], shares[:top])
    assert np.allclose(np.diff(x[start.top]), width / max(top, 1), rtol=0, atol=1e-12)
    if 0 < top < disks:
        highest = (start.position[:, 1] + start.radius)[~start.top].max()
        assert (start.position[:, 1] - start.radius)[start.top].min() >= highest - 1e-12


def test_a_seed_has_loose_starts_of_its_own():
    draws = [(7, 0), (7, 1), (7, 2), (8, 1), (1 + 2**32, 0), (1, 1)]
    starts = [random_start(100, (0.5, 0.7), 10, 11.9, seed, draw=draw).position for seed, draw in draws]
    assert np.array_equal(starts[0], random_start(100, (0.5, 0.7), 10, 11.9, 7).position)
    assert len({start.tobytes() for start in starts}) == len(draws)
