"""Tables of research: lines of JSON, and files of JSON."""

import json
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from faultgouge.studies.result_rows import append_row

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

SWEEP_ROWS = "results.jsonl"
"""Name of the file of rows in the folder of a sweep."""


def read_toml(path: Path) -> dict[str, Any]:
    """The contents of a scene or of a sweep as they are written."""
    return tomllib.loads(path.read_text(encoding="utf-8"))


def read_rows(path: Path) -> list[dict[str, Any]]:
    """The rows of a table that is whole."""
    return [json.loads(line) for line in path.read_text().splitlines()]


def known_rows(path: Path) -> list[dict[str, Any]]:
    """The rows of a table that is computed bit by bit; none where there is no table yet."""
    return read_rows(path) if path.exists() else []


def differing(known: Mapping[str, Any], again: Mapping[str, Any], names: Iterable[str], relative: float) -> list[str]:
    """The names of numbers that differ between a row of a table and the same row computed again, with both."""

    def same(old: Any, new: Any) -> bool:
        if old is None or new is None or isinstance(old, bool):
            return old is new
        return bool(np.allclose(old, new, rtol=relative, atol=1e-9))

    return [
        f"{name} {again[name]}, before {known[name]}"
        for name in names
        if name in known and not same(known[name], again[name])
    ]


def write_json(path: Path, value: object) -> None:
    """Write the numbers of a page."""
    path.write_text(json.dumps(value, indent=1) + "\n")


def add_seeds(
    table: Path, seeds: Iterable[int], rows_of: Callable[[int], Iterable[dict[str, Any]]], watch: Any = print
) -> None:
    """Add the rows of the seeds that a table lacks, in their order, whole seeds at a time."""
    known = {row["seed"] for row in known_rows(table)}
    for seed in seeds:
        if seed not in known:
            for row in list(rows_of(seed)):
                append_row(table, row)
            watch(f"seed {seed}", flush=True)
