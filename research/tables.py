"""Tables of research: lines of JSON, and files of JSON."""

import json
from pathlib import Path
from typing import Any

SWEEP_ROWS = "results.jsonl"
"""Name of the file of rows in the folder of a sweep."""


def read_rows(path: Path) -> list[dict[str, Any]]:
    """The rows of a table that is whole."""
    return [json.loads(line) for line in path.read_text().splitlines()]


def write_json(path: Path, value: object) -> None:
    """Write the numbers of a page."""
    path.write_text(json.dumps(value, indent=1) + "\n")
