"""The page of the sizes of eruptions."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...figures.pages import render
from .compute import DECADES, OVER, QUIET
from .draw import WORDS


def page(result: dict[str, Any]) -> str:
    """The page, in Markdown, from what eruptions.json holds."""
    runs = result["runs"]
    damped = {run["fx"]: run for run in runs if run["damped"]}
    damping = result["scene"].get("damping") or {}
    grown = [run["msd"] for run in runs if run["ends"] != "stable" and not run["damped"]]
    return render(
        __package__ or "",
        "eruptions.md.j2",
        runs=runs,
        units=result["units"],
        fy=result["scene"]["load"]["fy"],
        words=WORDS,
        beside=[(run, damped[run["fx"]]) for run in runs if not run["damped"] and run["fx"] in damped],
        damping=", ".join(f"{key} = {value:g}" for key, value in damping.items() if value),
        decades=float(np.log10(max(grown) / min(grown))) if grown else 0.0,
        noise=(min(run["noise"] for run in runs), max(run["noise"] for run in runs)),
        balance=max(run["balance"] for run in runs if not run["damped"]),
        criterion=(OVER, DECADES, QUIET),
    )
