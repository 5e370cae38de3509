r"""The proof of a Configuration: a few steps of LAMMPS beside the same steps of the linearised packing.

LAMMPS starts from small random velocities, in a copy of the process, without drag and without what writes. The
linearised packing starts from the same velocities, with the residual forces, and takes LAMMPS's own steps of velocity
Verlet (:func:`linear_motion`). So the comparison has no error of the time step, and the step may be as long as a stable
one. Dashpots feel the velocities of half steps in LAMMPS's styles, and extrapolated velocities in mindlin/smooth.

**The proof** is :math:`|\Delta v - \Delta u| / |\Delta u|`, weighted with the root of the masses, with the changes of
the velocities v of LAMMPS and u of the linearised packing. One motion is compared first. If its difference is not
small, the motions with both signs of the velocities are compared: half of their difference has no terms of second order
in the amplitude. With contacts at the bound the motions of both signs are not opposite. Then each is compared by
itself, after the motion from rest has been subtracted.

**Shorter steps** are taken if the first steps do not agree: where a model acts one step late (mdr), or takes the slip
by other velocities (synchronized_verlet), the difference falls as the step.

**K by differences of forces** has no contacts at the bound. If forces are one-sided, K is the mean of both sides,
and no linear motion is LAMMPS's: the difference is told, and the packing is not refused.

**Forces by position.** A force that depends on the position and belongs to no contact may be weak beside the contacts,
and strong beside the lowest eigenvalues of K. So all particles are also displaced alike. No contact between particles
then changes, and only particles at walls may feel other forces. (K by differences contains such forces.)

**Causes.** The laws of contacts hold with any constant forces besides. So a fix is the cause of a difference if LAMMPS
moves as K says once the forces which the fix exerts at rest are given to the particles as constants in its place.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...analysis import Configuration
from ...analysis.arrays import Floats
from ...analysis.counted import counted
from ...analysis.operators.linearised_contacts import rescaling_operators
from ...analysis.operators.sliders import sliders_of
from .acting_fixes import acting_fixes
from .balance import force_scale
from .granular_commands import GIVE_LINES, NotLinearisedError, NotTakenError
from .instance_queries import styles_of
from .lammps_arrays import (
    STILL_STEP,
    forces_in_order,
    has_bodies,
    on_coordinates,
    owned_array,
    rows_of,
    set_up_run,
    set_velocity,
)
from .look_in_a_copy import in_a_copy, quieten

LARGEST_DIFFERENCE = 1e-3
"""Difference from which on a packing is refused. Packings at rest have 1e-9 to 1e-5, by curvatures and roundings of
forces; what is out of balance by the share e of the mean contact force adds some e, for K is that of other overlaps. A
wrong stiffness of one contact in a hundred gives 1e-2 or more. An eigenvalue of K far below the largest may still be
wrong by this share of the largest."""

SMALL_DIFFERENCE = 1e-5
"""Difference from which on no other amplitude is tried."""

OTHER_STIFFNESS = 1e-6
"""Stiffness that is none of contacts, as a share of the mean normal stiffness of contacts, from which on a packing is
refused: far below the smallest eigenvalues, some 1e-4 of the largest, and far above rounding, 1e-11 and less."""

CREEP_SHARE = 0.99
"""Share of Coulomb's bound from which on a contact of a packing that creeps may slide: dashpots bear the rest."""

STEPS_OF_PROOF = 5
"""Steps of LAMMPS and of the linearised packing."""

SHORTER_STEPS = 10
"""By how much steps are shorter: a difference by the way in which a model takes its steps falls, and that of a K which
is not LAMMPS's does not."""

STEP_PHASE = 1.5
"""Time step times a bound of the fastest rate, which is some three times this rate: five steps are half an oscillation
of the fastest motion. Below 2 steps are stable."""

COMMON_DISPLACEMENT = 1e-3
"""Common displacement in units of the mean radius."""

SMALL_OVERLAP = 1e-2
"""Share of the median overlap: smaller overlaps do not decide how small the velocities are."""

USUAL_OVERLAP = 1e-4
"""Overlap as a share of the mean radius where no contact is known."""

CAUSE_SHARE = 0.1
"""Share of the difference that is left where constant forces stand in the place of a fix that is its cause."""

PUSH_SHARE, STEPS_AFTER_PUSH = 1e-3, 20_000
"""A push as a share of velocities that take a contact through its overlap, and the steps for which it is followed."""

