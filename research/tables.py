"""Tables of research: lines of JSON, and files of JSON."""

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from faultgouge.studies.result_rows import append_row

SWEEP_ROWS = "results.jsonl"
"""Name of the file of rows in the folder of a sweep."""


def read_rows(path: Path) -> list[dict[str, Any]]:
    """The rows of a table that is whole."""
    return [json.loads(line) for line in path.read_text().splitlines()]


def write_json(path: Path, value: object) -> None:
    """Write the numbers of a page."""
    path.write_text(json.dumps(value, indent=1) + "\n")


def add_seeds(
    table: Path, seeds: Iterable[int], rows_of: Callable[[int], Iterable[dict[str, Any]]], watch: Any = print
) -> None:
    """Add the rows of the seeds that a table lacks, in their order; what is written is of whole seeds."""
    known = {row["seed"] for row in read_rows(table)} if table.exists() else set()
    for seed in seeds:
        if seed not in known:
            for row in list(rows_of(seed)):
                append_row(table, row)
            watch(f"seed {seed}", flush=True)
