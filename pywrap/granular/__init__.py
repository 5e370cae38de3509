"""A LAMMPS of one's own: any packing of its granular styles, as it stands.

`granular_commands` reads what a deck says of contacts, `contact_law_measurement` measures these laws in a LAMMPS beside
it, and `law_remarks` compares both. `instance_queries` and `lammps_arrays` read an instance, `looks` all that a look
needs, and `look_in_a_copy` leaves the instance as it was. `contact_geometry` sorts contacts by their laws, of which
`configuration_by_laws` makes a Configuration. `force_differences` measures K and C by LAMMPS's forces where there is no
law, with those of a `force_probe` on particles of one of the `colours`, on the coordinates that `mobility` finds to
move, bodies among them (`translating_bodies`), for `configuration_by_differences`. `balance` says whether a
packing is at rest, and `moving_regions` whether its walls are. `motion_proof` compares a few of LAMMPS's own steps
(`lammps_steps`) with those of the Configuration (`linear_steps`), and `acting_fixes` explains why they differ.
`from_lammps` chooses among all of these; `compare_motion` compares a longer motion. `relax` brings an instance to rest,
`lammps_path` makes its loading path, and `run_deck` runs the deck of a user, once; `kept_state` keeps its state where
it cannot be taken.

May import: `lammps`, `load_path`.
"""