COMMON_MULTIPLE = 2**12 * 5**9 * 3**4 * 7 * 11 * 13
"""A time step that is a multiple of the intervals that people write: some fixes act every so many steps alone."""


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
        If something acts beside contacts, or may do so.
    NotTakenError
        If LAMMPS's forces do not change as K says, and nothing is known to act beside contacts.
    """
    comparison = _Comparison(lmp, configuration, extrapolates)
    if not comparison.timestep:
        return None
    others, moves = acting_fixes(fixes), comparison.least_difference
    difference, other_stiffness = moves()
    if other_stiffness > OTHER_STIFFNESS:
        if comparison.other_stiffness(np.zeros(3)) > OTHER_STIFFNESS:
            raise NotTakenError(
                "LAMMPS's forces change with the time, though nothing moves: a load or a wall follows a variable of "
                "the step or the time; give it a constant, and run on until the packing rests."
            )
        causes = _causes(others, lambda names: moves(names)[1] < OTHER_STIFFNESS)
        raise OtherStiffnessError(
            "LAMMPS's forces do not change as K says: where all particles are displaced alike, forces change that no "
            f"contact has; {' and '.join(causes or ['something acts on particles by their positions'])}."
        )
    if len(configuration.one_sided_particles):
        return difference  # no linear motion is LAMMPS's, and no verdict is given
    if difference > LARGEST_DIFFERENCE:
        shorter = _Comparison(lmp, configuration, extrapolates, SHORTER_STEPS)
        difference = min(difference, shorter.least_difference()[0])
    if difference <= SMALL_DIFFERENCE:
        return difference
    causes = _causes(others, lambda names: moves(names)[0] < CAUSE_SHARE * difference)
    if difference <= LARGEST_DIFFERENCE and not causes:
        return difference
    raise _not_proved(configuration, difference, causes)


def push_remark(lmp: Any, configuration: Configuration) -> str:
    """What LAMMPS's own particles do after a push without drag, for a packing whose forces are one-sided."""
    c, timestep = configuration, float(lmp.extract_global("dt"))
    push = PUSH_SHARE * _Comparison(lmp, c, extrapolates=False).start
    end = steps_in_a_copy(lmp, c, push, timestep, STEPS_AFTER_PUSH)
    left = float(np.sum(c.coordinate_mass * end**2) / np.sum(c.coordinate_mass * push**2))
    return (
        f"LAMMPS itself, pushed by {np.abs(push).max():.2g} (length / time) at most, without drag, has {left:.2g} of "
        f"the kinetic energy of the push after t = {STEPS_AFTER_PUSH * timestep:.4g} ({STEPS_AFTER_PUSH} steps)"
    )


def _causes(others: dict[str, str], serves: Callable[[tuple[str, ...]], bool]) -> list[str]:
    """What is said of the fixes that are the cause: each, or all together, with constants in their place."""
    causes = [says for name, says in others.items() if serves((name,))]
    return causes or (list(others.values()) if len(others) > 1 and serves(tuple(others)) else [])


def _differs(difference: float) -> str:
    """A difference in words, without a full stop."""
    return (
        f"LAMMPS's forces do not change as K says: in {STEPS_OF_PROOF} steps from small velocities the change differs "
        f"by {difference:.2g} of itself"
    )


def _not_proved(configuration: Configuration, difference: float, causes: list[str]) -> NotTakenError:
    """The error of a motion that is another one, with its causes, or the likeliest ones."""
    says, close = _differs(difference), configuration.mobilised > CREEP_SHARE
    slide = f"{counted(int(close.sum()), 'contact')} at Coulomb's bound or just below may slide while the packing "
    slide += "creeps: run on with drag until it rests"
    if causes:
        return NotProvedError(f"{says}; {' and '.join(causes)}{f'; or {slide}' if close.any() else ''}.")
    error = configuration.operator_error
    if configuration.operators == "laws":
        likely = f"{slide}; or " if np.any(close & ~configuration.contacts.at_bound) else ""
        likely += (
            "the commands are those of another run or instance, or some are not in the log (echo none, a full disk), "
            f"or a restart has lost histories of contacts: {GIVE_LINES}, as they hold now"
        )
    elif error > CAUSE_SHARE * difference:
        likely = (
            f"K by differences of forces misses {error:.1g} of the forces of a displacement of all particles, which "
            "are no functions of the displacements of neighbours, as may be with the model mdr"
        )
    else:
        likely = "though K and C are differences of these forces: they may depend on the time"
    return NotTakenError(f"{says}; {likely}.")


