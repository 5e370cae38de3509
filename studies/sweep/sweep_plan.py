"""A sweep: one scene with lists of values for some of its keys, in TOML.

    task = "onset"                                 # or "file.py:function", see user_function
    [sweep]
    "packing.seed" = "1:200"                       # 1, 2, ..., 200
    "law.mu" = [1.0, 0.8]
    "packing.disks, packing.width" = [[100, 11.9], [400, 23.8]]      # keys that vary together
    [scene.law]
    kn = 2e5
    ...

The points are the product of the lists, the last key varying fastest. Each point is a separate scene. Its key is a hash
of the task with its code, of the version of the program, and of the resolved scene with the contents of the files that
it names, so that a result can be recognised in any sweep, and no other result is taken for it.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from ... import registered
from ...pywrap import Scene, SceneError
from ...pywrap.scenes.validation import read_toml
from .user_function import locate, user_function

CHAOTIC = """settling is chaotic, so that a seed may be another packing at each value, and differences between values \
are those of packings, too: compare many seeds, or settle at one load with packing.settle_at"""

MOST_POINTS = 1_000_000
"""Points of a sweep at the most: more is a slip of the pen."""


@dataclass(frozen=True)
class SweepPoint:
    """One scene of a sweep: its `number` in the sweep, the `values` of the swept keys, and the scene, or why the values
    make none, `says`. `key` is sixteen hexadecimal digits that stand for task, version and scene."""

    number: int
    values: dict[str, Any]
    scene: Scene | None
    says: str | None
    key: str

    @cached_property
    def settling_key(self) -> str:
        """Digest of all keys on which settling depends; points with the same digest share the settled packing."""
        if self.scene is None:
            return self.key
        resolved = with_contents(self.scene) | {"perturb": self.scene.inertia_factor}
        resolved |= dict.fromkeys(("ramp", "friction", "output"))
        if not resolved["packing"].get("settle_friction", False):
            resolved["law"].pop("mu")
        return digest(resolved)


@dataclass(frozen=True)
class Sweep:
    """A task and the scenes for which to run it.

    Attributes
    ----------
    task : str
        Name of a task, or "file.py:function" as it was given.
    axes : dict
        Values by swept key; several keys that vary together are one, separated by commas.
    scene : dict
        Keys that all scenes share, in sections by name.
    code : str
        For a function of the user, sixteen hexadecimal digits that identify its code; else empty.
    folder : Path
        Folder to which the file name of such a function, and those in scenes, refer.
    """

    task: str
    axes: dict[str, list[Any]]
    scene: dict[str, Any]
    code: str = ""
    folder: Path = Path()

    @classmethod
    def from_toml(cls, path: str | Path) -> Sweep:
        """Read a sweep from a TOML file; SceneError if unreadable, or no sweep."""
        path = Path(path)
        return cls.from_mapping(read_toml(path, "sweep"), path.parent, str(path))

    @classmethod
    def of_task(cls, path: Path, task: str) -> Sweep:
        """The sweep of a file that has a sweep of this task, or a scene, which is a sweep of one point."""
        asked = read_toml(path, "sweep").get("task")
        if asked is None:
            return cls.from_mapping({"task": task, "scene": Scene.from_toml(path, command=task).resolved()})
        if asked != task:
            raise SceneError(f"{path}: task = {asked!r} is refused: give {task}.")
        return cls.from_toml(path)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any], folder: Path = Path(), name: str = "sweep") -> Sweep:
        """Make a sweep from the contents of a TOML file; SceneError if the contents describe no sweep.

        Relative names of files count from `folder`.
        """
        task, axes, scene = mapping.get("task"), mapping.get("sweep", {}), mapping.get("scene", {})
        own, wrong = isinstance(task, str) and ":" in task, ""
        if unknown := sorted(mapping.keys() - {"task", "sweep", "scene"}):
            wrong = f"{unknown[0]} is no key of a sweep: it has task, [sweep] and [scene.SECTION]."
        elif not own and task not in registered.tasks():
            known = ", ".join(registered.tasks())
            wrong = f'task = {task!r} is refused: give one of {known}, or a function of yours as "file.py:function".'
        for section, given in (("sweep", axes), ("scene", scene)):
            if not isinstance(given, Mapping):
                wrong = wrong or f"{section} is not a section: write [{section}] and its keys below."
        if wrong:
            raise SceneError(f"{name}: {wrong}")
        values = {key: _values(key, each, name) for key, each in axes.items()}
        if (count := prod(map(len, values.values()))) > MOST_POINTS:
            raise SceneError(f"{name}: {count} scenes are more than {MOST_POINTS}: make several sweeps of it.")
        code = user_function(locate(str(task), folder)).code if own else ""
        sweep = cls(str(task), values, dict(scene), code, folder)
        # what is wrong with every scene is refused before any work is done
        if all(point.says is not None for point in sweep.points):
            raise SceneError(f"{name}: no point of the sweep is a scene that can be run: {sweep.points[0].says}")
        return sweep

    @property
    def names(self) -> list[str]:
        """The swept keys, each by itself."""
        return [name for key in self.axes for name in _split_keys(key)]

    @cached_property
    def points(self) -> tuple[SweepPoint, ...]:
        """Every point, in the order of the table."""
        # a user's function is known by its name and code, without its folder
        task = f"{self.task.rpartition(':')[2]} {self.code}" if self.code else self.task
        points = []
        for number, chosen in enumerate(product(*self.axes.values())):
            values: dict[str, Any] = {}
            for key, value in zip(self.axes, chosen, strict=True):
                names = _split_keys(key)
                values |= zip(names, value if len(names) > 1 else [value], strict=True)
            mapping = {name: dict(part) if isinstance(part, Mapping) else part for name, part in self.scene.items()}
            for name, value in values.items():
                section, _, key = name.rpartition(".")
                (mapping.setdefault(section, {}) if section else mapping)[key] = value
            scene = says = None
            try:
                scene = Scene.from_mapping(mapping, self.folder, command=self.task)
                mapping = with_contents(scene)
            except SceneError as error:
                says = str(error).removeprefix("scene: ")
            key = digest([task, version("faultgouge"), mapping])
            points.append(SweepPoint(number, values, scene, says, key))
        return tuple(points)

    def as_dict(self) -> dict[str, Any]:
        """The sweep as JSON holds it."""
        return {"task": self.task, "sweep": self.axes, "scene": self.scene}


def points_of(points: tuple[SweepPoint, ...], part: tuple[int, int]) -> tuple[SweepPoint, ...]:
    """Part K of N of the points, counted from 1: whole settlings, so that no two parts settle the same packing."""
    order = {key: place for place, key in enumerate(dict.fromkeys(point.settling_key for point in points))}
    return tuple(point for point in points if order[point.settling_key] % part[1] == part[0] - 1)


def with_contents(scene: Scene) -> dict[str, Any]:
    """A resolved scene with the digests of its files in place of their names, which any other file could have."""
    resolved = scene.resolved()
    for name, content in scene.digests().items():
        section, key = name.split(".")
        resolved[section][key] = content[:16]
    return resolved


def digest(value: Any) -> str:
    """Sixteen hexadecimal digits that stand for a value."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()[:16]


