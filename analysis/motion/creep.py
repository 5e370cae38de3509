r"""How far vibration carries particles whose contacts have one derivative while they close and another while they part.

With mindlin_rescale and the standard law of this package the tangential force of a contact falls as it parts, and does
not rise as it closes. Vibration thus wears tangential forces down: in the equation of
:mod:`~faultgouge.analysis.motion.one_sided` each contact adds :math:`B_c \int |\dot\delta_c| \mathrm dt` to the forces,
and the packing moves on to another equilibrium. The eigenvalues of K, which has the mean of both derivatives, do not
show this creep.

**With dissipation** the vibration dies, and the particles stay displaced. The velocity of creep is proportional to the
vibration, and no vibration decays more slowly than as :math:`e^{\mathrm{Re}\, s\, t}` with the slowest s. So a velocity
v displaces particles by at most :math:`v / |\mathrm{Re}\, s|` more. The motion is followed until this displacement is
small, or, with weak dashpots, for a limited time: the displacement that is then still to come is stated.

**Without dissipation** the vibration goes on, and particles move at a constant mean velocity. D grows as the square of
the time, in proportion to the square of the push.

LAMMPS shows this creep, too (docs/contacts_at_bound.md).
"""

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Floats
from ..progress import report_progress
from .one_sided import LOOK_STEP, OneSidedSystem
from .one_sided_outcome import STEPS_OF_CHUNK, random_pushes

CHUNKS_OF_SPAN = 4
"""Chunks of `STEPS_OF_CHUNK` stable steps of a span: forty periods of a slow mode."""

MOST_SPANS = 8
"""Spans that are followed at the most."""

LOOKS_OF_SPAN = 40
"""Looks at D in a span."""

REMAINING_SHARE = 0.1
"""Displacement still to come, as a share of the displacement so far, below which motion is not followed any longer."""

LARGEST_CREEP_GROWTH = 100.0
"""Growth of D in the second half of the time that is no creep: as the square of the time it is 4."""


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
        Root mean square over the particles of its mean velocity in the last span, or the second half of the first, over
        the root mean square velocity of the push along an axis.
    limit : float or None
        `amplification` that vibration may reach later, while the slowest motion decays; None if that is not known, as
        without dissipation.
    grows : bool
        Whether D grew faster than as the square of the time.
    """

    amplification: float
    time: float
    velocity: float
    limit: float | None
    grows: bool

    @property
    def settled(self) -> bool:
        """Whether little is left to come."""
        return self.limit is not None and self.limit <= (1 + REMAINING_SHARE) ** 2 * self.amplification


def follow_creep(system: OneSidedSystem, pushes: int, time: float | None = None, decay: float = 0.0) -> Creep:
    """Follow the motion after random pushes and their opposites, with both derivatives and with their mean.

    Parameters
    ----------
    system : OneSidedSystem
        Of a configuration without contacts at Coulomb's bound.
    pushes : int
        How many.
    time : float, optional
        How long; until little is left to come by default, at the most for `MOST_SPANS` spans.
    decay : float
        -Re s of the slowest motion, 1 / time; 0 if that is not known, or nothing decays.
    """
    stable = system.time_step / system.step_share
    span = CHUNKS_OF_SPAN * STEPS_OF_CHUNK * stable if time is None else time
    both = system.start(random_pushes(system.motion.configuration, pushes))
    mean = replace(both, z=both.z.copy(), v=both.v.copy(), r=np.zeros((0, 2 * pushes)))
    added = [np.zeros_like(both.z)]
    for number in range(1, 1 + (MOST_SPANS if time is None and decay else 1)):
        count = int(np.ceil(span / LOOKS_OF_SPAN / (LOOK_STEP * stable)))
        for _ in range(LOOKS_OF_SPAN):
            for state in (both, mean):
                system.take_steps(state, span / LOOKS_OF_SPAN / count, count)
            added.append(both.z - mean.z)
        report_progress(f"creep: followed for t = {number * span:.4g}")
        found = _found(system, added, number * span, decay)
        if found.settled or found.grows:
            break
    return found


def _found(system: OneSidedSystem, added: list[Floats], time: float, decay: float) -> Creep:
    """Creep, of the displacements that vibration has added at equal times."""
    sizes = np.array([system.mean_square_displacement(each).max() for each in added])
    last, half = len(added) - 1, len(added) // 2
    before = max(last - LOOKS_OF_SPAN, half)
    moved = np.sqrt(system.mean_square_displacement(added[last] - added[before]).max())
    velocity = float(moved) / (time * (last - before) / last)
    limit = float(np.sqrt(sizes[-1]) + velocity / decay) ** 2 if decay > 0 else None
    return Creep(float(sizes.max()), time, velocity, limit, bool(not sizes[-1] < LARGEST_CREEP_GROWTH * sizes[half]))
