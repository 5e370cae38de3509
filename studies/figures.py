r"""The figures of the study, each a function from numbers to a `matplotlib.figure.Figure`.

Nothing is computed here and no window is opened: a figure shows what it is given, in the units of the scene.
Lengths, forces and times carry no unit in the labels, because the paper's are m, 2 R_1 and sqrt(m (2
R_1)^(1/2) / k_n) and a scene is free to choose others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import LinearSegmentedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from numpy.typing import ArrayLike, NDArray

from faultgouge.analysis import Packing

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

STYLE = str(files(__package__) / "faultgouge.mplstyle")

BULK, UPPER, EDGE, FLOOR, INK = "#dfe5ea", "#f2c14e", "#8a949c", "#c0392b", "#333333"
MOBILIZATION = LinearSegmentedColormap.from_list("mobilization", ["#14213d", "#3d6a9e", "#b56576", "#f07d1a"])


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
        Both members of the pair, 1 / time^2.
    fx_c : float or None
        Onset, the force at which they coalesce; None if they do not.
    """

    mu: float
    fx: Floats
    eigenvalues: Complexes
    fx_c: float | None


@matplotlib.rc_context(fname=STYLE)
def packing_figure(packing: Packing) -> Figure:
    """The packing with its force chains (the paper's figure 1).

    Disks are drawn to scale, cut where a periodic box ends and continued on its other side; the upper layer
    is yellow, rattlers are hollow, the floor is red. A bar joins the centres of each contact: its width is
    proportional to f_n, its colour is |s|/t*, the share of the slip at which the contact slides (on a
    logarithmic scale). Arrows show where the load acts, not its size.

    Parameters
    ----------
    packing : Packing
        Any configuration.

    Returns
    -------
    Figure
    """
    x, y = packing.position.T
    largest = packing.radius.max()
    if packing.box_length is None:
        left, right = (x - packing.radius).min(), (x + packing.radius).max()
        images = packing.position[None]
    else:
        left, right = 0.0, packing.box_length
        wrapped = np.column_stack([x % packing.box_length, y])
        images = wrapped + np.array([[[shift * packing.box_length, 0.0]] for shift in (-1, 0, 1)])
    bottom, ceiling = -0.3 * largest, (y + packing.radius).max() + 1.5 * largest
    axes_width = 2.9
    height = axes_width * (ceiling - bottom) / (right - left)
    figure = Figure(figsize=(3.4, height + 0.35), layout="constrained")
    axes = figure.add_subplot(aspect="equal", xlim=(left, right), ylim=(bottom, ceiling))
    axes.set_axis_off()
    points = 72 * axes_width / (right - left)  # of a unit of length, so that line widths are to scale too

    _draw_disks(axes, packing, images, points)
    chains = _draw_chains(axes, packing, images, points)
    axes.fill_between([left, right], bottom, 0, color=FLOOR, linewidth=0, zorder=4, label="floor")
    if packing.box_length is not None:
        axes.vlines([left, right], 0, ceiling, colors=INK, linewidths=0.8, linestyles=(0, (3, 3)))
    _draw_load(axes, packing, images, ceiling)
    if chains.get_array() is not None:
        bar = figure.colorbar(chains, ax=axes, shrink=0.45, aspect=28, pad=0.02)
        bar.set_label(r"$|s|/t^*$")
        bar.outline.set_linewidth(0.4)
    return figure


