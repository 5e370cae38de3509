"""Tables of research: lines of JSON."""

import json
from pathlib import Path
from typing import Any


def read_rows(path: Path) -> list[dict[str, Any]]:
    """The rows of a table that is whole."""
    return [json.loads(line) for line in path.read_text().splitlines()]
