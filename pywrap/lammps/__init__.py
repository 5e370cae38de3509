"""LAMMPS with one packing in it: instances, deck parts, and the way of every number into LAMMPS and out of it.

`engine` is the door; `trial` is what comes out after a displacement, `dynamics` what comes out of a run.

May import: `faultgouge.analysis`.
"""
