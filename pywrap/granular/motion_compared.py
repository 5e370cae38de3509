r"""LAMMPS's motion beside the exponential function of the operators of a Configuration.

From rest with the velocities :math:`\mathbf v_0` small motion is

.. math:: \begin{pmatrix} q \\ \dot q \end{pmatrix}(t) = e^{t G} \begin{pmatrix} 0 \\ \mathbf v_0 \end{pmatrix}, \qquad
    G = \begin{pmatrix} 0 & 1 \\ -M^{-1} K & -M^{-1} C \end{pmatrix} .

LAMMPS runs twice, with :math:`\pm \mathbf v_0`. Half of the difference has neither the motion by residual forces nor
terms of second order in :math:`\mathbf v_0`. Left are the error of the time step h, of the order h^2, or h with
dashpots; cubic terms of the forces; and, in `granular`, histories that are turned only beyond 1e-10 of Coulomb's bound.

Laws with two derivatives (mindlin_rescale) have other forces while a contact closes than while it parts. With the mean
K of both, and N and B of :func:`~faultgouge.analysis.operators.linearised_contacts.rescaling_operators`,

.. math:: M \dot{\mathbf v} = \mathbf F - C \mathbf v, \qquad
    \dot{\mathbf F} = -K \mathbf v + B\, |N \mathbf v| .
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.sparse import csr_array, diags_array

from ...analysis import BadInputError, Configuration, damping_matrix, largest_frequency, stiffness_matrix
from ...analysis.arrays import Floats, Indices
from ...analysis.motion.eigenvalues import active_coordinates, mass_weighted
from ...analysis.operators.linearised_contacts import rescaling_operators
from .granular_commands import NotTakenError
from .look_in_a_copy import require_instance
from .motion_proof import steps_in_a_copy

STEP_ERROR = 1e-10
"""Error of a step of the linear motion, as a share of the largest velocity."""


@dataclass(frozen=True, eq=False)
class MotionComparison:
    """Velocities of LAMMPS and of the linearised packing after some time.

    Attributes
    ----------
    difference : float
        |v - u| / |u| of the velocities v of LAMMPS and u of the linearised packing.
    time, timestep, periods : float
        The time, a whole number of steps; the step; and how many periods of the fastest undamped vibration it has.
    velocity, linear_velocity : ndarray, shape (E,)
        v and u, times the root of the masses, of the coordinates that feel a force.
    """

    difference: float
    time: float
    timestep: float
    velocity: Floats
    linear_velocity: Floats
    periods: float

    def __str__(self) -> str:
        after = f"t = {self.time:.4g}, {self.periods:.3g} periods of the fastest vibration"
        return f"relative difference {self.difference:.2g} after {after}"


def compare_motion(
    lmp: Any,
    configuration: Configuration,
    time: float,
    amplitude: float,
    *,
    timestep: float | None = None,
    seed: int = 0,
) -> MotionComparison:
    """LAMMPS's undamped motion from small velocities against exp(t G).

    Drag (fix viscous) is left out, dashpots at the contacts are in both. The instance does not change.

    Parameters
    ----------
    lmp : lammps.lammps
        The instance, as it was when the configuration was taken; on one rank.
    configuration : Configuration
        As `from_lammps` took it.
    time : float
        How long, positive.
    amplitude : float
        Size of the random velocities, length / time, positive: so small that displacements stay far below all overlaps.
        With `granular` not much smaller than that, or histories that do not turn are seen.
    timestep : float, optional
        Time step of LAMMPS, positive; that of the instance by default.
    seed : int
        Of the velocities.

    Returns
    -------
    MotionComparison
        `difference` is the relative difference.

    Raises
    ------
    NotTakenError
        If the instance has several ranks or threads, or other particles, or none of these feels a force.
    BadInputError
        If a time, the step or the amplitude is not positive and finite.
    """
    require_instance(lmp, "compare_motion")
    step = float(lmp.extract_global("dt")) if timestep is None else float(timestep)
    for name, value in (("time", time), ("timestep", step), ("amplitude", amplitude)):
        if not 0 < value < np.inf:
            raise BadInputError(f"{name} = {value:g} is refused: nothing would be compared; give a number above 0.")
    steps = max(1, round(time / step))
    active = active_coordinates(mass_weighted(stiffness_matrix(configuration), configuration))
    if not len(active):
        raise NotTakenError("Nothing that moves has a contact: there is no motion to compare with.")
    root = np.sqrt(configuration.coordinate_mass)
    start = np.zeros(configuration.coordinates)
    start[active] = amplitude * np.random.Generator(np.random.PCG64(seed)).standard_normal(len(active))
    there, back = (steps_in_a_copy(lmp, configuration, sign * start, step, steps) for sign in (1, -1))
    velocity = (0.5 * (there - back) * root)[active]
    linear = _linear_velocity(configuration, active, (start * root)[active], step * steps)
    difference = float(np.linalg.norm(velocity - linear) / np.linalg.norm(linear))
    periods = step * steps * largest_frequency(configuration) / (2 * np.pi)
    return MotionComparison(difference, step * steps, step, velocity, linear, periods)


def _linear_velocity(c: Configuration, active: Indices, start: Floats, time: float) -> Floats:
    """Velocities after some time, half of the difference of both signs; these and `start` are multiplied by the root of
    the masses."""
    k, d = (mass_weighted(each, c)[active][:, active] for each in (stiffness_matrix(c), damping_matrix(c)))
    weight, (rates, forces) = diags_array(1.0 / np.sqrt(c.coordinate_mass[active])), rescaling_operators(c)
    n, b = csr_array(rates[:, active] @ weight), csr_array(weight @ forces[active])
    omega = float(np.sqrt(np.abs(k).sum(axis=1).max()))  # forces over it weigh as much as velocities

    def slope(_: float, state: Floats) -> Floats:
        """Each contact has its own derivative."""
        force, velocity = np.split(state, 2)
        return np.concatenate([(b @ np.abs(n @ velocity) - k @ velocity) / omega, omega * force - d @ velocity])

    ends, error = [], STEP_ERROR * np.abs(start).max()
    for begin in (start, -start):
        state = np.concatenate([0.0 * begin, begin])
        found = solve_ivp(slope, (0, time), state, method="DOP853", t_eval=[time], rtol=STEP_ERROR, atol=error)
        if not found.success:
            raise NotTakenError(f"The predicted motion was not found: {found.message} Compare over a shorter time.")
        ends.append(found.y[len(start) :, 0])
    return np.asarray(0.5 * (ends[0] - ends[1]))
