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
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from faultgouge.analysis import spectrum
from faultgouge.pywrap import Equilibrium, Scene, ramp
from faultgouge.pywrap.onset.undamped import onset_run

PACKING = Path(__file__).parents[1] / "tests" / "reference" / "packing7.json"
EXACT = 0.021833056408038582
UNTIL = 0.0225
REPEATS = 5


@dataclass(frozen=True)
class Result:
    """An onset and what it took.

    Attributes
    ----------
    method : str
        How it was found.
    increment : float
        Of F_x.
    seconds, processor_seconds : float
        Wall time, and that of the processor.
    evaluations : int
        Force evaluations of the ramp's equilibria, those of the root-finding not counted.
    fx_c : float
        The onset.
    stated_error : float
        The uncertainty that the method states.
    difference : float
        |fx_c - EXACT|.
    one_path_seconds : float
        Of the processor's, what the onset took along one path; the rest states what other increments do to the path.
    """

    method: str
    increment: float
    seconds: float
    processor_seconds: float
    evaluations: int
    fx_c: float
    stated_error: float
    difference: float
    one_path_seconds: float


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


def solved(progress: Callable[[Equilibrium], None]) -> Result:
    """Newton's method and the root of the discriminant."""
    increment = 1e-3
    begin, along_one_path = clocks(), []

    def watch(says: str) -> None:
        if says.startswith("the path once more"):
            along_one_path.append(elapsed(begin)[1])

    run = onset_run(scene("newton", increment), 1.0, reached=progress, watch=watch)
    seconds = elapsed(begin)
    evaluations = sum(each.evaluations for each in run.equilibria)
    fx_c = run.onset.fx_c
    error = abs(fx_c - EXACT)
    return Result("solved", increment, *seconds, evaluations, fx_c, run.onset.error, error, along_one_path[0])


def scanned(progress: Callable[[Equilibrium], None]) -> Result:
    """Overdamped dynamics and the spectrum at every increment."""
    increment = 1e-4
    begin = clocks()
    equilibria = []
    for equilibrium in ramp(scene("overdamped", increment)):
        equilibria.append(equilibrium)
        progress(equilibrium)
    loads = [each.fx for each in equilibria if spectrum(each.packing).pairs]
    seconds = elapsed(begin)
    if not loads:
        sys.exit(f"The scan shows no complex pair up to F_x = {UNTIL}.")
    evaluations = sum(each.evaluations for each in equilibria)
    onset, error = loads[0] - 0.5 * increment, 0.5 * increment
    return Result("scanned", increment, *seconds, evaluations, onset, error, abs(onset - EXACT), seconds[1])


def announce(equilibrium: Equilibrium) -> None:
    """Say on standard error how far a ramp is."""
    print(f"\rF_x = {equilibrium.fx:.4f} of {UNTIL}", end="", file=sys.stderr, flush=True)


def compared(fast: Result, slow: Result) -> dict[str, float]:
    """How many times more the slow way takes and errs."""
    # a difference below the spacing of doubles says nothing
    return {
        "seconds": slow.seconds / fast.seconds,
        "processor_seconds": slow.processor_seconds / fast.processor_seconds,
        "evaluations": slow.evaluations / fast.evaluations,
        "stated_error": slow.stated_error / fast.stated_error,
        "difference": slow.difference / max(fast.difference, sys.float_info.epsilon * EXACT),
    }


def main() -> None:
    """Print the table."""
    cold, *warm = (solved(announce) for _ in range(1 + REPEATS))
    fast, slow = sorted(warm, key=lambda result: result.processor_seconds)[REPEATS // 2], scanned(announce)
    print(file=sys.stderr)
    print(f"{platform.processor() or platform.machine()}; F_x^c of the reference packing, mu = 1, exact {EXACT:.15g}\n")
    print(
        f"{'':10s}{'increment':>10s}{'wall s':>9s}{'CPU s':>9s}{'evaluations':>13s}"
        f"{'F_x^c':>20s}{'stated':>10s}{'error':>10s}"
    )
    for row in (fast, slow):
        print(
            f"{row.method:10s}{row.increment:10.0e}{row.seconds:9.2f}{row.processor_seconds:9.2f}{row.evaluations:13d}"
            f"{row.fx_c:20.15f}{row.stated_error:10.1e}{row.difference:10.1e}"
        )
    ratios = compared(fast, slow)
    print(
        f"{'ratio':20s}{ratios['seconds']:9.1f}{ratios['processor_seconds']:9.1f}{ratios['evaluations']:13.0f}{'':20s}"
        f"{ratios['stated_error']:10.1e}{ratios['difference']:10.1e}"
    )
    print(
        f"\nThe onset along one path took {fast.one_path_seconds:.2f} s on the processor; the rest is the path's error."
    )
    print(
        f"\nThe first solution in the process: {cold.seconds:.2f} s, {cold.processor_seconds:.2f} s on the processor."
    )


if __name__ == "__main__":
    main()
