"""A packing at rest under its load, at F_x = 0: settled from a loose start, or taken from a file.

May import: `lammps`, `equilibria`, `exchange`, `scenes`.
"""
