"""Runs of a scene: its path of equilibria, its undamped run, and run.h5, which stores both.

May import: `lammps`, `equilibria`, `scenes`, `settling`.
"""
