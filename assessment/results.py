"""What `report` and `extremes` leave in a folder: NAME.json and the page NAME.md, written again after every part, so
that a part that crashes the program is the missing part."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..analysis import FaultgougeError
from ..analysis.files.atomic_write import write_json, write_text
from ..figures.pages import render


class AssessmentError(FaultgougeError):
    """Parts that failed, in one sentence."""


def reason_of(error: Exception) -> str:
    """The kind of an error and the first line of what it says."""
    return f"{type(error).__name__}: {(str(error).splitlines() or ['no reason given'])[0]}"


def write_results(output: Path, name: str, package: str, result: dict[str, Any], **page: Any) -> None:
    """Write the numbers, of which none may be nan, and the page from the template NAME.md.j2 of a package."""
    write_json(output / f"{name}.json", result, allow_nan=False)
    write_text(output / f"{name}.md", render(package, f"{name}.md.j2", **result, **page))
