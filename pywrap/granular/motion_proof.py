r"""The proof of a Configuration: a few steps of LAMMPS beside the same steps of the linearised packing.

LAMMPS starts from small random velocities, in a copy of the process. The linearised packing starts from the same
velocities, with the residual forces, and takes LAMMPS's own steps of velocity Verlet; its contacts at Coulomb's bound
slide on ahead and stick on the way back (:mod:`~faultgouge.pywrap.granular.linear_steps`). So the comparison has no
error of the time step, and the step may be as long as a stable one. Dashpots feel the velocities of half steps in
LAMMPS's styles, and extrapolated velocities in mindlin/smooth (fix dashpot/velocities).

**The proof** is :math:`|\Delta v - \Delta u| / |\Delta u|`, weighted with the root of the masses, with the changes of
the velocities v of LAMMPS and u of the linearised packing. One motion is compared first. If its difference is not
small, the motions with both signs of the velocities are compared: half of their difference has no terms of second order
in the amplitude. With contacts at the bound the motions of both signs are not opposite. Then each is compared by
itself, after the motion from rest has been subtracted.

**K by differences of forces** has no contacts at the bound. If the model acts one step late, the difference is smaller
in shorter steps, which are taken if the first steps do not agree. If forces are one-sided, K is the mean of both sides,
and no linear motion is LAMMPS's: the difference is told, and the packing is not refused.

**Forces by position.** A force that depends on the position and belongs to no contact may be weak beside the contacts,
and strong beside the lowest eigenvalues of K. So all particles are also displaced alike. No contact between particles
then changes, and only particles at walls may feel other forces. (K by differences contains such forces.) A spring
between particles does not change, either, but bears a part of the weight, so that the motion without the spring is
another one. With such a spring the laws have to agree to `SMALL_DIFFERENCE`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...analysis import Configuration
from ...analysis.arrays import Floats
from ...analysis.counted import counted
from .acting_fixes import HOLDING, acting_fixes
from .granular_commands import GIVE_LINES, NotLinearisedError, NotTakenError
from .lammps_steps import steps_in_a_copy
from .linear_steps import LinearForces, linear_forces, linear_steps

LARGEST_DIFFERENCE = 1e-3
"""Difference from which on a packing is refused. Packings at rest have 1e-9 to 1e-5, by curvatures and roundings of
forces; what is out of balance by the share e of the mean contact force adds some e, for K is that of other overlaps. A
wrong stiffness of one contact in a hundred gives 1e-2 or more. An eigenvalue of K far below the largest may still be
wrong by this share of the largest."""

CREEP_SHARE = 0.99
"""Share of Coulomb's bound from which on a contact of a packing that creeps may slide: dashpots bear the rest."""

OTHER_STIFFNESS = 1e-6
"""Stiffness that is none of contacts, as a share of the mean normal stiffness of contacts, from which on a packing is
refused: far below the smallest eigenvalues, some 1e-4 of the largest, and far above rounding, 1e-11 and less."""

SLIDES_ON = "may slide while the packing creeps: run on with drag until it rests"
"""What is said of contacts that a load which the packing does not quite bear drives."""

CHANGES_IN_TIME = (
    "LAMMPS's forces change with the time, though nothing moves: a load or a wall follows a variable of the step or "
    "the time; give it a constant, and run on until the packing rests."
)

STEPS_OF_PROOF = 5
"""Steps of LAMMPS and of the linearised packing."""

SHORTER_STEPS = 10
"""By how much steps are shorter where a model may act one step late, as the volume of particles does in mdr: then the
difference falls as the step, and that of a K which is not LAMMPS's does not."""

STEP_PHASE = 1.5
"""Time step times a bound of the fastest rate, which is some three times this rate: five steps are half an oscillation
of the fastest motion. Below 2 steps are stable."""

COMMON_VELOCITY = 1.0
"""Velocity that all particles share, in units of their random ones. A fix that changes the total momentum changes this
velocity."""

COMMON_DISPLACEMENT = 1e-3
"""Common displacement in units of the mean radius."""

COORDINATE_ROUNDING = 1e-14
"""Rounding of a displacement, as a share of the largest coordinate: some units in the last place."""

SMALL_OVERLAP = 1e-2
"""Share of the median overlap: smaller overlaps do not decide how small the velocities are."""

SMALL_DIFFERENCE = 1e-5
"""Difference from which on no other amplitude is tried."""

