r"""The size of eruptions: undamped runs from rest at many loads, until they are over.

Above its onset a packing at rest is unstable. The rounding of the coordinates is a sufficient perturbation: D grows
from it at the rate :math:`2 |\mathrm{Im}\,\omega|` of the spectrum (:math:`2\,\mathrm{Re}\,s` with dissipation), by ten
and more decades, and then levels off. The largest D is the size of the eruption at that load.

**Over.** A run is over at time t when two conditions hold: the largest D of its second half, (t/2, t], is at most 1.5
times that of the quarter before, (t/4, t/2]; and t is long enough for D to grow by `DECADES_OF_D` decades at the rate
of the spectrum. A stable packing is observed for `QUIET_TIME` units of time and then reported as stable, unless D
*rises* nevertheless. A run that is not over in the time of the scene is cut off, and its size is a lower bound. A layer
that has slid by the diameter of a disk *flows*.

**What ends the growth** is determined when D first reaches a tenth of its largest value. Each sample examines the
contacts: *opens* if an initial contact has opened by then; *slides* if none has opened, but a contact slides at its
Coulomb bound that did not slide initially; and *law* if neither has happened: the growth then ends by the curvature of
the contact law alone. A contact that opens and closes between two samples is missed.

**Energy.** The tangential force has no potential, and energy is not conserved. But the balance of work holds: the
kinetic energy changes by the work of all forces, load included. Each run ends with `WORK_STEPS` steps in which this
work is summed. Without drag, which is not a force in LAMMPS, the error of the balance is of the order of the time step
squared. The noise floor is the largest D of the first time unit, before any growth.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from mpi4py import MPI
from threadpoolctl import threadpool_limits

from ...analysis import Packing, mean_square_displacement, nearest_image, spectrum
from ...analysis.arrays import Floats
from ...analysis.motion.growth_of_run import unstable_rates
from ...pywrap import Engine
from ...pywrap.lammps.dynamics import Dynamics, MotionState
from ...pywrap.runs.undamped import time_step
from ..packing_tools import contact_pairs, unit_of_time

DECADES_OF_D = 24.0
"""Decades of D between its noise, 1e-27 in the first steps, and the square of a tenth of an overlap."""

QUIET_TIME = 50.0
"""Times for which a stable packing is watched, in `unit_of_time`."""

SAMPLES_OF_RUN = 400
"""Samples of disks and contacts in a run of the full time, and at least so many in a shorter one."""

LATE_GROWTH_OF_D = 1.5
"""Largest growth of D, from the second quarter to the second half, of a run that is over: D of disks that wander about
at random would double."""

END_OF_GROWTH = 0.1
"""Share of the largest D at which the growth counts as ended."""

WORK_STEPS = 2000
"""Steps over which work is added up: some thirty periods of the fastest mode."""

Sample = dict[str, float]
"""A packing in the course of a run."""

RISE_OF_D = 1e4
"""Factor from the D of the first time unit from which D of a linearly stable packing has risen: rounding alone drifts
by a few hundred times in `QUIET_TIME`."""

WALK_FACTOR = 10.0
"""Factor from the D of a random walk, one rounding of a coordinate a time step, below which D has not risen: strong
drag leaves D at 1e-30 in the first time unit, and the walk is at 3e-25 after fifty."""

EndOfRun = Literal["opens", "slides", "law", "flows", "stable", "rises", "cut off"]


@dataclass(frozen=True, eq=False)
class Start:
    """Where a run begins, and how long it may take.

    Attributes
    ----------
    packing : Packing
        The equilibrium.
    residual : float
        Its largest force on a disk: contacts that carry less do not count.
    time : float
        Length of the run at the most, time.
    damped : bool
        Whether the packing has dashpots or drag.
    """

    packing: Packing
    residual: float
    time: float
    damped: bool = False


def erupt(start: Start) -> dict[str, Any]:
    """A run from rest until it is over, on this process alone.

    Returns
    -------
    dict
        fx : load, force on each disk of the upper layer; damped : whether with dashpots or drag; rate : growth rate of
        D from the spectrum, 1 / time, 0 of a stable packing; time : when the run was over; msd, kinetic_energy : the
        largest D, length^2, and the largest kinetic energy; slip : largest displacement of the upper layer along x,
        length; lost, gained, sliding : most contacts, in any sample, that were open, new, or slid; ended : when D first
        reached a tenth of its largest value, time, None if it did not grow; ends : what ended the growth, one of
        `EndOfRun`; noise : largest D of the first time unit; balance : kinetic energy less work, in units of the larger
        of the two and of the kinetic energy; series : the samples as columns.
    """
    with threadpool_limits(1):
        rate = growth_rate(start.packing)
        dt, unit = time_step(start.packing), unit_of_time(start.packing)
        samples: list[Sample] = []
        with Engine(start.packing, MPI.COMM_SELF) as engine, engine.undamped(dt) as dynamics:
            watch = _Watch(start)
            for at, motion in _course(dynamics, dt, start.time):
                samples.append(watch.sample(at, motion, engine.packing))
                if _over(samples, rate, unit) or _flows(samples, start.packing):
                    break
            balance = _balance(dynamics, start.packing)
    columns: dict[str, Floats] = {name: np.array([each[name] for each in samples]) for name in samples[0]}
    time = columns["time"]
    return {
        "fx": start.packing.fx,
        "damped": start.damped,
        "rate": rate,
        "time": float(time[-1]),
        **{name: float(columns[name].max()) for name in ("msd", "kinetic_energy")},
        "slip": float(np.abs(columns["slip"]).max()),
        **{name: int(columns[name].max()) for name in ("lost", "gained", "sliding")},
        **_end_of_growth(start, samples, columns, rate, unit),
        "noise": _noise(columns, unit),
        "balance": balance,
        "series": {name: column.tolist() for name, column in columns.items()},
    }


def growth_rate(packing: Packing) -> float:
    """Growth rate of D, 1 / time, from K or, with dissipation, from K, C and M; 0 for a stable packing."""
    if not packing.damped:
        return spectrum(packing).growth_rate()
    return 2 * float(unstable_rates(packing).real.max(initial=0.0))


def _course(dynamics: Dynamics, dt: float, longest: float) -> Iterator[tuple[float, MotionState]]:
    """Samples, close together at first and farther apart later, no two at one step."""
    last = int(longest / dt)
    early = np.geomspace(min(100, last), last, SAMPLES_OF_RUN).astype(np.int64)
    steps = np.union1d(early, np.linspace(min(100, last), last, SAMPLES_OF_RUN).astype(np.int64))
    done = 0
    for step in steps.tolist():
        yield step * dt, dynamics.advance(step - done)
        done = step


def _over(samples: list[Sample], rate: float, unit: float) -> bool:
    """Whether a run is over, see the module."""
    t = samples[-1]["time"]
    if rate == 0:
        return t >= QUIET_TIME * unit
    if t < DECADES_OF_D * np.log(10) / rate:
        return False
    quarter = max((each["msd"] for each in samples if t / 4 < each["time"] <= t / 2), default=0.0)
    half = max(each["msd"] for each in samples if each["time"] > t / 2)
    return half <= LATE_GROWTH_OF_D * quarter


def _flows(samples: list[Sample], packing: Packing) -> bool:
    return abs(samples[-1]["slip"]) > 2 * packing.radius.max()


class _Watch:
    """Changes of disks and contacts since the start."""

    def __init__(self, start: Start) -> None:
        self._start, self._position = start, start.packing.position
        self._moved = np.zeros_like(start.packing.position)
        carrying = start.packing.loaded(start.residual)
        self._contacts = contact_pairs(carrying)
        self._slid = _sliding_pairs(carrying)

    def sample(self, time: float, motion: MotionState, now: Packing) -> Sample:
        """The packing at one time.

        Time, D, mean displacement of the upper layer along x, kinetic energy of translation and rotation; contacts of
        the start that are open, contacts that are new, and contacts of the start that slide and did not.
        """
        first = self._start.packing
        step = motion.position - self._position
        step[:, 0] = nearest_image(step[:, 0], first.box_length)
        self._moved, self._position = self._moved + step, motion.position
        there = contact_pairs(now)
        # from step to step, disks move less than half a box; for small D, the difference itself has more digits
        msd = np.mean(np.sum(self._moved**2, axis=1))
        if abs(self._moved).max() < 0.25 * (first.box_length or np.inf):
            low = motion.position_low, first.position_low
            msd = mean_square_displacement(motion.position, first.position, first.box_length, *low)
        return {
            "time": time,
            "msd": float(msd),
            "slip": float(self._moved[first.top, 0].mean()),
            "kinetic_energy": motion.kinetic_energy(first),
            "lost": len(self._contacts - there),
            "gained": len(there - contact_pairs(first)),
            "sliding": len((_sliding_pairs(now) - self._slid) & self._contacts),
        }


def _sliding_pairs(packing: Packing) -> set[tuple[int, int]]:
    return contact_pairs(packing, packing.sliding)


def _balance(dynamics: Dynamics, packing: Packing) -> float:
    """Change of the kinetic energy less work, relative."""
    before = dynamics.advance(0).kinetic_energy(packing)
    motion, work = dynamics.work(WORK_STEPS)
    after = motion.kinetic_energy(packing)
    return float(abs(after - before - work) / max(abs(work), after, before))


def _noise(columns: dict[str, Floats], unit: float) -> float:
    """Largest D of the first time unit."""
    return float(columns["msd"][columns["time"] <= unit].max(initial=float(columns["msd"][0])))


def _end_of_growth(
    start: Start, samples: list[Sample], columns: dict[str, Floats], rate: float, unit: float
) -> dict[str, Any]:
    """Time and cause of the end of the growth, see the module."""
    ended: float | None = None
    drift = WALK_FACTOR * start.packing.coordinate_rounding**2 * columns["time"][-1] / time_step(start.packing)
    ends: EndOfRun = "stable" if columns["msd"].max() <= max(RISE_OF_D * _noise(columns, unit), drift) else "rises"
    if rate > 0:
        place = int(np.argmax(columns["msd"] >= END_OF_GROWTH * columns["msd"].max()))
        ended = float(columns["time"][place])
        upto = slice(0, place + 1)
        ends = "opens" if columns["lost"][upto].any() else "slides" if columns["sliding"][upto].any() else "law"
        if not _over(samples, rate, unit):
            ends = "cut off"
    return {"ended": ended, "ends": "flows" if _flows(samples, start.packing) else ends}
