"""Results that are written as they come: a line of JSON each, in a file that an interrupted study goes on with."""

from __future__ import annotations

import hashlib
import json
import os
from importlib.metadata import version
from pathlib import Path
from typing import Any

from ..pywrap import Scene


def complete_lines(path: Path) -> list[bytes]:
    """The lines of a file, none if there is no file. A last line that a kill has cut short is taken off the file."""
    if not path.exists():
        return []
    data = path.read_bytes()
    complete = data[: data.rfind(b"\n") + 1]
    if complete != data:
        os.truncate(path, len(complete))
    return complete.splitlines()


class Rows:
    """Lines of one scene in a file; lines of other scenes are left alone.

    Parameters
    ----------
    path : Path
        The file, NAME.jsonl. A last line that a crash cut short is taken off.
    scene : Scene
        Whose lines count.
    beside : str
        A section of the scene that may change without making lines of it worthless.
    """

    def __init__(self, path: Path, scene: Scene, beside: str) -> None:
        self.path = path
        resolved = {name: keys for name, keys in scene.resolved().items() if name != beside}
        self._scene = hashlib.sha256(json.dumps(resolved, sort_keys=True).encode()).hexdigest()[:12]
        self.rows: list[dict[str, Any]] = [
            row for line in complete_lines(path) if (row := json.loads(line))["scene"] == self._scene
        ]

    def append(self, **row: Any) -> dict[str, Any]:
        """Write a line; it is in the file when this returns."""
        row = {"scene": self._scene, "version": version("faultgouge")} | row
        with self.path.open("a") as file:
            file.write(json.dumps(row) + "\n")
        self.rows.append(row)
        return row

    def find(self, **wanted: Any) -> dict[str, Any] | None:
        """The first line with these values, if there is one."""
        return next((row for row in self.rows if all(row.get(key) == value for key, value in wanted.items())), None)
