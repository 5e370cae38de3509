"""The section of a report on remote triggering."""

from __future__ import annotations

import numpy as np

from ...figures.pages import render
from ...pywrap.scenes.refusals import needed
from .compute import ABOVE_NOISE, Triggering, summary


def section(triggering: Triggering) -> str:
    """The section, in Markdown."""
    numbers = summary(triggering)
    return render(
        __package__ or "",
        "triggering.md.j2",
        triggering=triggering,
        numbers=numbers,
        calibrated=isinstance(needed(triggering.scene.friction, "friction").v0, str),
        highest_speed=float(np.abs(triggering.erupting["layer_velocity"]).max()),
        jumped=float(np.log10(numbers["jump"] / numbers["largest_D"]["perturbed"])),
        above_noise=ABOVE_NOISE,
    )
