"""The study of complex modes: its tables computed, its page made from them, or a tenth of them computed again.

python docs/modes/make.py compute FOLDER [SET ...]   what the tables lack of all sets, on all cores, resumable; hours
python docs/modes/make.py page                       the pages, modes.json and the pictures, from the tables
python docs/modes/make.py check FOLDER [SET ...]     one packing in ten once more, compared with the tables

Without a SET, such as "loss 100", all of them.
"""

import sys
from pathlib import Path

from faultgouge.studies.modes.page import write_page
from faultgouge.studies.modes.sets import SHARES, sets
from faultgouge.studies.modes.tables import condense, known
from faultgouge.studies.sweep.compute import run_sweep
from faultgouge.studies.sweep.points import Sweep
from faultgouge.studies.sweep.tasks import TASKS

HERE = Path(__file__).parent
TABLES = HERE / "tables"


def compute(folder: Path, names: list[str], shares: tuple[float, ...] = SHARES, tables: Path | None = None) -> None:
    """The sweeps of the study, round by round, but for the packings of the tables."""
    for share in shares:
        for name, sweep in sets(share).items():
            rows = {} if tables is None else known(tables, name)
            seeds = [point.values["packing.seed"] for point in sweep.points if point.values["packing.seed"] not in rows]
            if seeds and (not names or name in names):
                print(f"{name}: {len(seeds)} packings", flush=True)
                rest = {"task": sweep.task, "sweep": {"packing.seed": seeds}, "scene": sweep.scene}
                run_sweep(Sweep.from_mapping(rest, TASKS), folder / name.replace(" ", "_"), workers=None)


def check(folder: Path, names: list[str]) -> None:
    """The first tenth of the packings of each set, compared with the tables: counts, and rates to six digits."""
    compute(folder, names, (0.1,))
    condense(folder, folder / "tables")
    wrong = compared = 0
    for path in sorted((folder / "tables").glob("*.jsonl")):
        before = known(TABLES, path.stem)
        for seed, row in known(folder / "tables", path.stem).items():
            for one, other in zip(row.get("loads", ()), before[seed].get("loads", ()), strict=True):
                same = one.get("pairs") == other.get("pairs")
                rates = [each.get("growth_rate", 0.0) for each in (one, other)]
                same = same and abs(rates[0] - rates[1]) <= 1e-6 * rates[1]
                compared, wrong = compared + 1, wrong + (not same)
    print(f"{compared} loads compared, {wrong} of them differ")
    sys.exit(wrong > 0)


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
