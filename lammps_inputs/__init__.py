"""The LAMMPS input decks: settle.in, ramp.in, perturb.in, and the parts that they include."""
