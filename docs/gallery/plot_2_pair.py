"""
The pair through its onset
==========================

Two real eigenvalues of the stability operator merge at the onset :math:`F_x^c` and become complex conjugates.
"""

import numpy as np

from faultgouge.analysis.onset.pair_form import pair_eigenvalues
from faultgouge.figures import PairCurve, draw_pair
from faultgouge.pywrap import Scene
from faultgouge.pywrap.onset.undamped import onset_run

scene = Scene.from_mapping(
    {
        "packing": {"seed": 4, "disks": 40, "width": 7.5},
        "law": {"kn": 2e5},
        "load": {"fy": 3.0},
        "ramp": {"step": 1e-3, "until": 0.05},
    }
)
run = onset_run(scene, mu=1.0)
print(run)

# %%
# The pair is followed from the onset to smaller loads and to larger ones.

first = run.onset.windows[0]
packings = [each.packing for each in run.equilibria]
loads = np.array([each.fx for each in run.equilibria])
above = loads > first.fx_onset
before = pair_eigenvalues([each for each, up in zip(packings, above, strict=True) if not up][::-1], first.eigenvalue)
after = pair_eigenvalues([each for each, up in zip(packings, above, strict=True) if up], first.eigenvalue)
curve = PairCurve(mu=1.0, fx=loads, eigenvalues=np.concatenate([before[::-1], after]), fx_c=first.fx_onset)
figure = draw_pair([curve])
