"""The page of the stiff and extreme cases."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from ...figures.pages import render
from .cases.case import Case, Outcome


def stability_page(done: Sequence[tuple[Case, Outcome]]) -> str:
    """stability.md with what there is."""
    statuses = [outcome.status for _, outcome in done]
    groups = [(name, list(members)) for name, members in groupby(done, lambda each: each[0].group)]
    return render(__package__ or "", "stability.md.j2", done=done, statuses=statuses, groups=groups)
