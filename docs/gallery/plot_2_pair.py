"""
The pair through its onset
==========================

Two real eigenvalues of the stability operator merge at the onset :math:`F_x^c` and become complex conjugates.
"""

import numpy as np

from faultgouge.analysis import find_onset, pair_eigenvalues
from faultgouge.figures import PairCurve, draw_pair
from faultgouge.pywrap import Engine, Scene, equilibrate, ramp

scene = Scene.from_mapping(
    {
        "packing": {"seed": 4, "disks": 40, "width": 7.5},
        "law": {"kn": 2e5},
        "load": {"fy": 3.0},
        "ramp": {"step": 1e-3, "until": 0.05},
    }
)
states = list(ramp(scene))
loads = np.array([each.fx for each in states])
with Engine(states[0].packing) as engine:

    def packing_at(fx):
        """The equilibrium at fx, from the one below it: friction remembers the way."""
        return equilibrate(engine, [each for each in states if each.fx <= fx][-1], fx=fx).packing

    onset = find_onset(packing_at, loads)
print(onset)

# %%
# The pair is followed from the onset to smaller loads and to larger ones.

first = onset.windows[0]
packings = [each.packing for each in states]
above = loads > first.fx_onset
before = pair_eigenvalues([each for each, up in zip(packings, above, strict=True) if not up][::-1], first.eigenvalue)
after = pair_eigenvalues([each for each, up in zip(packings, above, strict=True) if up], first.eigenvalue)
curve = PairCurve(mu=1.0, fx=loads, eigenvalues=np.concatenate([before[::-1], after]), fx_c=first.fx_onset)
figure = draw_pair([curve])
