"""A scene with [damping]: which stages it changes, and which it leaves as they are to the bit."""

from dataclasses import replace

import numpy as np
import pytest

from faultgouge.analysis import damping_matrix, largest_damping_rate, largest_frequency, stable_timestep
from faultgouge.pywrap import Scene, SceneError, ramp
from faultgouge.pywrap.runs.undamped import time_step

SCENE = {
    "packing": {"disks": 20, "width": 3.6, "seed": 2},
    "law": {"kn": 2e5},
    "load": {"fy": 3.0},
    "ramp": {"step": 1e-3, "until": 2e-3},
}
DAMPING = {"damping": {"cn": 30.0, "ct": 20.0, "tau": 0.2}}


def test_equilibria_are_the_same_to_the_bit_and_time_steps_stay_below_what_dashpots_allow():
    plain, damped = (list(ramp(Scene.from_mapping(SCENE | more))) for more in ({}, DAMPING))
    for a, b in zip(plain, damped, strict=True):
        assert a.packing == replace(b.packing, law=a.packing.law, drag_time=None)
    packing = damped[0].packing
    rate, limit = largest_damping_rate(packing), stable_timestep(largest_frequency(packing))
    dense = damping_matrix(packing).toarray() - np.eye(60) / packing.drag_time  # masses and I0 are 1
    assert rate == pytest.approx(np.linalg.eigvalsh(dense).max(), rel=1e-10)
    longest = 20 * time_step(packing)
    assert rate * longest + (longest / limit) ** 2 == pytest.approx(1.0, rel=1e-12)
    with pytest.raises(SceneError, match="over the limit"):
        time_step(packing, 1.01 * longest)


@pytest.mark.parametrize("precision", ["double", "compensated"])
def test_rescaled_slips_climb_with_newtons_method(precision):
    """Increments of half the length lead to nearly the same slips; those of the total law are others."""
    law = {"law": {"kn": 2e5, "history": "rescaled"}, "precision": precision}
    found = []
    for step in (2e-2, 1e-2):
        *_, last = ramp(Scene.from_mapping(SCENE | law | {"ramp": {"step": step, "until": 0.12}}))
        assert last.packing.law.rescaled
        assert last.residual < 10 * last.floor
        found.append(last)
    *_, total = ramp(Scene.from_mapping(SCENE | {"ramp": {"step": 2e-2, "until": 0.12}}))
    scale = np.abs(total.packing.tangential_force).max()
    forces = [each.packing.tangential_force for each in (*found, total)]
    apart, different = (np.abs(force - forces[0]).max() / scale for force in forces[1:])
    assert apart < 0.1 * different
    assert different > 1e-3


def test_harmonic_disks_settle_and_climb():
    scene = Scene.from_mapping(SCENE | {"law": {"kn": 3e3, "exponent": 1}})
    assert all(each.packing.law.exponent == 1 and each.residual < 1e-10 for each in ramp(scene))
