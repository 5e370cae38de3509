r"""A film of an undamped run with magnified displacements, and D(t) beside it.

**Magnification.** The displacements of an undamped run span ten decades and more, and would be invisible at their true
size. They are multiplied by a power of ten, which is printed on the frame. The largest displacement so far determines
the factor, so that the factor falls in steps while D grows.
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, Normalize

from faultgouge.analysis import Packing, PackingFileError, RunFile, nearest_image
from faultgouge.analysis.arrays import Floats

from .disk_view import View
from .film import DOTS, LARGEST_SHOWN, Film, packing_and_curve
from .packing_artist import PackingArtist
from .series import few_decades
from .style import BULK, EDGE, styled

DISPLACEMENT_COLOURS = LinearSegmentedColormap.from_list("moved", [BULK, "#f0b090", "#c0392b"])


@dataclass(frozen=True, eq=False)
class RunMotion:
    """Displacements of an undamped run.

    Attributes
    ----------
    packing : Packing
        The equilibrium where the run began.
    time : ndarray, shape (T,)
        Times.
    displacement : ndarray, shape (T, N, 2)
        From the equilibrium, length.
    """

    packing: Packing
    time: Floats
    displacement: Floats

    @classmethod
    def of(cls, packing: Packing, time: Floats, position: Floats, position_low: Floats | None = None) -> "RunMotion":
        """From positions, shape (T, N, 2), and their low parts if there are any."""
        displacement = nearest_image(position - packing.position, packing.box_length)
        if position_low is not None:
            own = 0.0 if packing.position_low is None else packing.position_low
            displacement = displacement + (position_low - own)
        return cls(packing, time, displacement)

    @classmethod
    def read(cls, run: RunFile) -> "RunMotion | None":
        """The undamped run of an open file; None if the file has no trajectory."""
        if "trajectory" not in run.names_of_series:
            return None
        packing, series = run.packing(-1), run.series("trajectory")
        # the run begins at rest, before its first sample
        time, position = np.insert(series["time"], 0, 0.0), np.insert(series["position"], 0, packing.position, axis=0)
        low = series.get("position_low")
        if low is not None and packing.position_low is not None:
            low = np.insert(low, 0, packing.position_low, axis=0)
        return cls.of(packing, time, position, low)

    def between(self, first: float, last: float) -> "RunMotion":
        """A part of the run. Raises PackingFileError if the run has fewer than two samples there."""
        part = (self.time >= first) & (self.time <= last)
        if part.sum() < 2:
            raise PackingFileError(
                f"the run has {part.sum()} samples from t = {first:g} to {last:g}, and two are needed: its times go "
                f"from {self.time[0]:g} to {self.time[-1]:g}"
            )
        return RunMotion(self.packing, self.time[part], self.displacement[part])

    @property
    def msd(self) -> Floats:
        """D(t), length^2, shape (T,)."""
        return np.sum(self.displacement**2, axis=2).mean(axis=1)

    def magnification(self) -> Floats:
        """The power of ten at each time, shape (T,): see the module."""
        largest = np.maximum.accumulate(np.sqrt(np.sum(self.displacement**2, axis=2)).max(axis=1))
        if not largest[-1]:
            return np.ones(len(largest))
        # before any displacement the factor is that of the first displacement
        largest = np.maximum(largest, largest[largest > 0][0])
        return 10.0 ** np.floor(np.log10(LARGEST_SHOWN * self.packing.radius.min() / largest))


class RunFilm(Film):
    """An undamped run with magnified displacements, and D(t) beside it.

    Parameters
    ----------
    frames : int
        How many frames; the samples of the run are taken at even intervals of time.
    """

    @styled
    def __init__(self, motion: RunMotion, frames: int, dots: int | None = DOTS) -> None:
        wanted = np.linspace(motion.time[0], motion.time[-1], frames)
        self._sample = np.clip(np.searchsorted(motion.time, wanted), 0, len(motion.time) - 1)
        self._motion, self._factor, self._msd = motion, motion.magnification(), motion.msd
        packing = motion.packing
        figure, axes, beside, points = packing_and_curve(packing)
        view = View.of(packing, margin=2 * packing.radius.max())
        self._artist = PackingArtist(axes, packing, view=view, points=points)
        self._artist.chains.set(color=EDGE, linewidth=0.5, zorder=2)
        self._artist.disks.set(array=np.zeros(len(view.disk)), cmap=DISPLACEMENT_COLOURS, norm=Normalize(0, 1))
        self._says = axes.text(0.5, 1.01, "", transform=axes.transAxes, ha="center", va="bottom", fontsize=8)
        key = "red: moves farthest; grey: rests"
        axes.text(0.5, -0.02, key, transform=axes.transAxes, ha="center", va="top", fontsize=7)
        seen = self._msd > 0
        beside.plot(motion.time[seen], self._msd[seen], color=BULK, linewidth=1.2)
        (self._line,) = beside.plot([], [], color="C1", linewidth=1.0)
        (self._dot,) = beside.plot([], [], "o", color="C0", markersize=4)
        beside.set(xlabel="$t$", ylabel="$D(t)$", yscale="log")
        late = seen & (motion.time >= 0.01 * motion.time[-1])  # the very first steps are many decades lower
        if late.any():
            beside.set_ylim(0.3 * self._msd[late].min(), 3 * self._msd.max())
        beside.margins(x=0.02)
        few_decades(beside)
        moving = [*self._artist.moving, self._says, self._line, self._dot]
        super().__init__(figure, moving, frames, dots)

    def show(self, number: int) -> None:
        """The run at the time of the frame."""
        k = self._sample[number]
        factor = self._factor[k]
        moved = factor * self._motion.displacement[k]
        self._artist.move(moved)
        share = np.linalg.norm(moved, axis=1)
        share = share / (share.max() or 1.0)
        self._artist.disks.set_array(share[self._artist.view.disk])
        self._says.set_text(
            rf"$t = {self._motion.time[k]:.3f}$, displacements $\times\,10^{{{round(np.log10(factor))}}}$"
        )
        self._line.set_data(self._motion.time[: k + 1], self._msd[: k + 1])
        self._dot.set_data([self._motion.time[k]], [self._msd[k]])
