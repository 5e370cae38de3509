"""A Configuration of a live LAMMPS with its own granular styles, or ours: any packing, as it stands.

Where all contacts have laws that can be measured, K and C are those of the laws. With other forces (cohesion, twisting
friction, regions, bonds, springs) K and C are differences of LAMMPS's own forces. A few of LAMMPS's own steps prove
either.
"""

from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np

from ...analysis import Configuration
from ...analysis.arrays import derive_frozen
from .balance import BALANCE, check_balance, force_scale, motion_remarks, refuse_motion
from .configuration_by_differences import configuration_by_differences, still_particles
from .configuration_by_laws import FORCE_AGREEMENT, KnownLaws, configuration_by_laws
from .granular_commands import GIVE_LINES, Commands, NotLinearisedError, NotTakenError, read_commands
from .look_in_a_copy import DRAG_STYLES, in_a_copy, open_files, require_instance
from .looks import Looked, acting_fixes, look, may_act
from .motion_proof import LARGEST_DIFFERENCE, SMALL_DIFFERENCE, NotProvedError
from .motion_proof import prove as prove_motion


def from_lammps(
    lmp: Any,
    commands: Iterable[str] | Commands | None = None,
    *,
    balance: float = BALANCE,
    prove: bool = True,
    differences: bool = False,
) -> Configuration:
    """The packing of a LAMMPS instance with its linearised contacts, as it stands.

    The instance does not change: its next run is the same to the bit as without the look, which is taken in a copy of
    the process.

    Parameters
    ----------
    lmp : lammps.lammps
        The instance: disks or spheres at rest, on one rank and one thread. Laws are measured with gran/hooke/history,
        gran/hertz/history, granular or mindlin/smooth, between planes of fix wall/gran or in a periodic box.
    commands : iterable of str, optional
        The lines pair_style, pair_coeff, fix wall/gran and fix nve/sphere of the deck; by default those in the
        instance's log.
    balance : float
        Residual that is allowed, as a share of the mean contact force; not negative.
    prove : bool
        Whether five steps of LAMMPS in a copy of the process are compared with those of the result, drag left out: its
        `proof` is their relative difference. A packing of more than 1e-3 is refused, and 1e-5 or less is usual. `proof`
        is None for a packing whose residual exceeds the default balance.
    differences : bool
        Whether K and C are found by differences of LAMMPS's forces even where all laws of contacts are measured.

    Returns
    -------
    Configuration
        With its contacts' laws, as they are measured; or, where these do not apply (`operators` says which), with K and
        C by differences of forces. Its `remarks` name the drag and the velocities that are left out, and say why
        differences are taken.

    Raises
    ------
    NotTakenError
        If the packing cannot be taken: it moves, or has moving walls or bodies that rotate; or the commands are not
        those of the instance; or LAMMPS's forces do not change as K says; or the process cannot be copied.

    Examples
    --------

    >>> from lammps import lammps
    >>> crystal = lammps(cmdargs=["-screen", "none"])
    >>> crystal.file("fcc.in")
    >>> faultgouge.from_lammps(crystal).contacts
    <LinearisedContacts: 648, 0 of them with walls>
    """
    return take_configuration(lmp, commands, {}, balance=balance, prove=prove, differences=differences)


def take_configuration(
    lmp: Any,
    commands: Iterable[str] | Commands | None,
    laws: KnownLaws,
    *,
    balance: float = np.inf,
    prove: bool = False,
    differences: bool = False,
) -> Configuration:
    """As :func:`from_lammps`, with known laws: these are not measured again, and new ones are added to them."""
    check_balance(balance)
    require_instance(lmp, "from_lammps")
    given = None if commands is None else read_commands(commands)
    try:
        if differences:
            raise NotLinearisedError("They are asked for.")
        looked = in_a_copy(partial(look, lmp, given, open_files()))
        try:
            found = configuration_by_laws(lmp, looked, laws)
        except ValueError as error:  # numbers that no contact at rest has
            advice = "bring it to rest by faultgouge.relax(lmp), in a command --relax"
            raise NotTakenError(f"The packing moves: {str(error).rstrip('.')}; {advice}.") from error
        rests = not found.residual > BALANCE * force_scale(found)
        if not (prove and rests):  # no motion can show whether these act
            held = {name: style for name, style in looked.fixes.items() if style.startswith(("spring", "indent"))}
            if acts := acting_fixes(held, looked.commands):
                raise NotLinearisedError(f"{may_act(acts)}.")
        size, c = np.linalg.norm(found.contacts.tangential_force, axis=1), found.contacts
        beyond = size > c.friction + FORCE_AGREEMENT * (c.friction + c.normal_force)
        if np.any(beyond):
            mu = np.min(c.friction[beyond] / c.normal_force[beyond])
            moves = "" if rests else "the packing moves: bring it to rest by faultgouge.relax(lmp); or "
            says = f"{np.count_nonzero(beyond)} contacts carry more than Coulomb's bound of the commands"
            other = f"{moves}the commands are not those of the instance; {GIVE_LINES}, as they hold now."
            raise NotTakenError(f"{says}, with mu = {mu:.3g}: {other}")
        return _at_rest(lmp, found, looked, balance=balance, prove=prove)
    except NotLinearisedError as error:
        reason = error
    unproved = reason if isinstance(reason, NotProvedError) else None
    try:
        start, looked = still_particles(lmp, given)
        found = _at_rest(lmp, configuration_by_differences(lmp, start, looked), looked, balance=balance, prove=prove)
    except NotTakenError as error:
        raise unproved or error from None
    # differences lack forces on velocities, or between particles far apart, too
    exact = found.proof is not None and found.proof <= LARGEST_DIFFERENCE and found.operator_error <= SMALL_DIFFERENCE
    # contacts that slide on one side have no linear motion, and no verdict is given
    if unproved is not None and not exact and not len(found.one_sided_particles):
        raise unproved
    why = f"K and C are differences of LAMMPS's forces: {str(reason).rstrip('.')}"
    return derive_frozen(found, remarks=(why, *found.remarks))


def _at_rest(lmp: Any, made: Configuration, looked: Looked, *, balance: float, prove: bool) -> Configuration:
    """A Configuration at rest with its proof, and remarks on what moves in LAMMPS, or may change."""
    v, omega, timestep = looked.found["v"], looked.found["omega"], float(lmp.extract_global("dt"))
    remarks = list(motion_remarks(made, v, omega, timestep))
    for name, style in looked.fixes.items():
        if style.startswith("adapt"):
            says = "may change sizes or laws as LAMMPS runs on: this is said of those that hold now"
            remarks.append(f"fix {name} (adapt) {says}")
        elif style.startswith(DRAG_STYLES):
            remarks.append(f"drag of fix {name} ({style}) is left out")
    refuse_motion(made, balance, looked.commands)
    made = derive_frozen(made, remarks=tuple(remarks))
    if not prove or made.residual > BALANCE * force_scale(made):
        return made
    others = may_act(acting_fixes(looked.fixes, looked.commands))
    return derive_frozen(made, proof=prove_motion(lmp, made, others))