@dataclass(frozen=True)
class _Comparison:
    """LAMMPS's steps beside linear ones; with `shorter`, so many times more and shorter steps."""

    lmp: Any
    configuration: Configuration
    extrapolates: bool
    shorter: int = 1

    @cached_property
    def linear(self) -> "LinearMotion":
        """The linear steps."""
        return linear_motion(self.configuration, extrapolates=self.extrapolates)

    @cached_property
    def timestep(self) -> float:
        """Of both, stable for certain, by sums of rows in absolute values; zero if nothing that moves has a contact."""
        c = self.configuration
        scale = 1 / np.sqrt(c.coordinate_mass)
        k, d = (float((scale * (abs(each) @ scale)).max(initial=0.0)) for each in c.assembled_operators())
        rate = 0.5 * (d + np.sqrt(d * d + 4 * k))  # the root of s^2 = d s + k
        return STEP_PHASE / rate / self.shorter if rate else 0.0

    @cached_property
    def start(self) -> Floats:
        """Random velocities of all that moves and touches something, and a common one, which fixes of the momentum
        change; the largest displacement of a contact is about as large as its overlap."""
        c, random = self.configuration, np.random.Generator(np.random.PCG64(0))
        translation, rotation = c.vectors(random.standard_normal(c.coordinates))
        common = random.standard_normal(3)
        translation += np.sqrt(3) * common / np.linalg.norm(common)
        start = c.join_vectors(translation, rotation) * (c.coordinate_free & ~self._rattle)
        moves, _ = c.vectors(STEPS_OF_PROOF * self.shorter * self.timestep * start)
        overlap, i, j = self._overlap, c.contacts.i, c.contacts.j
        between = moves[i] - np.where(c.contacts.wall[:, None], 0.0, moves[j]) if len(i) else moves
        size = np.linalg.norm(between, axis=1) / np.maximum(overlap, SMALL_OVERLAP * np.median(overlap))
        return np.asarray(start / size.max())

    @cached_property
    def resets(self) -> bool:
        """Whether the steps have other numbers: some fixes act every so many steps alone, and some loads depend on
        the number of the step."""
        work = partial(_constant_in_time, self.lmp, self.configuration)
        return bool(acting_fixes(styles_of(self.lmp).fixes)) and in_a_copy(work)

    @property
    def _overlap(self) -> Floats:
        """Sizes of overlaps, or of the gaps of cohesive contacts; a small one where no contact is known."""
        overlap = np.abs(self.configuration.contacts.overlap)
        return overlap if len(overlap) else np.array([USUAL_OVERLAP * self.configuration.radius.mean()])

    @property
    def _rattle(self) -> NDArray[np.bool_]:
        c = self.configuration
        return np.tile(np.isin(np.arange(len(c)), c.rattlers), c.axes)

    def least_difference(self, without: tuple[str, ...] = ()) -> tuple[float, float]:
        """Relative difference of LAMMPS's steps from the linear ones, at the amplitude where it is least, and the
        stiffness that no contact has; constant forces stand in the place of some fixes.

        A K that is not LAMMPS's disagrees at every amplitude: contacts open or begin to slide with large ones, and
        `granular` does not turn a history that has left its plane by less than 1e-10 of Coulomb's bound.
        """
        c, one_sided = self.configuration, bool(self.configuration.contacts.one_sided.any())
        # the rounding of a displacement is some units in the last place of the largest coordinate
        rounding = 1e-14 * float(np.abs(c.position).max() / np.median(self._overlap))
        # roundings over the amplitude are as large as terms of second order, or of third order
        alone, both = rounding ** (1 / 2), rounding ** (1 / 2 if one_sided else 1 / 3)
        way = COMMON_DISPLACEMENT * float(c.radius.mean()) * np.array([0.48, 0.6, 0.64])
        way[c.dimension :] = 0.0
        best, other = self._difference(alone, np.array([[1.0]]), without), 0.0
        if c.operators == "laws":
            other = self.other_stiffness(way, without)
        for factor in (1.0, 0.03, 30.0):
            if best < SMALL_DIFFERENCE or other > OTHER_STIFFNESS:
                break
            # without what is out of balance: half of the difference of two motions, or each without that from rest
            mix = np.array([[1.0, 0.0], [0.0, -1.0], [-1.0, 1.0]] if one_sided else [[0.5], [-0.5]])
            best = min(best, self._difference(factor * both, mix, without))
        return best, other

    def _difference(self, amplitude: float, mix: Floats, without: tuple[str, ...]) -> float:
        """Relative difference of the changes of velocities from 1, -1 and 0 times the start, in the mixtures of the
        columns."""
        c, steps = self.configuration, STEPS_OF_PROOF * self.shorter
        starts = amplitude * np.outer(self.start, [1.0, -1.0, 0.0][: len(mix)])
        began = COMMON_MULTIPLE - steps // 2 if self.resets else None
        ends = [
            steps_in_a_copy(self.lmp, c, v, self.timestep, steps, without=without, from_step=began) for v in starts.T
        ]
        moves = c.coordinate_free | ~np.tile(c.free, c.axes)  # particles that do not move are compared, too
        weight = (np.sqrt(c.coordinate_mass) * (moves & ~(self._rattle & c.coordinate_free)))[:, None]
        seen, linear = (
            weight * ((each - starts) @ mix)
            for each in (np.column_stack(ends), self.linear(starts, self.timestep, steps))
        )
        return float((np.linalg.norm(seen - linear, axis=0) / np.linalg.norm(linear, axis=0)).max())

    def other_stiffness(self, way: Floats, without: tuple[str, ...] = ()) -> float:
        """Largest change of a force on particles that touch no wall by a common displacement, or a step without one,
        over the size of a common displacement and the mean normal stiffness."""
        c = self.configuration
        inside = c.free.copy()
        inside[c.rattlers] = inside[c.contacts.i[c.contacts.wall]] = False
        change = in_a_copy(partial(_change_by_displacement, self.lmp, c, way, without))
        largest = np.abs(change[np.tile(inside, c.axes)]).max(initial=0.0)
        return float(largest / (COMMON_DISPLACEMENT * c.radius.mean() * np.mean(c.contacts.normal_stiffness)))


