"""The figures of remote triggering, from what `compute` has found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...figures.series import draw_series, few_decades, positive
from ...figures.style import INK, save, styled
from . import draw_friction, draw_response
from .compute import Triggering, column
from .draw_response import Course

UNPERTURBED, PERTURBED, WEAKENING, CONTROL = "C1", "C2", "C0", "C3"


@styled
def eruption_figure(
    unperturbed: Course,
    perturbed: Course,
    weakening: Course,
    control: Course | None = None,
    crossing: float | None = None,
) -> Figure:
    """D(t) below the onset: left alone, perturbed, and perturbed with weakening friction (the paper's figure 5a).

    Parameters
    ----------
    unperturbed, perturbed, weakening : Course
        The three runs, of the same packing. What is not positive is not drawn.
    control : Course, optional
        The last at a load where the packing is stable with the weakened friction, too.
    crossing : float, optional
        When the layer first exceeds v_0, marked.

    Returns
    -------
    Figure
        D on a logarithmic axis; the left panel has a logarithmic axis of time, for the jump, and the right one a linear
        axis, for the growth after it.
    """
    figure = Figure(figsize=(3.4, 2.7), layout="constrained")
    early, late = figure.subplots(1, 2, sharey=True)
    curves = [
        (weakening, WEAKENING, r"perturbed, friction $\mu(v)$"),
        (perturbed, PERTURBED, r"perturbed, $\mu_0$"),
        (unperturbed, UNPERTURBED, r"left alone, $\mu_0$"),
    ]
    if control is not None:
        curves.insert(1, (control, CONTROL, r"$\mu(v)$ below both onsets"))
    for axes in (early, late):
        for run, colour, name in curves:
            time, msd = positive(*run)
            draw_series(time, msd, axes, label=name, color=colour)
        if crossing is not None:
            axes.axvline(crossing, color=INK, linewidth=0.6, linestyle=":")
    if crossing is not None:
        _name_line(early, crossing, "$|v| > v_0$")
    early.set_xscale("log")
    late.set_ylabel("")
    late.set_xlim(0, float(weakening[0][-1]))
    few_decades(early, 5)
    for axes, name in ((early, "(a) the jump"), (late, "(b) what follows")):
        axes.set_title(name, loc="left", fontsize=8)
    # Above the axes: three curves over thirty decades leave no corner that stays free for every packing.
    figure.legend(*early.get_legend_handles_labels(), loc="outside upper center", ncols=2, columnspacing=1.0)
    return figure


def _name_line(axes: Axes, place: float, name: str) -> None:
    """A name at the head of a vertical line, to its left: before the crossing D is small."""
    axes.annotate(
        name,
        (place, 0.97),
        xycoords=axes.get_xaxis_transform(),
        xytext=(-2, 0),
        textcoords="offset points",
        ha="right",
        rotation=90,
        va="top",
        fontsize=7,
    )


def figures(triggering: Triggering, output: Path) -> None:
    """The paper's figures 2, 5 and 6, and three of the response: in time, over the distance from the onset, and over
    damping."""
    weak, mu, sensitive = triggering.weakening, triggering.start.packing.law.mu, triggering.sensitive
    runs = {name: _course(triggering, name) for name in ("unperturbed", "perturbed", "erupting", "strong")}
    save(draw_friction.friction_law_figure(replace(weak, v0=0.0, v_ss=1.0), mu), output / "figure2")
    control = None if triggering.control is None else _course(triggering, "control")
    erupts = eruption_figure(
        runs["unperturbed"], runs["perturbed"], runs["erupting"], control, crossing=triggering.crossing
    )
    save(erupts, output / "figure5a")
    speed, friction = (column(triggering.erupting, name) for name in ("layer_velocity", "friction"))
    save(draw_friction.weakening_figure(np.abs(speed), friction, weak, mu), output / "figure5b")
    save(draw_friction.measured_friction_figure(), output / "figure6")
    save(draw_response.response_figure(runs["strong"], triggering.response.msd), output / "response")
    save(draw_response.amplitude_figure(sensitive), output / "amplitude")
    if near := sensitive.near:
        chosen = [near[k] for k in np.unique(np.linspace(0, len(near) - 1, 4).astype(int))]
        save(draw_response.damping_figure(chosen), output / "damping")


def _course(triggering: Triggering, name: str) -> Course:
    samples = getattr(triggering, name)
    return column(samples, "time"), column(samples, "msd")
