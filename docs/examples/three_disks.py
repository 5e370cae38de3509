"""Three disks: nine eigenvalues, and the load at which two of them merge.

Friction makes the operator non-symmetric as F_x grows; the lesson of the documentation asks why.
"""

import faultgouge as fg

scene = fg.Scene.from_mapping(
    {
        "packing": {"disks": 3, "radii": [0.5], "top": 1, "width": 2.8},
        "law": {"kn": 2e5},
        "load": {"fy": 3.0},
        "ramp": {"step": 0.05, "until": 2.4},
    }
)
for state in fg.ramp(scene):  # equilibria at F_x = 0, 0.05, ..., 2.4
    if round(state.fx / 0.05) % 12 == 0:
        values = sorted(fg.spectrum(state.packing).eigenvalues.real.round(1).tolist())
        print(f"F_x = {state.fx:.1f}:", values)

onset = fg.onset(scene)
print(f"two eigenvalues merge at F_x = {onset.fx_c:.8f}, at {onset.windows[0].eigenvalue:.2f}")
