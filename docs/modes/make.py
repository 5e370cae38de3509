"""The study of complex modes: its tables computed, its page made from them, or a tenth of them computed again.

python docs/modes/make.py compute FOLDER     all sweeps, on all cores, resumable; hours. Then the tables
python docs/modes/make.py page               modes.md, modes.json and the pictures, from the tables beside this file
python docs/modes/make.py check FOLDER       one packing in ten once more, compared with the tables
"""

import json
import sys
from pathlib import Path

from faultgouge.studies.modes.page import write_page
from faultgouge.studies.modes.sets import SHARES, sets
from faultgouge.studies.modes.tables import condense
from faultgouge.studies.sweep.compute import run_sweep

HERE = Path(__file__).parent
TABLES = HERE / "tables"


def compute(folder: Path, shares: tuple[float, ...] = SHARES) -> None:
    """All sweeps of the study, round by round."""
    for share in shares:
        for name, sweep in sets(share).items():
            print(f"{name}: {len(sweep.points)} packings", flush=True)
            run_sweep(sweep, folder / name.replace(" ", "_"), workers=None)


def check(folder: Path) -> None:
    """A tenth of the packings of each set, the first ones, compared with the tables: pairs, and rates to six digits."""
    compute(folder, (0.1,))
    condense(folder, folder / "tables")
    wrong = compared = 0
    for path in sorted((folder / "tables").glob("*.jsonl")):
        known = {row["seed"]: row for row in map(json.loads, (TABLES / path.name).read_text().splitlines())}
        for row in map(json.loads, path.read_text().splitlines()):
            for one, other in zip(row.get("loads", ()), known[row["seed"]].get("loads", ()), strict=True):
                same = one["pairs"] == other["pairs"]
                same = same and abs(one["growth_rate"] - other["growth_rate"]) <= 1e-6 * other["growth_rate"]
                compared, wrong = compared + 1, wrong + (not same)
    print(f"{compared} loads compared, {wrong} of them differ")
    sys.exit(wrong > 0)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["compute", folder]:
            compute(Path(folder))
            condense(Path(folder), TABLES)
        case ["page"]:
            print(write_page(TABLES, HERE))
        case ["check", folder]:
            check(Path(folder))
        case _:
            sys.exit(__doc__)
