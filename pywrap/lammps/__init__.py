"""A LAMMPS instance with one packing: instances, deck parts, and the transfer of all numbers into LAMMPS and out of it.

`engine` is the door; `trial` is what comes out after a displacement, `dynamics` what comes out of a run.

May import: `faultgouge.analysis`.
"""
