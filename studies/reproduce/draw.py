"""The figures of the protocol, from what `compute` has found."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ...analysis import Growth
from ...analysis.packing.packing import Floats
from ...figures.packing import draw_packing
from ...figures.pair import PairCurve, draw_pair
from ...figures.series import begin_at_noise, draw_series, few_decades
from ...figures.style import styled
from ..frame import Figures
from .compute import GrowthRun


def figures(curves: Sequence[PairCurve], growth: GrowthRun) -> Figures:
    """The paper's figures 1, 3 and, where D grew far enough to measure its rate, 4."""
    fitted = growth.measured
    first = {"figure1": lambda: draw_packing(growth.start.packing), "figure3": lambda: draw_pair(curves)}
    if fitted is None:
        return first
    return first | {"figure4": lambda: growth_figure(growth.time, growth.msd, growth.predicted, fitted)}


@styled
def growth_figure(time: Floats, msd: Floats, rate: float, fitted: Growth) -> Figure:
    """The mean square displacement that grows out of rounding noise (the paper's figure 4).

    Parameters
    ----------
    time, msd : ndarray, shape (n,)
        D(t), length^2; what is not positive is not drawn.
    rate : float
        2 |Im omega| of the fastest growing pair, 1 / time.
    fitted : Growth
        The exponential growth that was measured.

    Returns
    -------
    Figure
        D on a logarithmic axis; beside it, a decade and a half above, the slope that the spectrum predicts.
    """
    figure = Figure(figsize=(3.4, 2.7), layout="constrained")
    axes = figure.add_subplot()
    deviation = 100 * (fitted.rate / rate - 1)
    measured = rf"$\mathrm{{d}}\ln D/\mathrm{{d}}t = {fitted.rate:.5g}$, measured (${deviation:+.2g}\,\%$)"
    draw_series(time, msd, axes, label=measured)
    inside = (msd > 0) & (time >= fitted.start) & (time <= fitted.end)
    intercept = np.mean(np.log(msd[inside]) - rate * time[inside])
    ends = np.array([fitted.start, fitted.end])
    predicted = rf"$2\,|\mathrm{{Im}}\,\omega| = {rate:.5g}$, from the spectrum"
    slope = 10**1.5 * np.exp(intercept + rate * ends)
    axes.plot(ends, slope, color="C0", linestyle="--", label=predicted)
    begin_at_noise(axes, time, msd)
    few_decades(axes)
    figure.legend(loc="outside upper left")
    return figure
