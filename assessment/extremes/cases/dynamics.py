r"""Undamped runs: at the limit of the time step, and very long ones.

**Time step.** Velocity Verlet moves a mode of a frozen K as :math:`x_n = x_0\cos n\Omega\,\Delta t`,
:math:`\cos\Omega\,\Delta t = 1 - \omega^2\Delta t^2/2`: bounded below :math:`\Delta t = 2/\omega_{max}`, and beyond it
growing by :math:`e^\kappa` a step, :math:`\cosh\kappa = \omega^2\Delta t^2/2 - 1`.

**Energy.** Verlet's trajectory conserves not E but a function close by,

.. math:: \tilde E = E + \Delta t^2 \left(\tfrac1{12} v^T K v - \tfrac1{24} F^T M^{-1} F\right) + O(\Delta t^4) ,

which is sampled instead, so that the oscillation of E does not hide a drift.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np
from mpi4py import MPI
from scipy.linalg import eigh

from ....analysis import Packing, spectrum, stable_timestep, stiffness_matrix
from ....pywrap import Engine, SceneError
from ....pywrap.equilibria.rattlers import place_disks
from ....pywrap.runs.undamped import time_step
from .alone import refused_by_lammps
from .case import Case, Outcome, measured_outcome, refused_outcome
from .packings import crystal, law, shear_packing

GROUP = "time stepping"

DRIFT = 1e-5
"""Relative change of energy that counts as none: what is left of its oscillation after 40 samples."""

MODE_AMPLITUDE = 1e-4
"""Amplitude of a mode in units of the smallest overlap: it moves as that of a frozen K up to this relative change of
K."""

SHAKE_AMPLITUDE = 0.1
"""Amplitude of the motion whose energy is followed, in units of the smallest overlap: contacts stay closed."""


@cache
def _smooth() -> Packing:
    """Six disks without friction at rest: K is symmetric, and there is an energy."""
    return shear_packing(crystal(3, 2, law(mu=0.0))).packing


@cache
def _fastest() -> tuple[np.ndarray, float]:
    """The stiffest mode and its stable time step; masses are one, and without friction nothing turns."""
    packing = _smooth()
    active = 2 * len(packing)
    values, vectors = eigh(stiffness_matrix(packing).toarray()[:active, :active])
    return vectors[:, -1], stable_timestep(float(np.sqrt(values[-1])))


def _displace_disks(packing: Packing, step: np.ndarray) -> Packing:
    return place_disks(packing, packing.position + step.reshape(2, -1).T)


def _excite_mode(share: float, amplitude: float, steps: np.ndarray) -> np.ndarray:
    """Amplitude of the stiffest mode after so many steps of a share of the limit, in units of the first."""
    packing = _smooth()
    mode, limit = _fastest()
    size = amplitude * packing.geometry.overlap.min()
    found = []
    with Engine(_displace_disks(packing, size * mode)) as engine, engine.undamped(share * limit) as dynamics:
        for forward in np.diff(steps, prepend=0).tolist():
            position = dynamics.advance(forward).position
            found.append(mode @ (position - packing.position).T.ravel() / size)
    return np.array(found)


def _below_the_limit(share: float, count: int) -> Outcome:
    steps = count // 100 * np.arange(1, 101)
    phase = np.arccos(1 - 2 * share**2)
    error = np.abs(_excite_mode(share, MODE_AMPLITUDE, steps) - np.cos(steps * phase)).max()
    return measured_outcome(
        error,
        1e-3,
        f"stiffest mode against cos(n Omega dt) over {count} steps, in units of its amplitude; that is "
        f"{MODE_AMPLITUDE:g} of the smallest overlap, so that K is frozen up to that and modes mix at the square of it",
    )


def _over_the_limit() -> Outcome:
    packing = _smooth()
    limit = stable_timestep(spectrum(packing).omega_max)
    return refused_outcome(lambda: time_step(packing, 1.01 * limit), "over the limit 2/omega_max", SceneError)


def _limit_is_sharp() -> Outcome:
    """Beyond the limit that the refusal protects, motion grows as theory predicts."""
    steps = np.array([10, 30])
    first, last = np.abs(_excite_mode(1.01, 1e-8, steps))
    kappa = np.arccosh(2 * 1.01**2 - 1)
    return measured_outcome(
        abs(np.log(last / first) / (20 * kappa) - 1),
        1e-3,
        f"growth of the stiffest mode in LAMMPS left alone, against kappa = {kappa:.4g} a step: the limit is sharp",
    )


def _energy(packing: Packing, position: np.ndarray, velocity: np.ndarray, dt: float) -> float:
    """The conserved energy at an instant, less the energy of the packing at rest."""
    moved = _displace_disks(packing, (position - packing.position).T.ravel())
    v = np.concatenate([velocity.T.ravel(), np.zeros(len(packing))])
    force = moved.net_force
    correction = v @ (stiffness_matrix(moved) @ v) / 12 - force @ force / 24
    elastic = sum(
        sign * 0.4 * (each.normal_force @ each.geometry.overlap) for sign, each in ((1, moved), (-1, packing))
    )
    lifted = packing.fy * (position - packing.position)[packing.top, 1].sum()
    return float(0.5 * v @ v + elastic + lifted + dt**2 * correction)


def _drift(steps: int) -> Outcome:
    """Energies, and momenta along x in units of the disks' own, of an undamped run without friction."""
    packing = _smooth()
    _, limit = _fastest()
    push = np.random.default_rng(1).uniform(-1, 1, 2 * len(packing)) * SHAKE_AMPLITUDE * packing.geometry.overlap.min()
    samples = 400
    energy, momentum = np.empty(samples), np.empty(samples)
    dt = 0.1 * limit
    # every rank has a run of its own, the same one: six disks on two ranks would do nothing but wait for each other
    with Engine(_displace_disks(packing, push), MPI.COMM_SELF) as engine, engine.undamped(dt) as dynamics:
        for k in range(samples):
            motion = dynamics.advance(steps // samples)
            energy[k] = _energy(packing, motion.position, motion.velocity, dt)
            momentum[k] = motion.velocity[:, 0].sum() / np.abs(motion.velocity[:, 0]).sum()
    tenth = samples // 10
    return measured_outcome(
        abs(energy[-tenth:].mean() / energy[:tenth].mean() - 1),
        DRIFT,
        f"relative change of the energy of 6 disks without friction in {steps:.0e} undamped steps of 0.1 of the limit; "
        f"the momentum along x stays below {np.abs(momentum).max():.0e} of the disks' own",
    )


CASES = [
    Case(GROUP, "step of 0.5 of the limit", partial(_below_the_limit, 0.5, 10_000), True),
    Case(GROUP, "step of 0.99 of the limit", partial(_below_the_limit, 0.99, 10_000), True),
    Case(GROUP, "step of 1.01 of the limit", _over_the_limit, True),
    Case(GROUP, "step of 1.01 of the limit, LAMMPS alone", _limit_is_sharp, True),
    Case(GROUP, "energy, 1e5 steps", partial(_drift, 100_000), True),
    Case(GROUP, "energy, 1e7 steps", partial(_drift, 10_000_000)),
    Case(
        GROUP,
        "more than a radius in one step, LAMMPS",
        partial(
            refused_by_lammps,
            [(3.0, 3.0)],
            "velocity all set 0.0 -1.0 0.0\ntimestep 0.6\nrun 10\n",
            "farther than its radius",
        ),
    ),
]
