"""The onset of a scene, undamped and damped, with the error that its path of equilibria adds; on one rank or on many.

May import: `lammps`, `equilibria`, `scenes`, `settling`, `runs`.
"""
