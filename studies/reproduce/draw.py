"""The figures of the protocol, from what `compute` has found."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from ...figures.packing import draw_packing
from ...figures.pair import PairCurve, draw_pair
from ...figures.series import begin_at_noise, draw_series, few_decades
from ...figures.style import save, styled
from .compute import GrowthRun


def figures(curves: Sequence[PairCurve], growth: GrowthRun, output: Path) -> None:
    """The paper's figures 1, 3 and, where D grew far enough to measure its rate, 4."""
    save(draw_packing(growth.start.packing), output / "figure1")
    save(draw_pair(curves), output / "figure3")
    measured = growth.measured
    if measured is None:
        return
    figure = growth_figure(
        growth.time,
        growth.msd,
        window=(measured.start, measured.end),
        predicted_rate=growth.predicted,
        measured_rate=measured.rate,
    )
    save(figure, output / "figure4")


@styled
def growth_figure(
    time: ArrayLike,
    msd: ArrayLike,
    *,
    window: tuple[float, float],
    predicted_rate: float,
    measured_rate: float,
) -> Figure:
    """The mean square displacement that grows out of rounding noise (the paper's figure 4).

    Parameters
    ----------
    time : array_like, shape (n,)
        Time.
    msd : array_like, shape (n,)
        D(t), length^2; what is not positive is not drawn.
    window : tuple of float
        First and last time of the exponential growth, where the rate was measured.
    predicted_rate : float
        2 |Im omega| of the fastest growing pair, 1 / time.
    measured_rate : float
        Rate of the exponential in the window, 1 / time.

    Returns
    -------
    Figure
        D on a logarithmic axis; beside it, a decade and a half above, the slope that the spectrum predicts.
    """
    time, msd = np.asarray(time, dtype=float), np.asarray(msd, dtype=float)
    figure = Figure(figsize=(3.4, 2.7), layout="constrained")
    axes = figure.add_subplot()
    deviation = 100 * (measured_rate / predicted_rate - 1)
    measured = rf"$\mathrm{{d}}\ln D/\mathrm{{d}}t = {measured_rate:.5g}$, measured (${deviation:+.2g}\,\%$)"
    draw_series(time, msd, axes, label=measured)
    inside = (msd > 0) & (time >= window[0]) & (time <= window[1])
    intercept = np.mean(np.log(msd[inside]) - predicted_rate * time[inside])
    ends = np.array(window)
    predicted = rf"$2\,|\mathrm{{Im}}\,\omega| = {predicted_rate:.5g}$, from the spectrum"
    slope = 10**1.5 * np.exp(intercept + predicted_rate * ends)
    axes.plot(ends, slope, color="C0", linestyle="--", label=predicted)
    begin_at_noise(axes, time, msd)
    few_decades(axes)
    figure.legend(loc="outside upper left")
    return figure
