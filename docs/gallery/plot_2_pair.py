"""
The pair through its onset
==========================

Two real eigenvalues of the stability operator merge at the onset :math:`F_x^c` and become complex conjugates.
"""

import faultgouge
from faultgouge.figures import draw_pair

scene = faultgouge.Scene.from_mapping(
    {
        "packing": {"seed": 4, "disks": 40, "width": 7.5},
        "law": {"kn": 2e5},
        "load": {"fy": 3.0},
        "ramp": {"step": 1e-3, "until": 0.05},
    }
)
print(faultgouge.onset(scene))

# %%
# The pair is followed from the onset to smaller loads and to larger ones. The loads crowd at the onset.

figure = draw_pair([faultgouge.pair(scene)])
