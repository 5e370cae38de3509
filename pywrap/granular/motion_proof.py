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

**A longer motion** (`compare_motion`) is compared with the exponential function. From rest with the velocities
:math:`\mathbf v_0` small motion is

.. math:: \begin{pmatrix} q \\ \dot q \end{pmatrix}(t) = e^{t G} \begin{pmatrix} 0 \\ \mathbf v_0 \end{pmatrix}, \qquad
    G = \begin{pmatrix} 0 & 1 \\ -M^{-1} K & -M^{-1} C \end{pmatrix} .

LAMMPS runs twice, with :math:`\pm \mathbf v_0`, in copies of the process, without drag. Half of the difference has
neither the motion by residual forces nor terms of second order in :math:`\mathbf v_0`. Three errors are left:

- the error of the time step h, of the order h^2, or h with dashpots, which feel the velocity of the half step;
- the cubic terms of the forces, of second order in the amplitude;
- in `granular`, a history that is turned only once it has left the contact's plane by 1e-10 of Coulomb's bound: an
  error that grows as the inverse of the amplitude.

At the best amplitude the last two together are 1e-7 to 1e-5, more where overlaps are small.

Laws with two derivatives (mindlin_rescale) have other forces while a contact closes than while it parts. With the mean
K of both, and N and B of :func:`~faultgouge.analysis.operators.linearised_contacts.rescaling_operators`, the motion
obeys

.. math:: M \dot{\mathbf v} = \mathbf F - C \mathbf v, \qquad
    \dot{\mathbf F} = -K \mathbf v + B\, |N \mathbf v| ,

from :math:`\pm \mathbf v_0`, integrated to ten digits.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.sparse import block_array, csr_array, diags_array
from scipy.sparse.linalg import expm_multiply

from ...analysis import BadInputError, Configuration, damping_matrix, largest_frequency, stiffness_matrix
from ...analysis.arrays import Floats, Indices
from ...analysis.counted import counted
from ...analysis.motion.eigenvalues import active_coordinates, mass_weighted
from ...analysis.operators.linearised_contacts import rescaling_operators
from ...analysis.operators.sliders import sliders_of
from .balance import force_scale
from .granular_commands import GIVE_LINES, MOBILE, WALLS, NotLinearisedError, NotTakenError, without_suffix
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
from .look_in_a_copy import DRAG_STYLES, INSERTS, PER_STEP, can_copy, in_a_copy, quieten, require_instance, styles_of

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

COMMON_DISPLACEMENT, COMMON_WAY = 1e-3, np.array([0.48, 0.6, 0.64])
"""Common displacement in units of the mean radius, and its direction."""

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


PASSIVE = (
    *WALLS, *PER_STEP, *DRAG_STYLES, *INSERTS, *MOBILE, "gravity", "enforce2d", "slip/history", "low/parts",
    "dashpot/velocities", "keep/histories", "store", "property/atom",
)  # fmt: skip
"""Fixes, by the beginnings of their styles, whose action is in K, or constant, or none; so are those that LAMMPS makes
for itself, whose styles are in capitals (GRANULAR/MDR): styles of pairs need them."""

PULLS = "pulls at particles as contacts do not tell: leave it out"
ACTING = {
    "spring": PULLS, "smd": PULLS, "drag": PULLS,
    "indent": "pushes particles as contacts do not tell: leave it out",
    "addforce": "has a force that depends on the position or on velocities: make the force a constant",
    "accelerate/cos": "has a force that depends on the position: use fix gravity",
    "momentum": "changes velocities: unfix it", "temp/": "changes velocities: unfix it",
    "oneway": "changes velocities: unfix it", "recenter": "moves particles: unfix it",
}  # fmt: skip
"""What is said of fixes, by the beginnings of their styles, without which LAMMPS moves as K says. The list only
explains a difference: the motion shows it."""


class NotProvedError(NotLinearisedError):
    """LAMMPS's motion shows a force on particles besides those of the contacts."""


class OtherStiffnessError(NotProvedError):
    """Forces depend on positions as no contact does, as of a spring or a trap: differences of forces have them."""


