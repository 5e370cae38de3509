"""Newton's method from one equilibrium to the next at another load; rattlers in the way are moved.

May import: `lammps`.
"""
