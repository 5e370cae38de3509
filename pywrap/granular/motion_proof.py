r"""The proof of a Configuration: a few steps of LAMMPS beside the same steps of the linearised packing.

LAMMPS starts from small random velocities, in a copy of the process, without drag. The linearised packing takes the
same steps of velocity Verlet, with the residual forces: the comparison has no error of the time step. Dashpots feel the
velocities of half steps in LAMMPS's styles, and extrapolated velocities in mindlin/smooth.

**The proof** is :math:`|\Delta v - \Delta u| / |\Delta u|`, weighted with the root of the masses, with the changes of
the velocities v of LAMMPS and u of the linearised packing. Where one motion leaves a difference, those with both signs
of the velocities are compared: half of their difference has no terms of second order. With contacts at the bound they
are not opposite, and each is compared after the motion from rest has been subtracted. Shorter steps are taken where a
model acts one step late (mdr, synchronized_verlet). K by differences of one-sided forces is a mean of both sides: the
difference is told, and the packing is not refused.

**Forces by position** that belong to no contact may be weak beside contacts, and strong beside the lowest eigenvalues
of K. So all particles are also displaced alike, which changes no contact between them.
"""

from typing import Any

import numpy as np

from ...analysis import Configuration
from ...analysis.arrays import Floats
from ...analysis.counted import counted
from ...analysis.operators.linearised_contacts import rescaling_operators
from ...analysis.operators.sliders import sliders_of
from .granular_commands import GIVE_LINES, NotLinearisedError, NotTakenError
from .lammps_arrays import STILL_STEP, has_bodies, on_coordinates, owned_array, set_up_run, set_velocity
from .look_in_a_copy import in_a_copy, quieten, styles_of

LARGEST_DIFFERENCE, SMALL_DIFFERENCE, DOUBTFUL = 1e-3, 1e-5, 3e-5
"""Differences beyond which a packing is refused, below which no other amplitude is tried, and beyond which a fix may
act that is not known. Packings at rest have 1e-9 to 1e-5, of 63 packings of all laws 1.4e-5 at most; what is out of
balance by the share e adds some e. A wrong stiffness of one contact in a hundred gives 1e-2 or more."""

OTHER_STIFFNESS = 1e-6
"""Stiffness of no contact, as a share of that of contacts, from which on a packing is refused: far below the smallest
eigenvalues, some 1e-4 of the largest, and far above rounding, 1e-11 and less."""

CREEP_SHARE = 0.99
"""Share of Coulomb's bound from which on a contact of a packing that creeps may slide: dashpots bear the rest."""

STEPS_OF_PROOF, SHORTER_STEPS = 5, 10
"""Steps of LAMMPS and of the linearised packing, and by how much shorter ones are shorter."""

STEP_PHASE = 1.5
"""Time step times a bound of the fastest rate, some three times this rate. Below 2 steps are stable."""

COMMON_DISPLACEMENT, COMMON_WAY = 1e-3, np.array([0.48, 0.6, 0.64])
"""Common displacement in units of the mean radius, and its direction."""

SMALL_OVERLAP, USUAL_OVERLAP = 1e-2, 1e-4
"""Share of the median overlap below which overlaps do not decide how small the velocities are; and the overlap as a
share of the mean radius where no contact is known."""


class NotProvedError(NotLinearisedError):
    """LAMMPS moves otherwise than the laws of contacts say, and some fix may be the cause."""


def prove(lmp: Any, configuration: Configuration, others: str) -> float | None:
    """Relative difference of LAMMPS's motion from that of its linearised packing at rest; None if no contact moves.

    `others` is what is said of fixes that may exert other forces than contacts. A NotProvedError if something acts
    beside contacts, or may do so; else a NotTakenError if LAMMPS's forces do not change as K says.
    """
    c, by_laws, scale = configuration, configuration.operators == "laws", 1 / np.sqrt(configuration.coordinate_mass)
    k, d = (float((scale * (abs(each) @ scale)).max(initial=0.0)) for each in c.assembled_operators())
    if not k and not d:
        return None  # nothing that moves has a contact
    timestep = STEP_PHASE / (0.5 * (d + np.sqrt(d * d + 4 * k)))  # stable: over a bound of the root of s^2 = d s + k
    difference = _least_difference(lmp, c, timestep, STEPS_OF_PROOF)
    if by_laws and _other_stiffness(lmp, c) > OTHER_STIFFNESS:
        alike = "where all particles are displaced alike, forces change that no contact has"
        cause = others or "something acts on particles by their positions"
        raise NotProvedError(f"LAMMPS's forces do not change as K says: {alike}; {cause}.")
    if len(c.one_sided_particles):
        return difference  # no linear motion is LAMMPS's, and no verdict is given
    if difference > LARGEST_DIFFERENCE:
        shorter = _least_difference(lmp, c, timestep / SHORTER_STEPS, STEPS_OF_PROOF * SHORTER_STEPS)
        difference = min(difference, shorter)
    if difference <= (DOUBTFUL if by_laws and others else LARGEST_DIFFERENCE):
        return difference
    differs = f"the change differs by {difference:.2g} of itself; {_likely(c, others)}."
    says = f"LAMMPS's forces do not change as K says: in {STEPS_OF_PROOF} steps from small velocities {differs}"
    raise (NotProvedError if by_laws and others else NotTakenError)(says)


