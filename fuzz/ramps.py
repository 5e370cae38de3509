"""Ramps at random: whether a packing flows, and where, must not depend on increments or on arithmetic.

    python -m fuzz.ramps [-o docs/extremes] [--ramps 200] [--workers 1]

Packings are drawn at random: seed, number of disks, friction, tangential stiffness, exponent of the law. Each is ramped
to F_x/F_y = 0.1 with three increments in both arithmetics. The ramp with the smallest increments in compensated
arithmetic is the packing's reference. A ramp agrees with it if both reach the end, or end within `NEAR` of F_y of one
another. Friction remembers the path: where contacts slide, or close, in another order, ramps with other increments lie
on other branches of equilibria. Of a ramp that differs it is asked whether the branch or the search ends there: its own
last equilibrium but one is ramped on with the increments of the reference. If this ends where the ramp ended, the
difference is the path's. If it goes on, an equilibrium that exists was not found, and that is a fault.

ramps.jsonl has a row for each packing, written as they come; the same command goes on where it was cut off. ramps.txt
is what extremes.md says of them, ramps.png draws where ramps end.
"""

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from faultgouge.analysis import NoEquilibriumError, Packing, nearest_image
from faultgouge.analysis.files.atomic_write import write_text
from faultgouge.figures.style import INK, STYLE, save
from faultgouge.pywrap import Equilibrium, Scene, ramp, settle
from faultgouge.pywrap.runs.path_error import bearing_contacts
from faultgouge.pywrap.scenes.validation import require_section
from faultgouge.studies.result_rows import append_row, read_keyed_rows

FY = 3.0
END = 0.1 * FY
"""F_x at which ramps end, F_x/F_y = 0.1."""

INCREMENTS = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4)
"""Of which each packing has `TRIED`. All have the multiples of the first in common, where equilibria are compared."""
TRIED = 3
ARITHMETICS = ("double", "compensated")

NEAR = 1e-3
"""Difference of ends, in units of F_y, up to which two ramps agree."""

Row = dict[str, Any]


def draw_scene(number: int) -> tuple[dict[str, Any], list[float]]:
    """The scene of a packing, without its ramp, and the increments to be tried."""
    chance = np.random.default_rng(number)
    disks = int(chance.choice([100, 100, 100, 100, 50, 30]))
    mapping = {
        "packing": {"disks": disks, "seed": int(chance.integers(1, 500))},
        "law": {
            "kn": 2e5,
            "mu": round(float(chance.uniform(0.1, 1.0)), 2),
            "kt": str(chance.choice(["2/7 kn", "0.5 kn", "1 kn"])),
            "exponent": float(chance.choice([1.5, 1.0])),
        },
        "load": {"fy": FY},
    }
    return mapping, sorted(chance.choice(INCREMENTS, TRIED, replace=False).tolist())


