"""A packing as a LAMMPS data file; and the order of the contacts in a dump."""

from pathlib import Path

from ...analysis import Packing
from ...analysis.files.formats.lammps_data import box_lines


def data_file(packing: Packing) -> str:
    """A LAMMPS data file of the disks, type 2 the upper layer; lengths to the bit, masses left to the decks."""
    columns = packing.top.tolist(), (2 * packing.radius).tolist(), *packing.position.T.tolist()
    rows = enumerate(zip(*columns, strict=True), 1)
    disks = [f"{n} {1 + top} {d!r} 1.0 {x!r} {y!r} 0.0" for n, (top, d, x, y) in rows]
    head = ["faultgouge packing", "", f"{len(packing)} atoms", "2 atom types", *box_lines(packing)]
    return "\n".join([*head, "", "Atoms # sphere", "", *disks, ""])


def sort_contacts(path: Path) -> None:
    """Sort the rows of a dump of contacts by their disks: LAMMPS writes them in the order of its neighbour lists.

    Force and slip of a contact are the same for either disk as the first one.
    """
    lines = path.read_text().splitlines()
    rows = 1 + next(k for k, line in enumerate(lines) if line.startswith("ITEM: ENTRIES"))
    split = [line.split() for line in lines[rows:]]
    pairs = sorted([*sorted((int(i), int(j))), *numbers] for i, j, *numbers in split)
    path.write_text("\n".join([*lines[:rows], *(" ".join(map(str, pair)) for pair in pairs), ""]))
