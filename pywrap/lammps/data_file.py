"""A packing as a LAMMPS data file; and the order of the contacts in a dump."""

from pathlib import Path

from ...analysis import Packing
from ...analysis.files.formats.lammps_data import box_lines


def data_file(packing: Packing) -> str:
    """A LAMMPS data file of the disks, type 2 the upper layer; lengths to the bit, masses left to the decks."""
    x, y = packing.position.T
    lines = ["faultgouge packing", "", f"{len(packing)} atoms", "2 atom types", *box_lines(packing)]
    lines += ["", "Atoms # sphere", ""]
    columns = zip(packing.top.tolist(), (2 * packing.radius).tolist(), x.tolist(), y.tolist(), strict=True)
    lines += [f"{n} {1 + top} {d!r} 1.0 {a!r} {b!r} 0.0" for n, (top, d, a, b) in enumerate(columns, 1)]
    return "\n".join(lines) + "\n"


def sort_contacts(path: Path) -> None:
    """Sort the rows of a dump of contacts by their disks: LAMMPS writes them in the order of its neighbour lists.

    Force and slip of a contact are the same for either disk as the first one.
    """
    lines = path.read_text().splitlines()
    rows = 1 + next(k for k, line in enumerate(lines) if line.startswith("ITEM: ENTRIES"))
    pairs = []
    for line in lines[rows:]:
        first, second, *numbers = line.split()
        pairs.append((*sorted((int(first), int(second))), *numbers))
    lines[rows:] = [" ".join(map(str, pair)) for pair in sorted(pairs)]
    path.write_text("\n".join(lines) + "\n")
