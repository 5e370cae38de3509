"""The windows of growing motion by the few modes that may grow, beside those of all modes at every load.

The search for growing motion follows few modes, and asks for all of them where these leave doubt. This script searches
20 ramps of packings with four kinds of dissipation in both ways, and compares every window: the same number, and edges
that differ by no more than ten times the sum of both stated errors, which are those of rounding. It also takes the
search for complex pairs on the same ramp, as the measure of time. The table is `damped.csv` beside this file.

    nice python benchmarks/damped.py [--disks 60] [--packings 20] [--until 0.02] [--table damped.csv]

With `--first` the first window is searched as that of a large packing, from 334 disks on in slices of the spectrum, and
held against all eigenvalues of the companion matrix, from LAPACK. None of them may have Re s > 0 at the last `BEFORE`
loads of the ramp before the onset, nor just below it, and one of them must have just above it.

    nice python benchmarks/damped.py --first --disks 100 --packings 10 --until 0.06 --table first.csv
    nice python benchmarks/damped.py --first --disks 200 --packings 4 --seed 4 --until 0.04 --table 200.csv
    nice python benchmarks/damped.py --first --disks 300 400 --packings 3 --seed 4 --until 0.04 --table 400.csv

With `--large` a packing is settled and its first window is sought on all ranks of `mpiexec`, as by `faultgouge onset`,
with `cn = 1`: 10,000 disks take a quarter of an hour on two cores. Scene, packing and onset stay in a folder, and the
same command goes on from there.

    nice python benchmarks/damped.py --large --disks 10000 --ranks 2 --step 2e-4 --folder large

It ends with exit code 1 where windows differ. All of it takes two minutes of one processor for 60 disks, and ten
for 100.
"""

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import csv
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import count
from pathlib import Path

import numpy as np
from scipy.linalg import eigvals

from faultgouge.analysis import NoEquilibriumError, OnsetError, Window, find_onset
from faultgouge.analysis.motion.motion import energy_norm, matrix_in_norm
from faultgouge.analysis.windows import System, find_windows
from faultgouge.analysis.windows.search import Search
from faultgouge.analysis.windows.sliced_search import SlicedSearch
from faultgouge.pywrap import Equilibrium, LoadPath, Scene, scene_path, settle
from faultgouge.pywrap.lammps.engine import Engine
from faultgouge.pywrap.runs.ramp_loads import ramp_loads

KINDS = ({"cn": 1.0}, {"cn": 10.0, "ct": 5.0}, {"ct": 0.1}, {"cn": 0.1, "drag_time": 300.0})
"""Dissipation, in turn."""

COLUMNS = ("disks", "seed", "dissipation", "windows", "all_modes", "largest_difference", "stated", "seconds")
COLUMNS += ("seconds_all_modes", "seconds_undamped")

FIRST_KINDS = ({"cn": 0.1}, {"cn": 10.0, "ct": 5.0}, {"cn": 1.0}, {"cn": 1000.0, "ct": 300.0}, {"drag_time": 100.0})
"""Dissipation, in turn, of what is searched for its first window: weak, medium, strong, and drag."""

FIRST_COLUMNS = ("disks", "seed", "dissipation", "onset", "error", "frequency", "before", "below", "above", "seconds")

BEFORE = 1
"""Loads of the ramp before the onset at which all eigenvalues are taken: half a minute each for 400 disks."""

NEAR = 1e-6
"""Distance of the loads on either side of an onset, in units of it: Re s is then 1e-9 of the frequency or more."""

SILENT = 1e-11
"""Re s from which on motion grows, 1 / time: rounding is 1e-13, and dashpots of 0.1 take 1e-6 or more."""

Row = dict[str, object]

Kinds = Sequence[dict[str, float]]

Case = tuple[int, LoadPath[Equilibrium], np.ndarray, dict[str, float]]
"""The seed, the path, its loads and the dissipation of a packing."""


def damped(path: LoadPath[Equilibrium], kind: dict[str, float]) -> Callable[[float], System]:
    """The systems along a path with some dissipation."""
    return lambda fx: System.of(path(fx).with_dissipation(**kind), dissipation=True)


