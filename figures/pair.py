r"""A pair of eigenvalues over F_x: real parts that coalesce, imaginary parts that bifurcate (the paper's figure 3).

Both eigenvalues are :math:`m \mp \sqrt D`. At an onset they have a branch point, but their mean m and their
discriminant D are smooth functions of the load, and D = 0 there. Between the loads of a ramp the curves are drawn from
m and D, interpolated by monotone cubics, so that both branches meet at the onset; dots are the computed eigenvalues.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from faultgouge.analysis.arrays import Floats

from .style import INK, styled

INSET_POINTS = 8
"""Loads beyond the onset that the inset shows."""

BETWEEN = 64
"""Points of a curve between two loads: closer to each other at the ends, where a square root is steep."""

FEW = 100
"""Loads up to which dots show the computed eigenvalues."""


@dataclass(frozen=True, eq=False)
class PairCurve:
    """A tracked pair of eigenvalues along a ramp.

    Attributes
    ----------
    mu : float
        Friction coefficient.
    fx : ndarray, shape (n,)
        Force on each disk of the upper layer, increasing.
    eigenvalues : ndarray of complex, shape (n, 2)
        Both members of the pair, 1 / time^2: two real numbers, or two complex conjugates; nan where the pair is
        unknown.
    fx_c : float or None
        Onset, the force at which the two coalesce; None if they do not.
    """

    mu: float
    fx: Floats
    eigenvalues: NDArray[np.complex128]
    fx_c: float | None

    @property
    def real(self) -> Floats:
        """Real parts, the smaller one first, shape (n, 2)."""
        return np.sort(self.eigenvalues.real, axis=1)

    @property
    def imaginary(self) -> Floats:
        """Imaginary parts, the negative one first, shape (n, 2); nan where the pair is unknown."""
        return np.sort(np.where(np.isnan(self.eigenvalues), np.nan, self.eigenvalues.imag), axis=1)

    def smooth(self) -> "PairCurve":
        """The same pair with many points between its loads, from its mean and its discriminant."""
        mean = 0.5 * self.eigenvalues.sum(axis=1).real
        discriminant = (0.25 * (self.eigenvalues[:, 1] - self.eigenvalues[:, 0]) ** 2).real
        known = np.flatnonzero(np.isfinite(mean))
        fx, values = [], []
        for run in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
            if len(run) < 2:
                fx.append(self.fx[run])
                values.append(self.eigenvalues[run])
                continue
            knots, height = self.fx[run], discriminant[run]
            if self.fx_c is not None and knots[0] < self.fx_c < knots[-1]:
                at = int(np.searchsorted(knots, self.fx_c))
                if knots[at] != self.fx_c:
                    knots, height = np.insert(knots, at, self.fx_c), np.insert(height, at, 0.0)
            share = 0.5 - 0.5 * np.cos(np.linspace(0, np.pi, BETWEEN, endpoint=False))
            dense = np.append((knots[:-1, None] + share * np.diff(knots)[:, None]).ravel(), knots[-1])
            root = np.emath.sqrt(PchipInterpolator(knots, height)(dense).astype(complex))
            middle = PchipInterpolator(self.fx[run], mean[run])(dense)
            fx += [dense, dense[-1:]]
            values += [np.stack([middle - root, middle + root], axis=1), np.full((1, 2), np.nan)]  # a gap behind it
        return PairCurve(self.mu, np.concatenate(fx), np.concatenate(values), self.fx_c) if fx else self


@styled
def draw_pair(curves: Sequence[PairCurve]) -> Figure:
    """Draw the real parts, which coalesce, and the imaginary parts, which bifurcate, over F_x.

    Parameters
    ----------
    curves : sequence of PairCurve
        One curve for each friction coefficient. The inset shows the first curve around its onset, if there is one.

    Returns
    -------
    Figure
        Panel (a) real, panel (b) imaginary parts, both branches of a pair in one colour, dotted lines at the onsets.
        Dots are the given eigenvalues; lines are interpolated as the module says.
    """
    figure = Figure(figsize=(3.4, 4.4), layout="constrained")
    real, imaginary = figure.subplots(2, 1, sharex=True)
    for number, curve in enumerate(curves):
        colour = to_hex(f"C{number}")
        fine = curve.smooth()
        for panel, line, dots in ((real, fine.real, curve.real), (imaginary, fine.imaginary, curve.imaginary)):
            panel.plot(fine.fx, line, color=colour)
            if len(curve.fx) <= FEW:
                panel.plot(curve.fx, dots, ".", color=colour, markersize=3)
        where = "" if curve.fx_c is None else f", $F_x^c = {curve.fx_c:.5g}$"
        real.plot([], [], color=colour, label=rf"$\mu = {curve.mu:g}${where}")
        if curve.fx_c is not None:
            for panel in (real, imaginary):
                panel.axvline(curve.fx_c, color=colour, linewidth=0.6, linestyle=":")
    real.set_ylim(_limits(curves))
    real.legend(loc="best")
    real.set_ylabel(r"$\mathrm{Re}\,\lambda$")
    imaginary.set_ylabel(r"$\mathrm{Im}\,\lambda$")
    imaginary.set_xlabel("$F_x$")
    for panel, name in ((real, "(a)"), (imaginary, "(b)")):
        panel.set_xlim(min(curve.fx[0] for curve in curves), max(curve.fx[-1] for curve in curves))
        panel.set_title(name, loc="left", fontsize=8.5, pad=3)
    imaginary.margins(y=0.1)
    if curves[0].fx_c is not None:
        _magnify_onset(imaginary, curves[0], curves[0].fx_c)
    return figure


def _limits(curves: Sequence[PairCurve]) -> tuple[float, float] | tuple[None, None]:
    """Range of the real parts up to the onsets and while the pairs are complex: what comes after may go anywhere."""
    shown = [
        curve.real[(curve.fx <= (np.inf if curve.fx_c is None else curve.fx_c)) | (curve.imaginary[:, 1] > 0)]
        for curve in curves
    ]
    values = np.concatenate([each.ravel() for each in shown])
    values = values[np.isfinite(values)]
    if not len(values):
        return None, None
    margin = 0.1 * (np.ptp(values) or 1.0)
    return float(values.min() - margin), float(values.max() + margin)


def _magnify_onset(axes: Axes, curve: PairCurve, fx_c: float) -> None:
    """Inset with the imaginary parts about the onset, counted from it in a power of ten."""
    beyond = curve.fx[curve.fx > fx_c][:INSET_POINTS]
    if not len(beyond):
        return
    reach = beyond[-1] - fx_c
    power = int(np.floor(np.log10(reach)))
    inset = axes.inset_axes((0.13, 0.66, 0.36, 0.31))
    for shown, style in ((curve.smooth(), "-"), (curve, "o")):
        near = np.abs(shown.fx - fx_c) <= 1.05 * reach
        from_onset = (shown.fx[near] - fx_c) / 10.0**power
        inset.plot(from_onset, shown.imaginary[near], style, color=to_hex("C0"), markersize=2, linewidth=0.7)
    inset.axvline(0, color=INK, linewidth=0.6, linestyle=":")
    inset.set_xlim(-1.05 * reach / 10.0**power, 1.05 * reach / 10.0**power)
    inset.locator_params(nbins=4)
    inset.tick_params(labelsize=6.5, pad=2)
    inset.set_xlabel(rf"$(F_x - F_x^c)\,/\,10^{{{power}}}$", fontsize=7, labelpad=1)
    inset.set_ylabel(r"$\mathrm{Im}\,\lambda$", fontsize=7, labelpad=1)
