"""Runs of a scene: its ramp, its loading path, its undamped run, and run.h5, which stores them.

May import: `lammps`, `load_path`, `equilibria`, `scenes`, `settling`.
"""
