r"""A mode of a packing: arrows for the displacement of the disks, colour for their rotation.

A real mode moves all disks along fixed lines, in phase. The disks of a complex mode move on ellipses, which two moments
a quarter of a period apart show. The phase of a vector is arbitrary: it is chosen so that the first moment has the
largest displacement.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from faultgouge.analysis import (
    BadInputError,
    Configuration,
    Modes,
    closest_to_meeting,
    normal_modes,
    spectrum,
)
from faultgouge.analysis.arrays import Complexes, Floats
from faultgouge.analysis.has_configuration import HasConfiguration

from .disk_view import View
from .packing import PACKING_WIDTH
from .packing_artist import PackingArtist
from .spheres import add_scale_of_turns, draw_turns, new_figure
from .style import EDGE, INK, STYLE, figure_of, require_axes, styled

TYPICAL_ARROW, LONGEST_ARROW = 1.2, 4.0
"""Length that three quarters of the arrows do not exceed, and length of the longest arrow at most, in units of the mean
radius: a few disks that move far leave the arrows of all others to be seen."""

FILM_DISPLACEMENT = 0.5
"""Largest displacement of a disk in a film, in units of the largest radius."""

ORTHOGONAL_COSINE = 1e-6
"""Cosine of two modes up to which they are taken for orthogonal: far above rounding, and an epsilon that no coalescence
is near."""

PURE_ROTATION = 1e-9
"""Displacements that are smaller than this share of the rotations are rounding: a sphere spins about its contact."""


TWO_MOMENTS = "at two moments a quarter of a period apart"


class ModeError(BadInputError):
    """A mode that a packing does not have, in one sentence."""


@dataclass(frozen=True, eq=False)
class ModeShape:
    """How the disks of a packing move in a mode.

    Attributes
    ----------
    number : int
        Which, counted by the real part of the eigenvalue from 0.
    eigenvalue : complex
        lambda, 1 / time^2.
    displacement : ndarray of complex, shape (axes, N)
        x, y and R theta of every disk, or all coordinates of every sphere. The longest displacement in space is one,
        or the largest rotation where nothing is displaced; its phase is turned as the module says.
    participation, rotation : float
        Participation ratio, and share of rotation in the kinetic energy.
    """

    number: int
    eigenvalue: complex
    displacement: Complexes
    participation: float
    rotation: float

    @classmethod
    def of(cls, packing: HasConfiguration, modes: Modes, number: int) -> "ModeShape":
        """One of the modes of a packing."""
        moved = displacement(packing, modes.right[:, number])
        return cls(
            number,
            complex(modes.values[number]),
            moved,
            float(modes.participation[number]),
            float(modes.rotation[number]),
        )

    @property
    def is_complex(self) -> bool:
        """Whether it grows with its partner, the complex conjugate."""
        return self.eigenvalue.imag != 0

    def at(self, phase: float) -> Floats:
        """The displacement at a phase of the oscillation, growth left out; shape (3, N)."""
        return np.real(self.displacement * np.exp(1j * phase))

    @property
    def plain(self) -> str:
        """The text of `words` for a terminal."""
        sign = f" +- {abs(self.eigenvalue.imag):.6g} i" if self.is_complex else ""
        return (
            f"mode {self.number}: lambda = {self.eigenvalue.real:.8g}{sign}, participation ratio "
            f"{self.participation:.3f}, rotation {100 * self.rotation:.1f} % of the kinetic energy"
        )

    @property
    def words(self) -> str:
        """Eigenvalue, participation ratio and share of rotation, for a caption."""
        sign = rf" \pm {abs(self.eigenvalue.imag):.4g}\,i" if self.is_complex else ""
        return (
            rf"mode {self.number}: $\lambda = {self.eigenvalue.real:.6g}{sign}$"
            f"\nparticipation ratio {self.participation:.2f}, "
            f"rotation {100 * self.rotation:.0f} % of the kinetic energy"
        )


def displacement(packing: HasConfiguration, vector: Complexes) -> Complexes:
    """A mass-weighted vector, shape (axes N,), as of `ModeShape`: the coordinates of every particle, (axes, N)."""
    vector = vector / np.sqrt(packing.coordinate_mass)
    vector = vector * np.exp(-0.5j * np.angle(np.sum(vector**2)))
    moved = vector.reshape(packing.axes, -1)
    largest = np.sqrt(np.sum(np.abs(moved[: packing.dimension]) ** 2, axis=0)).max()
    rotation = np.abs(moved).max()
    return np.asarray(moved / (largest if largest > PURE_ROTATION * rotation else rotation))


def unstable_pair(packing: HasConfiguration, modes: Modes, believed: Sequence[complex]) -> tuple[list[ModeShape], str]:
    """The modes that make a packing unstable, or are about to.

    Parameters
    ----------
    believed : sequence of complex
        Eigenvalues of the complex pairs that are no rounding noise, fastest growing first, as of
        :func:`~faultgouge.analysis.motion.spectrum`.

    Returns
    -------
    modes : list of ModeShape
        The member with positive imaginary part of the fastest growing pair; without one, the two real modes that are
        closest to a coalescence.
    words : str
        What they are.

    Raises
    ------
    ModeError
        If all modes are orthogonal, so that no two are about to meet.
    """
    if len(believed):
        number = int(np.argmin(np.abs(modes.values - believed[0])))
        words = "the complex pair" if len(believed) == 1 else f"the fastest growing of {len(believed)} complex pairs"
        return [ModeShape.of(packing, modes, number)], words
    first, second, cosine = closest_to_meeting(modes)
    if cosine < ORTHOGONAL_COSINE:
        raise ModeError(
            f"at F_x = {packing.fx:g} all modes are orthogonal to {ORTHOGONAL_COSINE:g}, so that no two of them are "
            "about to meet: take a later --frame, or a mode by its number"
            if packing.top.any()
            else f"all modes are orthogonal to {ORTHOGONAL_COSINE:g}, so that no two of them are about to meet: take a "
            "mode by its number"
        )
    words = f"the two real modes closest to meeting: the cosine between them is {cosine:.4f}"
    return [ModeShape.of(packing, modes, number) for number in (first, second)], words


class ModeArtist:
    """A mode on axes, whose phase can be changed from frame to frame.

    Parameters
    ----------
    points : float, optional
        Points per unit of length; as the axes stand now by default.
    moves : bool
        Whether disks move; otherwise arrows show how they would.
    """

    def __init__(
        self, axes: Axes, packing: HasConfiguration, mode: ModeShape, points: float | None = None, moves: bool = False
    ) -> None:
        self.mode, self.moves = mode, moves
        self.reach = FILM_DISPLACEMENT * packing.radius.max() if moves else _arrow_scale(packing, mode)
        self.artist = PackingArtist(
            axes, packing, view=View.of(packing, margin=self.reach if moves else 0.0), points=points
        )
        disk = self.artist.view.disk
        chains = self.artist.chains
        chains.set(color=EDGE, linewidth=0.4 if moves else 0.0, zorder=2)
        self.artist.disks.set(array=np.zeros(len(disk)), cmap="RdBu_r", norm=Normalize(-1, 1))
        self.arrows = None
        if not moves:
            still = np.zeros(len(disk))
            self.arrows = axes.quiver(
                *self.artist.view.place.T, still, still, angles="xy", scale_units="xy", scale=1, color=INK, width=0.007,
                headwidth=3.2, headlength=3.6, headaxislength=3.2, minlength=0.8,
            )  # fmt: skip
            self.arrows.set(zorder=5)
        self.rotates = np.abs(mode.displacement[2]).max() or 1.0

    def magnification(self, phase: float) -> float:
        """1, 2 or 5 times a power of ten by which the motion at a phase stays below the largest of the mode."""
        moved = self.mode.at(phase)
        largest = max(np.hypot(*moved[:2]).max(), np.abs(moved[2]).max() / self.rotates)
        if not largest:
            return 1.0
        unit = float(10 ** np.floor(-np.log10(largest)))
        return max(step * unit for step in (1, 2, 5) if step == 1 or step * unit * largest <= 1)

    def show(self, phase: float, magnified: float = 1.0) -> None:
        """Draw the mode at a phase, its motion magnified."""
        moved = magnified * self.mode.at(phase)
        disk = self.artist.view.disk
        self.artist.disks.set_array(moved[2, disk] / self.rotates)
        if self.arrows is None:
            self.artist.move(self.reach * moved[:2].T)
        else:
            self.arrows.set_UVC(*(self.reach * moved[:2, disk]))


def _arrow_scale(packing: HasConfiguration, mode: ModeShape) -> float:
    """Length of an arrow for a displacement of one, length."""
    largest = np.sqrt(np.sum(np.abs(mode.displacement[: packing.dimension]) ** 2, axis=0))
    typical = max(np.quantile(np.delete(largest, packing.rattlers), 0.75), PURE_ROTATION)
    longest = max(largest.max(), PURE_ROTATION)
    return float(packing.radius.mean() * min(TYPICAL_ARROW / typical, LONGEST_ARROW / longest))


def modes_of(packing: HasConfiguration, number: int | None = None) -> tuple[list[ModeShape], str]:
    """A mode of a packing by its number, or the modes of `unstable_pair`; with a description.

    Raises ModeError if the packing has no such mode.
    """
    modes = normal_modes(packing)
    if number is None:
        if len(modes.values) < 2:
            raise ModeError(f"the packing has {len(modes.values)} modes, and a pair is two of them")
        return unstable_pair(packing, modes, [pair.eigenvalue for pair in spectrum(packing).pairs])
    if not 0 <= number < len(modes.values):
        raise ModeError(f"mode {number}: the packing has {len(modes.values)} modes, counted from 0")
    return [ModeShape.of(packing, modes, number)], f"mode {number} of {len(modes.values)}"


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
    with matplotlib.rc_context(fname=STYLE):
        if packing.dimension == 3:
            _draw_spheres_of(axes, packing.configuration, modes[0])
        else:
            ModeArtist(axes, packing, modes[0]).show(0.0)
            axes.set_title(modes[0].words, fontsize=7)
    return figure_of(axes)


@styled
def draw_modes(packing: HasConfiguration, modes: Sequence[ModeShape], words: str) -> Figure:
    """Modes side by side, with their numbers below.

    Parameters
    ----------
    modes : sequence of ModeShape
        One or two.

    Returns
    -------
    Figure
        A complex mode also a quarter of a period later.
    """
    if packing.dimension == 3:
        return _draw_modes_of_spheres(packing.configuration, modes, words)
    panels = [(mode, phase) for mode in modes for phase in ((0.0, np.pi / 2) if mode.is_complex else (0.0,))]
    figure, axes, points = side_by_side(packing, len(panels))
    for one, (mode, phase) in zip(axes, panels, strict=True):
        artist = ModeArtist(one, packing, mode, points)
        later = phase > 0  # close to an onset the two moments differ by orders of magnitude
        magnified = artist.magnification(phase) if later else 1.0
        artist.show(phase, magnified)
        scale = "on the scale of the left picture" if magnified == 1 else f"arrows and colours times {magnified:g}"
        one.set_title(f"a quarter of a period later\n{scale}" if later else mode.words, fontsize=7)
    complex_ = any(mode.is_complex for mode in modes)
    finish(figure, axes, packing, f"{words}, {TWO_MOMENTS}" if complex_ else words)
    return figure


def _draw_modes_of_spheres(packing: Configuration, modes: Sequence[ModeShape], words: str) -> Figure:
    """Modes of spheres side by side, each at its largest displacement."""
    figure = new_figure(packing, len(modes))
    axes = figure.subplots(1, len(modes), squeeze=False)[0]
    for one, mode in zip(axes, modes, strict=True):
        _draw_spheres_of(one, packing, mode)
    figure.suptitle(f"{words}, at the largest displacement", fontsize=8)
    add_scale_of_turns(figure, axes)
    return figure


def _draw_spheres_of(axes: Axes, packing: Configuration, mode: ModeShape) -> None:
    """A mode of spheres at its largest displacement, on axes."""
    moved = mode.at(0.0)
    turns = np.linalg.norm(moved[3:], axis=0).max() or 1.0
    moved = np.concatenate([moved[:3], moved[3:] / turns])
    draw_turns(axes, packing, moved, _arrow_scale(packing, mode))
    axes.set_title(mode.words, fontsize=7)


def side_by_side(packing: HasConfiguration, count: int) -> tuple[Figure, list[Axes], float]:
    """A figure with axes for the same packing, and points per unit of length in them."""
    view = View.of(packing)
    across = PACKING_WIDTH - 0.1
    height = across * (view.ceiling - view.bottom) / (view.right - view.left)
    figure = Figure(figsize=(PACKING_WIDTH * count, height + 0.95), layout="constrained")
    axes = figure.subplots(1, count, squeeze=False)[0]
    return figure, list(axes), 72 * across / (view.right - view.left)


def finish(figure: Figure, axes: Sequence[Axes], packing: HasConfiguration, words: str) -> None:
    """The line above and the scale of rotation below."""
    load = f"$F_x = {packing.fx:.6g}$: " if packing.top.any() else ""
    figure.suptitle(f"{load}{words}", fontsize=8)
    scale = ScalarMappable(Normalize(-1, 1), "RdBu_r")
    bar = figure.colorbar(scale, ax=list(axes), location="bottom", aspect=50, shrink=0.6, pad=0.02)
    bar.set_ticks([-1, 0, 1], labels=["clockwise", "rotation", "anticlockwise"])
    bar.outline.set_linewidth(0.4)
