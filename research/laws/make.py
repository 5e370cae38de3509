"""Both laws of friction side by side: the tables computed, the page made from them, or a tenth of them computed again.

python -m research.laws.make compute FOLDER [SET ...]   what the tables lack of all sets, resumable; an hour
python -m research.laws.make page                       README.md and laws.json, from the tables
python -m research.laws.make check FOLDER [SET ...]     one packing in ten once more, compared with the tables

Without a SET, such as "force 100", all of them. From the folder of the repository.
"""

import sys
from math import ceil
from pathlib import Path

from research.laws.page import write_page
from research.laws.sets import sets
from research.modes.make import compute_seeds, different
from research.modes.packing_rows import computed_again, condense, read_known, table_of

HERE = Path(__file__).parent
TABLES = HERE / "tables"

TOLERANCES = {"draws": 1e-2, "error": 0.5, "overlap": 0.5}
"""Relative difference of numbers whose name has one of these words. What a run measures: a coordinate is rounded by
2e-15, which is 2e-4 of the push, and D is a square that beats; 2e-3 of D and 1e-5 of rates were seen. And stated errors
and the overlap y^H x at an onset, which say where rounding ends the search for a root; F_x^c agrees within it."""


def compute(folder: Path, names: list[str], share: float = 1.0, tables: Path | None = None) -> None:
    """A share of the packings of each set, on one process, but for those of the tables."""
    for name, sweep in sets().items():
        rows = {} if tables is None else read_known(tables, name)
        seeds = [point.values["packing.seed"] for point in sweep.points]
        seeds = [seed for seed in seeds[: ceil(share * len(seeds))] if seed not in rows]
        if not names or name in names:
            compute_seeds(folder, name, sweep, seeds, workers=1)


def check(folder: Path, names: list[str]) -> None:
    """The first tenth of the packings of each set that has a table, compared with it: every number of every load."""
    compute(folder, names or [name for name in sets() if table_of(TABLES, name).exists()], 0.1)
    compared, wrong = 0, []
    for packing, *rows in computed_again(folder, TABLES):
        compared += 1
        one, other = ({key: each[key] for key in each if key != "cpu_seconds"} for each in rows)
        wrong += [f"{packing}: {key}" for key in different(one, other, allowed=TOLERANCES)]
    said = "the same" if not wrong else f"{len(wrong)} numbers differ"
    print("\n".join([f"{compared} packings compared: {said}", *wrong]))
    sys.exit(len(wrong) > 0)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["compute", folder, *names]:
            compute(Path(folder), names, tables=TABLES)
            condense(Path(folder), TABLES)
        case ["page"]:
            print(write_page(TABLES, HERE))
        case ["check", folder, *names]:
            check(Path(folder), names)
        case _:
            sys.exit(__doc__)
