"""What the analysis of motion and of windows refuses before work starts, and the word that names the culprit."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array
from table_rows import rows_of
from three_disks import balanced, three_disks

from faultgouge.analysis import FaultgougeError, fastest_growing, find_onset, fit_growth, linear_response, stability
from faultgouge.analysis import one_sided_motion as one_sided
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.analysis.motion import stability as stability_module
from faultgouge.analysis.responses.signals import Signal

AT_REST = balanced(three_disks())
HELD = derive_frozen(AT_REST, free=np.array([False, True, True]))

ASKED = {
    "signal": lambda p, time, value: Signal(time, value),
    "fit": lambda p, time, msd: fit_growth(time, msd, 0.5, 1e9),
    "response": lambda p, **given: linear_response(p, **({"times": [1.0]} | given)),
    "damped response": lambda p, **given: linear_response(replace(p, drag_time=1.0), [1.0], **given),
    "motion": lambda p, **given: one_sided(p, **given),
    "verdict": lambda p, **given: stability(AT_REST, **given),
    "verdict, one held": lambda p, **given: stability(HELD, **given),
    "search": lambda p, cn, loads: find_onset(lambda fx: p.with_dissipation(cn=cn), loads, dissipation=True),
    "fastest": lambda p, size, periods: fastest_growing(csr_array(np.eye(size)), periods=periods),
}


@pytest.mark.parametrize("cluster", [1.0], indirect=True)
@pytest.mark.parametrize(("asked", "given", "says"), rows_of("analysis/motion/refused_motions.txt", np=np))
def test_refused(asked, given, says, cluster, monkeypatch):
    monkeypatch.setattr(stability_module, "linear_verdict", None)
    with pytest.raises((ValueError, FaultgougeError), match=says):
        ASKED[asked](cluster, **given)
