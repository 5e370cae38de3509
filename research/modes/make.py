"""The study of complex modes: its tables computed, its page made from them, or a tenth of them computed again.

python -m research.modes.make compute FOLDER [SET ...]   what the tables lack of all sets, resumable; hours
python -m research.modes.make page                       the pages, modes.json and the pictures, from the tables
python -m research.modes.make check FOLDER [SET ...]     one packing in ten once more, compared with the tables

Without a SET, such as "loss 100", all of them.
"""

import sys
from collections.abc import Mapping
from math import isclose
from pathlib import Path
from typing import Any

from faultgouge.studies.sweep import Sweep, run_sweep
from research.modes.packing_rows import computed_again, condense, read_known
from research.modes.page import write_page
from research.modes.sets import SHARES, sets

HERE = Path(__file__).parent
TABLES = HERE / "tables"


def compute(folder: Path, names: list[str], shares: tuple[float, ...] = SHARES, tables: Path | None = None) -> None:
    """The sweeps of the study, round by round, but for the packings of the tables."""
    for share in shares:
        for name, sweep in sets(share).items():
            rows = {} if tables is None else read_known(tables, name)
            seeds = [point.values["packing.seed"] for point in sweep.points if point.values["packing.seed"] not in rows]
            if not names or name in names:
                compute_seeds(folder, name, sweep, seeds, workers=None)


def compute_seeds(folder: Path, name: str, sweep: Sweep, seeds: list[int], workers: int | None) -> None:
    """The packings of some seeds of a set, in its folder."""
    if seeds:
        print(f"{name}: {len(seeds)} packings", flush=True)
        rest = {"task": sweep.task, "sweep": {"packing.seed": seeds}, "scene": sweep.scene}
        run_sweep(Sweep.from_mapping(rest), folder / name.replace(" ", "_"), workers=workers)


def check(folder: Path, names: list[str]) -> None:
    """The first tenth of the packings of each set, compared with the tables: every number of every load."""
    compute(folder, names, (0.1,))
    compared, wrong = 0, []
    for packing, new, known in computed_again(folder, TABLES):
        ours, theirs = new.get("loads", []), known.get("loads", [])
        if len(ours) != len(theirs):
            wrong.append(f"{packing}: {len(ours)} loads, and {len(theirs)} in the table")
        for one, other in zip(ours, theirs, strict=False):
            compared += 1
            wrong += [f"{packing}, F_x/F_y = {one['fx_over_fy']}: {key}" for key in different(one, other)]
    print("\n".join([f"{compared} loads compared, {len(wrong)} numbers of them differ", *wrong]))
    sys.exit(len(wrong) > 0)


TOLERANCES = {"measured": 1e-3}
"""Relative difference that numbers whose name has this word may have: rates that were measured in runs."""


def different(one: Any, other: Any, name: str = "", allowed: Mapping[str, float] = TOLERANCES) -> list[str]:
    """Names of what differs: numbers count as equal to six digits, but for those of which more is allowed."""
    if isinstance(one, dict) and isinstance(other, dict):
        keys = one.keys() & other.keys()  # what an older row lacks was added later
        return [
            each for key in sorted(keys) for each in different(one.get(key), other.get(key), f"{name} {key}", allowed)
        ]
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        pairs = enumerate(zip(one, other, strict=True))
        return [each for k, pair in pairs for each in different(*pair, f"{name} {k}", allowed)]
    if isinstance(one, float) and isinstance(other, (int, float)):
        return (
            []
            if isclose(one, other, rel_tol=max((allowed[word] for word in allowed if word in name), default=1e-6))
            else [name.strip()]
        )
    return [] if one == other else [name.strip()]


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