def acting_fixes(styles: dict[str, str]) -> dict[str, str]:
    """Fixes that may exert forces besides the contacts, by ID, with a clause on each."""
    plain = {name: without_suffix(style) for name, style in styles.items()}
    usual = "acts on particles as contacts do not tell: unfix it"
    return {
        name: f"fix {name} {style} {next((says for begin, says in ACTING.items() if style.startswith(begin)), usual)}"
        for name, style in plain.items()
        if not style.startswith(PASSIVE) and not style.isupper()
    }


def check_holding(styles: dict[str, str]) -> None:
    """Refuse fixes that may hold, push or pull particles, where no motion can show whether they do."""
    held = {name: style for name, style in styles.items() if style.startswith(("spring", "indent"))}
    for says in acting_fixes(held).values():
        raise NotLinearisedError(f"{says}.")


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
    c, timestep = configuration, _stable_step(configuration)
    if not timestep:
        return None
    others, linear = acting_fixes(fixes), linear_motion(c, extrapolates=extrapolates)
    resets = bool(others) and in_a_copy(partial(_constant_in_time, lmp, c))

    def differs(without: tuple[str, ...] = (), shorter: int = 1) -> float:
        return _least_difference(lmp, c, linear, timestep / shorter, STEPS_OF_PROOF * shorter, without, resets)

    difference, stiffness = differs(), partial(_other_stiffness, lmp, c)
    if c.operators == "laws" and stiffness(COMMON_WAY) > OTHER_STIFFNESS:
        if stiffness(np.zeros(3)) > OTHER_STIFFNESS:
            raise NotTakenError(
                "LAMMPS's forces change with the time, though nothing moves: a load or a wall follows a variable of "
                "the step or the time; give it a constant, and run on until the packing rests."
            )
        causes = _causes(others, lambda names: stiffness(COMMON_WAY, names) < OTHER_STIFFNESS)
        raise OtherStiffnessError(
            "LAMMPS's forces do not change as K says: where all particles are displaced alike, forces change that no "
            f"contact has; {' and '.join(causes or ['something acts on particles by their positions'])}."
        )
    if len(c.one_sided_particles):
        return difference  # no linear motion is LAMMPS's, and no verdict is given
    if difference > LARGEST_DIFFERENCE:
        difference = min(difference, differs(shorter=SHORTER_STEPS))
    if difference <= SMALL_DIFFERENCE:
        return difference
    causes = _causes(others, lambda names: differs(names) < CAUSE_SHARE * difference)
    if difference <= LARGEST_DIFFERENCE and not causes:
        return difference
    raise _not_proved(c, difference, causes)


def push_remark(lmp: Any, configuration: Configuration) -> str:
    """What LAMMPS's own particles do after a push without drag, for a packing whose forces are one-sided."""
    c, timestep = configuration, float(lmp.extract_global("dt"))
    push = PUSH_SHARE * _random_start(c, STEPS_OF_PROOF * _stable_step(c))
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


def _not_proved(configuration: Configuration, difference: float, causes: list[str]) -> NotTakenError:
    """The error of a motion that is another one, with its causes, or the likeliest ones."""
    says = (
        f"LAMMPS's forces do not change as K says: in {STEPS_OF_PROOF} steps from small velocities the change differs "
        f"by {difference:.2g} of itself"
    )
    close = configuration.mobilised > CREEP_SHARE
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


def _stable_step(c: Configuration) -> float:
    """A time step that is stable for certain, by sums of rows in absolute values; zero if nothing that moves has a
    contact."""
    scale = 1 / np.sqrt(c.coordinate_mass)
    k, d = (float((scale * (abs(each) @ scale)).max(initial=0.0)) for each in c.assembled_operators())
    rate = 0.5 * (d + np.sqrt(d * d + 4 * k))  # the root of s^2 = d s + k
    return STEP_PHASE / rate if rate else 0.0


def _overlaps(c: Configuration) -> Floats:
    """Sizes of overlaps, or of the gaps of cohesive contacts; a small one where no contact is known."""
    overlap = np.abs(c.contacts.overlap)
    return overlap if len(overlap) else np.array([USUAL_OVERLAP * c.radius.mean()])


