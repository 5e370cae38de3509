"""The report of the protocol in plain words."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from ...figures.pages import render
from ...pywrap import Scene
from ...pywrap.onset.undamped import OnsetRun
from ...pywrap.scenes.units import dashpot, quality_factor, real_units
from ..triggering.compute import Triggering, largest
from ..triggering.page import section
from .compute import GrowthRun


def report(
    scene: Scene,
    runs: list[OnsetRun],
    growth: GrowthRun,
    found: Triggering | str | None,
    another: list[OnsetRun] | None,
) -> str:
    """report.md.

    Parameters
    ----------
    scene : Scene
        What was run.
    runs : list of OnsetRun
        Ramp and onset for each friction coefficient.
    growth : GrowthRun
        The undamped run above the onset.
    found : Triggering, str or None
        The perturbation below the onset, or why there is nothing to trigger; None if no scene asks for it.
    another : list of OnsetRun or None
        Ramps and onsets of the packing that is triggered, if it is another one.
    """
    order = sorted(runs, key=lambda run: run.mu)
    return render(
        __package__ or "",
        "report.md.j2",
        packing=runs[0].equilibria[0].packing,
        ramp=scene.ramp,
        runs=runs,
        last=runs[0].equilibria[-1],
        residual=max(each.residual for run in runs for each in run.equilibria),
        mus_rise=all(a.onset.fx_c < b.onset.fx_c for a, b in pairwise(order)),
        growth=growth,
        triggering=section(found)
        if isinstance(found, Triggering)
        else f"## Triggering\n\n{found}\n\n"
        if found
        else "",
        another=another,
        settled_with_friction=getattr(scene.packing, "settle_friction", False),
        **_in_si(scene, growth, found if isinstance(found, Triggering) and another is None else None),
    )


def _in_si(scene: Scene, growth: GrowthRun, wave: Triggering | None) -> dict[str, Any]:
    """What the column in SI needs; `real` is None if the scene has no units."""
    real, units = real_units(scene), scene.units
    if real is None or units is None:
        return {"real": None}
    fastest = max(growth.spectrum.pairs, key=lambda each: each.growth_rate)
    constant = None
    if units.restitution is not None:
        constant = dashpot(scene.law.kn, units.restitution, 1.0, units.si("impact_velocity") / real.velocity(1.0))
    return {
        "real": real,
        "scene": scene,
        "fastest": fastest,
        "quality": quality_factor(0.5 * fastest.growth_rate + 1j * fastest.frequency),
        "dashpot": constant,
        "wave": wave,
        "erupted": None if wave is None else largest(wave.erupting),
    }
