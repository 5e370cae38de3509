"""The sweeps of the study, with the rule by which packings are chosen.

**The rule.** Packings are those of the seeds 1, 2, ..., M, all of them; M is in `SIZES`, `FEWER` and `KINDS`. It was
set by what a packing costs, and not by what came out. None is left out: where Newton's method finds no further
equilibrium a packing has its loads up to there.

**Checks** repeat some packings in another way: with increments of half the length, in compensated arithmetic, and with
seeds from another range.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from math import ceil, sqrt
from pathlib import Path
from typing import Any

from faultgouge.studies.sweep import Sweep
from research.tables import read_toml

SIZES = {50: 100, 100: 100, 200: 50, 400: 30, 1000: 15}
"""Packings by number of disks, with a fixed force on each disk of the layer and mu = 1."""

SWITCHED = 100
"""Disks of the packings of `SIZES` whose pairs are also counted with parts of b."""

FEWER = {50: 40, 100: 40, 200: 20, 400: 8}
"""The same for mu = 0.5, and for a fixed pressure."""

KINDS: Mapping[str, tuple[int, Mapping[str, Mapping[str, Any]]]] = {
    "settled with friction": (6, {"packing": {"settle_friction": True}}),
    "harmonic": (40, {"law": {"exponent": 1, "kn": 7e3}}),
    "stiff tangent": (40, {"law": {"kt": "1/2 kn"}}),
    "rescaled history": (20, {"law": {"history": "rescaled"}}),
}
"""Packings of 100 disks of other kinds: how many, and what differs. k_n of the harmonic law as in genericity."""

CHECKS: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "halved increments": ("1:10", {"ramp": {"step": 1.5e-3}}),
    "compensated": ("1:10", {"precision": "compensated"}),
    "other seeds": ("1001:1040", {}),
}
"""Packings of 100 disks once more: which seeds, and what differs."""

TASKED: Mapping[str, tuple[str, Mapping[int, int], list[float]]] = {
    "random": (
        "research.modes.random_matrices:random_matrices",
        {50: 20, 100: 20, 200: 10, 400: 4},
        [0.01, 0.02, 0.03, 0.05, 0.1, 0.2, 0.3],
    ),
    "loss": ("research.modes.loss:loss", {50: 40, 100: 40, 200: 20, 400: 8}, [0.02, 0.05, 0.1, 0.2, 0.3]),
    "runs": ("research.modes.lossy_runs:lossy_runs", {100: 6, 400: 1}, [0.1, 0.2]),
}
"""Other tasks than "modes": packings by number of disks, which are the first ones of `SIZES`, and F_x/F_y."""

QUARTZ = {"1 MPa": 20, "10 MPa": 20, "100 MPa": 20}
"""Packings of the shipped scenes quartz_1MPa.toml and so on, with other seeds."""

THICK = {50: 20, 200: 10, 400: 4}
"""The same at 10 MPa with other numbers of disks in the same width: other thicknesses of the layer."""

SHARES = (0.2, 0.5, 1.0)
"""Rounds, so that a study that is cut off has something of all."""

STANDARD: Mapping[str, Mapping[str, Any]] = {
    "law": {"kn": 2e5},
    "load": {"fy": 3.0},
    "ramp": {"step": 3e-3, "until": 1.2},
}
"""Increments of 1e-3 F_y, to loads that few packings bear."""

WIDTH = 11.9
"""Of 100 disks; the width grows with the root of the number of disks, so that all packings have one shape."""


def sets(share: float = 1.0) -> dict[str, Sweep]:
    """The sweeps by name, each with a share of its packings, at least one."""
    found = {}
    for disks, most in SIZES.items():
        task = "research.modes.parts_of_b:parts_of_b" if disks == SWITCHED else "modes"
        found[f"force {disks}"] = _sweep(disks, _first(most, share), {}, task)
    for disks, most in FEWER.items():
        found[f"friction {disks}"] = _sweep(disks, _first(most, share), {"law": {"mu": 0.5}})
        if disks != 100:
            ratio = 1 / sqrt(disks / 100)
            pressed = {"load": {"fy": 3.0 * ratio}, "ramp": {"step": 3e-3 * ratio, "until": 1.2 * ratio}}
            found[f"pressure {disks}"] = _sweep(disks, _first(most, share), pressed)
    for name, (most, changes) in KINDS.items():
        found[name] = _sweep(100, _first(most, share), changes)
    for name, (task, packings, loads) in TASKED.items():
        for disks, most in packings.items():
            found[f"{name} {disks}"] = _sweep(disks, _first(most, share), {"modes": {"fx_over_fy": loads}}, task)
    for depth, most in QUARTZ.items():
        found[f"quartz {depth}"] = _shipped_scene(depth, _first(most, share))
    for disks, most in THICK.items():
        found[f"thick {disks}"] = _shipped_scene("10 MPa", _first(most, share), disks)
    for name, (seeds, changes) in CHECKS.items():
        found[name] = _sweep(100, seeds, changes)
    return found


def _first(most: int, share: float) -> str:
    return f"1:{max(1, ceil(most * share))}"


def quartz(depth: str, disks: int = 100) -> dict[str, Any]:
    """The shipped scene of quartz spheres under an overburden, such as "10 MPa", with so many disks."""
    scene = read_toml(Path(str(files("faultgouge.scenes") / f"quartz_{depth.replace(' ', '')}.toml")))
    scene["packing"]["disks"] = disks
    return scene


def _shipped_scene(depth: str, seeds: str, disks: int = 100) -> Sweep:
    return Sweep.from_mapping(
        {"task": "research.modes.loss:loss", "sweep": {"packing.seed": seeds}, "scene": quartz(depth, disks)}
    )


def _sweep(disks: int, seeds: str, changes: Mapping[str, Any], task: str = "modes") -> Sweep:
    packing = {"disks": disks, "width": WIDTH * sqrt(disks / 100)}
    scene: dict[str, Any] = {"packing": packing} | {name: dict(section) for name, section in STANDARD.items()}
    for name, value in changes.items():
        scene[name] = scene.get(name, {}) | dict(value) if isinstance(value, Mapping) else value
    return Sweep.from_mapping({"task": task, "sweep": {"packing.seed": seeds}, "scene": scene})
