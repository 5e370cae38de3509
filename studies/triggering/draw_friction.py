r"""Friction that weakens with the velocity v of the upper layer: the law, and what runs go through of it.

.. math:: \mu(v) = \mu_0 \left(B\, e^{-w (v - v_0)/v_{ss}} + \mu_{ss}\right) \quad (v > v_0), \qquad \mu_0
   \quad (v \le v_0),

which passes :math:`v_0` without a jump if :math:`B + \mu_{ss} = 1`.
"""

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from numpy.typing import ArrayLike

from ...analysis.packing.packing import Floats
from ...figures.series import positive
from ...figures.style import INK, styled
from ...pywrap.lammps.dynamics import Weakening

WEAKENING = "C0"


def share(law: Weakening, velocity: ArrayLike) -> Floats:
    """mu / mu_0 at some velocities of the upper layer, an array of their shape."""
    v = np.asarray(velocity, dtype=float)
    above = np.maximum(v - law.v0, 0.0) / law.v_ss
    return np.where(v > law.v0, law.B * np.exp(-law.w * above) + law.mu_ss, 1.0)


@styled
def friction_law_figure(law: Weakening, mu_0: float) -> Figure:
    """The law mu(v) (the paper's figure 2).

    Parameters
    ----------
    law : Weakening
        The axis counts from its v_0, in units of its v_ss.
    mu_0 : float
        Static friction coefficient.

    Returns
    -------
    Figure
    """
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(xlabel=r"$(v - v_0)/v_{ss}$", ylabel=r"$\mu(v)$")
    fall = 1 / law.w
    reduced = np.linspace(-1.2 * fall, 5.5 * fall, 400)
    axes.plot(reduced, mu_0 * share(law, law.v0 + law.v_ss * reduced), color=WEAKENING)
    steady = mu_0 * law.mu_ss
    axes.axhline(steady, color=INK, linewidth=0.6, linestyle=":")
    axes.axvline(0, color=INK, linewidth=0.6, linestyle=":")
    span = mu_0 - steady
    axes.set(xlim=(reduced[0], reduced[-1]), ylim=(steady - 0.12 * span, mu_0 + 0.12 * span))
    axes.text(-0.15 * fall, steady + 0.04 * span, r"$\mu_0\,\mu_{ss}$", ha="right", va="bottom")
    axes.text(0.15 * fall, mu_0, "$v = v_0$", va="center")
    equation = rf"$\mu_0 = {mu_0:g}$, $\mu_{{ss}} = {law.mu_ss:g}$, $B = {law.B:g}$, $w = {law.w:g}$"
    axes.text(0.96, 0.82, equation, transform=axes.transAxes, ha="right", va="top")
    return figure


@styled
def weakening_figure(velocity: ArrayLike, mu: ArrayLike, law: Weakening, mu_0: float) -> Figure:
    """The friction coefficient that a run has gone through, over the velocity (the paper's figure 5b).

    Parameters
    ----------
    velocity : array_like, shape (n,)
        Mean velocity of the upper layer, length / time. Where it is not positive, mu is mu_0 and nothing is drawn.
    mu : array_like, shape (n,)
        Friction coefficient of the run at the same times.
    law : Weakening
        The law with this run's v_0 and v_ss, as a line.
    mu_0 : float
        Static friction coefficient.

    Returns
    -------
    Figure
        The axis of velocities is logarithmic.
    """
    velocity, mu = positive(velocity, mu)
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(xscale="log", xlabel="mean velocity of the upper layer, $|v|$", ylabel=r"$\mu(v)$")
    smooth = np.geomspace(velocity.min(), velocity.max(), 500)
    axes.plot(smooth, mu_0 * share(law, smooth), color=INK, linewidth=0.8, label=r"law $\mu(v)$", zorder=1)
    axes.plot(velocity, mu, "o", color=WEAKENING, markersize=2.5, alpha=0.5, markeredgewidth=0, label="run")
    for value, name in ((law.v0, "$v_0$"), (law.v_ss, "$v_{ss}$")):
        if velocity.min() < value < velocity.max():
            axes.axvline(value, color=INK, linewidth=0.6, linestyle=":")
            axes.annotate(
                name,
                (value, 0.03),
                xycoords=axes.get_xaxis_transform(),
                xytext=(2, 0),
                textcoords="offset points",
            )
    steady = mu_0 * law.mu_ss
    axes.set_ylim(steady - 0.12 * (mu_0 - steady), mu_0 + 0.12 * (mu_0 - steady))
    axes.xaxis.set_major_locator(LogLocator(numticks=7))
    axes.legend(loc="upper right", bbox_to_anchor=(1, 0.9))
    return figure


@styled
def measured_friction_figure() -> Figure:
    """The law with the parameters that the paper fitted to measurements (the paper's figure 6).

    B = 0.22, w = 4, v_0 = 0.05 v_ss, and mu_ss = 0.74 and 0.78 for two driving velocities. The measured points, of
    Nasuno, Kudrolli, Bak and Gollub (1998), are not public and are not drawn, as the picture says. For 0.74 the law is
    not continuous at v_0: B + mu_ss = 0.96.

    Returns
    -------
    Figure
    """
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(xlabel="$v/v_{ss}$", ylabel=r"$\mu/\mu_0$")
    for mu_ss, colour, style in ((0.78, "C1", "-"), (0.74, "C0", "--")):
        law = Weakening(B=0.22, w=4.0, mu_ss=mu_ss, v0=0.05, v_ss=1.0)
        above = np.linspace(np.nextafter(law.v0, 1), 1, 400)
        velocity = np.concatenate([[0.0, law.v0], above])
        name = rf"$\mu_{{ss}} = {mu_ss:g}$"
        axes.plot(velocity, share(law, velocity), color=colour, linestyle=style, label=name)
    axes.set(xlim=(0, 1), ylim=(0.72, 1.02))
    legend = axes.legend(loc="upper right", title="$B = 0.22$, $w = 4$, $v_0 = 0.05\\,v_{ss}$")
    legend.get_title().set_fontsize(matplotlib.rcParams["legend.fontsize"])
    axes.text(
        0.96,
        0.47,
        "the paper's fits; the measured points\nare not public and are not drawn",
        transform=axes.transAxes,
        ha="right",
        va="center",
        fontstyle="italic",
        color=INK,
    )
    return figure
