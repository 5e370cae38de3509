r"""A mode of a packing: arrows for the displacement of the disks, colour for their rotation.

A real mode moves all disks along fixed lines, in phase. The disks of a complex mode move on ellipses, which two moments
a quarter of a period apart show. The phase of a vector is arbitrary: it is chosen so that the first moment has the
largest displacement.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgb
from matplotlib.figure import Figure

from faultgouge.analysis import BadInputError, Modes, closest_to_meeting, normal_modes, spectrum
from faultgouge.analysis.arrays import Complexes, Floats
from faultgouge.analysis.has_configuration import HasConfiguration

from .packing import PackingArtist, figure_for
from .spheres import INTO, draw_spheres, flat
from .style import INK, figure_of, require_axes, styled

TYPICAL_ARROW, LONGEST_ARROW = 1.2, 4.0
"""Length that three quarters of the arrows do not exceed, and length of the longest arrow at most, in units of the mean
radius: a few disks that move far leave the arrows of all others to be seen."""

ORTHOGONAL_COSINE = 1e-6
"""Cosine of two modes up to which they are taken for orthogonal: far above rounding, and an epsilon that no coalescence
is near."""

PURE_ROTATION = 1e-9
"""Displacements that are smaller than this share of the rotations are rounding: a sphere spins about its contact."""

TURNS = "#f4f4f4", "#1f5fa8"
"""Colours of a sphere that does not rotate, and of the one that rotates most."""

ARROWS: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "color": INK, "zorder": 5}
ARROWS |= {"headwidth": 3.2, "headlength": 3.6, "headaxislength": 3.2, "minlength": 0.8}


class ModeShape(NamedTuple):
    """How the particles of a packing move in a mode: its number, counted by the real part of the eigenvalue from 0, the
    eigenvalue lambda, the displacement, the participation ratio, and the share of rotation in the kinetic energy.

    The displacement, shape (axes, N), has x, y and R theta of every disk, or all coordinates of every sphere. The
    longest displacement in space is one, or the largest rotation where nothing is displaced; its phase is turned as the
    module says.
    """

    number: int
    eigenvalue: complex
    displacement: Complexes
    participation: float
    rotation: float

    @classmethod
    def of(cls, packing: HasConfiguration, modes: Modes, number: int) -> "ModeShape":
        """One of the modes of a packing."""
        moved, value = displacement(packing, modes.right[:, number]), complex(modes.values[number])
        return cls(number, value, moved, float(modes.participation[number]), float(modes.rotation[number]))

    @property
    def is_complex(self) -> bool:
        """Whether it grows with its partner, the complex conjugate."""
        return self.eigenvalue.imag != 0

    def at(self, phase: float) -> Floats:
        """The displacement at a phase of the oscillation, growth left out; shape (axes, N)."""
        return np.real(self.displacement * np.exp(1j * phase))

    @property
    def plain(self) -> str:
        """Eigenvalue, participation ratio and share of rotation, for a terminal."""
        sign = f" +- {abs(self.eigenvalue.imag):.6g} i" if self.is_complex else ""
        ratios = f"participation ratio {self.participation:.3f}, rotation {100 * self.rotation:.1f} %"
        return f"mode {self.number}: lambda = {self.eigenvalue.real:.8g}{sign}, {ratios} of the kinetic energy"

    @property
    def words(self) -> str:
        """The same for a caption."""
        sign = rf" \pm {abs(self.eigenvalue.imag):.4g}\,i" if self.is_complex else ""
        ratios = f"participation ratio {self.participation:.2f}, rotation {100 * self.rotation:.0f} %"
        value = rf"$\lambda = {self.eigenvalue.real:.6g}{sign}$"
        return f"mode {self.number}: {value}\n{ratios} of the kinetic energy"


def displacement(packing: HasConfiguration, vector: Complexes) -> Complexes:
    """A mass-weighted vector, shape (axes N,), as of `ModeShape`: the coordinates of every particle, (axes, N)."""
    vector = vector / np.sqrt(packing.coordinate_mass)
    vector = vector * np.exp(-0.5j * np.angle(np.sum(vector**2)))
    moved = vector.reshape(packing.axes, -1)
    largest = np.sqrt(np.sum(np.abs(moved[: packing.dimension]) ** 2, axis=0)).max()
    rotation = np.abs(moved).max()
    return np.asarray(moved / (largest if largest > PURE_ROTATION * rotation else rotation))


def modes_of(packing: HasConfiguration, number: int | None = None) -> tuple[list[ModeShape], str]:
    """A mode of a packing by its number, or those that make it unstable, or are about to; with a description.

    Without a number: the member with positive imaginary part of the fastest growing pair; without one, the two real
    modes that are closest to a coalescence. Raises BadInputError if the packing has no such mode.
    """
    modes = normal_modes(packing)
    count = len(modes.values)
    if number is not None:
        if not 0 <= number < count:
            raise BadInputError(f"mode {number}: the packing has {count} modes, counted from 0")
        return [ModeShape.of(packing, modes, number)], f"mode {number} of {count}"
    if count < 2:
        raise BadInputError(f"the packing has {count} modes, and a pair is two of them")
    pairs = spectrum(packing).pairs  # fastest growing first, without those that are rounding noise
    if pairs:
        words = "the complex pair" if len(pairs) == 1 else f"the fastest growing of {len(pairs)} complex pairs"
        return [ModeShape.of(packing, modes, int(np.argmin(np.abs(modes.values - pairs[0].eigenvalue))))], words
    first, second, cosine = closest_to_meeting(modes)
    if cosine < ORTHOGONAL_COSINE:
        where, later = (f"at F_x = {packing.fx:g} ", "a later --frame, or ") if packing.top.any() else ("", "")
        says = f"{where}all modes are orthogonal to {ORTHOGONAL_COSINE:g}, so that no two of them are about to meet"
        raise BadInputError(f"{says}: take {later}a mode by its number")
    words = f"the two real modes closest to meeting: the cosine between them is {cosine:.4f}"
    return [ModeShape.of(packing, modes, each) for each in (first, second)], words


def _arrow_scale(packing: HasConfiguration, mode: ModeShape) -> float:
    """Length of an arrow for a displacement of one, length."""
    largest = np.sqrt(np.sum(np.abs(mode.displacement[: packing.dimension]) ** 2, axis=0))
    typical = max(np.quantile(np.delete(largest, packing.rattlers), 0.75), PURE_ROTATION)
    longest = max(largest.max(), PURE_ROTATION)
    return float(packing.radius.mean() * min(TYPICAL_ARROW / typical, LONGEST_ARROW / longest))


def _show_mode(axes: Axes, packing: HasConfiguration, mode: ModeShape, phase: float, points: float | None) -> None:
    """A mode at a phase on axes, with its numbers; of spheres at its largest displacement."""
    title, moved, reach = mode.words, mode.at(phase), _arrow_scale(packing, mode)
    if packing.dimension == 2:
        turn, magnified = np.abs(mode.displacement[2]).max() or 1.0, 1.0
        if phase:  # close to an onset the two moments differ by orders of magnitude
            largest = max(np.hypot(*moved[:2]).max(), np.abs(moved[2]).max() / turn) or 1.0
            unit = 10.0 ** np.floor(-np.log10(largest))
            magnified = float(max(step * unit for step in (1, 2, 5) if step == 1 or step * unit * largest <= 1))
            scale = "on the scale of the left picture" if magnified == 1 else f"arrows and colours times {magnified:g}"
            title = f"a quarter of a period later\n{scale}"
        artist = PackingArtist(axes, packing, points=points)
        disk, moved = artist.view.disk, magnified * moved
        artist.chains.set(linewidth=0.0)
        artist.disks.set(array=moved[2, disk] / turn, cmap="RdBu_r", norm=Normalize(-1, 1))
        axes.quiver(*artist.view.place.T, *(reach * moved[:2, disk]), width=0.007, **ARROWS)
    else:
        turns = np.linalg.norm(moved[3:] / (np.linalg.norm(moved[3:], axis=0).max() or 1.0), axis=0)[:, None]
        faces = (1 - turns) * np.array(to_rgb(TURNS[0])) + turns * np.array(to_rgb(TURNS[1]))
        draw_spheres(axes, packing.configuration, {}, 0.0, faces)
        order = np.argsort(-(packing.position @ INTO))
        arrow = reach * flat(moved[:3].T)
        axes.quiver(*flat(packing.position)[order].T, *arrow[order].T, width=0.008, **ARROWS)
    axes.set_title(title, fontsize=7)


def draw_mode(packing: HasConfiguration, number: int | None = None, axes: Axes | None = None) -> Figure:
    """Draw a mode: arrows for displacements, colours for rotations.

    Parameters
    ----------
    packing : Packing or Configuration
        The packing.
    number : int, optional
        Which mode, counted by the real part of the eigenvalue from 0. By default the fastest growing complex pair, at
        two moments a quarter of a period apart; without one, the two real modes that are closest to meeting.
    axes : Axes, optional
        Where to draw the first of them at its first moment; a figure of its own, with a scale, by default.

    Returns
    -------
    Figure
        With the eigenvalue, the participation ratio and the share of rotation above.

    Raises
    ------
    BadInputError
        If the packing has no such mode.
    """
    require_axes(axes)
    modes, words = modes_of(packing, number)
    if axes is None:
        return draw_modes(packing, modes, words)
    styled(_show_mode)(axes, packing, modes[0], 0.0, None)
    return figure_of(axes)


@styled
def draw_modes(packing: HasConfiguration, modes: Sequence[ModeShape], words: str) -> Figure:
    """Modes side by side, one or two, with their numbers below; a complex mode of disks also a quarter of a period
    later."""
    spheres, two = packing.dimension == 3, (0.0, 0.5 * np.pi)
    panels = [(mode, phase) for mode in modes for phase in (two if mode.is_complex and not spheres else two[:1])]
    figure, axes, points = figure_for(packing, len(panels), below=0.95)
    for one, (mode, phase) in zip(axes, panels, strict=True):
        _show_mode(one, packing, mode, phase, points)
    moments = ", at the largest displacement" if spheres else ", at two moments a quarter of a period apart"
    finish(axes, packing, words + moments if spheres or len(panels) > len(modes) else words)
    return figure


def finish(axes: Sequence[Axes], packing: HasConfiguration, words: str) -> None:
    """The line above and the scale of rotation below."""
    figure, spheres = figure_of(axes[0]), packing.dimension == 3
    load = f"$F_x = {packing.fx:.6g}$: " if packing.top.any() and not spheres else ""
    figure.suptitle(f"{load}{words}", fontsize=8)
    about: dict[str, Any] = {"ax": list(axes), "location": "bottom"}
    if spheres:
        scale = ScalarMappable(Normalize(0, 1), LinearSegmentedColormap.from_list("turns", TURNS))
        bar = figure.colorbar(scale, aspect=40, shrink=0.5, **about)
        bar.set_ticks([0, 1], labels=["no rotation", "largest rotation"])
    else:
        bar = figure.colorbar(ScalarMappable(Normalize(-1, 1), "RdBu_r"), aspect=50, shrink=0.6, pad=0.02, **about)
        bar.set_ticks([-1, 0, 1], labels=["clockwise", "rotation", "anticlockwise"])
    bar.outline.set_linewidth(0.4)
