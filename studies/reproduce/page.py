"""The report of the protocol in plain words."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from ...figures.pages import render
from ...pywrap import Scene
from ...pywrap.onset.undamped import OnsetRun
from ...pywrap.scenes.units import dashpot, quality_factor, real_units
from ..triggering.compute import largest
from ..triggering.page import section
from .compute import GrowthRun, TriggeringRun


def report(scene: Scene, runs: list[OnsetRun], growth: GrowthRun, triggered: TriggeringRun | None) -> str:
    """report.md.

    Parameters
    ----------
    scene : Scene
        What was run.
    runs : list of OnsetRun
        Ramp and onset for each friction coefficient.
    growth : GrowthRun
        The undamped run above the onset.
    triggered : TriggeringRun or None
        The perturbation below it, if the scene has one.
    """
    packing = runs[0].equilibria[0].packing
    order = sorted(runs, key=lambda run: run.mu)
    return render(
        __package__ or "",
        "report.md.j2",
        packing=packing,
        ramp=scene.ramp,
        runs=runs,
        last=runs[0].equilibria[-1],
        residual=max(each.residual for run in runs for each in run.equilibria),
        mus_rise=all(a.onset.fx_c < b.onset.fx_c for a, b in pairwise(order)),
        growth=growth,
        triggering=_triggering(triggered),
        another=triggered if triggered is not None and triggered.scene is not scene else None,
        settled_with_friction=getattr(scene.packing, "settle_friction", False),
        **_in_si(scene, growth, triggered),
    )


def _triggering(triggered: TriggeringRun | None) -> str:
    if triggered is None:
        return ""
    if triggered.triggering is None:
        return f"## Triggering\n\n{triggered.says}\n\n"
    return section(triggered.triggering)


def _in_si(scene: Scene, growth: GrowthRun, triggered: TriggeringRun | None) -> dict[str, Any]:
    """What the column in SI needs; `real` is None if the scene has no units."""
    real, units = real_units(scene), scene.units
    if real is None or units is None:
        return {"real": None}
    fastest = max(growth.spectrum.pairs, key=lambda each: each.growth_rate)
    found = {
        "real": real,
        "scene": scene,
        "fastest": fastest,
        "quality": quality_factor(0.5 * fastest.growth_rate + 1j * fastest.frequency),
        "dashpot": None,
        "wave": None,
    }
    if units.restitution is not None:
        velocity = units.si("impact_velocity") / real.velocity(1.0)
        found["dashpot"] = dashpot(scene.law.kn, units.restitution, 1.0, velocity)
    if triggered is not None and triggered.triggering is not None and triggered.scene is scene:
        found |= {"wave": triggered, "erupted": largest(triggered.triggering.erupting)}
    return found
