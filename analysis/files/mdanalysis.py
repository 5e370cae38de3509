"""Reader of run.h5 for MDAnalysis: import this module, and a Universe opens the file.

    import MDAnalysis
    import faultgouge.analysis.files.mdanalysis

    universe = MDAnalysis.Universe("run.h5")
    layer = universe.select_atoms("type top")

An atom is a disk, with its radius, its mass and its type, "top" (the upper layer) or "bed". A frame is an equilibrium,
with its number as its time, or a sample of an undamped run, with the time of the run. Positions in MDAnalysis are
float32. ``ts.data["position"]`` is float64, and ``ts.data`` has all other observables of the frame, such as fx;
observables that an undamped run does not store are nan.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from MDAnalysis.coordinates.H5MD import H5MDReader
from MDAnalysis.core.topology import Topology
from MDAnalysis.core.topologyattrs import Atomids, Atomtypes, Masses, Radii, Resids, Resnums, Segids
from MDAnalysis.topology.base import TopologyReaderBase

from .runfile import RunFile

FORMAT = "H5"
"""MDAnalysis's name of a format is the suffix of its files; its own suffix of H5MD is .h5md."""


class RunFileParser(TopologyReaderBase):
    """Radii, masses and types of a run.h5, for ``MDAnalysis.Universe``."""

    format = FORMAT

    def parse(self, **_: Any) -> Topology:
        """The disks of the file, which is checked whole; a PackingFileError if it is damaged, or no run of ours."""
        with RunFile(self.filename) as file:
            packing = file.packing(0)
        count = len(packing)
        types, segments = np.where(packing.top, "top", "bed").astype(object), np.array(["disks"], dtype=object)
        attributes = [Atomids(np.arange(1, count + 1)), Atomtypes(types), Masses(packing.mass), Radii(packing.radius)]
        attributes += [Resids(np.array([1])), Resnums(np.array([1])), Segids(segments)]
        return Topology(count, 1, 1, attrs=attributes)


class RunFileReader(H5MDReader):
    """The frames of a run.h5, for ``MDAnalysis.Universe``; a file has no units, so that `convert_units`, as of
    MDAnalysis's reader of H5MD, is False by default."""

    format = FORMAT

    def __init__(self, filename: Any, convert_units: bool = False, **more: Any) -> None:
        super().__init__(filename, convert_units=convert_units, **more)

    def _copy_to_data(self) -> None:
        super()._copy_to_data()
        # a file that was written before there was a link among the observables
        self.ts.data["position"] = self._particle_group["position/value"][self._frame]
        low = self._file.get("faultgouge/trajectory/position_low", ())
        if (behind := self._frame - self.n_frames) >= -len(low):
            self.ts.data["position_low"] = low[behind]