CAUSE_SHARE = 0.1
"""Share of the difference that is left without a fix that is its cause."""

CHANGE_SHARE = 0.5
"""Share of the difference, or its inverse, up to which the difference without all fixes is the same, and none is the
cause. Where a packing creeps 0.87 of the difference is left without two constant forces. Without rhok, which also keeps
the balance, the difference is 3.7 times as large."""

AMPLITUDES = 1.0, 0.03, 30.0
"""Amplitudes that are tried, in units of the first."""

USUAL_OVERLAP = 1e-4
"""Overlap as a share of the mean radius where no contact is known."""


class NotProvedError(NotLinearisedError):
    """LAMMPS's motion shows a force on particles besides those of the contacts."""


class OtherStiffnessError(NotProvedError):
    """Forces depend on positions as no contact does, as of a spring or a trap: differences of forces have them."""


def prove(lmp: Any, configuration: Configuration, fixes: dict[str, str], *, extrapolates: bool) -> float | None:
    """Relative difference of LAMMPS's motion from that of the linearised packing; None if no contact moves.

    Parameters
    ----------
    lmp : lammps.lammps
        The instance, whose process can be copied.
    configuration : Configuration
        Its packing at rest.
    fixes : dict
        Styles of its fixes, by ID.
    extrapolates : bool
        Whether dashpots feel velocities of whole steps.

    Raises
    ------
    NotProvedError
        If LAMMPS's forces do not change as K says, with the likeliest cause: something acts beside contacts.
    NotTakenError
        If nothing is known to act beside contacts: the commands are others.
    """
    comparison = _Comparison.of(configuration, extrapolates=extrapolates)
    if comparison is None:
        return None
    others, moves = acting_fixes(fixes), partial(comparison.least_difference, lmp)
    difference, other_stiffness = moves()
    if other_stiffness > OTHER_STIFFNESS:
        if comparison.drifts(lmp):
            raise NotTakenError(CHANGES_IN_TIME)
        raise _other_stiffness(others, moves)
    if len(configuration.one_sided_particles):
        return difference  # no linear motion is LAMMPS's, and no verdict is given
    if difference > LARGEST_DIFFERENCE and configuration.operators == "differences":
        difference = min(difference, comparison.in_shorter_steps().least_difference(lmp)[0])
    tells = difference > SMALL_DIFFERENCE
    pulls = [says for name, says in others.items() if fixes[name].startswith(tuple(HOLDING))]
    if tells and pulls and configuration.operators == "laws":
        raise OtherStiffnessError(f"{_differs(difference)}; {' and '.join(pulls)}.")
    causes = [says for name, says in others.items() if tells and moves((name,))[0] < CAUSE_SHARE * difference]
    if difference <= LARGEST_DIFFERENCE and not causes:
        return difference
    if not causes and others and not CHANGE_SHARE < moves(tuple(others))[0] / difference < 1 / CHANGE_SHARE:
        causes = list(others.values())  # which of them is not known, but without them the motion is another one
    raise _not_proved(configuration, difference, causes)


Moves = Callable[..., tuple[float, float]]
"""Difference and other stiffness without some fixes."""


def _other_stiffness(others: dict[str, str], moves: Moves) -> OtherStiffnessError:
    """The error of forces that change where all particles are displaced alike, with the fixes that exert them."""
    causes = [says for name, says in others.items() if moves((name,))[1] < OTHER_STIFFNESS]
    if not causes and moves(tuple(others))[1] < OTHER_STIFFNESS:
        causes = list(others.values())
    return OtherStiffnessError(
        "LAMMPS's forces do not change as K says: where all particles are displaced alike, forces change that no "
        f"contact has; {' and '.join(causes or ['something acts on particles by their positions'])}."
    )


def _differs(difference: float) -> str:
    """A difference in words, without a full stop."""
    return (
        f"LAMMPS's forces do not change as K says: in {STEPS_OF_PROOF} steps from small velocities the change differs "
        f"by {difference:.2g} of itself"
    )


