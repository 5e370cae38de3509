"""A LAMMPS of one's own: any packing of its granular styles, as it stands.

`granular_commands` reads what a deck says of contacts, `contact_law_measurement` measures these laws in a LAMMPS beside
it, `instance_queries` and `lammps_arrays` read an instance, `look_in_a_copy` leaves it as it was, `force_differences`
measures K and C by LAMMPS's forces where there is no law, on the coordinates that `mobility` finds to move,
`from_lammps` puts a Configuration together, `compare_motion` proves it, `relax` brings an instance to rest,
`lammps_equilibrium_path` makes a path along a load, and `run_deck` runs the deck of a user, which `deck_trial` has
tried without its runs; `kept_state` keeps its state where it cannot be taken.

May import: lammps.
"""
