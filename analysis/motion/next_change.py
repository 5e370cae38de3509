r"""How far a load may rise until a sticking contact reaches Coulomb's bound, or a contact opens or closes.

While the load rises by :math:`x`, the particles move by :math:`x u`, with the drift u. To first order the tangential
force of contact c becomes :math:`\mathbf f_t + x\, \mathbf g_c` in the plane of the contact, Coulomb's bound
:math:`\mu f_n + x\, h_c`, and the overlap :math:`\delta + x\, \dot\delta_c`. The contact reaches the bound where

.. math:: |\mathbf f_t + x\, \mathbf g_c| = \mu f_n + x\, h_c ,

and opens where the overlap is zero. Particles that are nearer than the largest overlap, and do not touch yet, close
where their gap is zero. Contacts of particles farther apart are not foreseen.
"""

import numpy as np

from ..arrays import Floats
from ..configuration import Configuration
from ..operators.gaps import gaps_of
from .one_sided import OneSidedSystem

REACHES, OPENS, CLOSES = "reaches Coulomb's bound", "opens", "closes"


def next_change(system: OneSidedSystem, velocity: Floats, paths: Floats) -> tuple[float | None, str | None]:
    """At which increase of the load a contact changes first, and whether it reaches the bound, opens or closes.

    None twice if no contact is known that changes.

    Parameters
    ----------
    system : OneSidedSystem
        Of the configuration.
    velocity : ndarray, shape (E, 1)
        Mean mass-weighted velocity at the rate 1.
    paths : ndarray, shape (R, 1)
        Mean rates of the paths of the overlaps of contacts with two derivatives.
    """
    configuration = system.motion.configuration
    if configuration.stiffness is not None or not len(configuration.contacts):
        return None, None
    slides, opens = _increases(configuration, system.of_particles(velocity), system.of_contacts(paths))
    gaps = gaps_of(configuration)
    rates = gaps.rates(configuration) @ system.of_particles(velocity)
    closes = np.where(rates > 0, gaps.gap / np.where(rates > 0, rates, 1.0), np.inf).min(initial=np.inf)
    first, event = min((float(slides.min()), REACHES), (float(opens.min()), OPENS), (float(closes), CLOSES))
    return (first, event) if first < np.inf else (None, None)


def _increases(configuration: Configuration, velocity: Floats, paths: Floats) -> tuple[Floats, Floats]:
    """Increases of the load until each contact reaches the bound, and until each opens; infinite if none does."""
    c = configuration.contacts
    moves, turns = configuration.vectors(velocity)
    turns = turns / configuration.radius[:, None]
    other = ~c.wall[:, None]
    parting = moves[c.i] - other * moves[c.j]
    rolling = c.slip_arm[:, :1] * turns[c.i] + other * c.slip_arm[:, 1:] * turns[c.j]
    closing = -np.einsum("ca,ca->c", c.normal, parting)
    slip = parting + closing[:, None] * c.normal + np.cross(c.normal, rolling)
    gain = -c.tangential_stiffness[:, None] * slip + c.overlap_derivative() * closing[:, None]
    gain += 0.5 * (c.overlap_derivative(0.0) - c.overlap_derivative(1.0)) * paths[:, None]
    sticks = np.isfinite(c.friction) & (c.friction > 0) & ~c.at_bound
    bound = np.where(sticks, c.friction, 1.0)
    bound_gain = bound / c.normal_force * c.normal_stiffness * closing
    # a x^2 + 2 b x + slack = 0 with a negative slack
    a = np.einsum("ca,ca->c", gain, gain) - bound_gain**2
    b = np.einsum("ca,ca->c", c.tangential_force, gain) - bound * bound_gain
    slack = np.einsum("ca,ca->c", c.tangential_force, c.tangential_force) - bound**2
    root = b + np.sqrt(np.maximum(b * b - a * slack, 0.0))
    reaches = sticks & (b * b >= a * slack) & (root > 0)
    slides = np.where(reaches, -slack / np.where(reaches, root, 1.0), np.inf)
    parts = (closing < 0) & (c.overlap > 0)
    return slides, np.where(parts, c.overlap / np.where(parts, -closing, 1.0), np.inf)
