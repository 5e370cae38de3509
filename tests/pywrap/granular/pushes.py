"""Pushes of particles at rest, whose motion in LAMMPS is compared with one-sided motion."""

from itertools import islice

import numpy as np

from faultgouge.analysis.motion.one_sided import OneSidedSystem

PUSH = 1e-7
"""Length / time. Displacements stay below 1e-5."""


def velocities(here, push):
    """Pushes of all coordinates as velocities of the particles, shape (P, N, d)."""
    return [column.reshape(here.axes, len(here))[: here.dimension].T for column in push.T]


def pushed(lmp, here, push, times, dt, size=PUSH):
    """D of LAMMPS's particles over the push squared: shape (T, P) for pushes of all coordinates, shape (.., P)."""
    from faultgouge.pywrap.granular.lammps_arrays import owned_array, rows_of, set_velocity
    from faultgouge.pywrap.granular.look_in_a_copy import in_a_copy, quieten

    def follow(velocity):
        lmp.command("log none")
        quieten(lmp, drag=True)
        lmp.command(f"timestep {dt}")
        at_rest = owned_array(lmp, "x")[rows_of(lmp, here)].copy()
        set_velocity(lmp, here, size * velocity)
        found, steps = [], 0
        low, high, *_ = lmp.extract_box()
        width = np.subtract(high, low)
        for time in times:
            lmp.command(f"run {round(time / dt) - steps} post no")
            steps = round(time / dt)
            away = owned_array(lmp, "x")[rows_of(lmp, here)] - at_rest
            away[:, 0] -= width[0] * np.round(away[:, 0] / width[0])
            found.append(float(np.mean(np.sum(away**2, axis=1))) / size**2)
        return found

    return np.transpose([in_a_copy(lambda v=v: follow(v)) for v in push.T])


def in_steps(here, push, times, dt):
    """D of the one-sided motion in LAMMPS's own steps, shape (T,): fast motions of different phase add up to D, and
    what the step changes their phases by is not small."""
    system = OneSidedSystem.of(here)
    state, steps, found = system.start(push), 0, []
    for time in times:
        for _ in islice(system.steps(state, dt), round(time / dt) - steps):
            steps += 1
        found.append(np.sum(system.displacement(state.z)[..., 0] ** 2, axis=1).mean())
    return np.array(found)
