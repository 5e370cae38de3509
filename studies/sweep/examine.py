"""One point of a sweep, examined: its row, whatever goes wrong."""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

from mpi4py import MPI
from scipy.sparse.linalg import ArpackError
from threadpoolctl import threadpool_limits

from ...analysis import FaultgougeError, Packing
from ...pywrap import Equilibrium, Scene, settle
from ...pywrap.settling.bed import settled_bed
from .points import Point
from .tasks import TASKS

Row = dict[str, Any]

FAILURES = (FaultgougeError, ValueError, ArithmeticError, ArpackError, MemoryError)
"""What may go wrong with one scene: of the package, of LAPACK, of ARPACK, and of a packing that is too large."""


def examined(task: str, point: Point, bed: Packing | None, keep: bool) -> tuple[Row, Packing | None]:
    """One point: its row, and if it is to be kept the packing as it settled.

    What goes wrong with a point is in its row under "says".
    """
    begin = time.perf_counter(), time.process_time()
    beds = [] if bed is None else [bed]
    row: Row = {
        "key": point.key,
        "version": version("faultgouge"),
        "values": point.values,
        "result": {},
        "says": point.says,
    }
    if point.scene is not None:
        with threadpool_limits(1):
            try:
                row["result"] = TASKS[task].run(point.scene, _starter(point.scene, beds))
                row["says"] = row["result"].pop("says", None)
            except FAILURES as error:
                row["says"] = str(error) or type(error).__name__
    row["seconds"] = round(time.perf_counter() - begin[0], 3)
    row["cpu_seconds"] = round(time.process_time() - begin[1], 3)
    return row, (beds[0] if keep and beds else bed if keep else None)


def _starter(scene: Scene, beds: list[Packing]) -> Callable[[float], Equilibrium]:
    """The settled packing for a friction coefficient; what settles goes to `beds`, and is taken from there."""

    def start(mu: float) -> Equilibrium:
        if scene.packing.model_dump().get("settle_friction", False) and mu != scene.law.mus[0]:
            return settle(scene, mu, MPI.COMM_SELF)
        if not beds:
            beds.append(settled_bed(scene, mu, MPI.COMM_SELF))
        return settle(scene, mu, MPI.COMM_SELF, bed=beds[0])

    return start