@matplotlib.rc_context(fname=STYLE)
def coalescence_figure(curves: Sequence[PairCurve]) -> Figure:
    """Real parts that coalesce and imaginary parts that bifurcate as F_x grows (the paper's figure 3).

    Parameters
    ----------
    curves : sequence of PairCurve
        One for each friction coefficient. The inset shows the first one about its onset, if it has one.

    Returns
    -------
    Figure
        Panel (a) real, panel (b) imaginary parts, dotted lines at the onsets.
    """
    figure = Figure(figsize=(3.4, 4.2), layout="constrained")
    real, imaginary = figure.subplots(2, 1, sharex=True)
    for number, curve in enumerate(curves):
        colour = f"C{number}"
        real.plot(curve.fx, np.sort(curve.eigenvalues.real, axis=1), color=colour)
        imaginary.plot(curve.fx, np.sort(curve.eigenvalues.imag, axis=1), color=colour)
        if curve.fx_c is not None:
            for axes in (real, imaginary):
                axes.axvline(curve.fx_c, color=colour, linewidth=0.6, linestyle=":")
        # Names stand along the onsets, at different heights because onsets may lie close together.
        real.annotate(
            rf"$\mu = {curve.mu:g}$",
            (curve.fx[-1] if curve.fx_c is None else curve.fx_c, 0.04 + 0.22 * number),
            xycoords=real.get_xaxis_transform(),
            xytext=(-1.5, 0),
            textcoords="offset points",
            rotation=90,
            color=colour,
            ha="right",
            va="bottom",
        )
    real.set_ylabel(r"$\mathrm{Re}\,\lambda$")
    imaginary.set_ylabel(r"$\mathrm{Im}\,\lambda$")
    imaginary.set_xlabel("$F_x$")
    imaginary.margins(y=0.15)
    for axes, name in ((real, "(a)"), (imaginary, "(b)")):
        axes.set_xlim(min(curve.fx[0] for curve in curves), max(curve.fx[-1] for curve in curves))
        axes.text(0.02, 0.96, name, transform=axes.transAxes, va="top")
    if curves[0].fx_c is not None:
        _magnify_onset(imaginary, curves[0], curves[0].fx_c)
    return figure


@matplotlib.rc_context(fname=STYLE)
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
    seen = msd > 0
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(yscale="log", xlabel="$t$", ylabel="$D(t)$")
    axes.plot(time[seen], msd[seen], color="C1", linewidth=0.8)

    inside = seen & (time >= window[0]) & (time <= window[1])
    intercept = np.mean(np.log(msd[inside]) - predicted_rate * time[inside])
    ends = np.array(window)
    axes.plot(ends, 10**1.5 * np.exp(intercept + predicted_rate * ends), color="C0", linestyle="--")
    axes.margins(x=0)

    deviation = 100 * (measured_rate / predicted_rate - 1)
    for line, text, colour in (
        (0.95, rf"$2\,|\mathrm{{Im}}\,\omega| = {predicted_rate:.5g}$, from the spectrum", "C0"),
        (
            0.86,
            rf"$\mathrm{{d}}\ln D/\mathrm{{d}}t = {measured_rate:.5g}$, measured (${deviation:+.2g}\,\%$)",
            "C1",
        ),
    ):
        axes.text(0.04, line, text, color=colour, transform=axes.transAxes, va="top")
    return figure


@matplotlib.rc_context(fname=STYLE)
def onset_curve_figure(mu: ArrayLike, fx_c: ArrayLike, error: ArrayLike) -> Figure:
    """The onset over the friction coefficient.

    Parameters
    ----------
    mu : array_like, shape (n,)
        Friction coefficients.
    fx_c : array_like, shape (n,)
        Onsets; NaN where there is none.
    error : array_like, shape (n,)
        Errors of the onsets.

    Returns
    -------
    Figure
    """
    order = np.argsort(mu)
    mu, fx_c, error = (np.asarray(values, dtype=float)[order] for values in (mu, fx_c, error))
    figure = Figure(layout="constrained")
    axes = figure.add_subplot(xlabel=r"$\mu$", ylabel="$F_x^c$")
    axes.plot(mu, fx_c, color="C1", linewidth=0.6, alpha=0.5)
    axes.errorbar(mu, fx_c, yerr=error, color="C1", fmt="o", elinewidth=0.8, capsize=2)
    return figure


@matplotlib.rc_context(fname=STYLE)
def save(figure: Figure, stem: str | Path) -> tuple[Path, Path]:
    """Write a figure as PNG (200 dots an inch) and SVG, the same bytes for the same figure.

    Parameters
    ----------
    figure : Figure
        What to write.
    stem : str or Path
        Path without ending; its folder exists.

    Returns
    -------
    tuple of Path
        The PNG and the SVG.
    """
    stem = Path(stem)
    png, svg = stem.with_name(stem.name + ".png"), stem.with_name(stem.name + ".svg")
    figure.savefig(png)
    figure.savefig(svg, metadata={"Date": None})
    return png, svg


def _draw_disks(axes: Axes, packing: Packing, images: Floats, points: float) -> None:
    """Every image of every disk that reaches into the axes; `images` has shape (images, N, 2)."""
    left, right = axes.get_xlim()
    hollow = np.isin(np.arange(len(packing)), packing.rattlers)
    faces = np.where(hollow, "white", np.where(packing.top, UPPER, BULK))
    edges = np.where(packing.top & hollow, UPPER, EDGE)
    x, radius = images[..., 0], packing.radius
    image, disk = np.nonzero((x + radius > left) & (x - radius < right))
    disks = PatchCollection(
        [Circle(tuple(images[k, i]), radius[i]) for k, i in zip(image, disk, strict=True)],
        facecolors=faces[disk],
        edgecolors=edges[disk],
        linewidths=min(0.6, 0.05 * points),
        zorder=1,
    )
    disks.set_label("disks")
    axes.add_collection(disks)


