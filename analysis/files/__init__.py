"""Files: run.h5 and its checks, LAMMPS dumps, packings as JSON, signals; files are either complete or absent.

May import: `packing`, `responses.signals`.
"""
