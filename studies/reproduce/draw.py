"""The figures of the protocol, from the results of `compute`."""

from __future__ import annotations

from collections.abc import Sequence

from ...figures.packing import draw_packing
from ...figures.pair import PairCurve, draw_pair
from ...figures.series import draw_growth
from ..study import Figures
from .compute import GrowthRun


def figures(curves: Sequence[PairCurve], growth: GrowthRun) -> Figures:
    """The paper's figures 1, 3 and, where D grew far enough to measure its rate, 4."""
    fitted = growth.measured
    first = {"figure1": lambda: draw_packing(growth.start.packing), "figure3": lambda: draw_pair(curves)}
    if fitted is None:
        return first
    return first | {"figure4": lambda: draw_growth(growth.time, growth.msd, growth.predicted, fitted)}
