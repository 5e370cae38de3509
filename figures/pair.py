r"""A pair of eigenvalues over F_x: real parts that coalesce, imaginary parts that bifurcate (the paper's figure 3).

Both eigenvalues are :math:`m \mp \sqrt D`. At an onset they have a branch point, but their mean m and their
discriminant D are smooth functions of the load, and D = 0 there. Between the loads of a ramp the curves are drawn from
m and D, interpolated by monotone cubics, so that both branches meet at the onset; dots are the computed eigenvalues.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from faultgouge.analysis import Onset, pair_eigenvalues
from faultgouge.analysis.arrays import Floats

from .style import styled

LOADS_BETWEEN = 10
"""Points of a curve between two loads: closer to each other at the ends, where a square root is steep."""

DOTTED_LOADS = 100
"""Loads up to which dots show the computed eigenvalues."""


def curve_through(load: Floats, eigenvalues: NDArray[np.complex128]) -> tuple[Floats, NDArray[np.complex128]]:
    """The curve of a pair of eigenvalues through the stored loads, which increase or decrease: loads and both members.

    The interpolation keeps to the shape of the numbers (Fritsch and Carlson, SIAM J. Numer. Anal. 17, 238 (1980)): D
    does not change its sign between two loads with the same sign of D. A pair, shape (n, 2), is two real numbers or two
    complex conjugates, nan where it is unknown. The curve has the stored loads at which the pair is known, the
    coalescences, and loads in between, with nan between two stretches of known loads; the member with the positive
    imaginary part, or the lower one, is first.
    """
    known = np.isfinite(eigenvalues).all(axis=1)
    ends = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(int)))
    parts = [_curve(load[a:b], eigenvalues[a:b]) for a, b in ends.reshape(-1, 2)]
    gap = np.full((1, 3), complex(np.nan, np.nan))
    joined = np.concatenate([gap[:0], *(row for part in parts for row in (part, gap))])[:-1]
    return joined[:, 0].real, joined[:, 1:]


def mean_and_square(eigenvalues: NDArray[np.complex128]) -> dict[str, Floats]:
    """Mean of both members of a pair, and the square of their difference, 4 D."""
    return {"mean": eigenvalues.mean(axis=1).real, "square": ((eigenvalues[:, 0] - eigenvalues[:, 1]) ** 2).real}


def _curve(load: Floats, eigenvalues: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Rows of a load and two eigenvalues along one stretch of known loads, with loads that crowd at the roots of D."""
    order = slice(None, None, -1 if load[-1] < load[0] else 1)
    load, eigenvalues = load[order], eigenvalues[order]
    mean, square = mean_and_square(eigenvalues).values()
    if len(load) > 1:
        mean_at, square_at = PchipInterpolator(load, mean), PchipInterpolator(load, square)
        roots = square_at.roots(extrapolate=False)
        roots = roots[np.isfinite(roots)]
        knots = np.union1d(load, roots)
        # short steps at both ends, as an eigenvalue leaves a coalescence as a square root
        share = np.sin(np.linspace(0, 0.5 * np.pi, LOADS_BETWEEN + 1)[:-1]) ** 2
        load = np.append((knots[:-1, None] + np.diff(knots)[:, None] * share).ravel(), knots[-1])
        # zero to the last bit, so that the branches meet
        mean, square = mean_at(load), np.where(np.isin(load, roots), 0.0, square_at(load))
    root = 0.5 * np.sqrt(square.astype(np.complex128))
    below = np.where(square > 0, -root, root)
    return np.column_stack([load, mean + below, mean - below])[order]


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

    @classmethod
    def of_onset(cls, run: Onset) -> "PairCurve":
        """The pair of a scene's onset up to the end of its window, or to twice the onset if the window has no end.

        Parameters
        ----------
        run : Onset
            With the equilibria of the ramp, and those near the onset: `equilibria` and `between`.
        """
        first = run.windows[0]
        packings = {each.fx: each.packing for each in run.equilibria} | run.between
        last = 2.0 * first.fx_onset if first.fx_end is None else first.fx_end
        fx = np.array(sorted(load for load in packings if load <= last))
        below, beyond = fx[fx <= first.fx_onset][::-1], fx[fx > first.fx_onset]
        values = [pair_eigenvalues([packings[load] for load in side], first.eigenvalue) for side in (below, beyond)]
        return cls(run.mu, fx, np.concatenate([values[0][::-1], values[1]]), first.fx_onset)

    @property
    def real(self) -> Floats:
        """Real parts, the smaller one first, shape (n, 2)."""
        return np.sort(self.eigenvalues.real, axis=1)

    @property
    def imaginary(self) -> Floats:
        """Imaginary parts, the negative one first, shape (n, 2); nan where the pair is unknown."""
        return np.sort(np.where(np.isnan(self.eigenvalues), np.nan, self.eigenvalues.imag), axis=1)

    def smooth(self) -> "PairCurve":
        """The same pair with many points between its loads, see :func:`curve_through`."""
        load, eigenvalues = curve_through(self.fx, self.eigenvalues)
        return PairCurve(self.mu, load, eigenvalues, self.fx_c)


@styled
def draw_pair(curves: Sequence[PairCurve]) -> Figure:
    """Draw the real parts, which coalesce, and the imaginary parts, which bifurcate, over F_x.

    Parameters
    ----------
    curves : sequence of PairCurve
        One curve for each friction coefficient.

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
            if len(curve.fx) <= DOTTED_LOADS:
                panel.plot(curve.fx, dots, ".", color=colour, markersize=3)
            if curve.fx_c is not None:
                panel.axvline(curve.fx_c, color=colour, linewidth=0.6, linestyle=":")
        where = "" if curve.fx_c is None else f", $F_x^c = {curve.fx_c:.5g}$"
        real.plot([], [], color=colour, label=rf"$\mu = {curve.mu:g}${where}")
    real.legend(loc="best")
    real.set_ylabel(r"$\mathrm{Re}\,\lambda$")
    imaginary.set(xlabel="$F_x$", ylabel=r"$\mathrm{Im}\,\lambda$")
    for panel, name in ((real, "(a)"), (imaginary, "(b)")):
        panel.margins(y=0.1)
        panel.set_xlim(min(curve.fx[0] for curve in curves), max(curve.fx[-1] for curve in curves))
        panel.set_title(name, loc="left", fontsize=8.5, pad=3)
    return figure
