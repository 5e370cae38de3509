r"""What comes before a driven run: the settled packing, warnings, and LAMMPS with the spring.

Driving is *slow* if the spring loads the layer to mu F_y in many periods of the slowest vibration of the packing,

.. math:: \mu F_y/(k V) \gg 2\pi/\omega_1 ,

and stick-slip is expected of springs softer than the layer, :math:`k < k_l = f/u`, u the mean displacement of the layer
under the force f on each of its disks.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from ...analysis import Contacts, Packing, dynamical_matrix, layer_force, nearest_modes, stable_timestep
from ...analysis.factors.sparse_lu import general_lu
from ...analysis.motion.signals import Signal
from ...analysis.progress import Watch
from ..lammps.dynamics import Dynamics
from ..lammps.engine import Engine
from ..scenes.drive_section import Drive
from ..scenes.packing_section import GeneratedPacking
from ..scenes.scene import Scene
from ..scenes.validation import SceneError, require_section
from ..settling.settle import law_of, settle, settle_bed
from .drive_plan import Plan, strength

LEAST_LOADING_PERIODS, REFUSED_LOADING_PERIODS = 100.0, 10.0
"""Periods of the slowest vibration in which the spring loads the layer to mu F_y: below the first a run is warned, and
below the second refused."""

STEPS_A_PULSE = 10
"""Time steps in a period of a pulse: velocity Verlet then samples it to some per cent."""


def settle_for_drive(scene: Scene, communicator: MPI.Comm | None = None, watch: Watch | None = None) -> Packing:
    """Settle the packing of a scene at F_x = 0, where its slips begin at zero.

    Friction bears nothing in a packing that has settled without friction: its slips and the low parts of its
    coordinates are rounding. They are left out, so that a data file describes the packing for the deck drive.in. A
    stored packing is taken as it is, to the bit, with its slips, as the deck takes the packing of a data file: to
    balance a packing more closely would move it, any distance along x if only friction holds it.

    Parameters
    ----------
    scene : Scene
        Its sections [packing], [law] and [load] count.
    communicator : mpi4py.MPI.Comm, optional
        The ranks that share the packing; all by default.
    watch : callable, optional
        Told in words what is under way.

    Raises
    ------
    NoEquilibriumError
        If the packing does not settle.
    """
    section = scene.packing
    if isinstance(section, GeneratedPacking) and section.settle_friction:
        return settle(scene, communicator=communicator, watch=watch).packing
    if isinstance(section, GeneratedPacking):
        packing = settle(scene.model_copy(update={"precision": "double"}), 0.0, communicator, watch).packing
        contacts = Contacts(packing.contacts.i, packing.contacts.j, np.zeros(len(packing.contacts)))
        packing = replace(packing, law=law_of(scene, scene.law.mus[0]), contacts=contacts)
    else:
        packing = settle_bed(scene)
    if scene.precision == "double":
        return packing
    contacts = packing.contacts
    if contacts.slip_low is None:
        contacts = replace(contacts, slip_low=np.zeros(len(contacts)))
    low = np.zeros_like(packing.position) if packing.position_low is None else packing.position_low
    return replace(packing, contacts=contacts, position_low=low)


def check_drive(scene: Scene, start: Packing, communicator: MPI.Comm | None = None) -> list[str]:
    """Warnings about a drive that may not stick and slip.

    Raises SceneError if the drive is not slow against the vibrations of the layer, or time steps do not follow it.
    """
    settings, warnings = require_section(scene.drive, "drive"), list[str]()
    with driven(settings, start, communicator) as (_, dynamics):
        Plan.of(settings, start, dynamics.time_step)
    if settings.spring == "rigid":
        return warnings
    matrix, active = dynamical_matrix(start)
    slowest = nearest_modes(start, 0.0, 1).values.real.min()
    period = 2 * math.pi / math.sqrt(max(slowest, np.finfo(float).tiny))
    loading = strength(start) / (settings.spring * settings.fastest)
    says = (
        f"drive.velocity = {settings.fastest:g} loads the layer to mu F_y in {loading:.3g}, which is "
        f"{loading / period:.2g} periods of its slowest vibration"
    )
    if loading < REFUSED_LOADING_PERIODS * period:
        raise SceneError(
            f"{says}, and slow driving takes {LEAST_LOADING_PERIODS:g} or more: lower it to "
            f"{settings.fastest * loading / (LEAST_LOADING_PERIODS * period):.1g}, or take a softer spring"
        )
    if loading < LEAST_LOADING_PERIODS * period:
        warnings.append(f"{says}: slow driving takes {LEAST_LOADING_PERIODS:g} or more")
    unit = (layer_force(start, 1.0) / start.coordinate_mass)[active]
    moved = np.zeros(start.coordinates)
    moved[active] = general_lu(matrix.tocsc()).solve(unit)
    stiffness = 1 / moved[: len(start)][start.top].mean()
    if settings.spring > stiffness:
        warnings.append(
            f"drive.spring = {settings.spring:g} is stiffer than the layer, which has {stiffness:.3g} for each disk at "
            "rest: the layer may slide without sticking"
        )
    return warnings


@contextmanager
def driven(settings: Drive, start: Packing, communicator: MPI.Comm | None = None) -> Iterator[tuple[Engine, Dynamics]]:
    """LAMMPS with the drive, at its beginning; refused if its time steps do not follow signal, spring and dashpots."""
    signal = settings.forcing()
    with (
        Engine(start, communicator) as engine,
        engine.driven(settings.spring, settings.stages, signal, settings.on) as dynamics,
    ):
        if signal is not None:
            _check_signal(settings, signal, dynamics.time_step)
        _check_time_step(settings, start, dynamics.time_step)
        yield engine, dynamics


def _check_time_step(settings: Drive, start: Packing, dt: float) -> None:
    """Refuse a spring or dashpots with which the time step of the deck would blow up, and a layer that leaps."""
    leap = settings.fastest * dt
    if settings.spring == "rigid" and leap > start.radius.min():
        raise SceneError(
            f"the layer moves at {settings.fastest:g} by {leap:.3g} in a time step of {dt:.3g}, farther than the "
            f"smallest radius {start.radius.min():g}: lower drive.velocity"
        )
    drawn = start if settings.spring == "rigid" else replace(start, spring=settings.spring)
    limit = float(stable_timestep(drawn))
    if dt >= limit:
        lower = "damping.cn and damping.ct" if dt >= float(stable_timestep(start)) else "drive.spring"
        raise SceneError(
            f"the time step of the run is {dt:.3g}, and the limit {limit:.3g}, above which every run of this packing "
            f"blows up: lower {lower}"
        )


def _check_signal(settings: Drive, signal: Signal, dt: float) -> None:
    """Refuse a signal that time steps would not follow."""
    says = f"and the time step is {dt:.3g}: the run would not follow it, so give a slower signal"
    if settings.omega is not None and 2 * math.pi / settings.omega < STEPS_A_PULSE * dt:
        raise SceneError(f"drive.omega = {settings.omega:g} has a period of {2 * math.pi / settings.omega:.3g}, {says}")
    if settings.signal != "pulse" and signal.shortest < dt:
        raise SceneError(f"drive.signal has rows that are {signal.shortest:.3g} apart, {says}")
