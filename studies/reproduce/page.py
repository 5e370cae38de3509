"""The report of the protocol in plain words."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from ...analysis import Onset
from ...analysis.packing.solid_fraction import solid_fraction, solid_fraction_below_top
from ...figures.pages import render
from ...pywrap import Scene
from ...pywrap.runs.undamped import ACCURATE_SHARE
from ...pywrap.scenes.units import dashpot, quality_factor, real_units
from ...pywrap.scenes.validation import require_section
from ..triggering import ABOVE_NOISE, Triggering, largest, summary
from .compute import GrowthRun


def report(
    scene: Scene,
    runs: list[Onset],
    growth: GrowthRun,
    found: Triggering | str | None,
    another: list[Onset] | None,
) -> str:
    """report.md of ramps for each friction coefficient, the run above the onset, and the triggering below it.

    `found` is a sentence where there is nothing to trigger, and None if no scene asks for it; `another` has the ramps
    of the packing that is triggered, if it is another one.
    """
    settled = runs[0].equilibria[0].packing
    order = sorted(runs, key=lambda run: run.mu)
    triggering = found if isinstance(found, Triggering) else None
    return render(
        __package__ or "",
        "report.md.j2",
        packing=settled,
        solid_fraction=(solid_fraction(settled), solid_fraction_below_top(settled)),
        ramp=scene.ramp,
        runs=runs,
        last=runs[0].equilibria[-1],
        residual=max(each.residual for run in runs for each in run.equilibria),
        earlier=[_is_earlier(a, b) for a, b in pairwise(order)],
        growth=growth,
        triggering=triggering,
        says=found,
        another=another,
        time_step_share=ACCURATE_SHARE,
        settled_with_friction=getattr(scene.packing, "settle_friction", False),
        **({} if triggering is None else _triggering_numbers(triggering)),
        **_in_si(scene, growth, triggering if another is None else None),
    )


def _is_earlier(one: Onset, other: Onset) -> bool | None:
    """Whether an onset comes before another one; None where their errors do not tell."""
    apart = other.fx_c - one.fx_c
    return None if abs(apart) <= one.error + other.error else apart > 0


def _triggering_numbers(found: Triggering) -> dict[str, Any]:
    """Numbers of the section on triggering, besides the runs."""
    numbers = summary(found)
    jump = numbers["jump"]
    return {
        "numbers": numbers,
        "calibrated": isinstance(require_section(found.scene.friction, "friction").v0, str),
        "highest_speed": float(np.abs(found.runs["erupting"]["layer_velocity"]).max()),
        "jumped": None if jump is None else float(np.log10(jump / numbers["largest_D"]["perturbed"])),
        "above_noise": ABOVE_NOISE,
    }


def _in_si(scene: Scene, growth: GrowthRun, wave: Triggering | None) -> dict[str, Any]:
    """Numbers of the column in SI; `real` is None if the scene has no units."""
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
        "erupted": None if wave is None else largest(wave.runs["erupting"]),
    }
