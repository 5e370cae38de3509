"""The tables of README.md, a record a line; what is there is not computed again.

python -m research.dissipation.make weak|cn|drag|gain [SEED ..]
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from faultgouge.analysis import NoEquilibriumError
from faultgouge.pywrap import Scene
from faultgouge.studies.result_rows import append_row
from research.dissipation.compute import RATIOS, over_distance, over_strength, ramped, weak_cases
from research.packing_tools import with_seed
from research.tables import read_rows

HERE = Path(__file__).parent

SCENE = Scene.from_mapping(
    {"packing": {"seed": 1}, "law": {"kn": 2e5}, "load": {"fy": 3.0}, "ramp": {"step": 1e-3, "until": 0.03}}
)
"""That of README, and higher loads."""

PACKINGS, MOST_SEEDS = 10, 40

STRENGTHS = {"cn": np.geomspace(1e-4, 1e2, 13), "drag": np.geomspace(1e-4, 1e-1, 7)}

START = 0.0135
"""No motion grows at lower loads with C_N = 1: the whole ramp was searched for that one."""

DISTANCES = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4)

DISSIPATIONS = ((0.0, 0.0), (0.0, 1e-2), (0.0, 1e-1), (1.0, 0.0))
"""(C_N, 1/tau)."""


def weak(done: list[dict[str, Any]], only: list[int]) -> Iterator[dict[str, Any]]:
    """Ten packings, five ratios each; seeds without an onset, or that flow, say so."""
    seeds: dict[int, int] = {}
    for each in done:
        seeds[each["seed"]] = seeds.get(each["seed"], 0) + ("cn" in each)
    for seed in only or range(1, MOST_SEEDS):
        if sum(count == len(RATIOS) for count in seeds.values()) == PACKINGS:
            return
        known = {(each.get("cn"), each.get("ct")) for each in done if each["seed"] == seed}
        if (None, None) in known or len(known) == len(RATIOS):
            continue
        try:
            with ramped(with_seed(SCENE, seed)) as path:
                seeds[seed] = len(known)
                for case in weak_cases(path, [ratio for ratio in RATIOS if ratio not in known]):
                    seeds[seed] += 1
                    yield {"seed": seed} | case
                if seeds[seed] == 0:
                    yield {"seed": seed, "without": "an undamped window"}
        except NoEquilibriumError as error:
            yield {"seed": seed, "without": str(error)}


def strength(kind: str, done: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """One packing."""
    known = [each["strength"] for each in done]
    with ramped(SCENE) as path:
        wanted = [float(each) for each in STRENGTHS[kind] if not np.any(np.isclose(each, known, atol=0))]
        yield from over_strength(path, kind, wanted, START)


def gain(done: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """One packing, a kind of dissipation after the other."""
    with ramped(SCENE) as path:
        for kind in DISSIPATIONS:
            known = [each["distance"] for each in done if (each["cn"], each["drag"]) == kind]
            wanted = [float(each) for each in DISTANCES if not np.any(np.isclose(each, known, atol=0))]
            yield from over_distance(path, wanted, [kind])


def main(what: str, seeds: list[int]) -> None:
    """Append to one table; of `weak` these seeds alone."""
    path = HERE / "tables" / f"{what}.jsonl"
    done = read_rows(path) if path.exists() else []
    records = weak(done, seeds) if what == "weak" else gain(done) if what == "gain" else strength(what, done)
    for record in records:
        append_row(path, record)
        print(record, flush=True)


if __name__ == "__main__":
    main(sys.argv[1], [int(each) for each in sys.argv[2:]])
