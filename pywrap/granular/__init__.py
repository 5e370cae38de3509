"""A LAMMPS of one's own: any packing of its granular styles, as it stands.

- `granular_commands`: the commands of a deck that concern contacts, and which coordinates they move;
  `contact_law_measurement`: the laws of these contacts, measured in a second LAMMPS
- `look_in_a_copy`: the instance and its log, in a copy of the process; `lammps_arrays`: an instance in numbers;
  `looks`: all numbers of one look, and whether forces follow the time
- `configuration_by_laws`: a Configuration with the measured laws; `configuration_by_differences`: one with K and C by
  differences of LAMMPS's forces
- `balance`: whether a packing rests
- `motion_proof`: a few of LAMMPS's own steps beside those of the Configuration; `motion_compared`: a longer motion
- `from_lammps`: the choice among all of these
- `relax`: an instance brought to rest; `lammps_path`: its loading path; `growth_followed`: where a motion that grows
  ends; `run_deck`: the deck of a user, carried out by LAMMPS, and the last state of one that cannot be taken

May import: `lammps`, `load_path`.
"""