def _random_start(c: Configuration, time: float) -> Floats:
    """Random velocities of all that moves and touches something, and a common one, which fixes of the momentum change;
    after the time the largest displacement of a contact is about as large as its overlap."""
    random = np.random.Generator(np.random.PCG64(0))
    translation, rotation = c.vectors(random.standard_normal(c.coordinates))
    common = random.standard_normal(3)
    translation += np.sqrt(3) * common / np.linalg.norm(common)
    touches = ~np.tile(np.isin(np.arange(len(c)), c.rattlers), c.axes)
    start = c.join_vectors(translation, rotation) * (c.coordinate_free & touches)
    moves, _ = c.vectors(time * start)
    overlap, i, j = _overlaps(c), c.contacts.i, c.contacts.j
    between = moves[i] - np.where(c.contacts.wall[:, None], 0.0, moves[j]) if len(i) else moves
    size = np.linalg.norm(between, axis=1) / np.maximum(overlap, SMALL_OVERLAP * np.median(overlap))
    return np.asarray(start / size.max())


def _least_difference(
    lmp: Any, c: Configuration, linear: "LinearMotion", timestep: float, count: int, without: tuple[str, ...],
    resets: bool,
) -> float:  # fmt: skip
    """Relative difference of LAMMPS's steps from the linear ones, at the amplitude where it is least; constant forces
    stand in the place of some fixes. The steps may get other numbers: some fixes act every so many steps alone.

    A K that is not LAMMPS's disagrees at every amplitude: contacts open or begin to slide with large ones, and
    `granular` does not turn a history that has left its plane by less than 1e-10 of Coulomb's bound.
    """
    one_sided, start = bool(c.contacts.one_sided.any()), _random_start(c, count * timestep)
    moves = c.coordinate_free | ~np.tile(c.free, c.axes)  # particles that do not move are compared, too
    rattles = np.tile(np.isin(np.arange(len(c)), c.rattlers), c.axes)
    weight = (np.sqrt(c.coordinate_mass) * (moves & ~(rattles & c.coordinate_free)))[:, None]
    began = COMMON_MULTIPLE - count // 2 if resets else None

    def difference(amplitude: float, mix: Floats) -> float:
        """Of the changes of velocities from 1, -1 and 0 times the start, in the mixtures of the columns."""
        starts = amplitude * np.outer(start, [1.0, -1.0, 0.0][: len(mix)])
        ends = [steps_in_a_copy(lmp, c, v, timestep, count, without=without, from_step=began) for v in starts.T]
        both = np.column_stack(ends), linear(starts, timestep, count)
        seen, expected = (weight * ((each - starts) @ mix) for each in both)
        return float((np.linalg.norm(seen - expected, axis=0) / np.linalg.norm(expected, axis=0)).max())

    # the rounding of a displacement is some units in the last place of the largest coordinate; roundings over the
    # amplitude are as large as terms of second order, or of third order
    rounding = 1e-14 * float(np.abs(c.position).max() / np.median(_overlaps(c)))
    best = difference(rounding ** (1 / 2), np.array([[1.0]]))
    # without what is out of balance: half of the difference of two motions, or each without that from rest
    mix = np.array([[1.0, 0.0], [0.0, -1.0], [-1.0, 1.0]] if one_sided else [[0.5], [-0.5]])
    for factor in (1.0, 0.03, 30.0):
        if best >= SMALL_DIFFERENCE:
            best = min(best, difference(factor * rounding ** (1 / 2 if one_sided else 1 / 3), mix))
    return best


def _other_stiffness(lmp: Any, c: Configuration, direction: Floats, without: tuple[str, ...] = ()) -> float:
    """Largest change of a force on particles that touch no wall by a common displacement, or a step without one, over
    the size of a common displacement and the mean normal stiffness."""
    way = COMMON_DISPLACEMENT * float(c.radius.mean()) * np.where(np.arange(3) < c.dimension, direction, 0.0)
    inside = c.free.copy()
    inside[c.rattlers] = inside[c.contacts.i[c.contacts.wall]] = False
    change = in_a_copy(partial(_change_by_displacement, lmp, c, way, without))
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


STEP_ERROR = 1e-10
"""Error of a step in the motion with two derivatives, as a share of the largest velocity."""


