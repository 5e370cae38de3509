"""
A packing and its unstable mode
===============================

This example settles forty disks, and shears them to a load at which one pair of eigenvalues is complex.
"""

from faultgouge.analysis import spectrum
from faultgouge.figures import draw_mode, draw_packing
from faultgouge.pywrap import Scene, reach

scene = Scene.from_mapping({"packing": {"seed": 4, "disks": 40, "width": 7.5}, "law": {"kn": 2e5}, "load": {"fy": 3.0}})
*_, last = reach(scene, 0.05)
packing = last.packing
print(packing)

# %%
# Bars are contacts, with a width proportional to the normal force. The colour shows the mobilised fraction of
# Coulomb's bound.

chains = draw_packing(packing)

# %%
# The spectrum has one complex pair. The motion of this pair grows exponentially.

found = spectrum(packing)
print(found)
print(f"D grows as exp({found.growth_rate():.4f} t)")

# %%
# Arrows are displacements and colours rotations, at two moments that are a quarter of a period apart.

motion = draw_mode(packing)
