"""The frames of a run.h5: its undamped run if the file has its trajectory, else its ramp."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...errors import BadInputError
from ...motion.hysteresis import turning_points
from ...packing.geometry import nearest_image, touching
from ...packing.packing import Packing
from ..runfile import RunFile
from .export_quantities import Frame


def choose_frames(run: RunFile, says: str) -> range:
    """Interpret a choice of frames as numbers of frames.

    Parameters
    ----------
    run : RunFile
        The file.
    says : str
        "all", or START:STOP or START:STOP:STEP as in Python.

    Raises
    ------
    BadInputError
        If the text is neither, or selects no frame.
    """
    total = len(run)
    if "trajectory" in run.names_of_series:
        total = 1 + len(run.series("trajectory")["time"])
    parts = says.split(":")
    try:
        wanted = slice(None) if says == "all" else slice(*(int(part) if part else None for part in parts))
        found = range(total)[wanted]
    except (TypeError, ValueError):
        found = None
    if found is None or (says != "all" and len(parts) < 2):
        raise BadInputError(f"--frames {says}: give all, START:STOP or START:STOP:STEP, counted from 0.")
    if not found:
        raise BadInputError(f"--frames {says}: {run.path} has {total} frames, and none of them is meant.")
    return found


def frames_of(run: RunFile, numbers: range) -> Iterator[Frame]:
    """Yield the frames of a file one after the other.

    Parameters
    ----------
    run : RunFile
        The file, which must stay open until the last frame has been read. Frame 0 of an undamped run is its initial
        equilibrium.
    numbers : range
        From :func:`choose_frames`.
    """
    if "trajectory" in run.names_of_series:
        yield from _of_run(run, numbers)
        return
    first = run.packing(0)
    way = run.fx
    if turning_points(way):  # programs want times that grow
        way = np.append(0.0, np.cumsum(np.abs(np.diff(way))))
    for number in numbers:
        packing = run.packing(number)
        yield Frame(packing, float(way[number]), _displacement(packing, first), whole=True)


def _of_run(run: RunFile, numbers: range) -> Iterator[Frame]:
    start, series = run.packing(-1), run.series("trajectory")
    low = series.get("position_low")
    for number in numbers:
        time, place, place_low = 0.0, start.position, start.position_low
        if number:
            time, place = float(series["time"][number - 1]), series["position"][number - 1]
            place_low = None if low is None else low[number - 1]
        packing = replace(
            start,
            position=place,
            position_low=place_low,
            contacts=touching(place, start.radius, start.box_length),
            angle=np.zeros(len(start)),
        )
        yield Frame(packing, time, _displacement(packing, start), whole=False)


def _displacement(packing: Packing, start: Packing) -> np.ndarray:
    moved = nearest_image(packing.position - start.position, packing.box_length)
    if packing.position_low is not None and start.position_low is not None:
        moved = moved + (packing.position_low - start.position_low)
    return moved
