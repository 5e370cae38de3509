"""What the analysis of motion and of windows refuses before work starts, and the word that names the culprit."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.sparse import csr_array
from three_disks import balanced, three_disks

from faultgouge.analysis import FaultgougeError, fastest_growing, find_onset, fit_growth, linear_response, stability
from faultgouge.analysis import one_sided_motion as one_sided
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.analysis.motion import stability as stability_module
from faultgouge.analysis.responses.signals import Signal

UNEVEN = np.geomspace(1, 1e5, 200)
AT_REST = balanced(three_disks())
HELD = derive_frozen(AT_REST, free=np.array([False, True, True]))
SIGNALS = [
    ([0.0], [1.0], "two rows or more"),
    ([0.0, 1.0], [1.0], "two columns of one length"),
    ([0.0, 1.0], [1.0, np.nan], "row 2 of the signal has the value nan"),
    ([0.0, np.inf], [1.0, 1.0], "row 2 of the signal has the time inf"),
    ([0.0, 2.0, 1.0], [1.0, 1.0, 1.0], "the time 1 in row 3 of the signal is not later than the 2 before it"),
]
RUNS = [
    (np.arange(10), np.ones(9), "one length"),
    ([0, 1, 3] * 40, np.ones(120), "must increase"),
    (UNEVEN, np.exp(1e-4 * UNEVEN), "stretches with"),
    (np.arange(100), np.ones(100), "decade"),
    (np.arange(100), np.zeros(100), "0 samples"),
    (np.arange(30), np.exp(np.arange(30)), "samples"),
]
RESPONSES = [
    ({"times": [-1.0]}, "negative"),
    ({"times": [[1.0]]}, "list"),
    ({"times": [0.05], "dt": 0.02}, "multiples"),
    ({"dt": -0.1}, "dt = -0.1 must be positive"),
    ({"force": np.zeros(5)}, "force has shape"),
    ({"initial": np.zeros((3, 6))}, "initial has shape"),
]
MOTIONS = [
    ({"rise": "fy", "times": [1.0]}, 'rise is "fx" of a packing with an upper layer, or an array of forces'),
    *(({"times": times}, "increasing order") for times in ([1.0, 0.5], [-1.0], [np.nan])),
]
VERDICTS = [
    (AT_REST, {"rise": "fx"}, "upper layer"),
    (AT_REST, {"rise": np.zeros((3, 2))}, "a force on no particle that moves"),
    (HELD, {"rise": np.outer([1.0, 0.0, 0.0], [1.0, 0.0])}, "a force on no particle that moves"),
    *((AT_REST, {"time": time}, "followed is a positive number, not ") for time in (-1, 0, np.nan, "long")),
]
SEARCHES = [
    *((1.0, loads, "increasing") for loads in ([0.02], [0.02, 0.01], [0.0, np.nan])),
    (0.0, [0.0, 0.001], "no dissipation"),
]


def search(cn, loads, packing):
    return find_onset(lambda fx: packing.with_dissipation(cn=cn), loads, dissipation=True)


REFUSED = [
    *((lambda p, given=given: Signal(*given), says) for *given, says in SIGNALS),
    *((lambda p, given=given: fit_growth(*given, 0.5, 1e9), says) for *given, says in RUNS),
    *((lambda p, given=given: linear_response(p, **({"times": [1.0]} | given)), says) for given, says in RESPONSES),
    (lambda p: linear_response(replace(p, drag_time=1.0), [1.0], dt=0.1), "undamped"),
    *((lambda p, given=given: one_sided(p, **given), says) for given, says in MOTIONS),
    *((lambda p, at=at, given=given: stability(at, **given), says) for at, given, says in VERDICTS),
    *((partial(search, *given), says) for *given, says in SEARCHES),
    (lambda p: fastest_growing(csr_array(np.eye(40)), periods=(100.0, 10.0)), "100 to 10 periods"),
    (lambda p: fastest_growing(csr_array(np.eye(4)), periods=(1.0, 2.0)), "4 coordinates"),
]


@pytest.mark.parametrize("cluster", [1.0], indirect=True)
@pytest.mark.parametrize(("asked", "says"), REFUSED)
def test_refused(asked, says, cluster, monkeypatch):
    monkeypatch.setattr(stability_module, "linear_verdict", None)
    with pytest.raises((ValueError, FaultgougeError), match=says):
        asked(cluster)