@dataclass(frozen=True, eq=False)
class MotionComparison:
    """Velocities of LAMMPS and of the linearised packing after some time.

    Attributes
    ----------
    difference : float
        |v - u| / |u| of the velocities v of LAMMPS and u of the linearised packing, with the root of the masses.
    time, timestep : float
        The time, a whole number of steps, and the step.
    velocity, linear_velocity : ndarray, shape (E,)
        Velocities of LAMMPS and of the linearised packing, times the root of the masses, of the coordinates that feel
        a force.
    periods : float
        How many periods of the fastest vibration without dashpots the time has. A time far below one compares the
        acceleration alone; slow vibrations are compared over a share of a period.
    """

    difference: float
    time: float
    timestep: float
    velocity: Floats
    linear_velocity: Floats
    periods: float

    def __float__(self) -> float:
        return self.difference

    def __str__(self) -> str:
        return (
            f"relative difference {self.difference:.2g} after t = {self.time:.4g}, {self.periods:.3g} periods of the "
            "fastest vibration"
        )


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
        Of :func:`~faultgouge.pywrap.from_lammps`.
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
        `difference` is the relative difference; it is also the value of ``float(...)``.

    Raises
    ------
    NotTakenError
        If the instance has several ranks or threads, or other particles than the configuration, or none of these feels
        a force.
    BadInputError
        If a time, the step or the amplitude is not positive and finite: nothing would move, and nothing be compared.
    """
    require_instance(lmp, "compare_motion")
    if not can_copy(lmp):
        raise NotTakenError("compare_motion runs LAMMPS in copies of the process: use one rank and one thread.")
    step = float(lmp.extract_global("dt")) if timestep is None else float(timestep)
    for name, value in (("time", time), ("timestep", step), ("amplitude", amplitude)):
        if not 0 < value < np.inf:
            raise BadInputError(f"{name} = {value:g} is refused: nothing would be compared; give a number above 0.")
    steps = max(1, round(time / step))
    stiffness = mass_weighted(stiffness_matrix(configuration), configuration)
    active = active_coordinates(stiffness)
    if not len(active):
        raise NotTakenError("Nothing that moves has a contact: there is no motion to compare with.")
    root = np.sqrt(configuration.coordinate_mass)
    start = np.zeros(configuration.coordinates)
    start[active] = amplitude * np.random.Generator(np.random.PCG64(seed)).standard_normal(len(active))
    there, back = (steps_in_a_copy(lmp, configuration, sign * start, step, steps) for sign in (1, -1))
    velocity = (0.5 * (there - back) * root)[active]
    linear = _linear_velocity(configuration, stiffness, active, (start * root)[active], step * steps)
    difference = float(np.linalg.norm(velocity - linear) / np.linalg.norm(linear))
    periods = step * steps * largest_frequency(configuration) / (2 * np.pi)
    return MotionComparison(difference, step * steps, step, velocity, linear, periods)


def _linear_velocity(
    configuration: Configuration, stiffness: csr_array, active: Indices, start: Floats, time: float
) -> Floats:
    """Velocities after some time; these and `start` are multiplied by the root of the masses."""
    a = stiffness[active][:, active]
    g = mass_weighted(damping_matrix(configuration), configuration)[active][:, active]
    # displacements or forces over omega, so that both halves weigh as much
    omega = float(np.sqrt(np.abs(a).sum(axis=1).max()))
    still = np.zeros_like(start)
    rates, forces = rescaling_operators(configuration)
    if not forces.data.any():
        system = csr_array(block_array([[None, omega * diags_array(np.ones(len(start)))], [-a / omega, -g]]))
        return np.asarray(expm_multiply(time * system, np.concatenate([still, start])))[len(start) :]
    from scipy.integrate import solve_ivp

    weight = diags_array(1.0 / np.sqrt(configuration.coordinate_mass[active]))
    n, b = csr_array(rates[:, active] @ weight), csr_array(weight @ forces[active])

    def slope(_: float, state: Floats) -> Floats:
        """F' = -A v + B |N v| and v' = F - G v: each contact has its own derivative."""
        force, velocity = np.split(state, 2)
        return np.concatenate([(b @ np.abs(n @ velocity) - a @ velocity) / omega, omega * force - g @ velocity])

    ends = []
    for sign in (1, -1):
        begin, error = np.concatenate([still, sign * start]), STEP_ERROR * np.abs(start).max()
        found = solve_ivp(slope, (0, time), begin, method="DOP853", t_eval=[time], rtol=STEP_ERROR, atol=error)
        if not found.success:
            raise NotTakenError(f"The predicted motion was not found: {found.message} Compare over a shorter time.")
        ends.append(found.y[len(start) :, 0])
    return np.asarray(0.5 * (ends[0] - ends[1]))
