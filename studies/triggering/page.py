"""The section of a report on remote triggering."""

from __future__ import annotations

import numpy as np

from ...figures.pages import render
from ...pywrap.scenes.refusals import needed
from .compute import ABOVE_NOISE, Triggering, column, summary


def section(triggering: Triggering) -> str:
    """The section, in Markdown."""
    numbers = summary(triggering)
    return render(
        __package__ or "",
        "triggering.md.j2",
        triggering=triggering,
        sensitive=triggering.sensitive,
        settings=triggering.scene.perturb,
        calibrated=isinstance(needed(triggering.scene.friction, "friction").v0, str),
        mu=triggering.start.packing.law.mu,
        weak=triggering.weakening,
        largest=numbers["largest_D"],
        lowest_mu=numbers["smallest_mu"],
        highest_speed=float(np.abs(column(triggering.erupting, "layer_velocity")).max()),
        jump=numbers["jump"],
        jumped=float(np.log10(numbers["jump"] / numbers["largest_D"]["perturbed"])),
        control=numbers["largest_D_of_the_control"],
        above_noise=ABOVE_NOISE,
        half_gain=numbers["half_gain_time_over_tau_d"],
    )
