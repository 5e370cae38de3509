"""A packing at rest under its load, at F_x = 0: settled from a loose random packing, or read from a file.

May import: `lammps`, `equilibria`, `exchange`, `scenes`.
"""
