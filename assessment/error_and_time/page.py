"""The page of the studies: which method to take when, with every figure and number."""

from __future__ import annotations

import re
from typing import Any

from ...figures.pages import render
from .work_precision.study import Study


def stem(name: str) -> str:
    """A study's name as that of a file, and of its heading's anchor."""
    return re.sub("[^a-z ]", "", name.lower()).replace(" ", "-")


def report_page(where: dict[str, Any], quick: bool, done: list[Study], failed: dict[str, str]) -> str:
    """report.md with what there is."""
    return render(__package__ or "", "report.md.j2", where=where, quick=quick, done=done, failed=failed, stem=stem)
