"""Pushes of particles at rest, whose motion in LAMMPS is compared with one-sided motion."""

from itertools import islice

import numpy as np
import pytest
from granular_packings import command

from faultgouge.analysis import one_sided_motion
from faultgouge.analysis.motion.one_sided import OneSidedSystem

PUSH = 1e-7
"""Length / time. Displacements stay below 1e-5."""


def motion_after(packing, push, times):
    """The one-sided motion after a push of all coordinates, shape (.., 1), as velocities of the particles."""
    here = packing.configuration
    velocity = push[:, 0].reshape(here.axes, len(here))[: here.dimension].T
    return one_sided_motion(packing, velocity, times=times)


def in_a_quiet_copy(lmp, work, lines=""):
    """What some work returns in a copy of LAMMPS without drag and output, after some commands."""
    from faultgouge.pywrap.granular.look_in_a_copy import in_a_copy, quieten

    def follow():
        lmp.command("log none")
        quieten(lmp, drag=True)
        command(lmp, lines)
        return work()

    return in_a_copy(follow)


def places(lmp, here):
    """Positions of LAMMPS's particles, in the order of those of a configuration."""
    from faultgouge.pywrap.granular.lammps_arrays import owned_array, rows_of

    return owned_array(lmp, "x")[rows_of(lmp, here)].copy()


def pushed(lmp, here, push, times, dt, size=PUSH):
    """D of LAMMPS's particles over the push squared: shape (T, P) for pushes of all coordinates, shape (.., P)."""
    from faultgouge.pywrap.granular.lammps_arrays import set_velocity

    low, high, *_ = lmp.extract_box()

    def follow(velocity):
        at_rest, found = places(lmp, here), []
        set_velocity(lmp, here, size * velocity)
        for steps in np.diff(np.rint(np.array(times) / dt).astype(int), prepend=0):
            lmp.command(f"run {steps} post no")
            away = places(lmp, here) - at_rest
            away[:, 0] -= (high[0] - low[0]) * np.round(away[:, 0] / (high[0] - low[0]))
            found.append(float(np.mean(np.sum(away**2, axis=1))) / size**2)
        return found

    return np.transpose([in_a_quiet_copy(lmp, lambda v=v: follow(v), f"timestep {dt}") for v in push.T])


def moves_alike(lmp, found, time) -> None:
    """LAMMPS moves as K and C say, extrapolated to a step of zero: dashpots feel the velocity of half steps."""
    from faultgouge.pywrap import compare_motion

    runs = [compare_motion(lmp, found, time, 1e-6, timestep=h) for h in (1e-4, 5e-5)]
    assert runs[0].difference / runs[1].difference == pytest.approx(2, rel=0.1)
    rest = 2 * runs[1].velocity - runs[0].velocity - runs[0].linear_velocity
    assert np.linalg.norm(rest) < 1e-4 * np.linalg.norm(runs[0].linear_velocity)


def in_steps(here, push, times, dt):
    """D of the one-sided motion in LAMMPS's own steps, shape (T,): fast motions of different phase add up to D, and
    what the step changes their phases by is not small."""
    system = OneSidedSystem.of(here)
    state, found = system.start(push), []
    for steps in np.diff(np.rint(np.array(times) / dt).astype(int), prepend=0):
        for _ in islice(system.steps(state, dt), steps):
            pass
        found.append(np.sum(system.displacement(state.z)[..., 0] ** 2, axis=1).mean())
    return np.array(found)
