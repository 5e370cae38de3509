"""Vibrations of a packing: density of states, shares and quality factors over frequency; plane waves."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from faultgouge.analysis import ElasticModuli, PlaneWave, Vibrations

from .style import EDGE, FLOOR, INK, MOBILIZATION, styled

SHARE_COLOUR = MOBILIZATION(0.35)
"""Blue, of shares of rotation and of transverse waves."""


@styled
def draw_vibrations(found: Vibrations) -> Figure:
    """g with its standard error and its window, what the motions are like, and Q.

    Parameters
    ----------
    found : Vibrations
        Of all modes, each of which is a dot, or of random vectors.
    """
    figure = Figure(figsize=(3.5, 5.6 if np.any(found.damping > 0) else 4.2), layout="constrained")
    rows = figure.subplots(3 if np.any(found.damping > 0) else 2, sharex=True)
    density, share = rows[0], rows[1]
    density.fill_between(
        found.frequency, found.density - found.density_error, found.density + found.density_error,
        color=EDGE, linewidth=0, alpha=0.5,
    )  # fmt: skip
    density.plot(found.frequency, found.density, color=INK, linewidth=0.9)
    density.set(ylabel=r"density of states $g(\omega)$", ylim=(0, None), xlim=(0, found.largest))
    width = found.resolution[0]
    density.plot([0.03 * found.largest, 0.03 * found.largest + width], [0.92, 0.92], color=FLOOR, linewidth=1.5,
                 transform=density.get_xaxis_transform())  # fmt: skip
    density.text(0.03 * found.largest + 1.5 * width, 0.92, "window", va="center", fontsize=6, color=FLOOR,
                 transform=density.get_xaxis_transform())  # fmt: skip
    if found.modes is not None:
        share.plot(found.modes["frequency"], found.modes["participation"], ".", color=INK, markersize=2)
    share.plot(found.frequency, found.rotation, color=SHARE_COLOUR, linewidth=0.9)
    says = "participation (dots), rotation (line)" if found.modes is not None else "share of rotation"
    share.set(ylabel=says, ylim=(0, 1))
    if len(rows) == 3:
        if found.modes is not None:
            quality = found.modes["frequency"] / np.maximum(found.modes["damping"], np.finfo(float).tiny)
            rows[2].plot(found.modes["frequency"], quality, ".", color=INK, markersize=2)
        rows[2].plot(found.frequency, found.quality, color=SHARE_COLOUR, linewidth=0.9)
        rows[2].set(ylabel="quality factor $Q$", yscale="log")
    rows[-1].set_xlabel(r"$\omega$")
    return figure


@styled
def draw_waves(waves: Sequence[PlaneWave], moduli: ElasticModuli | None = None) -> Figure:
    """Frequency and attenuation of plane waves over their wave number, beside the speeds of the elastic moduli.

    Parameters
    ----------
    waves : sequence of PlaneWave
        Along one direction.
    moduli : ElasticModuli, optional
        Their lines are those of its isotropic part.
    """
    figure = Figure(figsize=(3.5, 4.4), layout="constrained")
    above, below = figure.subplots(2, sharex=True)
    most = max(wave.wave_number for wave in waves)
    names = ("longitudinal", "transverse", "transverse, the other")
    for kind in sorted({wave.polarisation for wave in waves}):
        these = [wave for wave in waves if wave.polarisation == kind]
        colour, mark = (INK if kind == 0 else SHARE_COLOUR), "os^"[kind]
        number = [wave.wave_number for wave in these]
        above.plot(number, [wave.frequency for wave in these], mark, color=colour, markersize=3.5, label=names[kind])
        below.plot(number, [wave.attenuation for wave in these], mark, color=colour, markersize=3.5)
    if moduli is not None:
        lame = moduli.bulk - 2 * moduli.shear / moduli.dimension
        speeds = np.sqrt(np.array([lame + 2 * moduli.shear, moduli.shear]) / moduli.density)
        for speed, shade, name in zip(speeds, (INK, SHARE_COLOUR), ("P", "S"), strict=True):
            above.plot([0, most], [0, speed * most], color=shade, linewidth=0.7, linestyle="--",
                       label=f"{name}, elastic moduli")  # fmt: skip
    above.set(ylabel=r"frequency $\omega$", ylim=(0, None))
    above.legend(fontsize=6)
    below.set(xlabel="wave number $q$", ylabel=r"attenuation $\gamma$", xlim=(0, 1.05 * most))
    below.axhline(0, color=EDGE, linewidth=0.5)
    return figure
