"""How the verdict on contacts at Coulomb's bound depends on the numbers by which it is made, beside LAMMPS's motion.

Small packings of LAMMPS's own laws come to rest on slopes. Of those with contacts at the bound, one-sided motion is
followed for `MOST_CHUNKS`, and the verdict is made of it as `stability` makes it within this time: with its numbers,
and with each of them halved and doubled. Beside it LAMMPS is followed after the same pushes, for 60 units of time or
more. The table `tables/verdict_numbers.csv` has a row a packing. `time` is when the verdict is made, and D is over the
square of the push. `lammps` is the largest D in the last fifth of LAMMPS's motion over that in its first half. The last
column says which verdicts are others: "DECADES x 2: unknown" for instance.

    nice python benchmarks/verdict_numbers.py [--packings 100:180] [--keep FOLDER]
"""

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import csv
import pickle
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from faultgouge.analysis import Configuration, stability
from faultgouge.analysis.motion import one_sided_outcome as module
from faultgouge.analysis.motion.one_sided import OneSidedSystem
from faultgouge.pywrap import from_lammps, in_a_copy
from faultgouge.pywrap.granular.lammps_arrays import owned_array, rows_of, set_velocity
from faultgouge.pywrap.granular.look_in_a_copy import quieten

sys.path.insert(0, str(Path(__file__).parent.parent))
from research.lammps_laws.compute import pour

LAWS = (
    "granular hertz, mindlin/force", "gran/hertz/history", "granular hertz, mindlin_rescale/force",
    "granular hooke, linear_history", "granular hertz, mindlin",
)  # fmt: skip
NUMBERS = (
    "SLIP_LEFT_SHARE", "DECADES", "GAIN_SHARE", "EXPONENTIAL_RATIO", "SLIP_CHANGE", "DECAY_SHARE", "CHUNKS_BEFORE_SUM"
)  # fmt: skip
NAMES = {True: "grows", False: "rests", None: "unknown"}
COLUMNS = (
    "packing", "law", "dimension", "particles", "at_bound", "verdict", "time", "amplification", "amplification_lammps",
    "lammps", "others",
)  # fmt: skip
AT_REST = 1e-9
"""Residual over the mean contact force, which then falls no further than by a third, or to 3e-11."""


def packing(number: int, log: Path) -> tuple[Any, str, Configuration] | None:
    """LAMMPS with a packing on a slope, its law, and its configuration; None if it does not come to rest."""
    random, law = np.random.default_rng(number), LAWS[number % len(LAWS)]
    count, dashpot = int(random.choice([16, 24, 32])), float(random.choice([4.0, 40.0, 150.0]))
    mu = float(random.choice([0.3, 0.5]))
    slope = mu * float(random.choice([0.2, 0.35, 0.5]))
    lmp = pour(law, 3 if number % 3 else 2, count, mu, number, log, dashpot / 10 if "hooke" in law else dashpot)
    for part in np.linspace(0.0, slope, 6):
        lmp.command(f"variable slope equal {part}")
        lmp.command("run 10000 post no")
    last = np.inf
    for _ in range(14):
        lmp.command("run 10000 post no")
        now = from_lammps(lmp, balance=np.inf, prove=False)
        residual = now.residual / now.contacts.normal_force.mean()
        if residual < 3e-11 or (residual < AT_REST and residual > 0.7 * last):
            return lmp, law, from_lammps(lmp)
        last = residual
    lmp.close()
    return None


def in_lammps(lmp: Any, here: Configuration, push: np.ndarray, size: float, times: np.ndarray) -> np.ndarray:
    """D of LAMMPS's particles over the square of the push, shape (T, P)."""
    low, high, *_ = lmp.extract_box()
    width = np.subtract(high, low)

    def follow(velocity: np.ndarray) -> list[float]:
        lmp.command("log none")
        quieten(lmp, drag=True)
        lmp.command("timestep 1e-3")
        before = owned_array(lmp, "x")[rows_of(lmp, here)].copy()
        set_velocity(lmp, here, size * velocity)
        found = []
        for steps in np.diff(np.round(times / 1e-3).astype(int), prepend=0):
            lmp.command(f"run {steps} post no")
            away = owned_array(lmp, "x")[rows_of(lmp, here)] - before
            away[:, 0] -= width[0] * np.round(away[:, 0] / width[0])
            found.append(float(np.mean(np.sum(away**2, axis=1))) / size**2)
        return found

    return np.transpose([in_a_copy(lambda column=column: follow(column)) for column in push.T])


