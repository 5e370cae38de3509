"""Reader of run.h5 for MDAnalysis: import this module, and a Universe opens the file.

    import MDAnalysis
    import faultgouge.analysis.files.mdanalysis

    universe = MDAnalysis.Universe("run.h5")
    layer = universe.select_atoms("type top")

An atom is a disk, with its radius, its mass and its type, "top" (the upper layer) or "bed". A frame is an equilibrium,
with its number as its time, or a sample of an undamped run, with the time of the run. Positions in MDAnalysis are
float32. ``ts.data["position"]`` is float64, and ``ts.data`` has all other observables of the frame, such as fx;
observables that an undamped run does not store are nan.

`MeanSquareDisplacement` computes D(t) of the selected disks, as an analysis of MDAnalysis.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import PackingFileError
from ..motion.growth import mean_square_displacement
from .runfile import RunFile

try:
    from MDAnalysis.analysis.base import AnalysisBase
    from MDAnalysis.coordinates.H5MD import H5MDReader
    from MDAnalysis.core.topology import Topology
    from MDAnalysis.core.topologyattrs import Atomids, Atomtypes, Masses, Radii, Resids, Resnums, Segids
    from MDAnalysis.topology.base import TopologyReaderBase
except ImportError:
    raise ImportError(
        "faultgouge.analysis.files.mdanalysis needs the library MDAnalysis: pip install MDAnalysis"
    ) from None

FORMAT = "H5"
"""MDAnalysis's name of a format is the suffix of its files; its own suffix of H5MD is .h5md."""

DISK_TYPES = "bed", "top"


class RunFileParser(TopologyReaderBase):
    """Radii, masses and types of a run.h5, for ``MDAnalysis.Universe``."""

    format = FORMAT

    def parse(self, **_: Any) -> Topology:
        """The disks of the file, which is checked whole.

        Raises
        ------
        PackingFileError
            If the file is damaged, or not a run of faultgouge.
        """
        with RunFile(self.filename) as file:
            packing = file.packing(0)
        count = len(packing)
        attributes = [
            Atomids(np.arange(1, count + 1)),
            Atomtypes(np.array(DISK_TYPES, dtype=object)[packing.top.astype(int)]),
            Masses(packing.mass),
            Radii(packing.radius),
            Resids(np.array([1])),
            Resnums(np.array([1])),
            Segids(np.array(["disks"], dtype=object)),
        ]
        return Topology(count, 1, 1, attrs=attributes)


class RunFileReader(H5MDReader):
    """The frames of a run.h5, for ``MDAnalysis.Universe``; a file has no units.

    Parameters
    ----------
    filename : path
        The file.
    convert_units : bool
        As of MDAnalysis's reader of H5MD, but False by default.
    **more
        As of MDAnalysis's reader of H5MD.
    """

    format = FORMAT

    def __init__(self, filename: Any, convert_units: bool = False, **more: Any) -> None:
        super().__init__(filename, convert_units=convert_units, **more)

    def _copy_to_data(self) -> None:
        super()._copy_to_data()
        data, position = self.ts.data, self._particle_group["position"]
        # a file that was written before there was a link among the observables
        data["position"] = position["value"][self._frame]
        low = self._file.get("faultgouge/trajectory/position_low")
        behind = self._frame - position["value"].shape[0]
        if low is not None and behind >= -len(low):
            data["position_low"] = low[behind]

    @staticmethod
    def parse_n_atoms(filename: Any, **_: Any) -> int:
        """Number of disks."""
        with RunFile(filename) as file:
            return len(file.packing(0))


class MeanSquareDisplacement(AnalysisBase):
    """D(t) of some disks of a run.h5: the mean of their squared displacements from a frame, in float64.

    Parameters
    ----------
    atoms : MDAnalysis.AtomGroup
        Disks of a Universe of a run.h5.
    reference : int
        The frame from which displacements count. By default it is the first one; that of an undamped run is the
        equilibrium where the run began.

    Attributes
    ----------
    results.msd : ndarray, shape (T,)
        D of each frame, length^2.
    times : ndarray, shape (T,)
        Times of the frames.

    Raises
    ------
    PackingFileError
        If the file has a single frame, in which nothing moves.
    """

    def __init__(self, atoms: Any, reference: int = 0, **more: Any) -> None:
        trajectory = atoms.universe.trajectory
        if len(trajectory) < 2:
            raise PackingFileError(
                f"{trajectory.filename} has one equilibrium and no trajectory, so that D would be 0: run `faultgouge "
                "perturb` with trajectory = true under [output]"
            )
        super().__init__(trajectory, **more)
        self._atoms, self._reference = atoms, reference

    def _prepare(self) -> None:
        now = self._trajectory.ts.frame
        self._from, self._from_low, self._period = self._place(self._trajectory[self._reference])
        self._trajectory[now]
        self.results.msd = np.empty(self.n_frames)

    def _single_frame(self) -> None:
        place, low, _ = self._place(self._ts)
        both = low is not None and self._from_low is not None
        self.results.msd[self._frame_index] = mean_square_displacement(
            place, self._from, self._period, low if both else None, self._from_low if both else None
        )

    def _place(self, ts: Any) -> tuple[np.ndarray, np.ndarray | None, float | None]:
        """Positions in the plane, their low parts, and the period along x, in float64."""
        chosen, low = self._atoms.indices, ts.data.get("position_low")
        edges = self._trajectory._particle_group["box"].get("edges/value")
        period = None if edges is None else float(edges[ts.frame, 0])
        return ts.data["position"][chosen, :2], None if low is None else low[chosen], period