LinearMotion = Callable[[Floats, float, int], Floats]
"""Velocities of the coordinates, shape (axes N, P), after a number of steps of some length from those at first."""


def linear_motion(configuration: Configuration, *, extrapolates: bool = False) -> LinearMotion:
    """Steps of velocity Verlet of the linearised packing, with the forces that are left at rest.

    Forces change by :math:`-K q - C v`, by :math:`B \\int |N \\dot q|\\, dt` in laws with two derivatives
    (:mod:`~faultgouge.analysis.operators.linearised_contacts`), and by the sliders of the contacts at Coulomb's bound
    (:mod:`~faultgouge.analysis.operators.sliders`), which first move by what they lack of the bound.

    Parameters
    ----------
    configuration : Configuration
        The packing.
    extrapolates : bool
        Whether dashpots feel 2 v(n + 1/2) - v(n), as those of mindlin/smooth do, in place of v(n + 1/2).
    """
    c, (k, d) = configuration, configuration.assembled_operators()
    sliders, (rates, rescaled) = sliders_of(c), rescaling_operators(c)
    size = np.linalg.norm(c.contacts.tangential_force, axis=1)
    missing = np.where(np.isfinite(c.contacts.friction), c.contacts.friction - size, 0.0)[sliders.contact][:, None]
    mobility = (c.coordinate_free / c.coordinate_mass)[:, None]

    def steps(velocity: Floats, timestep: float, count: int) -> Floats:
        excess, opening = missing, np.zeros((len(c.contacts), 1))
        way = opening

        def acceleration(q: Floats, v: Floats) -> Floats:
            nonlocal excess, opening, way
            now = rates @ q
            way, opening = way + np.abs(now - opening), now
            springs = sliders.excess @ q + sliders.rectified[:, None] * way[sliders.contact]
            whole = springs + sliders.viscous_excess @ v
            excess = np.maximum(excess, np.where(sliders.viscous[:, None], whole, springs))
            slid = sliders.force @ (np.maximum(excess, whole) - missing)
            return np.asarray(mobility * (c.coordinate_force[:, None] - k @ q - d @ v + rescaled @ way - slid))

        displacement = np.zeros_like(velocity)
        change = acceleration(displacement, velocity)
        for _ in range(count):
            half = velocity + 0.5 * timestep * change
            displacement = displacement + timestep * half
            change = acceleration(displacement, 2 * half - velocity if extrapolates else half)
            velocity = half + 0.5 * timestep * change
        return velocity

    return steps


