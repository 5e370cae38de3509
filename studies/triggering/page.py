"""The section of a report on remote triggering."""

from __future__ import annotations

import numpy as np

from ...figures.pages import render
from ...pywrap import Scene
from ...pywrap.scenes.refusals import needed
from .compute import ABOVE_NOISE, Sensitivity, Triggering, column, jump, summary


def section(triggering: Triggering, sensitive: Sensitivity, scene: Scene, mu: float) -> str:
    """The section, in Markdown.

    Parameters
    ----------
    triggering, sensitive
        What was found.
    scene : Scene
        With [perturb] and [friction].
    mu : float
        Static friction coefficient.
    """
    first = jump(triggering.erupting)
    return render(
        __package__ or "",
        "triggering.md.j2",
        triggering=triggering,
        sensitive=sensitive,
        settings=scene.perturb,
        calibrated=isinstance(needed(scene.friction, "friction").v0, str),
        mu=mu,
        weak=triggering.weakening,
        largest=summary(triggering, sensitive)["largest_D"],
        lowest_mu=float(column(triggering.erupting, "friction").min()),
        highest_speed=float(np.abs(column(triggering.erupting, "layer_velocity")).max()),
        jump=first,
        jumped=float(np.log10(first / column(triggering.perturbed, "msd").max())),
        control=None if triggering.control is None else float(column(triggering.control, "msd").max()),
        above_noise=ABOVE_NOISE,
        half_gain=[pair.half_gain_time() / pair.tau_d for pair in sensitive.near],
    )
