"""What pictures are drawn of: a layer along a path of loads, a column of two spheres, disks in another order."""

from dataclasses import replace

import numpy as np
import pytest
from reference_layer import SMALL

TURN = 4
"""The equilibrium at which `there_and_back` turns for the first time, with two complex pairs."""


@pytest.fixture(scope="session")
def there_and_back():
    """Equilibria of a small layer up through its onset, down to zero, and up again."""
    from faultgouge.pywrap import Scene, ramp

    changed = {"packing": SMALL["packing"] | {"seed": 2}, "ramp": {"step": 0.04, "until": [0.16, 0.0, 0.16]}}
    return [each.packing for each in ramp(Scene.from_mapping(SMALL | changed))]


@pytest.fixture(scope="session")
def column():
    """Two spheres, one on the other on a floor, at rest under their weight of one each."""
    from faultgouge.analysis import Material
    from faultgouge.analysis.elasticity.material_spheres import spheres_of_material

    contacts = np.array([0, 1]), np.array([-1, 0]), np.array([[0.0, 0.0, 0.49], [0.0, 0.0, 0.98]])
    return spheres_of_material(
        [[0.5, 0.5, 0.49], [0.5, 0.5, 1.47]], [0.5, 0.5], Material(kn=200.0, kt=150.0, exponent=1.0), mass=[1, 1],
        box=np.diag([1.0, 1.0, 3.0]), periodic=[True, True, False], contacts=contacts, normal_force=np.array([2.0, 1]),
        tangential_force=np.zeros((2, 3)),
    )  # fmt: skip


@pytest.fixture(scope="session")
def renumbered(there_and_back):
    """The layer where it turns, under another load, with its disks in another order: displacements of its modes are
    those of other disks."""
    from faultgouge.analysis.arrays import derive_frozen

    last = there_and_back[TURN]
    order = np.random.default_rng(1).permutation(len(last))
    i, j = (np.where(each < 0, each, np.argsort(order)[each]) for each in (last.contacts.i, last.contacts.j))
    moved = {name: getattr(last, name)[order] for name in ("position", "radius", "mass", "angle", "top")}
    return derive_frozen(last, fx=0.17, contacts=replace(last.contacts, i=i, j=j), **moved)
