"""The deck of a small pile, of disks or of spheres, that users import."""

DECK = """
units lj
dimension {d}
atom_style sphere
boundary f f {z}
newton off
comm_modify vel yes
region box block -2 2 {box} units box
create_box 1 box
create_atoms 1 single -0.45 {a} units box
create_atoms 1 single 0.45 {a} units box
create_atoms 1 single 0 {b} units box
set group all diameter 1.0
set group all density 1.0
variable kn equal 1e3
pair_style gran/hertz/history ${{kn}} NULL 10 NULL 0.9 1
pair_coeff * *
fix floor all wall/gran hertz/history ${{kn}} NULL 10 NULL 0.9 1 {plane} {word}
fix load all gravity 1.0 vector {down}
fix move all nve/sphere
fix drag all viscous 1.0
timestep 0.005
run 6000
"""

FLAT = {"d": 2, "z": "p", "box": "0 4 -0.5 0.5", "a": "0.5 0", "b": "1.3 0", "plane": "yplane 0 NULL", "down": "0 -1 0"}

ROUND = {"d": 3, "z": "f", "box": "-2 2 0 4", "a": "0 0.5", "b": "0 1.3", "plane": "zplane 0 NULL", "down": "0 0 -1"}