def _split_keys(key: str) -> list[str]:
    return [name.strip() for name in key.split(",")]


def _values(key: str, values: Any, name: str) -> list[Any]:
    """The values of a swept key: the elements of a list, or the whole numbers of "FIRST:LAST"."""
    if isinstance(values, str) and (match := re.fullmatch(r"\s*(\d{1,7})\s*:\s*(\d{1,7})\s*", values)):
        values = list(range(int(match[1]), int(match[2]) + 1))
    if not isinstance(values, list) or not values:
        cure = 'give a list of values, or a range "FIRST:LAST", both included'
        raise SceneError(f'{name}: "{key}" = {values!r} is refused: {cure}.')
    count = len(_split_keys(key))
    if count > 1 and not all(isinstance(each, list) and len(each) == count for each in values):
        raise SceneError(f'{name}: "{key}" names {count} keys: each value is a list of {count}.')
    return values


def other_packings(sweep: Sweep) -> str | None:
    """A sentence that names the swept keys by which a seed may be another packing at each value; None without any.

    Settling amplifies the last digit of its load and of its stiffness; with `settle_friction`, of the friction, too.
    Packings that settle at a load of reference (`settle_at`) and are carried to other loads remain one packing.
    """
    packing = sweep.scene.get("packing", {})
    at, frictional = packing.get("settle_at", {}), packing.get("settle_friction", False)
    load, stiffness = "fy" not in at, "kn" not in at  # of [units], k_n follows from all keys but the overburden
    settles = {"load.fy": load, "units.overburden": load, "law.kn": stiffness, "law.exponent": True}
    settles |= {"law.mu": frictional, "law.kt": frictional}
    keys = [name for name in sweep.names if settles.get(name, name.startswith("units.") and stiffness)]
    return None if not keys or "file" in packing else f"{', '.join(keys)}: {CHAOTIC}"