@dataclass(frozen=True, eq=False)
class RampRun:
    """One ramp.

    Attributes
    ----------
    scene : Scene
        Of the ramp.
    ends : float or None
        The largest F_x that had an equilibrium; None if the end of the ramp was reached.
    shared : dict
        The equilibria at loads that all ramps have in common, by F_x in units of the largest increment.
    ways : tuple of str
        Ways that led on where smaller increments did not.
    seconds : float
        Of the processor.
    """

    scene: Scene
    ends: float | None
    shared: dict[int, Equilibrium]
    ways: tuple[str, ...]
    seconds: float

    @classmethod
    def of(cls, scene: Scene, start: Equilibrium) -> "RampRun":
        """Ramp from an equilibrium on."""
        begin, ends = time.process_time(), None
        shared, ways = {round(start.fx / INCREMENTS[0]): start}, []
        try:
            for each in ramp(scene, start):
                if abs(each.fx / INCREMENTS[0] - round(each.fx / INCREMENTS[0])) < 1e-9:
                    shared[round(each.fx / INCREMENTS[0])] = each
                if each.way is not None:
                    ways.append(f"{each.fx:.10g}: {each.way}")
        except NoEquilibriumError as error:
            ends = error.beyond
        return cls(scene, ends, shared, tuple(ways), time.process_time() - begin)

    @property
    def step(self) -> float:
        """The increment, force."""
        return require_section(self.scene.ramp, "ramp").step

    def agrees(self, other: "RampRun") -> bool:
        """Whether both reach the end, or end at nearly the same load."""
        mine, theirs = (END if each.ends is None else each.ends for each in (self, other))
        return abs(mine - theirs) <= NEAR * FY

    def compare_with(self, reference: "RampRun") -> Row:
        """How far this ramp is from another one at the loads that both have reached."""
        common = sorted(self.shared.keys() & reference.shared.keys())
        pairs = [(self.shared[k].packing, reference.shared[k].packing) for k in common]
        differ = [len(bearing_contacts(a) ^ bearing_contacts(b)) for a, b in pairs]
        first = next((k for k, count in zip(common, differ, strict=True) if count), None)
        return {
            "compared_to": common[-1] * INCREMENTS[0],
            "apart": apart(*pairs[-1]),
            "contacts": differ[-1],
            "parts_at": None if first is None else first * INCREMENTS[0],
        }


def apart(one: Packing, other: Packing) -> float:
    """Largest distance of a disk that bears a load in both packings, length."""
    bearing = np.ones(len(one), dtype=bool)
    for each in (one, other):
        carrying = each.loaded(1e-9 * FY).contacts
        bearing &= np.isin(np.arange(len(one)), np.concatenate([carrying.i, carrying.j]))
    moved = nearest_image(one.position - other.position, one.box_length)
    return float(np.hypot(*moved[bearing].T).max(initial=0.0))


def packing_row(number: int) -> Row:
    """All ramps of a packing, and their onsets."""
    mapping, increments = draw_scene(number)
    climbs = []
    for precision, step in product(ARITHMETICS, increments):
        scene = Scene.from_mapping(mapping | {"precision": precision, "ramp": {"step": step, "until": END}})
        climbs.append(RampRun.of(scene, settle(scene)))
    reference = climbs[len(increments)]  # compensated, with the smallest increments
    ramps = [_compare_ramps(climb, reference) for climb in climbs]
    return {"draw": number} | mapping["packing"] | mapping["law"] | {"ramps": ramps}


def _compare_ramps(climb: RampRun, reference: RampRun) -> Row:
    """What is found of a ramp; of one that does not agree, where its own equilibria end with other increments."""
    found = {
        "step": climb.step,
        "precision": climb.scene.precision,
        "ends": climb.ends,
        "ways": climb.ways,
        "cpu_seconds": round(climb.seconds, 2),
        "verdict": "agrees",
        "crossed": None,
    }
    if not climb.agrees(reference):
        shorter, longer = sorted((climb, reference), key=lambda each: END if each.ends is None else each.ends)
        onward = shorter.scene.model_copy(update={"ramp": longer.scene.ramp})
        again = RampRun.of(onward, shorter.shared[max(shorter.shared)])
        found |= {"verdict": "path" if again.agrees(shorter) else "not found", "crossed": again.ends}
    return found | climb.compare_with(reference)


def rows_of(path: Path, packings: int, workers: int) -> Iterator[Row]:
    """The rows of packings, from the file or else computed and appended to the file."""
    known = {row["draw"]: row for row in read_keyed_rows(path, ("draw",), "python -m fuzz.ramps")}
    yield from known.values()
    missing = [number for number in range(packings) if number not in known]
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        for future in as_completed([pool.submit(packing_row, number) for number in missing]):
            append_row(path, future.result())
            yield future.result()