def compare_searches(path: LoadPath[Equilibrium], forces: np.ndarray, kind: dict[str, float]) -> tuple[Row, bool]:
    """Both searches on a ramp, and whether they agree."""
    times = [time.process_time()]
    try:
        complex_pairs = find_onset(path, forces).windows
    except OnsetError:
        complex_pairs = ()
    ends = [0.5 * (each.fx_onset + each.fx_end) for each in complex_pairs if each.fx_end is not None]
    inside = [*(each.fx_onset for each in complex_pairs), *ends]
    times.append(time.process_time())
    few = find_windows(damped(path, kind), forces, look=lambda a, b: [fx for fx in inside if a < fx < b])
    times.append(time.process_time())
    all_loads = np.unique(np.concatenate([forces, [fx for fx in inside if fx < forces[-1]]]))
    *_, (_, every) = Search(damped(path, kind), 1e-7 * float(forces[-1])).along(all_loads)
    times.append(time.process_time())
    undamped, seconds, whole = np.diff(times)
    differences, stated = edges(few, every)
    row: Row = {"windows": len(few), "all_modes": len(every), "seconds": f"{seconds:.2f}"}
    row |= {"largest_difference": f"{max(differences, default=0.0):.1e}", "stated": f"{max(stated, default=0.0):.1e}"}
    row |= {"seconds_all_modes": f"{whole:.2f}", "seconds_undamped": f"{undamped:.2f}"}
    same = len(few) == len(every) and all(a <= 10 * b for a, b in zip(differences, stated, strict=True))
    return row, same


def edges(few: tuple[Window, ...], every: tuple[Window, ...]) -> tuple[list[float], list[float]]:
    """Differences of onsets and ends, with the errors stated of both; inf where one window ends and the other not."""
    differences, stated = [], []
    for one, other in zip(few, every, strict=False):
        ends = (one.fx_end, other.fx_end)
        open_ends = [end is None for end in ends]
        end = 0.0 if all(open_ends) else np.inf if any(open_ends) else abs(float(ends[0] or 0) - float(ends[1] or 0))
        differences.append(max(abs(one.fx_onset - other.fx_onset), end))
        stated.append(one.error + other.error)
    return differences, stated


def against_all_eigenvalues(
    path: LoadPath[Equilibrium], forces: np.ndarray, kind: dict[str, float]
) -> tuple[Row, bool]:
    """The first window from slices, and whether all eigenvalues of the companion matrix agree with it."""
    system = damped(path, kind)
    begin = time.process_time()
    window, doubtful = SlicedSearch(system).first_window(forces)
    row: Row = {"seconds": f"{time.process_time() - begin:.2f}"}
    onset = np.inf if window is None else window.fx_onset

    def fastest(fx: float) -> float:
        place = system(fx)
        a, g = place.stiffness.toarray(), place.damping.toarray()
        return float(eigvals(matrix_in_norm(energy_norm(a), a, g)).real.max())

    def largest(loads: Iterable[float]) -> float:
        return max(map(fastest, loads), default=-np.inf)

    before = largest(float(fx) for fx in forces[forces < onset][-BEFORE:])
    row |= {"before": f"{before:.1e}"}
    if window is None:
        return row, before < SILENT and not doubtful
    row |= {"onset": f"{onset:.12g}", "error": f"{window.error:.1e}", "frequency": f"{window.frequency:.6g}"}
    below, above = largest([onset * (1 - NEAR)]), largest([onset * (1 + NEAR)])
    row |= {"below": f"{below:.1e}", "above": f"{above:.1e}"}
    return row, before < SILENT and below < SILENT < above and not doubtful


