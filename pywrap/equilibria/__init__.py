"""From one equilibrium to the next at another load, by Newton's method; rattlers are moved out of its way.

May import: `lammps`.
"""