def _not_proved(configuration: Configuration, difference: float, causes: list[str]) -> NotTakenError:
    """The error of a motion that is another one, with its causes, or the likeliest ones."""
    says = _differs(difference)
    close = configuration.mobilised > CREEP_SHARE
    if causes:
        slide = counted(int(close.sum()), "contact")
        or_slide = f"; or {slide} at Coulomb's bound or just below {SLIDES_ON}" if close.any() else ""
        return NotProvedError(f"{says}; {' and '.join(causes)}{or_slide}.")
    if configuration.operators == "differences":
        error = configuration.operator_error
        if error > CAUSE_SHARE * difference:
            return NotTakenError(
                f"{says}; K by differences of forces misses {error:.1g} of the forces of a displacement of all "
                "particles, which are no functions of the displacements of neighbours, as may be with the model mdr."
            )
        return NotTakenError(f"{says}, though K and C are differences of these forces, which may depend on the time.")
    close = close & ~configuration.contacts.at_bound
    if close.any():
        return NotTakenError(
            f"{says}; {counted(int(close.sum()), 'contact')} just below Coulomb's bound {SLIDES_ON}; or the commands "
            f"are not those of the instance: {GIVE_LINES}."
        )
    return NotTakenError(
        f"{says}; the commands are those of another run or instance, or some are not in the log (echo none, a full "
        f"disk), or a restart has lost histories of contacts: {GIVE_LINES}, as they hold now."
    )


@dataclass(frozen=True)
class _Comparison:
    """LAMMPS's steps beside linear ones.

    Attributes
    ----------
    configuration : Configuration
        The linearised packing.
    forces : LinearForces
        Its forces to first order.
    extrapolates : bool
        Whether dashpots feel velocities of whole steps.
    start : ndarray, shape (coordinates,)
        Velocities that make the largest displacement of a contact about as large as its overlap.
    timestep : float
        Of both, stable for certain.
    steps : int
        Their number.
    """

    configuration: Configuration
    forces: LinearForces
    extrapolates: bool
    start: Floats
    timestep: float
    steps: int = STEPS_OF_PROOF

    @classmethod
    def of(cls, configuration: Configuration, *, extrapolates: bool) -> "_Comparison | None":
        """None if nothing that moves has a contact."""
        forces = linear_forces(configuration)
        rate = forces.fastest_rate()
        if not rate:
            return None
        timestep, start = STEP_PHASE / rate, _start(configuration)
        start = start / _deformation(configuration, STEPS_OF_PROOF * timestep * start)
        return cls(configuration, forces, extrapolates, start, timestep)

    def in_shorter_steps(self) -> "_Comparison":
        """The same motion in more steps."""
        return replace(self, timestep=self.timestep / SHORTER_STEPS, steps=SHORTER_STEPS * self.steps)

    @property
    def one_sided(self) -> bool:
        """Whether contacts are at Coulomb's bound."""
        return bool(self.configuration.contacts.one_sided.any())

    def least_difference(self, lmp: Any, without: tuple[str, ...] = ()) -> tuple[float, float]:
        """Relative difference of LAMMPS's steps from the linear ones, at the amplitude where it is least, and the
        stiffness that no contact has.

        A K that is not LAMMPS's disagrees at every amplitude: contacts open or begin to slide with large ones, and
        `granular` does not turn a history that has left its plane by less than 1e-10 of Coulomb's bound.

        Parameters
        ----------
        lmp : lammps.lammps
            The instance, whose process can be copied.
        without : tuple of str
            IDs of fixes that are left out.
        """
        overlap = float(np.median(_overlaps(self.configuration)))
        rounding = COORDINATE_ROUNDING * float(np.abs(self.configuration.position).max()) / overlap
        # roundings over the amplitude are as large as terms of second order, or of third order
        alone, both = rounding ** (1 / 2), rounding ** (1 / 2 if self.one_sided else 1 / 3)
        best, other = self.difference(lmp, alone, (1.0,), without)
        for factor in AMPLITUDES:
            if best < SMALL_DIFFERENCE or other > OTHER_STIFFNESS:
                break
            signs = (1.0, -1.0, 0.0) if self.one_sided else (1.0, -1.0)
            best = min(best, self.difference(lmp, factor * both, signs, without)[0])
        return best, other

    def difference(
        self, lmp: Any, amplitude: float, signs: tuple[float, ...], without: tuple[str, ...]
    ) -> tuple[float, float]:
        """Relative difference of the changes of velocities, and the stiffness that no contact has.

        Parameters
        ----------
        lmp, without
            As above.
        amplitude : float
            Of the velocities, in units of `start`.
        signs : tuple of float
            (1,) compares one motion; (1, -1) half of the difference of two, without terms of second order and without
            what is out of balance; (1, -1, 0) each of two without what is out of balance.
        """
        c, sizes = self.configuration, amplitude * np.array(signs)
        displaces = c.operators == "laws"
        ends = [
            steps_in_a_copy(
                lmp,
                c,
                size * self.start,
                self.timestep,
                self.steps,
                displacement=self._common_displacement if displaces and k == 0 else None,
                without=without,
            )
            for k, size in enumerate(sizes)
        ]
        linear = np.column_stack([self._linear_steps(size * self.start) for size in sizes])
        mix = {1: [[1.0]], 2: [[0.5], [-0.5]], 3: [[1.0, 0.0], [0.0, -1.0], [-1.0, 1.0]]}[len(signs)]
        moves = c.coordinate_free | ~np.tile(c.free, c.axes)  # particles that do not move are compared, too
        weight = np.sqrt(c.coordinate_mass) * (moves & ~np.tile(self._rattle & c.free, c.axes))
        seen, expected = (
            weight[:, None] * (each @ mix - amplitude * self.start[:, None])
            for each in (np.column_stack([end.velocity for end in ends]), linear)
        )
        difference = float((np.linalg.norm(seen - expected, axis=0) / np.linalg.norm(expected, axis=0)).max())
        change = ends[0].force_change
        return difference, 0.0 if change is None else self._other_stiffness(change)

    def drifts(self, lmp: Any) -> bool:
        """Whether forces change as much in a step in which no particle is displaced."""
        rest = 0.0 * self.start
        still = steps_in_a_copy(lmp, self.configuration, rest, self.timestep, self.steps, displacement=np.zeros(3))
        return still.force_change is not None and self._other_stiffness(still.force_change) > OTHER_STIFFNESS

    @property
    def _common_displacement(self) -> Floats:
        """Of all particles, shape (3,)."""
        direction = np.where(np.arange(3) < self.configuration.dimension, [0.48, 0.6, 0.64], 0.0)
        return np.asarray(COMMON_DISPLACEMENT * float(self.configuration.radius.mean()) * direction)

    def _linear_steps(self, velocity: Floats) -> Floats:
        """Velocities of all coordinates after the linear steps."""
        c = self.configuration
        return linear_steps(c, self.forces, velocity, self.timestep, self.steps, extrapolates=self.extrapolates)

    @property
    def _rattle(self) -> NDArray[np.bool_]:
        return np.isin(np.arange(len(self.configuration)), self.configuration.rattlers)

    def _other_stiffness(self, change: Floats) -> float:
        """Largest change of a force on particles that touch no wall, over the common displacement and the mean normal
        stiffness."""
        c = self.configuration
        inside = c.free & ~self._rattle
        inside[c.contacts.i[c.contacts.wall]] = False
        largest = np.abs(change[np.tile(inside, c.axes)]).max(initial=0.0)
        return float(largest / np.linalg.norm(self._common_displacement) / np.mean(c.contacts.normal_stiffness))


