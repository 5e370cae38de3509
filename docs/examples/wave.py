"""A wave from a file shakes the layer: the motion in LAMMPS beside the linear response.

The force on each disk of the upper layer is a pulse, written as a file of times and values. Below the onset a small
pulse leaves a small vibration, in proportion to the pulse.
"""

from pathlib import Path

import numpy as np

from faultgouge.pywrap import Scene, perturb, reach

times = np.linspace(0, 4, 401)
Path("pulse.txt").write_text("\n".join(f"{t:.4f} {np.sin(np.pi * t / 4) ** 2:.10f}" for t in times))


def largest_displacement(scale):
    """sqrt(D) at its largest, for a pulse of this height."""
    scene = Scene.from_mapping(
        {
            "packing": {"seed": 4, "disks": 40, "width": 7.5},
            "law": {"kn": 2e5},
            "load": {"fy": 3.0},
            "perturb": {"fx": 0.01, "time": 6.0, "signal": str(Path("pulse.txt").resolve()), "scale": scale},
        }
    )
    *_, start = reach(scene, 0.01)
    return max(sample.msd for sample in perturb(scene, start)) ** 0.5


small, large = largest_displacement(1e-7), largest_displacement(1e-6)
print(f"sqrt(D) up to {small:.3e} and {large:.3e}: a pulse ten times as high moves the layer {large / small:.3f} times")
