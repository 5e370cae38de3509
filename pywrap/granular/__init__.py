"""A LAMMPS of one's own: any packing of its granular styles, as it stands.

`granular_commands` reads what a deck says of contacts, `contact_law_measurement` measures these laws in a LAMMPS beside
it, `instance_queries` and `lammps_arrays` read an instance, `look_in_a_copy` leaves it as it was, `from_lammps` puts a
Configuration together, `compare_motion` proves it, `lammps_equilibrium_path` makes a path along a load, and `run_deck`
runs the deck of a user, once.

May import: lammps.
"""