def record(number: int) -> dict[str, Any] | None:
    """A packing with its motion in LAMMPS."""
    with TemporaryDirectory() as folder:
        found = packing(number, Path(folder) / "log")
        if found is None:
            return None
        lmp, law, here = found
        told = stability(here)
        most = 0.0 if told.one_sided is None else told.one_sided.time
        least, largest = (1e-9, 1e-9) if told.one_sided is None else told.one_sided.scales
        size = np.sqrt(max(least, 1e-13) * min(largest, 1e-4)) if least < largest else 3 * least
        times = np.linspace(0, np.clip(2 * most, 60.0, 400.0), 121)[1:].round(1)
        push = module.random_pushes(here, module.PUSHES)
        size = float(np.clip(size, 1e-11, 1e-6)) if np.isfinite(size) else 1e-9
        msd = in_lammps(lmp, here, push, size, times)
        lmp.close()
    return {"law": law, "here": here, "D": msd}


def looks_of(here: Configuration) -> module.Looks:
    """Looks at the one-sided motion for as long as `stability` would follow it."""
    system = OneSidedSystem.of(here, module.VERDICT_STEP)
    state = system.start(module.random_pushes(here, module.PUSHES))
    chunk, most = module.window_and_most(system, 2 * module.PUSHES, None)
    seen = module.Looks([], [], [state.p.copy()], wears=bool(len(state.r)))
    for look in range(most * module.LOOKS_PER_CHUNK):
        system.advance(state, chunk * (look + 1) / module.LOOKS_PER_CHUNK)
        seen.look(system, state)
        if not np.all(np.isfinite(seen.sizes[-1])):
            break
    return seen


def verdict_of(seen: module.Looks, sticking: float, grows: bool) -> tuple[bool | None, int]:
    """The verdict, and after how many looks it is made."""
    found, each = None, module.LOOKS_PER_CHUNK
    for count in range(each, len(seen.times) + 1, each):
        part = module.Looks(seen.times[:count], seen.sizes[:count], seen.slid[: count + 1], seen.wears)
        found, _ = module.outcome_and_slip_left(part, sticking, grows, rested=found is False)
        if found is not None:
            return found, count
    return None, len(seen.times)


def row_of(number: int, kept: dict[str, Any]) -> dict[str, Any] | None:
    """The row of a packing; None without contacts at the bound."""
    here = kept["here"]
    told = stability(here, time=1.0)  # for the motion with sticking contacts alone
    if told.one_sided is None:
        return None
    sticking = told.sticking.growth_rate, told.sticking.growth_rate > 0
    seen, others = looks_of(here), []
    found, count = verdict_of(seen, *sticking)
    for name in NUMBERS:
        usual = getattr(module, name)
        for factor in (0.5, 2):
            # 1 is the ratio of exact exponential growth
            setattr(
                module, name, 1 - (1 - usual) / factor if name == "EXPONENTIAL_RATIO" else type(usual)(usual * factor)
            )
            other, _ = verdict_of(seen, *sticking)
            if other is not found:
                others.append(f"{name} x {factor}: {NAMES[other]}")
        setattr(module, name, usual)
    msd = kept["D"].max(axis=1)
    values = (
        number, kept["law"], here.dimension, len(here), told.at_bound, NAMES[found], f"{seen.times[count - 1]:.4g}",
        f"{np.max(seen.sizes[:count]):.3g}", f"{msd.max():.3g}",
        f"{msd[-len(msd) // 5 :].max() / msd[: len(msd) // 2].max():.3g}", "; ".join(others),
    )  # fmt: skip
    return dict(zip(COLUMNS, values, strict=True))


def main() -> None:
    """Write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--packings", default="100:180", help="FIRST:STOP")
    parser.add_argument("--keep", type=Path, help="folder in which packings and LAMMPS's motion are kept")
    options = parser.parse_args()
    with (Path(__file__).parent / "tables" / "verdict_numbers.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        for number in range(*map(int, options.packings.split(":"))):
            place = None if options.keep is None else options.keep / f"{number}.pkl"
            kept = pickle.loads(place.read_bytes()) if place is not None and place.exists() else record(number)
            if place is not None:
                place.write_bytes(pickle.dumps(kept))
            row = None if kept is None else row_of(number, kept)
            if row is not None:
                table.writerow(row)
                file.flush()


if __name__ == "__main__":
    main()
