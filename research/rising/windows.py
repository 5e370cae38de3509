"""Windows of the motion under a load that rises: one-sided, and as LAMMPS integrates it from the same two starts.

A drag fades out in the first `FADE_WINDOWS` windows, on all coordinates or not on rotations, as in
:mod:`faultgouge.analysis.motion.rising_load`: between parts of LAMMPS's run velocities are multiplied by what the drag
leaves of them. Drift and vibration are then those of the same span of windows.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
from mpi4py import MPI

from faultgouge.analysis import Configuration, Floats, Packing, Signal, stable_timestep
from faultgouge.analysis.motion.one_sided import OneSidedSystem, forces_on_coordinates
from faultgouge.analysis.motion.rising_load import DRAG, FADE_WINDOWS, WINDOW, means_of_windows, windows_under_load
from faultgouge.pywrap import Engine

STEPS_OF_LOOK, LOOKS = 15, 400
"""Time steps between two looks at velocities, each some 0.05 of the stable one, and looks in a window."""

DEFAULT = 40, 36
"""Windows of a run, and of its span, where the motion beside it was solved for and not followed."""


@dataclass(frozen=True)
class Windows:
    """The windows of a motion that is followed.

    Attributes
    ----------
    length : float
        Of one of them, time.
    count, span : int
        How many there are, and of how many at the end drift and vibration are.
    """

    length: float
    count: int
    span: int

    @classmethod
    def of(cls, configuration: Configuration, rising: Mapping[str, Any]) -> Windows:
        """Those of one-sided motion, `Stability.rising`."""
        length = _length(configuration)
        if rising["time"] is None:
            return cls(length, *DEFAULT)
        return cls(length, round(rising["time"] / length), round(rising["span"] / length))

    @property
    def time_step(self) -> float:
        """Of LAMMPS, time."""
        return self.length / (STEPS_OF_LOOK * LOOKS)


def _length(configuration: Configuration) -> float:
    return WINDOW * float(stable_timestep(configuration))


def follow_one_sided(packing: Packing, count: int) -> tuple[float, Floats]:
    """Length of a window, and drift and vibration of a layer in each window after the drag, shape (windows, 2, S)."""
    system, length = OneSidedSystem.of(packing), _length(packing.configuration)
    load = system.weight.T @ forces_on_coordinates(packing.configuration, "fx")
    followed = list(islice(windows_under_load(system, load, length), count))[FADE_WINDOWS:]
    return length, np.array([means_of_windows(system, [window]) for window in followed])


def rise_in_plugin(packing: Packing, rate: float, windows: Windows, spins: bool) -> list[tuple[Floats, Floats]]:
    """The windows of a layer, `windows_in`, under a load that rises, as the plugin integrates it.

    Parameters
    ----------
    packing : Packing
        The layer with its dashpots.
    rate : float
        Of the force on each disk of the upper layer, force / time.
    windows : Windows
        Of this motion.
    spins : bool
        Whether the drag acts on rotations, too.
    """
    end = 2 * windows.count * windows.length
    signal = Signal(np.array([0.0, end]), np.array([0.0, rate * end]))
    with Engine(packing, MPI.COMM_SELF) as engine, engine.undamped(windows.time_step, signal=signal):
        return list(windows_in(engine.lammps, len(packing), windows, spins))


def drift_and_vibration(parts: Sequence[tuple[Floats, Floats]], length: float, rate: float) -> dict[str, float]:
    """Root mean squares over particles and axes, over the rate, of windows that follow each other, each so long."""
    moved, squares = np.mean(parts, axis=0)
    mean = moved / length
    left = np.maximum(squares - mean**2, 0.0)
    drift, vibration = (float(np.sqrt(np.mean(each)) / rate) for each in (mean**2, left))
    return {"drift": drift, "vibration": vibration}


def windows_in(lmp: Any, count: int, windows: Windows, spins: bool) -> Iterator[tuple[Floats, Floats]]:
    """How far each particle moves, and the mean squares of its velocities, in each window after the drag.

    Particles move by less than half a periodic box between two looks.
    """
    dimension = lmp.extract_setting("dimension")
    low, high, *_ = lmp.extract_box()
    box = np.subtract(high, low)[:dimension]

    def by_id(name: str) -> Floats:
        order = np.argsort(lmp.numpy.extract_atom("id")[:count])
        return np.asarray(lmp.numpy.extract_atom(name)[order, :dimension], dtype=float)

    lmp.command("run 0 post no")
    for look in range(FADE_WINDOWS * LOOKS):
        lmp.command(f"run {STEPS_OF_LOOK} pre no post no")
        left = np.exp(-DRAG / LOOKS * (1 - (look + 1) / LOOKS / FADE_WINDOWS) ** 2)
        for name in ("v", "omega") if spins else ("v",):
            lmp.numpy.extract_atom(name)[:count] *= left
    place = by_id("x")
    for _ in range(windows.count - FADE_WINDOWS):
        moved, squares = np.zeros_like(place), np.zeros_like(place)
        for _ in range(LOOKS):
            lmp.command(f"run {STEPS_OF_LOOK} pre no post no")
            here = by_id("x")
            step = here - place
            moved += step - box * np.round(step / box)
            squares += by_id("v") ** 2 / LOOKS
            place = here
        yield moved, squares