def says(rows: Sequence[Row]) -> str:
    """What extremes.md says of the ramps."""
    ramps = [each for row in rows for each in row["ramps"]]
    flowing = sum(row["ramps"][TRIED]["ends"] is not None for row in rows)
    agree, path, missed = (
        [each for each in ramps if each["verdict"] == verdict] for verdict in ("agrees", "path", "not found")
    )
    others = sum(bool(each["ways"]) for each in ramps)
    text = (
        f"Of {len(ramps)} ramps of {len(rows)} packings to F_x/F_y = {END / FY:g}, {TRIED} increments in both "
        f"arithmetics of each, {len(agree)} agree on whether their packing flows and, within {NEAR:g} of F_y, where; "
        f"{len(path)} end elsewhere because their path has led to another branch of equilibria, and {len(missed)} have "
        f"missed an equilibrium that exists. {flowing} of the packings flow, and {others} ramps needed other ways than "
        "smaller increments."
    )
    if not path:
        return text
    sizes = [np.median([each[name] for each in path]) for name in ("apart", "contacts")]
    return text + (
        f" Where the path is to blame, disks of the two branches lie {sizes[0]:.1e} apart and {sizes[1]:g} contacts "
        "touch or slide in one of them alone (medians, at the last load that both have), and either branch ends where "
        "it ends with the increments of the other."
    )


@matplotlib.rc_context(fname=STYLE)
def figure_of(rows: Sequence[Row]) -> Figure:
    """Where the ramps of each packing end, by the end of its reference; ramps that differ in another colour."""
    figure = Figure(figsize=(6.8, 3.2), layout="constrained")
    axes = figure.subplots()
    in_order = sorted(rows, key=lambda row: _load(row["ramps"][TRIED]))
    marks = {"double": "o", "compensated": "x"}
    for place, row in enumerate(in_order):
        axes.plot([place, place], [0, _load(row["ramps"][TRIED])], color=INK, alpha=0.15, linewidth=0.8)
        for k, each in enumerate(row["ramps"]):
            color = "C0" if each["verdict"] == "agrees" else "C3"
            at = place + 0.25 * (k % TRIED - 1)
            axes.plot(at, _load(each), marks[each["precision"]], color=color, markersize=3.5, markerfacecolor="none")
    handles = [
        Line2D([], [], linestyle="none", color=INK, marker=mark, markerfacecolor="none") for mark in marks.values()
    ]
    colours = [Line2D([], [], linestyle="none", color=color, marker="s") for color in ("C0", "C3")]
    axes.legend([*handles, *colours], [*marks, "agrees", "differs"], ncols=4, loc="lower right", fontsize="small")
    axes.axhline(END / FY, color=INK, linewidth=0.6, linestyle=":")
    axes.set(xlabel="packing", ylabel="$F_x/F_y$ at which the ramp ends", ylim=(0, 1.08 * END / FY), xticks=[])
    return figure


def _load(found: Row) -> float:
    return (END if found["ends"] is None else float(found["ends"])) / FY


def main() -> int:
    """The command; its exit code is 1 if an equilibrium was missed."""
    parser = argparse.ArgumentParser(prog="python -m fuzz.ramps", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("-o", "--output", type=Path, default=Path("docs/extremes"), help="the folder")
    parser.add_argument("--ramps", type=int, default=200, help="at least; each packing has six")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    chosen = parser.parse_args()
    chosen.output.mkdir(parents=True, exist_ok=True)
    packings = -(-chosen.ramps // (TRIED * len(ARITHMETICS)))
    rows: list[Row] = []
    for row in rows_of(chosen.output / "ramps.jsonl", packings, chosen.workers):
        rows.append(row)
        print(f"ramps: {len(rows)} of {packings} packings", file=sys.stderr, flush=True)
    rows.sort(key=lambda row: row["draw"])
    print(says(rows))
    write_text(chosen.output / "ramps.txt", says(rows) + "\n")
    save(figure_of(rows), chosen.output / "ramps")
    return int(any(each["verdict"] == "not found" for row in rows for each in row["ramps"]))


if __name__ == "__main__":
    sys.exit(main())
