r"""How far vibration carries particles whose contacts have one derivative while they close and another while they part.

With mindlin_rescale and the standard law of this package the tangential force of a contact falls as it parts, and does
not rise as it closes. Vibration thus wears tangential forces down: in the equation of
:mod:`~faultgouge.analysis.motion.one_sided` each contact adds :math:`B_c \int |\dot\delta_c| \mathrm dt` to the forces,
and the packing moves on to another equilibrium. Eigenvalues of K, which has the mean of both derivatives, do not know
this. With dissipation the vibration dies, and the particles stay displaced. Without dissipation the vibration goes on,
and particles move at a constant mean velocity, so that D grows as the square of the time, in proportion to the square
of the push. (A small vibration wears down what a contact bears in LAMMPS, too: docs/contacts_at_bound.md.)
"""

from dataclasses import dataclass, replace

import numpy as np

from ..progress import report_progress
from .one_sided import CLOSE_STEP, OneSidedSystem
from .one_sided_outcome import STEPS_OF_CHUNK, random_pushes

CHUNKS = 4
"""Spans of `STEPS_OF_CHUNK` stable steps that the motion is followed: forty periods of a slow mode."""

GROWS = 6.0
"""Decades of D beyond the first look that are no creep: as the square of the time it gains 3.2, and the first look may
come before the contacts have moved back and forth."""

LOOKS = 40
"""Looks at D."""


@dataclass(frozen=True)
class Creep:
    """How far vibration carries particles: what it adds to the motion that K, of the mean of both derivatives, has.

    Attributes
    ----------
    amplification : float
        Largest D of this displacement over the mean square velocity of the push along an axis, time^2.
    time : float
        How long motion was followed.
    velocity : float
        Root mean square over the particles of its mean velocity in the second half of this time, over the root mean
        square velocity of the push along an axis.
    grows : bool
        Whether D grew faster than as the square of the time.
    """

    amplification: float
    time: float
    velocity: float
    grows: bool


def follow_creep(system: OneSidedSystem, pushes: int, time: float | None = None) -> Creep:
    """Follow the motion after random pushes and their opposites, with both derivatives and with their mean.

    Parameters
    ----------
    system : OneSidedSystem
        Of a configuration without contacts at Coulomb's bound.
    pushes : int
        How many.
    time : float, optional
        How long; `CHUNKS` by default.
    """
    stable = system.time_step / system.step_share
    whole = CHUNKS * STEPS_OF_CHUNK * stable if time is None else time
    count = int(np.ceil(whole / LOOKS / (CLOSE_STEP * stable)))
    both = system.start(random_pushes(system.motion.configuration, pushes))
    mean = replace(both, z=both.z.copy(), v=both.v.copy(), r=np.zeros((0, 2 * pushes)))
    added = [np.zeros_like(both.z)]
    for _ in range(LOOKS):
        for state in (both, mean):
            system.take_steps(state, whole / LOOKS / count, count)
        added.append(both.z - mean.z)
    report_progress(f"creep: followed for t = {whole:.4g}")
    sizes = np.array([system.mean_square_displacement(each).max() for each in added])
    velocity = np.sqrt(system.mean_square_displacement(added[-1] - added[LOOKS // 2]).max()) / (whole / 2)
    grows = not sizes[-1] < 10.0**GROWS * sizes[1]
    return Creep(float(sizes.max()), whole, float(velocity), grows)
