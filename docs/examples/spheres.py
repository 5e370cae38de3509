"""Spheres on a slope, from a deck in a file: do they move, and what if the slope grows steeper?"""

from pathlib import Path

import numpy as np

from faultgouge import draw, load, stability

Path("slope.in").write_text("""
units           lj
atom_style      sphere
boundary        p p f
newton          off
comm_modify     vel yes
region          box block 0 3 0 3 0 16
create_box      1 box
region          pile block 0.5 2.5 0.5 2.5 1 10
create_atoms    1 random 30 11 pile overlap 0.95 maxtry 1000
set             group all diameter 1.0 density 1.9
pair_style      granular
pair_coeff      * * hertz 1e4 40 tangential mindlin_rescale/force 1e4 1.0 0.5 damping viscoelastic
fix             floor all wall/gran granular hertz 1e4 40 tangential mindlin_rescale/force 1e4 1.0 0.5 &
                damping viscoelastic zplane 0 NULL contacts
fix             weight all gravity 1.0 vector 0.2 0 -1
fix             move all nve/sphere
fix             drag all viscous 1.0
timestep        0.002
run             60000
""")
packing = load("slope.in")
print(packing)
steeper = np.tile([1.0, 0.0, 0.0], (len(packing), 1)) * packing.mass[:, None]  # gravity that leans further
print(stability(packing, rise=steeper))
draw(packing).savefig("slope.png")