def _draw_chains(axes: Axes, packing: Packing, images: Floats, points: float) -> LineCollection:
    contacts, geometry = packing.contacts, packing.geometry
    start = images[:, contacts.i]
    end = start - geometry.distance[:, None] * geometry.normal
    left, right = axes.get_xlim()
    xs = np.stack([start[..., 0], end[..., 0]])
    image, contact = np.nonzero((xs.max(axis=0) > left) & (xs.min(axis=0) < right))
    force = packing.normal_force
    widest = 0.5 * packing.radius.min() * points
    slip_limit = packing.law.slip_limit(geometry.overlap)
    share = np.divide(np.abs(contacts.slip), slip_limit, out=np.zeros(len(contacts)), where=slip_limit > 0)
    # Most contacts of a stable packing stick far below the bound, so that only a logarithm shows them apart.
    colours = {"array": share[contact], "cmap": MOBILIZATION, "norm": LogNorm(1e-4, 1)}
    chains = LineCollection(
        list(np.stack([start, end], axis=2)[image, contact]),
        linewidths=widest * (force / force.max(initial=np.finfo(float).tiny))[contact],
        capstyle="round",
        zorder=3,
        **(colours if share.any() else {"colors": INK}),
    )
    chains.set_label("contacts")
    axes.add_collection(chains)
    if force.any():
        unit = 10.0 ** np.floor(np.log10(force.max()))
        values = [part * unit for part in (0.5, 1, 2, 5) if part * unit <= force.max()]
        key = [Line2D([], [], color=INK, linewidth=widest * value / force.max()) for value in values]
        names = [f"$f_n = {values[0]:g}$", *(f"${value:g}$" for value in values[1:])]
        axes.figure.legend(key, names, loc="outside lower left", ncols=len(values), columnspacing=1.2)
    return chains


def _draw_load(axes: Axes, packing: Packing, images: Floats, ceiling: float) -> None:
    """Arrows down onto the upper layer, and one along x above it."""
    if not packing.top.any():
        return
    x, y = images[len(images) // 2, packing.top].T
    radius = packing.radius[packing.top]
    length = 1.2 * packing.radius.max()
    style: dict[str, Any] = {
        "angles": "xy",
        "scale_units": "xy",
        "scale": 1,
        "zorder": 5,
        "color": INK,
        "width": 0.006,
    }
    if packing.fy:
        axes.quiver(x, y + radius + length, np.zeros_like(x), np.full_like(x, -length), **style)
        highest = np.argmax(y + radius)
        axes.text(x[highest] + 0.2 * length, y[highest] + radius[highest] + 0.6 * length, "$F_y$", zorder=5)
    if packing.fx:
        left, right = axes.get_xlim()
        middle, height = 0.5 * (left + right), ceiling - 0.4 * length
        axes.quiver([middle], [height], [np.sign(packing.fx) * 2 * length], [0.0], **style)
        axes.text(middle - 0.2 * length, height, "$F_x$", ha="right", va="center")


def _magnify_onset(axes: Axes, curve: PairCurve, fx_c: float) -> None:
    """Inset with the imaginary parts about the onset, as far as the fourth computed point beyond it."""
    beyond = curve.fx[curve.fx > fx_c][:4]
    if not len(beyond):
        return
    reach = beyond[-1] - fx_c
    near = np.abs(curve.fx - fx_c) <= reach
    inset = axes.inset_axes((0.13, 0.62, 0.4, 0.34))
    inset.plot(curve.fx, np.sort(curve.eigenvalues.imag, axis=1), color="C0", marker="o", markersize=2, linewidth=0.7)
    inset.axvline(fx_c, color=INK, linewidth=0.7)
    height = 1.15 * np.abs(curve.eigenvalues.imag[near]).max()
    inset.set(xlim=(fx_c - reach, fx_c + 1.05 * reach), ylim=(-height, height) if height else None)
    inset.set_xticks([fx_c], [f"$F_x^c = {fx_c:.5g}$"])
    inset.tick_params(labelsize=6.5)
