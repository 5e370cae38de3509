"""The verdict on packings beside LAMMPS's own motion, and how it depends on the numbers by which it is made.

Packings of LAMMPS's own laws come to rest on slopes: 100 to 179 are those on which the numbers were chosen, with
contacts at Coulomb's bound; 200 to 299 are others, of all laws, in two and three dimensions, with weak and strong
dashpots, with lids that move as one, and of up to 200 particles. LAMMPS is followed after the pushes of the verdict,
for 60 units of time or more. The table `tables/verdict_numbers.csv` has a row a packing. `time` is how long one-sided
motion was followed, 0 where linear motion decides, and D is over the square of the push. `lammps` is the largest D in
the last fifth of LAMMPS's motion over that in its first half. The last column says which verdicts of the first packings
are others with one of the numbers halved or doubled: "STILL_SHARE x 2: unknown" for instance.

    nice python benchmarks/verdict_numbers.py [--packings 100:180 200:300] [--keep FOLDER]
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
from faultgouge.analysis.motion import pushes as module
from faultgouge.pywrap import from_lammps, in_a_copy
from faultgouge.pywrap.granular.lammps_arrays import owned_array, rows_of, set_velocity
from faultgouge.pywrap.granular.look_in_a_copy import quieten

sys.path.insert(0, str(Path(__file__).parent.parent))
from research.lammps_laws.compute import LAWS as ALL_LAWS
from research.lammps_laws.compute import pour

LAWS = (
    "granular hertz, mindlin/force", "gran/hertz/history", "granular hertz, mindlin_rescale/force",
    "granular hooke, linear_history", "granular hertz, mindlin",
)  # fmt: skip
NUMBERS = "STILL_SHARE", "GROWN_ENERGY", "CHUNK"
NAMES = {False: "grows", True: "rests", None: "unknown"}
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
    return at_rest(lmp, law, slope)


def other_packing(number: int, log: Path) -> tuple[Any, str, Configuration] | None:
    """The same of the other packings, on which no number was chosen."""
    random, law = np.random.default_rng(number), tuple(ALL_LAWS)[number % len(ALL_LAWS)]
    count = int(random.choice([20, 40, 60])) if number % 10 else 200
    dashpot = float(random.choice([1.0, 10.0, 60.0, 400.0]))
    mu = float(random.choice([0.2, 0.5, 0.8]))
    slope = mu * float(random.choice([0.1, 0.3, 0.55]))
    d = 3 if number % 2 else 2
    lmp = pour(law, d, count, mu, number, log, dashpot / 10 if "hooke" in law else dashpot)
    if number % 4 == 3:  # the highest spheres are a lid
        lmp.command("run 20000 post no")
        high = np.argsort(owned_array(lmp, "x")[:, 2])[-max(3, count // 8) :]
        lmp.command("group lid id " + " ".join(map(str, owned_array(lmp, "id")[high])))
        for line in (
            "group filling subtract all lid", "neigh_modify exclude group lid lid", "unfix move",
            "fix move filling nve/sphere", "fix body lid nve", "fix stiff lid aveforce 0.0 0.0 0.0",
        ):  # fmt: skip
            lmp.command(line)
    return at_rest(lmp, law, slope)


def at_rest(lmp: Any, law: str, slope: float) -> tuple[Any, str, Configuration] | None:
    """LAMMPS with its packing brought to rest on a slope, as of `packing`."""
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
        found = (packing if number < 200 else other_packing)(number, Path(folder) / "log")
        if found is None:
            return None
        lmp, law, here = found
        told = stability(here)
        most = 0.0 if told.one_sided is None else told.one_sided.time
        least, largest = (1e-9, 1e-7) if told.one_sided is None else told.one_sided.scales
        size = np.sqrt(max(least, 1e-13) * min(largest, 1e-4)) if least < largest else 3 * least
        size = 1e-9 if told.stable is False or not np.isfinite(size) else float(np.clip(size, 1e-11, 1e-6))
        slow = 25 / told.growth_rate if told.stable is False else 0.0
        times = np.linspace(0, np.clip(max(2 * most, slow), 60.0, 400.0), 121)[1:].round(1)
        msd = in_lammps(lmp, here, module.random_pushes(here, module.PUSHES), size, times)
        lmp.close()
    return {"law": law, "here": here, "D": msd}


def row_of(number: int, kept: dict[str, Any]) -> dict[str, Any] | None:
    """The row of a packing; None of those of the first kind without contacts at the bound."""
    here, others = kept["here"], []
    if number < 200 and not here.contacts.one_sided.any():
        return None
    found = stability(here)
    if number < 200:
        for name in NUMBERS:
            usual = getattr(module, name)
            for factor in (0.5, 2):
                setattr(module, name, type(usual)(usual * factor))
                other = stability(here).stable
                if other is not found.stable:
                    others.append(f"{name} x {factor}: {NAMES[other]}")
            setattr(module, name, usual)
    msd, outcome = kept["D"].max(axis=1), found.one_sided
    values = (
        number, kept["law"], here.dimension, len(here), found.at_bound, NAMES[found.stable],
        f"{outcome.time:.4g}" if outcome else 0, f"{outcome.amplification:.3g}" if outcome else "", f"{msd.max():.3g}",
        f"{msd[-len(msd) // 5 :].max() / msd[: len(msd) // 2].max():.3g}", "; ".join(others),
    )  # fmt: skip
    return dict(zip(COLUMNS, values, strict=True))


def main() -> None:
    """Write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--packings", nargs="*", default=["100:180", "200:300"], help="FIRST:STOP")
    parser.add_argument("--keep", type=Path, help="folder in which packings and LAMMPS's motion are kept")
    options = parser.parse_args()
    with (Path(__file__).parent / "tables" / "verdict_numbers.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        for number in (k for each in options.packings for k in range(*map(int, each.split(":")))):
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
