"""A ramp in MDAnalysis: the upper layer selected by its type, and how far the layer goes."""

from pathlib import Path

import MDAnalysis
import numpy as np

import faultgouge.analysis.files.mdanalysis
from faultgouge.pywrap import Record, Scene, ramp

scene = Scene.from_mapping(
    {
        "packing": {"seed": 4, "disks": 40, "width": 7.5},
        "law": {"kn": 2e5},
        "load": {"fy": 3.0},
        "ramp": {"step": 1e-2, "until": 0.05},
    }
)
with Record(Path("run.h5"), scene) as record:
    for state in ramp(scene):
        record.append(state)
    record.finish()

universe = MDAnalysis.Universe("run.h5")
layer = universe.select_atoms("type top")
place = np.array([ts.data["position"][layer.indices, :2] for ts in universe.trajectory])
moved = faultgouge.analysis.mean_square_displacement(place, place[0], faultgouge.load("run.h5").box_length)
print(f"{len(universe.atoms)} disks, {len(layer)} of them in the upper layer, {len(universe.trajectory)} equilibria")
print("sqrt(D) of the layer:", *(f"{each**0.5:.3e}" for each in moved))