def steps_in_a_copy(
    lmp: Any,
    configuration: Configuration,
    velocity: Floats,
    timestep: float,
    steps: int,
    *,
    without: tuple[str, ...] = (),
    from_step: int | None = None,
) -> Floats:
    """Velocities of the coordinates, shape (axes N,), after some steps of LAMMPS from others, in a copy of the process:
    without drag, with constant forces in the place of some fixes, and from another number of the step, if given."""

    def take() -> Floats:
        _leave_out(lmp, configuration, without)
        if from_step is not None:
            lmp.command(f"reset_timestep {from_step}")
        set_velocity(lmp, configuration, velocity)
        lmp.command(f"timestep {timestep:.17g}")
        set_up_run(lmp)
        lmp.command(f"run {steps} pre no post no")
        return on_coordinates(lmp, configuration, "v", "omega")

    return in_a_copy(take)


def _constant_in_time(lmp: Any, configuration: Configuration) -> bool:
    """Whether forces at rest are the same at another time step. The instance is a copy."""
    _leave_out(lmp, configuration, ())
    set_velocity(lmp, configuration, np.zeros(configuration.coordinates))
    try:
        lmp.command("run 0 post no")
        before = on_coordinates(lmp, configuration, "f", "torque")
        lmp.command(f"reset_timestep {COMMON_MULTIPLE}")
        lmp.command("run 0 post no")
    except Exception:  # a fix or a load that takes no other step
        return False
    change = np.abs(on_coordinates(lmp, configuration, "f", "torque") - before)
    return bool(change.max() <= 1e-9 * force_scale(configuration))


def _change_by_displacement(lmp: Any, configuration: Configuration, way: Floats, without: tuple[str, ...]) -> Floats:
    """By how much a displacement of all particles, shape (3,), changes the forces (F, T/R) at rest, shape (axes N,):
    the smaller change of both signs, one of which may bring particles to walls. The instance is a copy."""
    _leave_out(lmp, configuration, without)
    set_velocity(lmp, configuration, np.zeros(configuration.coordinates))
    lmp.command(f"timestep {STILL_STEP * lmp.extract_global('dt'):.17g}")
    lmp.command("run 0 post no")
    before, changes = on_coordinates(lmp, configuration, "f", "torque"), []
    # within one run: a spring of fix smd begins where a run begins; but a fix rigid has its bodies follow where it does
    step = "run 1 post no" if has_bodies(lmp) else "run 1 pre no post no"
    for each in (way, -2 * way):
        owned_array(lmp, "x")[:] += each
        lmp.command(step)
        changes.append(np.abs(on_coordinates(lmp, configuration, "f", "torque") - before))
    return np.minimum(*changes)


def _leave_out(lmp: Any, configuration: Configuration, without: tuple[str, ...]) -> None:
    """Close the log and all that writes, leave out drag, and put constant forces in the place of some fixes; what moves
    particles by drag alone moves them by their inertia. The instance is a copy."""
    lmp.command("log none")
    styles = styles_of(lmp)
    quieten(lmp, drag=True)
    factor = (configuration.inertia / (configuration.mass * configuration.radius**2))[configuration.free].mean()
    for name, style in styles.fixes.items():
        if style == "overdamped/disc":
            lmp.command(f"fix {name} {styles.groups[name]} nve/disc {factor:.17g}")
    if not without:
        return
    set_velocity(lmp, configuration, np.zeros(configuration.coordinates))
    lmp.command("run 0 post no")
    force = forces_in_order(lmp, configuration.ids)
    for name in without:
        lmp.command(f"unfix {name}")
    lmp.command("run 0 post no")
    force -= forces_in_order(lmp, configuration.ids)
    lmp.command("fix faultgouge_p all property/atom d_fg_x d_fg_y d_fg_z")
    for k, axis in enumerate("xyz"):
        owned_array(lmp, f"d_fg_{axis}")[rows_of(lmp, configuration)] = force[:, k]
        lmp.command(f"variable fg_{axis} atom d_fg_{axis}")
    lmp.command("fix faultgouge_f all addforce v_fg_x v_fg_y v_fg_z")
