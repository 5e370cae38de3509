"""A LAMMPS of one's own: any packing of its granular styles, as it stands.

`commands` reads what a deck says of contacts, `contact_law` measures these laws in a LAMMPS beside it, `reading` looks
into an instance without changing it, `from_lammps` puts a Snapshot together, and `compare_motion` proves it.

May import: lammps.
"""
