"""The onset by Newton's method and a root of the discriminant, beside the scan by overdamped dynamics, in one run.

Both start from the reference packing of 100 disks at F_x = 0 and end with F_x^c for mu = 1:

    solved    F_x raised by 1e-3 with Newton's method, all windows of complex eigenvalues up to 0.0225 solved for
    scanned   F_x raised by 1e-4 with overdamped dynamics down to the rounding of the coordinates, as in the paper; the
              spectrum at every equilibrium; the onset in the middle between the last real and the first complex one

The exact onset is that of an independent code, for equilibria by Newton's method from increments of 1e-3. What is timed
is everything from the packing's file on, with one thread: the wall, and the processor's time, which is the one to
compare where others use the machine too. The scan takes a minute or more and is timed once. The solution takes less
than a second and is repeated: the run of median time on the processor counts. The first one, which also loads the
libraries, is not among them and shown beside.

    python benchmarks/onset_against_scan.py
"""

import os

# before NumPy is imported: one thread each, for a fair comparison
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import platform
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from faultgouge.analysis import spectrum
from faultgouge.pywrap import Equilibrium, Scene, ramp
from faultgouge.pywrap.onset.undamped import onset_run

PACKING = Path(__file__).parents[1] / "tests" / "reference" / "packing7.json"
EXACT = 0.021833056408038582
UNTIL = 0.0225
REPEATS = 5

Row = dict[str, Any]


def scene(method: Literal["newton", "overdamped"], increment: float) -> Scene:
    """The ramp of the reference packing."""
    return Scene.from_mapping(
        {
            "packing": {"file": str(PACKING)},
            "law": {"kn": 2e5, "mu": 1.0},
            "load": {"fy": 3.0},
            "ramp": {"step": increment, "until": UNTIL, "method": method},
        }
    )


def clocks() -> tuple[float, float]:
    """The wall's clock and the processor's, seconds."""
    return time.perf_counter(), time.process_time()


def elapsed(begin: tuple[float, float]) -> tuple[float, float]:
    """Seconds on both clocks since they showed this."""
    return time.perf_counter() - begin[0], time.process_time() - begin[1]


def solved(progress: Callable[[Equilibrium], None]) -> Row:
    """Newton's method and the root of the discriminant."""
    increment = 1e-3
    begin, along_one_path = clocks(), []

    def watch(says: str) -> None:
        if says.startswith("the path once more"):
            along_one_path.append(elapsed(begin)[1])

    run = onset_run(scene("newton", increment), 1.0, reached=progress, watch=watch)
    row = found("solved", increment, begin, run.equilibria, run.onset.fx_c, run.onset.error)
    return row | {"one_path_seconds": along_one_path[0]}


def scanned(progress: Callable[[Equilibrium], None]) -> Row:
    """Overdamped dynamics and the spectrum at every increment."""
    increment = 1e-4
    begin = clocks()
    equilibria = []
    for equilibrium in ramp(scene("overdamped", increment)):
        equilibria.append(equilibrium)
        progress(equilibrium)
    loads = [each.fx for each in equilibria if spectrum(each.packing).pairs]
    if not loads:
        sys.exit(f"The scan shows no complex pair up to F_x = {UNTIL}.")
    return found("scanned", increment, begin, equilibria, loads[0] - 0.5 * increment, 0.5 * increment)


def found(
    method: str, increment: float, begin: tuple[float, float], path: list[Equilibrium], fx_c: float, error: float
) -> Row:
    """An onset with the error that its method states, and what the method took since both clocks showed `begin`.

    Force evaluations are those of the path's equilibria; those of the root-finding are not counted.
    """
    row: Row = {"method": method, "increment": increment, "evaluations": sum(each.evaluations for each in path)}
    row |= dict(zip(("seconds", "processor_seconds"), elapsed(begin), strict=True))
    return row | {"fx_c": fx_c, "stated_error": error, "difference": abs(fx_c - EXACT)}


def announce(equilibrium: Equilibrium) -> None:
    """Say on standard error how far a ramp is."""
    print(f"\rF_x = {equilibrium.fx:.4f} of {UNTIL}", end="", file=sys.stderr, flush=True)


def compared(fast: Row, slow: Row) -> Row:
    """How many times more the slow way takes and errs."""
    # a difference below the spacing of doubles says nothing
    fast = fast | {"difference": max(fast["difference"], sys.float_info.epsilon * EXACT)}
    names = ("seconds", "processor_seconds", "evaluations", "stated_error", "difference")
    return {name: slow[name] / fast[name] for name in names}


def main() -> None:
    """Print the table."""
    cold, *warm = (solved(announce) for _ in range(1 + REPEATS))
    fast, slow = sorted(warm, key=lambda row: row["processor_seconds"])[REPEATS // 2], scanned(announce)
    print(file=sys.stderr)
    print(f"{platform.processor() or platform.machine()}; F_x^c of the reference packing, mu = 1, exact {EXACT:.15g}\n")
    print(
        f"{'':10s}{'increment':>10s}{'wall s':>9s}{'CPU s':>9s}{'evaluations':>13s}"
        f"{'F_x^c':>20s}{'stated':>10s}{'error':>10s}"
    )
    for row in (fast, slow):
        print(
            "{method:10s}{increment:10.0e}{seconds:9.2f}{processor_seconds:9.2f}{evaluations:13d}{fx_c:20.15f}"
            "{stated_error:10.1e}{difference:10.1e}".format(**row)
        )
    ratios = compared(fast, slow)
    print(
        f"{'ratio':20s}{ratios['seconds']:9.1f}{ratios['processor_seconds']:9.1f}{ratios['evaluations']:13.0f}{'':20s}"
        f"{ratios['stated_error']:10.1e}{ratios['difference']:10.1e}"
    )
    one_path, wall, processor = fast["one_path_seconds"], cold["seconds"], cold["processor_seconds"]
    print(f"\nThe onset along one path took {one_path:.2f} s on the processor; the rest is the path's error.")
    print(f"\nThe first solution in the process: {wall:.2f} s, {processor:.2f} s on the processor.")


if __name__ == "__main__":
    main()