def _likely(c: Configuration, others: str) -> str:
    """The likeliest causes of a motion that is another one."""
    close, causes = c.mobilised > CREEP_SHARE, [others] if others else []
    if close.any() and (others or np.any(close & ~c.contacts.at_bound)):
        slide = f"{counted(int(close.sum()), 'contact')} at Coulomb's bound or just below may slide while the packing "
        causes.append(f"{slide}creeps: run on with drag until it rests")
    if c.operators == "laws":
        log = "the commands are those of another run or instance, or some are not in the log (echo none, a full disk)"
        causes.append(f"{log}, or a restart has lost histories of contacts: {GIVE_LINES}, as they hold now")
    else:
        causes.append(
            f"K by differences of forces misses {c.operator_error:.1g} of the forces of a displacement of all "
            "particles, and they may be no functions of the displacements of neighbours, as with the model mdr"
        )
    return "; or ".join(causes)


def _least_difference(lmp: Any, c: Configuration, timestep: float, count: int) -> float:
    """Relative difference of LAMMPS's steps from the linear ones, at the amplitude where it is least.

    A K that is not LAMMPS's disagrees at every amplitude: contacts open or begin to slide with large ones, and
    `granular` does not turn a history that has left its plane by less than 1e-10 of Coulomb's bound.
    """
    # random velocities of all that moves and touches something, and a common one, which fixes of the momentum change
    random = np.random.Generator(np.random.PCG64(0))
    translation, rotation = c.vectors(random.standard_normal(c.coordinates))
    common = random.standard_normal(3)
    translation += np.sqrt(3) * common / np.linalg.norm(common)
    rattles = np.tile(np.isin(np.arange(len(c)), c.rattlers), c.axes)
    start = c.join_vectors(translation, rotation) * (c.coordinate_free & ~rattles)
    # after the time the largest displacement of a contact, or gap, is about as large as its overlap
    moves, _ = c.vectors(count * timestep * start)
    i, j, overlap = c.contacts.i, c.contacts.j, np.abs(c.contacts.overlap)
    if not len(overlap):
        overlap = np.array([USUAL_OVERLAP * c.radius.mean()])
    between = moves[i] - np.where(c.contacts.wall[:, None], 0.0, moves[j]) if len(i) else moves
    size = np.linalg.norm(between, axis=1) / np.maximum(overlap, SMALL_OVERLAP * np.median(overlap))
    start = start / size.max()
    one_sided = bool(c.contacts.one_sided.any())
    moved = c.coordinate_free | ~np.tile(c.free, c.axes)  # particles that do not move are compared, too
    weight = (np.sqrt(c.coordinate_mass) * (moved & ~(rattles & c.coordinate_free)))[:, None]

    def difference(amplitude: float, mix: Floats) -> float:
        """Of the changes of velocities from 1, -1 and 0 times the start, in the mixtures of the columns."""
        starts = amplitude * np.outer(start, [1.0, -1.0, 0.0][: len(mix)])
        ends = np.column_stack([steps_in_a_copy(lmp, c, v, timestep, count) for v in starts.T])
        both = ends, _linear_steps(c, starts, timestep, count)
        seen, expected = (weight * ((each - starts) @ mix) for each in both)
        return float((np.linalg.norm(seen - expected, axis=0) / np.linalg.norm(expected, axis=0)).max())

    # the rounding of a displacement is some units in the last place of the largest coordinate; roundings over the
    # amplitude are as large as terms of second order, or of third order
    rounding = 1e-14 * float(np.abs(c.position).max() / np.median(overlap))
    best = difference(rounding ** (1 / 2), np.array([[1.0]]))
    # without what is out of balance: half of the difference of two motions, or each without that from rest
    mix = np.array([[1.0, 0.0], [0.0, -1.0], [-1.0, 1.0]] if one_sided else [[0.5], [-0.5]])
    for factor in (1.0, 0.03, 30.0):
        if best >= SMALL_DIFFERENCE:
            best = min(best, difference(factor * rounding ** (1 / 2 if one_sided else 1 / 3), mix))
    return best