def cases(disks: int, seeds: Iterator[int], packings: int, until: float, kinds: Kinds, whole: bool) -> Iterator[Case]:
    """So many packings that bear the first increment, each with a kind of dissipation; with their `whole` ramps, or
    equilibria as they are asked for."""
    done = 0
    while done < packings:
        seed = next(seeds)
        packing = {"disks": disks, "width": round(1.192 * disks**0.5, 1), "seed": seed}
        steps = {"step": until / 20, "until": until}
        scene = Scene.from_mapping({"packing": packing, "law": {"kn": 2e5}, "load": {"fy": 3.0}, "ramp": steps})
        wanted = ramp_loads(scene)
        try:
            start = settle(scene)
            with Engine(start.packing) as engine:
                path = scene_path(engine, start, scene, onward=True)
                for _ in path.climb(wanted[1:] if whole else wanted[1:2]):
                    pass
                forces = np.array([each.fx for each in path.equilibria]) if whole else wanted
                yield seed, path, forces, kinds[seed % len(kinds)]
                done += 1
        except NoEquilibriumError as error:
            print(f"seed {seed} left out: {error}", flush=True)


def large(disks: int, ranks: int, step: float, folder: Path) -> None:
    """Settle a packing, seek its first window on some ranks, and tell how long that took."""
    folder.mkdir(parents=True, exist_ok=True)
    packing, scene = folder / "packing.h5", folder / "damped.toml"
    rest = f"[law]\nkn = 2e5\n[load]\nfy = 3.0\n[ramp]\nstep = {step:g}\nuntil = {100 * step:g}\n[damping]\ncn = 1.0\n"
    program = [sys.executable, "-m", "faultgouge"]
    if not packing.exists():
        width = round(1.192 * disks**0.5, 1)
        scene.write_text(f"[packing]\ndisks = {disks}\nwidth = {width}\nseed = 1\n{rest}")
        subprocess.run([*program, "settle", str(scene), "-o", str(packing)], check=True)
    scene.write_text(f'[packing]\nfile = "{packing.name}"\n{rest}')
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    search = [*program, "onset", str(scene), "-o", str(folder / "onset.json")]
    subprocess.run(["mpiexec", "-n", str(ranks), *search] if ranks > 1 else search, check=True)
    after, seconds = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - begin
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(f"{disks} disks on {ranks} ranks: {seconds:.0f} s, {processor:.0f} s of processor time")


def main() -> None:
    """Search, compare, and write the table as it grows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", action="store_true", help="the first window, as of large packings")
    parser.add_argument("--disks", type=int, nargs="+", default=[60], help="of a packing")
    parser.add_argument("--packings", type=int, default=20, help="how many of each size")
    parser.add_argument("--seed", type=int, default=1, help="of the first packing of each size")
    parser.add_argument("--until", type=float, default=0.02, help="largest F_x; 20 increments")
    parser.add_argument("--large", action="store_true", help="the first window of one packing, by the command")
    parser.add_argument("--ranks", type=int, default=2, help="with --large: of mpiexec")
    parser.add_argument("--step", type=float, default=2e-4, help="with --large: increment of F_x")
    parser.add_argument("--folder", type=Path, default=Path("large"), help="with --large: for what is written")
    parser.add_argument("--table", type=Path, default=Path(__file__).parent / "damped.csv", help="the table")
    options = parser.parse_args()
    if options.large:
        large(options.disks[0], options.ranks, options.step, options.folder)
        return
    compare, kinds = (against_all_eigenvalues, FIRST_KINDS) if options.first else (compare_searches, KINDS)
    wrong, total, rows = 0, options.packings * len(options.disks), []
    with options.table.open("w", newline="") as file:
        table = csv.DictWriter(file, FIRST_COLUMNS if options.first else COLUMNS, lineterminator="\n")
        table.writeheader()
        for disks in options.disks:
            seeds = count(options.seed)
            for seed, path, forces, kind in cases(
                disks, seeds, options.packings, options.until, kinds, not options.first
            ):
                found, same = compare(path, forces, kind)
                words = " ".join(f"{key}={value:g}" for key, value in kind.items())
                row = {"disks": disks, "seed": seed, "dissipation": words} | found
                table.writerow(row)
                file.flush()
                wrong += not same
                rows.append(row)
                print(*row.values(), "" if same else "NOT THE SAME", flush=True)
    names = [name for name in table.fieldnames if name.startswith("seconds")]
    sums = ", ".join(f"{name} {sum(float(str(row[name])) for row in rows):.1f}" for name in names)
    print(f"{wrong} of {total} differ; {sums}")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
