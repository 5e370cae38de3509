"""Twelve spheres in a box: the operator, a vibration, and LAMMPS's own motion as a check."""

import numpy as np
from lammps import lammps

from faultgouge.analysis import normal_modes, stiffness_matrix
from faultgouge.pywrap import compare_motion, from_lammps

DECK = """
units           lj
atom_style      sphere
boundary        p p f
newton          off
comm_modify     vel yes
region          box block 0 2.4 0 2.4 0 12
create_box      1 box
region          pile block 0.3 2.1 0.3 2.1 0.6 8
create_atoms    1 random 12 7 pile overlap 0.9 maxtry 1000
set             group all diameter 1.0 density 1.9
pair_style      gran/hertz/history 2e3 NULL 20 NULL 0.5 1
pair_coeff      * *
fix             floor all wall/gran hertz/history 2e3 NULL 20 NULL 0.5 1 zplane 0 NULL contacts
fix             weight all gravity 1.0 vector 0 0 -1
fix             move all nve/sphere
fix             drag all viscous 1.0
timestep        0.004
run             30000
"""

lmp = lammps(cmdargs=["-screen", "none"])
lmp.commands_string(DECK)
packing = from_lammps(lmp)
K = stiffness_matrix(packing)
print(f"{len(packing)} spheres, K has {K.shape[0]} rows")
modes = normal_modes(packing)
moving = modes.values.real > 1e-6 * modes.values.real.max()  # without the spins that no contact feels
lowest = modes.values.real[moving].min()
print(f"lowest vibration: period {2 * np.pi / np.sqrt(lowest):.2f}, highest eigenvalue {modes.values.real.max():.1f}")
proof = compare_motion(lmp, packing, time=0.5, amplitude=1e-6, timestep=1e-4)
print(f"LAMMPS's motion differs from that of K and C by {proof.difference:.1e}")
