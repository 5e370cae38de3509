"""The page of the map of waves that trigger."""

from __future__ import annotations

from typing import Any

from ...figures.pages import render
from ...pywrap import Scene


def page(scene: Scene, result: dict[str, Any]) -> str:
    """The page, in Markdown.

    Parameters
    ----------
    scene : Scene
        What was asked for.
    result : dict
        What trigger.json holds.
    """
    rows = result["map"]
    distances = sorted({row["distance"] for row in rows}, reverse=True)
    weakest = [min((r for r in rows if r["distance"] == d), key=lambda r: r["predicted"]) for d in distances]
    slowest = [min((r for r in rows if r["distance"] == d), key=lambda r: r["omega"]) for d in distances]
    return render(
        __package__ or "",
        "trigger.md.j2",
        result=result,
        runs=[row for row in rows if row["measured"] is not None],
        distances=list(zip(distances, weakest, slowest, strict=True)),
        wave="a force a cos(omega t) along x on each disk of the upper layer"
        if result["on"] == "layer"
        else "an acceleration a cos(omega t) of the floor along x",
        units=result["units"],
        damped=scene.damping is not None,
    )
