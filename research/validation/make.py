"""Closed forms and results of others beside the program: the numbers computed, and the page made from them.

python -m research.validation.make compute      validation.json; a minute
python -m research.validation.make page         README.md from it

From the folder of the repository.
"""

import json
import sys
from pathlib import Path

from faultgouge.figures import render
from research.tables import write_json
from research.validation import compute

HERE = Path(__file__).parent
CELLS = (2, 3, 3)


def numbers() -> dict[str, object]:
    """All numbers of the page; circles are of the disks as they rest, before others have sheared them."""
    disks = compute.disks_at_rest()
    circles = compute.circles(disks)
    return {
        "duffy_mindlin": compute.duffy_mindlin((0.0, 0.1, 0.2, 0.3, 0.45), (1e-3, 1e-5, 1e-7)),
        "lattice": [
            compute.lattice_dynamics(compute.crystal_in_lammps(overlap, CELLS), CELLS) for overlap in (1e-2, 1e-4)
        ],
        "ishima": compute.ishima(disks),
        "circles": circles,
        "density": compute.density_of_states(),
        "time_steps": compute.time_steps((0.0, 0.1, 0.2, 0.3, 0.45), 1e-3),
    }


def write_page(folder: Path) -> Path:
    """README.md of the stored numbers."""
    page = folder / "README.md"
    found = json.loads((HERE / "validation.json").read_text())
    page.write_text(render("research.validation", "README.md.j2", **found))
    return page


if __name__ == "__main__":
    if sys.argv[1:] == ["compute"]:
        write_json(HERE / "validation.json", numbers())
    elif sys.argv[1:] == ["page"]:
        write_page(HERE)
    else:
        sys.exit(__doc__)
