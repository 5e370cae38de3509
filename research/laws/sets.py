"""The sweeps of this study: the packings of `research.modes`, those of the seeds 1, 2, ..., M.

M was set by what a packing costs, and not by what came out, but for 400 disks: these were three packings at 0.2, of
which one reached that load, and became ten, with 0.1 besides, after that was seen. All ten were computed anew. Quartz
under 100 MPa was added when the other two depths were known. Increments are 1e-3 F_y.
"""

from __future__ import annotations

from typing import Any

from faultgouge.studies.sweep import Sweep
from research.modes.sets import quartz
from research.modes.sets import sets as sets_of_modes

LAWS, GROWTH = "research.laws.both_laws:both_laws", "research.laws.growth:growth"

FORCE: dict[int, tuple[int, tuple[float, ...]]] = {
    100: (20, (0.03, 0.1, 0.2, 0.3)),
    50: (10, (0.03, 0.1, 0.2, 0.3)),
    200: (10, (0.1, 0.2)),
    400: (10, (0.1, 0.2)),
}
"""Packings by number of disks, mu = 1 and a fixed force, and F_x/F_y."""

QUARTZ = {"10 MPa": 10, "1 MPa": 10, "100 MPa": 10}
"""Packings of the shipped scenes of quartz."""

QUARTZ_LOADS = (0.2, 0.3)

GROWING, GROWTH_LOADS = 20, (0.2,)
"""Packings whose growth is measured, and the load."""

ONSETS, REACH = 20, 0.1
"""Packings whose first window is sought with either law, and F_x/F_y up to where."""


def sets() -> dict[str, Sweep]:
    """The sweeps by name, in the order in which they are computed."""
    found, modes = {}, sets_of_modes()
    for disks, (most, loads) in FORCE.items():
        found[f"force {disks}"] = _sweep(modes[f"force {disks}"].scene, most, loads, LAWS)
        if disks == 100:
            found["growth 100"] = _sweep(modes["force 100"].scene, GROWING, GROWTH_LOADS, GROWTH)
            for history in ("total", "coulomb"):
                found[f"onset {history}"] = _onset(modes["force 100"].scene, history)
            for depth, packings in QUARTZ.items():
                found[f"quartz {depth}"] = _sweep(quartz(depth), packings, QUARTZ_LOADS, LAWS)
    return found


def _onset(scene: dict[str, Any], history: str) -> Sweep:
    fy = scene["load"]["fy"]
    changed = scene | {"law": scene["law"] | {"history": history}, "ramp": {"step": 1e-3 * fy, "until": REACH * fy}}
    return Sweep.from_mapping({"task": "onset", "sweep": {"packing.seed": f"1:{ONSETS}"}, "scene": changed})


def _sweep(scene: dict[str, Any], most: int, loads: tuple[float, ...], task: str) -> Sweep:
    fy = scene["load"]["fy"]
    ramp = {"step": 1e-3 * fy, "until": max(loads) * fy}
    changed = scene | {"ramp": ramp, "modes": {"fx_over_fy": list(loads)}}
    return Sweep.from_mapping({"task": task, "sweep": {"packing.seed": f"1:{most}"}, "scene": changed})
