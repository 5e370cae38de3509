"""A packing as a LAMMPS data file."""

from ...analysis import Packing


def data_file(packing: Packing) -> str:
    """A LAMMPS data file of the disks, type 2 the upper layer; lengths to the bit, masses left to the decks."""
    x, y = packing.position.T
    lines = [
        "faultgouge packing",
        "",
        f"{len(packing)} atoms",
        "2 atom types",
        *box_lines(packing),
        "",
        "Atoms # sphere",
        "",
    ]
    columns = zip(packing.top.tolist(), (2 * packing.radius).tolist(), x.tolist(), y.tolist(), strict=True)
    lines += [f"{n} {1 + top} {d!r} 1.0 {a!r} {b!r} 0.0" for n, (top, d, a, b) in enumerate(columns, 1)]
    return "\n".join(lines) + "\n"


def box_lines(packing: Packing) -> list[str]:
    """The box of a data file, with room around the disks."""
    x, y = packing.position.T
    period = packing.box_length
    margin = 4 * packing.radius.max()
    left, right = (0.0, period) if period is not None else (x.min() - margin, x.max() + margin)
    # open above: a layer that erupts has room for its own height twice more
    top = 3 * (y.max() + margin)
    # LAMMPS makes bins along z, too: the disks lie in the plane z = 0, in a box as thick as one of them
    thickness = float(packing.radius.min())
    return [
        f"{float(left)!r} {float(right)!r} xlo xhi",
        f"{-float(margin)!r} {float(top)!r} ylo yhi",
        f"{-thickness!r} {thickness!r} zlo zhi",
    ]
