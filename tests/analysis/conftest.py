"""Packings for the tests of the analysis."""

import bisect
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from faultgouge.analysis import Contacts, MindlinLaw, Packing, touching

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parent / "windows"))

import quasistatic


class Ramp:
    """Equilibria of a ramp by its grid of loads; between two of them, from the one below."""

    def __init__(self, start: Packing, grid: np.ndarray) -> None:
        self.grid = [start.fx, *grid]
        self.states = [start]
        for fx in grid:
            self.states.append(quasistatic.equilibrium(self.states[-1], fx))

    def __call__(self, fx: float) -> Packing:
        below = self.states[bisect.bisect_right(self.grid, fx) - 1]
        return below if below.fx == fx else quasistatic.equilibrium(below, fx)


@pytest.fixture(scope="session")
def ramp(reference_packing: Callable[[float], Packing]) -> Callable[[float, float, int], Ramp]:
    """Ramps of the reference packing by friction, increment and number of increments, computed once."""

    @cache
    def make(mu: float, increment: float, count: int) -> Ramp:
        return Ramp(reference_packing(mu), increment * np.arange(1, count + 1))

    return make


@pytest.fixture(scope="session")
def path(ramp: Callable[[float, float, int], Ramp]) -> Ramp:
    """Equilibria of the reference packing with mu = 1, through its onset at F_x = 0.0218330564080."""
    return ramp(1.0, 1e-3, 22)


@pytest.fixture(params=[1.5, 1.0], ids=["Hertz", "harmonic"])
def cluster(request: pytest.FixtureRequest) -> Packing:
    """Six disks in every state of contact: sticking, near the bound, sliding either way, on the floor, across
    the box.

    Overlaps are a hundredth of a radius, so that finite differences have room; no balance is intended.
    """
    position = [[0.2, 0.49], [1.18, 0.493], [2.16, 0.488], [0.7, 1.34], [1.68, 1.345], [3.17, 0.492]]
    radius = [0.5, 0.5, 0.5, 0.5, 0.5, 0.5]
    law = MindlinLaw(kn=2e5, kt=2e5 * 2 / 7, mu=0.7, exponent=request.param)
    found = touching(position, radius, box_length=3.95)
    bare = Packing(position=position, radius=radius, contacts=found, law=law, box_length=3.95)
    share = np.resize([0.3, -0.99, 1.5, -0.2, 0.6, -1.5, 0.9], len(found))
    slip = share * law.slip_limit(bare.geometry.overlap)
    return Packing(
        position=position, radius=radius, angle=[0.1, -0.2, 0.3, 0.0, 1.0, 2.0], mass=[1.0, 2.0, 1.0, 0.5, 1.0, 1.0],
        inertia_factor=0.5, contacts=Contacts(found.i, found.j, slip), law=law, box_length=3.95,
        top=[False, False, False, True, True, False], fx=0.5, fy=3.0,
    )  # fmt: skip


@pytest.fixture
def bound(cluster: Packing) -> Packing:
    """Six disks with Coulomb's slider and dashpots; contacts slide at the bound in either direction, or stick."""
    law = MindlinLaw(2e3, 6e2, 0.7, exponent=cluster.law.exponent, cn=9.0, ct=4.0, coulomb=True)
    bare, c = replace(cluster, law=law), cluster.contacts
    share = np.resize([1.0, 0.3, -1.0, -0.4], len(c))
    return replace(bare, contacts=Contacts(c.i, c.j, share * law.slip_limit(bare.geometry.overlap)))
