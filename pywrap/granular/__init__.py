"""A LAMMPS of one's own: any packing of its granular styles, as it stands.

- `granular_commands`: the commands of a deck that concern contacts; `contact_law_measurement`: the laws of these
  contacts, measured in a second LAMMPS, and where both disagree
- `instance_queries`, `lammps_arrays`: an instance in numbers; `looks`: all numbers of one look; `look_in_a_copy`: looks
  that leave the instance as it was
- `configuration_by_laws`: a Configuration with the measured laws
- `configuration_by_differences`: a Configuration with K and C by differences of LAMMPS's forces (`force_differences`),
  by displacements of the particles of one of the `colours` along the coordinates that `mobility` finds to move, bodies
  among them (`translating_bodies`)
- `balance`: whether a packing rests, and its walls do
- `motion_proof`: a few of LAMMPS's own steps beside those of the Configuration; `acting_fixes`: what explains a
  difference
- `from_lammps`: the choice among all of these; `compare_motion`: a longer motion beside LAMMPS's
- `relax`: an instance brought to rest; `lammps_path`: its loading path; `run_deck`: the deck of a user, carried out by
  LAMMPS; `kept_state`: the last state of a deck that cannot be taken

May import: `lammps`, `load_path`.
"""
