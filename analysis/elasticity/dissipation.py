r"""Where the energy of a motion goes: dashpots and sliders of each contact, and modes.

A motion is given by displacements and velocities at some times. To first order contact c then has the rates of overlap
and slip :math:`\dot\delta_c` and :math:`\dot{\mathbf s}_c`, and takes

.. math:: c_n \dot\delta_c^2 + c_t |\dot{\mathbf s}_c|^2 \quad\text{(dashpots)}, \qquad
    |\mathbf f_t| \cdot |\dot{\mathbf s}^{\mathrm p}_c| \quad\text{(slider)}

per unit of time. The slip :math:`\mathbf s^{\mathrm p}` of a slider follows from the forces step by step: a trial force
:math:`\mathbf f_t - k_t' \Delta \mathbf s + \mathbf b\, \Delta\delta` beyond :math:`\mu (f_n + f_n' \Delta\delta)` goes
back to the bound, and what it exceeds the bound by, over :math:`k_t'`, is slip. A sliding contact has no tangential
dashpot. Drag takes :math:`\dot q^T M \dot q / \tau`.

**Modes.** With :math:`\dot q = \sum_k x_k a_k` in the modes of K, :math:`P = \sum_k a_k x_k^T C \dot q`, and the k-th
term is what mode k loses.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eig
from scipy.sparse import csr_array, diags_array

from ..arrays import Floats, derive_frozen, ratio
from ..errors import BadInputError
from ..has_configuration import HasConfiguration
from ..operators.damping import damping_matrix
from ..operators.stiffness import stiffness_matrix


@dataclass(frozen=True, eq=False)
class LostEnergy:
    """What a motion loses, energy; between the given times, by the trapezoidal rule.

    Attributes
    ----------
    time : ndarray, shape (T,)
        Times of the motion.
    normal_dashpot, tangential_dashpot, slider : ndarray, shape (C,)
        What each contact has taken by the last time.
    drag : float
        What the drag has taken.
    total : ndarray, shape (T,)
        What all have taken together by each time.
    """

    time: Floats
    normal_dashpot: Floats
    tangential_dashpot: Floats
    slider: Floats
    drag: float
    total: Floats


def lost_energy(packing: HasConfiguration, time: Floats, displacement: Floats, velocity: Floats) -> LostEnergy:
    """Where the energy of a motion goes, contact by contact.

    Parameters
    ----------
    packing : Packing or Configuration
        At rest.
    time : array_like, shape (T,)
        Ascending; so dense that forces change little between two times.
    displacement, velocity : array_like, shape (T, coordinates)
        From rest, length, and length / time; rotations as R theta.

    Raises
    ------
    BadInputError
        If the shapes do not fit, or contacts have no laws.
    """
    configuration = packing.configuration
    c, t = configuration.contacts, np.asarray(time, float)
    moved, speed = np.asarray(displacement, float), np.asarray(velocity, float)
    if moved.shape != (len(t), configuration.coordinates) or speed.shape != moved.shape or np.any(np.diff(t) <= 0):
        shapes = f"shape (T, {configuration.coordinates}), not {t.shape}, {moved.shape} and {speed.shape}"
        raise BadInputError(f"A motion has T times that ascend, and displacements and velocities of {shapes}.")
    if configuration.stiffness is not None:
        raise BadInputError("The law of each contact is needed, and this packing has K by differences of forces.")
    whole = derive_frozen(configuration, free=np.ones(len(configuration), np.bool_))
    u, w = whole.pair_rows(), whole.pair_rows(arms=c.slip_arm)

    def rates(q: Floats) -> tuple[Floats, Floats]:
        """Changes of the overlaps, shape (C,), and slips, (C, 3), of displacements or velocities."""
        shift, roll = (u @ q).reshape(-1, 3), np.cross(c.normal, (w @ q).reshape(-1, 3))
        along = np.einsum("ca,ca->c", c.normal, shift)
        return -along, ~c.couple[:, None] * (shift - along[:, None] * c.normal) + roll

    stiff, limit, force, b = c.tangential_stiffness, c.normal_force, c.tangential_force, c.overlap_derivative()
    share = np.where(c.normal_force > 0, ratio(c.friction, c.normal_force), np.inf)
    taken, power, totals = np.zeros((3, len(c))), np.zeros((2, len(c))), np.zeros(len(t))
    before, earlier = (np.zeros(len(c)), np.zeros((len(c), 3))), power
    for k in range(len(t)):
        (overlap, slip), (growth, sliding) = rates(moved[k]), rates(speed[k])
        force = force - stiff[:, None] * (slip - before[1]) + b * (overlap - before[0])[:, None]
        limit = limit + c.normal_stiffness * (overlap - before[0])
        size, bound = np.linalg.norm(force, axis=1), share * np.maximum(limit, 0.0)
        excess = np.where(size > bound, size - bound, 0.0)
        slid = ratio(excess, stiff)
        force *= np.where(size > 0, ratio(size - excess, size), 1.0)[:, None]
        sticks = np.einsum("ca,ca->c", sliding, sliding) * (slid == 0)
        power = np.array([~c.couple * c.normal_dashpot * growth**2, c.tangential_dashpot * sticks])
        if k:
            taken[:2] += 0.5 * (t[k] - t[k - 1]) * (power + earlier)
            taken[2] += (size - excess) * slid
            totals[k] = taken.sum()
        before, earlier = (overlap, slip), power
    drag = configuration.drag_rate * np.einsum("ti,i,ti->t", speed, configuration.coordinate_mass, speed)
    by_drag = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(t) * (drag[1:] + drag[:-1]))])
    return LostEnergy(t, taken[0], taken[1], taken[2], float(by_drag[-1]), totals + by_drag)


def lost_by_modes(packing: HasConfiguration, velocity: Floats) -> tuple[Floats, Floats]:
    """What each mode of K loses to dashpots and drag at some velocities.

    Parameters
    ----------
    velocity : array_like, shape (coordinates,)
        Length / time.

    Returns
    -------
    frequency, power : ndarray, shape (n,)
        sqrt(|lambda|), radian / time, ascending, and energy / time; the powers add up to q'^T C q'.
    """
    configuration = packing.configuration
    k, c = stiffness_matrix(packing), damping_matrix(packing)
    root = np.sqrt(configuration.coordinate_mass)
    weighted = csr_array(diags_array(1 / root) @ k @ diags_array(1 / root)).toarray()
    values, modes = eig(weighted)
    moved = np.asarray(velocity, float)
    share = np.linalg.solve(modes, root * moved)
    lost = np.real(share * (modes.T @ ((c @ moved) / root)))
    order = np.argsort(values.real)
    return np.sqrt(np.abs(values[order])), lost[order]
