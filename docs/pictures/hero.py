"""The first picture of README: the layer with its forces, the two eigenvalues that merge, and the growth in LAMMPS.

python docs/pictures/hero.py, from the folder of the repository; a minute
"""

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from faultgouge import Scene, onset, perturb, ramp
from faultgouge.analysis import Packing, pair_eigenvalues, spectrum
from faultgouge.analysis.arrays import Floats
from faultgouge.figures import PairCurve, draw_packing, draw_series
from faultgouge.figures.series import begin_at_noise, few_decades
from faultgouge.figures.style import INK, STYLE, save_as
from faultgouge.pywrap import Equilibrium

SECTIONS = {
    "packing": {"seed": 1},
    "law": {"kn": 2e5},
    "load": {"fy": 3.0},
    "ramp": {"step": 5e-4, "until": 0.02},
    "perturb": {"fx": 0.02, "time": 160.0},
}
"""The scene of README, in finer steps."""

SIZES = {"font.size": 10, "axes.labelsize": 11, "xtick.labelsize": 9, "ytick.labelsize": 9, "lines.linewidth": 1.6}
"""Letters that can be read where the picture is 830 pixels wide."""


def merging(states: Sequence[Equilibrium], fx_c: float, eigenvalue: float) -> PairCurve:
    """The two eigenvalues that merge, followed from the onset to smaller and to larger loads."""
    below = [state.packing for state in states if state.fx <= fx_c]
    beyond = [state.packing for state in states if state.fx > fx_c]
    values = [pair_eigenvalues(below[::-1], eigenvalue)[::-1], pair_eigenvalues(beyond, eigenvalue)]
    return PairCurve(1.0, np.array([state.fx for state in states]), np.concatenate(values), fx_c)


def draw(packing: Packing, curve: PairCurve, time: Floats, msd: Floats, rate: float) -> Figure:
    """Three panels: the layer, the eigenvalues over the load, and D over time with the predicted slope."""
    figure = Figure(figsize=(8.3, 4.7))
    layer = figure.add_axes((0.0, 0.15, 0.5, 0.77))
    draw_packing(packing, layer)
    (chains,) = (each for each in layer.collections if each.get_label() == "contacts")
    scale = figure.add_axes((0.07, 0.105, 0.36, 0.02))
    figure.colorbar(chains, cax=scale, orientation="horizontal", label="friction of a contact / Coulomb's bound")
    panels = figure.add_axes((0.6, 0.6, 0.375, 0.32)), figure.add_axes((0.6, 0.105, 0.375, 0.32))
    _draw_pair(panels[0], curve)
    _draw_growth(panels[1], time, msd, rate)
    titles = (
        "A layer of grains is pressed and sheared",
        "Two vibrations become one",
        "Beyond, at $F_x = 0.02$, rounding noise grows",
    )
    for x, y, number, title in zip((0.01, 0.545, 0.545), (0.96, 0.96, 0.465), "123", titles, strict=True):
        figure.text(x, y, number, fontsize=14, color="C0", weight="bold")
        figure.text(x + 0.025, y, title, fontsize=12)
    return figure


def _draw_pair(axes: Axes, curve: PairCurve) -> None:
    fine = curve.smooth()
    axes.plot(fine.fx, fine.real, color="C1")
    axes.axvline(curve.fx_c, color=INK, linewidth=0.8, linestyle=":")
    axes.text(curve.fx_c, 0.05, " $F_x^c$", transform=axes.get_xaxis_transform())
    axes.set(xlabel="$F_x$", ylabel=r"eigenvalue $\mathrm{Re}\,\lambda$", xlim=(0, fine.fx[-1]))
    axes.locator_params(axis="x", nbins=5)


def _draw_growth(axes: Axes, time: Floats, msd: Floats, rate: float) -> None:
    draw_series(time, msd, axes, label="LAMMPS")
    ends = time[-1] * np.array([0.2, 0.5, 0.8])
    slope = 100 * np.interp(ends[1], time, msd) * np.exp(rate * (ends - ends[1]))
    axes.plot(ends, slope, "--", color="C0", label="predicted slope")
    begin_at_noise(axes, time, msd)
    axes.set_ylim(top=100 * msd.max())
    axes.set_ylabel("displacement $D(t)$")
    few_decades(axes, 6)
    axes.legend(loc="lower right")


if __name__ == "__main__":
    scene = Scene.from_mapping(SECTIONS)
    states, found = list(ramp(scene)), onset(scene)
    last = states[-1]
    samples = np.array([(each.time, each.msd) for each in perturb(scene, last)])
    curve = merging(states, found.fx_c, found.windows[0].eigenvalue)
    with matplotlib.rc_context(fname=STYLE), matplotlib.rc_context(SIZES):
        picture = draw(last.packing, curve, *samples.T, spectrum(last.packing).growth_rate())
        save_as(picture, Path(__file__).with_suffix(".png"))
