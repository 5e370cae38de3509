"""Walls of regions that move: no packing rests between them, and the place of such a wall differs in each run.

A region may have `move` and `rotate` with variables. Whether these change in time, or have come to a constant, is seen
in a few steps of a copy.
"""

from functools import partial
from typing import Any

import numpy as np

from .granular_commands import Commands, without_suffix
from .instance_queries import styles_of
from .look_in_a_copy import in_a_copy, quieten

STEPS_TO_CHANGE = 3
"""Steps in which a variable that depends on the time has other values."""


def moving_region(lmp: Any, commands: Commands) -> str:
    """The sentence on a wall whose region moves; empty if no region is known to move."""
    styles = styles_of(lmp).fixes
    found = [
        (name, region, variable)
        for name, line in commands.fixes.items()
        if name in styles and without_suffix(line.split()[3]) == "wall/gran/region"
        for region in _parts(commands, line.split()[line.split().index("region") + 1])
        for variable in _variables(commands.regions[region])
    ]
    moving = in_a_copy(partial(_changing, lmp, sorted({each for *_, each in found}))) if found else set()
    for name, region, variable in found:
        if variable in moving:
            return (
                f"Region {region} of fix {name} moves with v_{variable}: give this variable a constant before the last "
                "run, and run on until the packing rests."
            )
    return ""


def _parts(commands: Commands, region: str) -> list[str]:
    """IDs of a region and of those that make it up, as far as they are known."""
    words = commands.regions.get(region, "").split()
    if not words:
        return []
    parts = words[4 : 4 + int(words[3])] if words[2] in ("union", "intersect") else []
    return [region, *(name for part in parts for name in _parts(commands, part))]


def _variables(line: str) -> list[str]:
    """Variables by which a region moves or rotates."""
    words = line.split()
    at = [k for k, word in enumerate(words) if word in ("move", "rotate")]
    return [word[2:] for k in at for word in words[k + 1 : k + 4] if word.startswith("v_")]


def _changing(lmp: Any, variables: list[str]) -> set[str]:
    """Variables that change in some steps, in a copy."""
    quieten(lmp)
    lmp.command(f"fix faultgouge_v all vector 1 {' '.join(f'v_{name}' for name in variables)}")
    lmp.command(f"run {STEPS_TO_CHANGE} post no")
    one = len(variables) == 1
    values = np.array(
        [
            [lmp.extract_fix("faultgouge_v", 0, 1 if one else 2, row, column) for column in range(len(variables))]
            for row in range(STEPS_TO_CHANGE + 1)
        ]
    )
    return {name for name, column in zip(variables, values.T, strict=True) if np.ptp(column) > 0}
