"""The figures of remote triggering, from what `compute` has found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...analysis.onset.pair_form import PairForm
from ...figures.series import draw_series, few_decades, positive
from ...figures.style import INK, save, styled
from . import draw_friction, draw_response
from .compute import Sensitivity, Triggering, column
from .draw_response import DampingCurve, Displacements

UNPERTURBED, PERTURBED, WEAKENING, CONTROL = "C1", "C2", "C0", "C3"


@styled
def eruption_figure(
    unperturbed: Displacements,
    perturbed: Displacements,
    weakening: Displacements,
    control: Displacements | None = None,
    crossing: float | None = None,
) -> Figure:
    """D(t) below the onset: left alone, perturbed, and perturbed with weakening friction (the paper's figure 5a).

    Parameters
    ----------
    unperturbed, perturbed, weakening : Displacements
        The three runs, of the same packing. What is not positive is not drawn.
    control : Displacements, optional
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
            time, msd = positive(run.time, run.msd)
            draw_series(time, msd, axes, label=name, color=colour)
        if crossing is not None:
            axes.axvline(crossing, color=INK, linewidth=0.6, linestyle=":")
    if crossing is not None:
        _name_line(early, crossing, "$|v| > v_0$")
    early.set_xscale("log")
    late.set_ylabel("")
    late.set_xlim(0, float(weakening.time[-1]))
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


def figures(triggering: Triggering, sensitive: Sensitivity, mu: float, output: Path) -> None:
    """The paper's figures 2, 5 and 6, and three of the response: in time, over the distance from the onset, and over
    damping."""
    weak = triggering.weakening
    law = draw_friction.FrictionLaw(mu_0=mu, B=weak.B, w=weak.w, mu_ss=weak.mu_ss, v_0=weak.v0, v_ss=weak.v_ss)
    runs = {name: _displacements(triggering, name) for name in ("unperturbed", "perturbed", "erupting", "strong")}
    reduced = draw_friction.FrictionLaw(mu_0=mu, B=weak.B, w=weak.w, mu_ss=weak.mu_ss)
    save(draw_friction.friction_law_figure(reduced), output / "figure2")
    control = None if triggering.control is None else _displacements(triggering, "control")
    erupts = eruption_figure(
        runs["unperturbed"], runs["perturbed"], runs["erupting"], control, crossing=triggering.crossing
    )
    save(erupts, output / "figure5a")
    speed, friction = (column(triggering.erupting, name) for name in ("layer_velocity", "friction"))
    save(draw_friction.weakening_figure(np.abs(speed), friction, law), output / "figure5b")
    save(draw_friction.measured_friction_figure(), output / "figure6")
    linear = Displacements(triggering.response.time, triggering.response.msd)
    save(draw_response.response_figure(runs["strong"], linear), output / "response")
    reach = (float(sensitive.distance.min()), float(sensitive.distance.max()))
    curve = draw_response.AmplitudeCurve("", sensitive.distance, sensitive.amplitude, sensitive.fit, reach)
    save(draw_response.amplitude_figure([curve]), output / "amplitude")
    if near := sensitive.near:
        chosen = [near[k] for k in np.unique(np.linspace(0, len(near) - 1, 4).astype(int))]
        save(draw_response.damping_figure([_damping_curve(pair) for pair in chosen]), output / "damping")


def _displacements(triggering: Triggering, name: str) -> Displacements:
    samples = getattr(triggering, name)
    return Displacements(column(samples, "time"), column(samples, "msd"))


def _damping_curve(pair: PairForm) -> DampingCurve:
    damping_time = pair.tau_d * np.geomspace(1e-2, 1e2, 33)
    return DampingCurve(
        epsilon=pair.form.epsilon,
        damping_time=damping_time,
        amplitude=np.array([pair.amplitude(tau) for tau in damping_time]),
        undamped=pair.amplitude(),
        tau_d=pair.tau_d,
        half_time=pair.half_gain_time(),
    )