def _other_stiffness(lmp: Any, c: Configuration) -> float:
    """Largest change of a force on particles that touch no wall by a common displacement, over its size and the mean
    normal stiffness: the smaller change of both signs, one of which may bring particles to walls."""
    size = COMMON_DISPLACEMENT * float(c.radius.mean())
    inside = c.free.copy()
    inside[c.rattlers] = inside[c.contacts.i[c.contacts.wall]] = False

    def changes() -> Floats:
        _leave_out(lmp, c)
        set_velocity(lmp, c, np.zeros(c.coordinates))
        lmp.command(f"timestep {STILL_STEP * lmp.extract_global('dt'):.17g}")
        lmp.command("run 0 post no")
        before, found = on_coordinates(lmp, c, "f", "torque"), []
        # within one run: a spring of fix smd begins where a run begins; but a fix rigid has its bodies follow there
        step = "run 1 post no" if has_bodies(lmp) else "run 1 pre no post no"
        for way in (size, -2 * size):
            owned_array(lmp, "x")[:] += way * np.where(np.arange(3) < c.dimension, COMMON_WAY, 0.0)
            lmp.command(step)
            found.append(np.abs(on_coordinates(lmp, c, "f", "torque") - before))
        return np.minimum(*found)

    largest = in_a_copy(changes)[np.tile(inside, c.axes)].max(initial=0.0)
    return float(largest / (size * np.mean(c.contacts.normal_stiffness)))


def _linear_steps(c: Configuration, velocity: Floats, timestep: float, count: int) -> Floats:
    r"""Velocities of the coordinates, shape (axes N, P), after some steps of Verlet of the linearised packing,
    with the forces that are left at rest.

    Forces change by :math:`-K q - C v`, by :math:`B \int |N \dot q|\, dt` in laws with two derivatives
    (:mod:`~faultgouge.analysis.operators.linearised_contacts`), and by the sliders of the contacts at Coulomb's bound
    (:mod:`~faultgouge.analysis.operators.sliders`), which first move by what they lack of the bound.
    """
    (k, d), sliders, (rates, rescaled) = c.assembled_operators(), sliders_of(c), rescaling_operators(c)
    size = np.linalg.norm(c.contacts.tangential_force, axis=1)
    missing = np.where(np.isfinite(c.contacts.friction), c.contacts.friction - size, 0.0)[sliders.contact][:, None]
    mobility = (c.coordinate_free / c.coordinate_mass)[:, None]
    extrapolates = len(size) > 0 and not c.contacts.viscous_slider.any()  # as mindlin/smooth does
    excess, opening, way = missing, np.zeros((len(size), 1)), np.zeros((len(size), 1))

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


def steps_in_a_copy(lmp: Any, configuration: Configuration, velocity: Floats, timestep: float, steps: int) -> Floats:
    """Velocities of the coordinates, shape (axes N,), after some steps of LAMMPS from others, in a copy of the process
    and without drag."""

    def take() -> Floats:
        _leave_out(lmp, configuration)
        set_velocity(lmp, configuration, velocity)
        lmp.command(f"timestep {timestep:.17g}")
        set_up_run(lmp)
        lmp.command(f"run {steps} pre no post no")
        return on_coordinates(lmp, configuration, "v", "omega")

    return in_a_copy(take)


def _leave_out(lmp: Any, configuration: Configuration) -> None:
    """Close the log and all that writes, and leave out drag; what moves particles by drag alone moves them by their
    inertia. The instance is a copy."""
    lmp.command("log none")
    styles = styles_of(lmp)
    quieten(lmp, drag=True)
    factor = (configuration.inertia / (configuration.mass * configuration.radius**2))[configuration.free].mean()
    for name, style in styles.fixes.items():
        if style == "overdamped/disc":
            lmp.command(f"fix {name} {styles.groups[name]} nve/disc {factor:.17g}")
