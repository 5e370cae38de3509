"""The windows of complex eigenvalues of many packings, and a stored table of them to compare with.

A change to the search for complex pairs must not lose a window. This script searches

    reference  the packing of an independent code (tests/reference/packing7.json), mu = 1 and 0.8
    paper      the shipped scene scenes/paper.toml, both of its friction coefficients
    small      28 ramps: the packings of 100 disks of the seeds 1 to 14, mu = 1 and 0.4, to F_x = 0.028 in increments of
               1e-3, with all of their windows
    large      21 packings of 320 to 600 disks, seven seeds each, in increments of 2/N, up to the first window

and compares every window with that of `windows.json` beside this file: the same number, the same kinds, and edges
that differ by no more than the sum of both stated errors. It ends with exit code 1 where they do not.

    nice python benchmarks/windows.py [--only reference paper small large] [--first] [--write] [--table windows.json]

`--first` seeks the first window of each ramp alone, as `faultgouge onset` does, and compares it with the first one of
the table. `--write` makes the table anew from the version at hand. Equilibria come from the same version, so a change
of Newton's method moves windows, too. All of it takes four minutes of one processor, `--first` three.
"""

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from faultgouge.analysis import NoEquilibriumError, OnsetError
from faultgouge.pywrap import Scene
from faultgouge.pywrap.onset import onset_run

HERE = Path(__file__).parent
GROUPS = ("reference", "paper", "small", "large")

Row = dict[str, Any]


def scenes(group: str) -> Iterator[tuple[str, Scene, float]]:
    """The ramps of a group: a name, a scene and a friction coefficient."""
    load: Row = {"load": {"fy": 3.0}}
    if group == "reference":
        packing = {"file": str(HERE.parent / "tests" / "reference" / "packing7.json")}
        ramp = {"step": 1e-3, "until": 0.0225}
        for mu in (1.0, 0.8):
            yield "packing7", Scene.from_mapping({"packing": packing, "law": law(mu), "ramp": ramp} | load), mu
    elif group == "paper":
        scene = Scene.from_toml(HERE.parent / "scenes" / "paper.toml")
        for mu in (1.0, 0.8):
            yield "paper", scene, mu
    elif group == "small":
        for seed in range(1, 15):
            packing = {"disks": 100, "radii": [0.5, 0.7], "top": 10, "width": 11.9, "seed": seed}
            ramp = {"step": 1e-3, "until": 0.028}
            for mu in (1.0, 0.4):
                yield f"100:{seed}", Scene.from_mapping({"packing": packing, "law": law(mu), "ramp": ramp} | load), mu
    else:
        for disks in (320, 450, 600):
            for seed in range(1, 8):
                packing = {"disks": disks, "width": round(1.192 * disks**0.5, 1), "seed": seed}
                ramp = {"step": 2 / disks, "until": 80 / disks}
                scene = Scene.from_mapping({"packing": packing, "law": law(1.0), "ramp": ramp} | load)
                yield f"{disks}:{seed}", scene, 1.0


def law(mu: float) -> Row:
    """The section [law]."""
    return {"kn": 2e5, "mu": mu}


def search_windows(scene: Scene, mu: float, first: bool) -> Row:
    """The windows of one ramp, or the first alone, and how the search for them ends."""
    begin = time.process_time()
    row: Row = {"ends": "onset", "windows": [], "doubtful": []}
    try:
        onset = onset_run(scene, mu, first=first)
    except OnsetError:
        row["ends"] = "none"
    except NoEquilibriumError:
        row["ends"] = "flows"
    else:
        row["windows"] = [window.as_dict() | {"end_error": window.end and window.end.error} for window in onset.windows]
        row["doubtful"] = [list(each) for each in onset.doubtful]
    row["seconds"] = round(time.process_time() - begin, 2)
    return row


def differences(here: Row, there: Row) -> list[str]:
    """Differences of two rows, in words."""
    counts = [f"{row['ends']} with {len(row['windows'])} windows" for row in (there, here)]
    if counts[0] != counts[1]:
        return [" has become ".join(counts)]
    found = []
    for one, other in zip(here["windows"], there["windows"], strict=True):
        if one["kind"] != other["kind"]:
            found.append(f"the window at {other['fx_onset']:.10g} has another kind: {one['kind']}")
        for edge, error in (("fx_onset", "error"), ("fx_end", "end_error")):
            a, b = one[edge], other[edge]
            if (a is None) != (b is None):
                found.append(f"{edge} {b} has become {a}")
            elif a is not None and abs(a - b) > one[error] + other[error]:
                found.append(f"{edge} {b:.15g} has become {a:.15g}, errors {other[error]:.1e} and {one[error]:.1e}")
    return found


def first_of(known: Row, found: Row) -> Row:
    """A row of the table with its first window alone; without the window's end where the search has not come so far."""
    windows = [dict(each) for each in known["windows"][:1]]
    if windows and found["windows"] and found["windows"][0]["fx_end"] is None:
        windows[0] |= {"fx_end": None, "end_error": None}
    return known | {"windows": windows}


def largest_shift(here: Row, there: Row) -> float:
    """The largest difference of an edge, force."""
    pairs = zip(here["windows"], there["windows"], strict=False)
    return max(
        (
            abs(one[edge] - other[edge])
            for one, other in pairs
            for edge in ("fx_onset", "fx_end")
            if None not in (one[edge], other[edge])
        ),
        default=0.0,
    )


def main() -> None:
    """Search, compare, and say what differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=GROUPS, default=GROUPS, help="which groups")
    parser.add_argument("--first", action="store_true", help="the first window of each ramp alone")
    parser.add_argument("--write", action="store_true", help="make the table anew in place of comparing with it")
    parser.add_argument("--table", type=Path, default=HERE / "windows.json", help="the table")
    options = parser.parse_args()
    table: dict[str, Row] = json.loads(options.table.read_text()) if options.table.exists() else {}
    wrong = 0
    for group in options.only:
        rows, worst, seconds = 0, 0.0, [0.0, 0.0]
        windows = 0
        for name, scene, mu in scenes(group):
            key = f"{name} mu={mu:g}"
            row = search_windows(scene, mu, options.first)
            rows, windows = rows + 1, windows + len(row["windows"])
            print(
                f"{group:10s}{key:20s}{row['ends']:6s}{len(row['windows']):3d} windows{row['seconds']:8.2f} s", end=""
            )
            if options.write:
                table[key] = row
                options.table.write_text(json.dumps(table, indent=0) + "\n")
                print(flush=True)
                continue
            known = first_of(table[key], row) if options.first else table[key]
            found = differences(row, known)
            worst = max(worst, largest_shift(row, known))
            seconds = [seconds[0] + row["seconds"], seconds[1] + table[key]["seconds"]]
            wrong += bool(found)
            print("  " + ("; ".join(found) or "the same"), flush=True)
        print(f"{group}: {rows} ramps, {windows} windows", end="")
        print("" if options.write else f"; edges differ by {worst:.1e} at the most", end="")
        print("" if options.write else f"; {seconds[0]:.0f} s of processor time, {seconds[1]:.0f} s in the table")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
