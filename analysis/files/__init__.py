"""Files: run.h5 and its checks, dumps of LAMMPS, packings by hand in JSON, signals; files that are whole or not there.

May import: `packing`, `motion.signals`.
"""
