"""The picture of a sweep: the share of scenes with an onset up to F_x, a curve for each sample of scenes that have the
same values of all swept keys but the seed."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from ...figures.style import report_failure, save, styled
from ..result_rows import Row
from ..statistics import course


def draw_sweep(rows: Sequence[Row], folder: Path, say: Callable[[str], None]) -> str:
    """Save results.png and results.svg, and return words for that; none where rows have no onsets."""
    samples = defaultdict(list)
    for row in rows:
        ramps = row["result"].get("ramps")  # a user's function may have anything under any name
        end = ramps[0] if isinstance(ramps, list) and ramps and isinstance(ramps[0], dict) else row["result"]
        reach = end.get("reach", end.get("fx_c"))
        if isinstance(reach, float):
            label = ", ".join(f"{key} = {value}" for key, value in row["values"].items() if key != "packing.seed")
            samples[label].append((reach, end.get("ends", "onset") == "onset"))
    if not samples:
        return ""
    with report_failure(f"{folder}/results.png", say):
        save(onsets_figure(samples), folder / "results")
        return f" and {folder}/results.png"
    return ""


@styled
def onsets_figure(samples: Mapping[str, Sequence[tuple[float, bool]]]) -> Figure:
    """The share of scenes with an onset up to F_x, force per disk of the upper layer, a curve a sample: of each scene
    the largest F_x up to which it has no window, and whether that is the onset."""
    figure = Figure(figsize=(3.4, 2.2 + 0.15 * len(samples)), layout="constrained")
    axes = figure.add_subplot(xlabel="$F_x$", ylabel="share with an onset", ylim=(0, 1))
    colours = colormaps["viridis"](np.linspace(0, 0.9, len(samples)))
    for (label, ends), colour in zip(samples.items(), colours, strict=True):
        reach, found = np.transpose(ends)
        axes.step(*course(reach, found.astype(bool)), where="post", color=colour, label=label)
    onsets = [found for ends in samples.values() for _, found in ends]
    axes.set_title(f"{len(onsets)} scenes: {sum(onsets)} with an onset, {onsets.count(False)} without", fontsize=8)
    axes.set_xlim(0)
    if len(samples) > 1:
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.25))
    return figure
