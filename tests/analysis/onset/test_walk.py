"""The walker, with an oracle that knows nothing of eigenvalues: roots of a function of the load."""

from itertools import pairwise

import numpy as np
import pytest

from faultgouge.analysis.onset.edge import sign_change
from faultgouge.analysis.onset.walk import walk


class Negative:
    """Roots of a function, from its signs at the ends of increments that are divided `depth` times."""

    def __init__(self, function, depth, most=None):
        self.function, self.depth, self.most = function, depth, most
        self.roots, self.increments = [], []

    @property
    def finished(self):
        return self.most is not None and len(self.roots) >= self.most

    def candidates(self, places, depth):
        return [self.function(a) * self.function(b) < 0 for a, b in pairwise(places)]

    def confirm(self, changes, here, there, depth):
        if depth < self.depth:
            return None, [0.5 * (here + there)]
        self.increments.append((here, there))
        return (sign_change(self.function, here, there).fx if changes else None), []

    def record(self, sure):
        self.roots.append(sure)


def test_increments_are_divided_and_come_in_order():
    oracle = Negative(np.sin, depth=2)
    walk(oracle, [1.0, 4.0, 7.0])
    np.testing.assert_allclose(np.diff(oracle.increments, axis=1), 0.75)
    np.testing.assert_allclose(np.ravel(oracle.increments)[1:-1:2], np.ravel(oracle.increments)[2::2])
    assert oracle.roots == pytest.approx([np.pi, 2 * np.pi], abs=1e-12)


def test_the_walk_ends_where_the_oracle_has_what_it_seeks():
    oracle = Negative(np.sin, depth=1, most=1)
    walk(oracle, [1.0, 4.0, 7.0, 10.0])
    assert oracle.roots == pytest.approx([np.pi], abs=1e-12)
    assert oracle.increments[-1] == (2.5, 4.0)
