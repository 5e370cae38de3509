"""Where the time of one increment of F_x goes, from equilibrium to equilibrium by Newton's method.

The reference packing of 100 disks is ramped from F_x = 0 to 0.02 in increments of 1e-3, ten times over, and each
increment is split into

    solve       LAPACK: the factors of the stiffness matrix and the solutions with them
    LAMMPS      the command `run 1`: its set-up, neighbour list, forces
    overhead    everything else that Python does: contacts to matrix, state in and out of LAMMPS, other commands

Times are those of the processor, with one thread, so that others on the machine disturb them little: medians over the
increments, in milliseconds.

    python benchmarks/increment.py
"""

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import platform
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from faultgouge.analysis.factors import linear_solver
from faultgouge.pywrap import Engine, Equilibrium, Scene, equilibrate, settle

PACKING = Path(__file__).parents[1] / "tests" / "reference" / "packing7.json"
STEP, INCREMENTS, ROUNDS = 1e-3, 20, 10


class Stopwatch:
    """Seconds on the processor spent in functions, in total."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def __call__(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function with a clock around it."""

        def time_call(*arguments: Any, **keywords: Any) -> Any:
            begin = time.process_time()
            try:
                return function(*arguments, **keywords)
            finally:
                self.seconds += time.process_time() - begin

        return time_call


class TimedLammps:
    """A LAMMPS instance whose runs are timed."""

    def __init__(self, lammps: Any, watch: Stopwatch) -> None:
        self._lammps, self._run = lammps, watch(lammps.command)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._lammps, name)

    def command(self, text: str) -> None:
        """A command; its time counts if it is a run."""
        (self._run if text.startswith("run ") else self._lammps.command)(text)


def increments(engine: Engine, start: Equilibrium, solve: Stopwatch, lammps: Stopwatch) -> list[dict[str, float]]:
    """The parts of each increment of one ramp, milliseconds."""
    rows, here = [], start
    for k in range(1, INCREMENTS + 1):
        solve.seconds = lammps.seconds = 0.0
        begin = time.process_time()
        here = equilibrate(engine, here, k * STEP)
        total = time.process_time() - begin
        parts = {"solve": solve.seconds, "LAMMPS": lammps.seconds, "overhead": total - solve.seconds - lammps.seconds}
        rows.append({name: 1e3 * value for name, value in (parts | {"all": total}).items()})
        rows[-1]["evaluations"] = here.evaluations
    return rows


def main() -> None:
    """Print the table."""
    scene = {"packing": {"file": str(PACKING)}, "law": {"kn": 2e5, "mu": 1.0}, "load": {"fy": 3.0}}
    start = settle(Scene.from_mapping(scene))
    solve, lammps = Stopwatch(), Stopwatch()
    for name in ("dgbtrf", "dgbtrs"):
        setattr(linear_solver, name, solve(getattr(linear_solver, name)))
    with Engine(start.packing) as engine:
        engine._lammps = TimedLammps(engine.lammps, lammps)
        increments(engine, start, solve, lammps)  # the first ones load libraries and caches
        rows = [row for _ in range(ROUNDS) for row in increments(engine, start, solve, lammps)]

    print(f"{platform.processor() or platform.machine()}; {len(rows)} increments of {STEP:g}\n")
    print(f"{'':12s}{'median ms':>10s}{'least':>8s}{'90 %':>8s}")
    for name in ("solve", "LAMMPS", "overhead", "all"):
        values = [row[name] for row in rows]
        tenths = statistics.quantiles(values, n=10)
        print(f"{name:12s}{statistics.median(values):10.3f}{min(values):8.3f}{tenths[-1]:8.3f}")
    print(f"\nevaluations of the forces: {statistics.mean(row['evaluations'] for row in rows):.2f} an increment")


if __name__ == "__main__":
    main()
