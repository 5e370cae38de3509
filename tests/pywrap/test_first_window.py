"""Windows of settled packings: the first one of hundreds of disks, against LAPACK, and one where contacts change."""

import numpy as np
import pytest
from scipy.linalg import eigvals

from faultgouge.analysis import find_onset
from faultgouge.analysis.motion.eigenvalues import unit_rounding
from faultgouge.analysis.windows import System
from faultgouge.pywrap import Engine, Scene, settle
from faultgouge.pywrap.runs.ramp_loads import ramp_loads
from faultgouge.pywrap.runs.scene_path import scene_path


@pytest.mark.long
def test_no_pair_is_complex_below_the_first_window():
    """360 disks, whose first pair is complex by 3e-5 of itself: by less than clusters of modes may be in error."""
    packing, step = {"disks": 360, "width": 22.6, "seed": 5}, 2 / 360
    keys = {"packing": packing, "law": {"kn": 2e5}, "ramp": {"step": step, "until": 3 * step}}
    scene = Scene.from_mapping({**keys, "load": {"fy": 3.0}})
    start = settle(scene)
    with Engine(start.packing) as engine:
        path = scene_path(engine, start, scene)
        onset = find_onset(path, step * np.arange(4))
        assert (onset.complete, onset.doubtful) == (False, ())
        loads = [*np.linspace(0, onset.fx_c - 1e-3 * step, 5), onset.fx_c + 1e-3 * step]
        matrices = [System.of(path(float(fx))).stiffness.toarray() for fx in loads]
    imaginary = [np.abs(eigvals(each, check_finite=False).imag).max() for each in matrices]
    # A double eigenvalue is uncertain by the root of u |A| times its coupling, which is of order 1.
    noise = 10 * np.sqrt(unit_rounding(matrices[-1]))
    assert max(imaginary[:-1]) < noise < imaginary[-1]


BESIDE_A_SLIDING_CONTACT = {
    "precision": "compensated",
    "packing": {"disks": 30, "seed": 98},
    "law": {"kn": 2e3, "kt": "kn", "mu": 0.07},
    "ramp": {"step": 4e-4, "until": 0.028},
}
"""The contact slides from 0.0246 on and bends the levels: seen from both ends they seem to stay apart."""
ACROSS_OTHER_LEVELS = {
    "packing": {"disks": 100, "width": 11.9, "top": 10, "seed": 9},
    "law": {"kn": 2e5, "mu": 0.2},
    "ramp": {"step": 2e-3, "until": 0.012},
}
"""A rattling mode falls from 690 to 289 through four others; its slopes at both ends are those of flat levels."""


@pytest.mark.long
@pytest.mark.parametrize(
    ("keys", "apart", "window", "known"),
    [
        (BESIDE_A_SLIDING_CONTACT, [0.024, 0.028], (0.0241548556, 0.0244768428), 1e-9),
        (ACROSS_OTHER_LEVELS, None, (0.011169096612, 0.011204647041), 1e-10),
    ],
    ids=["beside a contact that begins to slide", "of a level that bends across another"],
)
def test_a_window_is_found_between_loads_far_apart(keys, apart, window, known):
    scene = Scene.from_mapping({**keys, "load": {"fy": 3.0}})
    with Engine((start := settle(scene)).packing) as engine:
        path = scene_path(engine, start, scene)
        list(path.climb(ramp_loads(scene)[1:]))
        (found,) = find_onset(path, ramp_loads(scene) if apart is None else apart).windows
    assert (found.fx_onset, found.fx_end) == pytest.approx(window, abs=known)