def _start(configuration: Configuration) -> Floats:
    """Random velocities of size one of all that moves and touches something, and a common one."""
    random = np.random.Generator(np.random.PCG64(0))
    touches = np.ones(len(configuration), bool)
    touches[configuration.rattlers] = False
    translation, rotation = configuration.vectors(random.standard_normal(configuration.coordinates))
    common = random.standard_normal(3)
    translation += COMMON_VELOCITY * np.sqrt(3) * common / np.linalg.norm(common)
    start = configuration.join_vectors(translation, rotation)
    return start * (configuration.coordinate_free & np.tile(touches, configuration.axes))


def _deformation(configuration: Configuration, displacement: Floats) -> float:
    """Largest displacement of a contact over its overlap."""
    c, (u, _) = configuration.contacts, configuration.vectors(displacement)
    overlap = _overlaps(configuration)
    between = u[c.i] - np.where(c.wall[:, None], 0.0, u[c.j]) if len(c) else u
    return float((np.linalg.norm(between, axis=1) / np.maximum(overlap, SMALL_OVERLAP * np.median(overlap))).max())


def _overlaps(configuration: Configuration) -> Floats:
    """Sizes of overlaps, or of the gaps of cohesive contacts; a small one where no contact is known."""
    overlap = np.abs(configuration.contacts.overlap)
    return overlap if len(overlap) else np.array([USUAL_OVERLAP * configuration.radius.mean()])
