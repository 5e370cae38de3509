"""A Configuration of a live LAMMPS with its own granular styles, or ours: any packing, as it stands.

Where all contacts have laws that can be measured, K and C are those of the laws
(:mod:`~faultgouge.pywrap.granular.configuration_by_laws`). With other forces (cohesion, rolling and twisting friction,
regions, bonds, springs, a lid that moves as one) K and C are differences of LAMMPS's own forces
(:mod:`~faultgouge.pywrap.granular.configuration_by_differences`). A few of LAMMPS's own steps prove either
(:mod:`~faultgouge.pywrap.granular.motion_proof`).
"""

from collections.abc import Iterable
from functools import partial
from typing import Any

from ...analysis import Configuration
from ...analysis.arrays import Floats, derive_frozen
from .acting_fixes import check_holding, drag_remarks
from .balance import BALANCE, check_balance, force_scale, held_remarks, lost_histories, motion_remarks, refuse_motion
from .configuration_by_differences import configuration_by_differences, still_particles
from .configuration_by_laws import KnownLaws, check_friction, configuration_by_laws
from .granular_commands import OWN, Commands, NotLinearisedError, NotTakenError, read_commands, with_one_rank
from .instance_queries import open_files, require_instance
from .look_in_a_copy import can_copy, in_a_copy
from .looks import look
from .motion_proof import LARGEST_DIFFERENCE, SMALL_DIFFERENCE, NotProvedError, OtherStiffnessError, push_remark
from .motion_proof import prove as prove_motion


def from_lammps(
    lmp: Any,
    commands: Iterable[str] | Commands | None = None,
    *,
    slides: bool = False,
    balance: float = BALANCE,
    prove: bool = True,
    differences: bool = False,
) -> Configuration:
    """The packing of a LAMMPS instance with its linearised contacts, as it stands.

    The instance does not change: its next run is the same to the bit as without the look. On several ranks, or with the
    threads of `package omp`, LAMMPS itself runs zero steps: fixes and variables that these would change are refused by
    their names before.

    Parameters
    ----------
    lmp : lammps.lammps
        The instance: disks or spheres at rest. Laws are measured with gran/hooke/history, gran/hertz/history, granular
        or mindlin/smooth, between planes of fix wall/gran or in a periodic box. On several ranks all make this call.
    commands : iterable of str, optional
        The lines pair_style, pair_coeff, fix wall/gran and fix nve/sphere of the deck; by default those in the
        instance's log.
    slides : bool
        Whether contacts at Coulomb's bound slide; they stick by default.
    balance : float
        Residual that is allowed, as a share of the mean contact force; not negative.
    prove : bool
        Whether five steps of LAMMPS in a copy of the process are compared with those of the result, drag left out: its
        `proof` is their relative difference (:mod:`~faultgouge.pywrap.granular.motion_proof`). A packing of more than
        1e-3 is refused, and 1e-5 or less is usual. `proof` is None on several ranks or with threads, where no copy can
        be made, and for a packing whose residual exceeds the default balance.
    differences : bool
        Whether K and C are found by differences of LAMMPS's forces even where all laws of contacts are measured.

    Returns
    -------
    Configuration
        With its contacts' laws, as they are measured; or, where these do not apply (`operators` says which), with K and
        C by differences of forces, on one rank. Its `remarks` name the drag and the velocities that are left out, and
        say why differences are taken.

    Raises
    ------
    NotTakenError
        If the packing cannot be taken: it moves, or has moving walls or bodies that rotate; or the commands are not
        those of the instance; or LAMMPS's forces do not change as K says; or the look would change the next run.

    Examples
    --------

    >>> from lammps import lammps
    >>> crystal = lammps(cmdargs=["-screen", "none"])
    >>> crystal.file("fcc.in")
    >>> faultgouge.from_lammps(crystal).contacts
    <LinearisedContacts: 648, 0 of them with walls>
    """
    return take_configuration(lmp, commands, {}, slides=slides, balance=balance, prove=prove, differences=differences)


def take_configuration(
    lmp: Any,
    commands: Iterable[str] | Commands | None,
    laws: KnownLaws,
    *,
    slides: bool,
    balance: float,
    prove: bool,
    differences: bool = False,
) -> Configuration:
    """As :func:`from_lammps`, with known laws: these are not measured again, and new ones are added to them."""
    check_balance(balance)
    require_instance(lmp, "from_lammps")
    given = None if commands is None else read_commands(commands)
    try:
        if differences:
            raise NotLinearisedError("They are asked for.")
        found = _by_laws(lmp, given, laws, balance=balance, prove=prove)
    except NotLinearisedError as error:
        found = _instead_of_laws(lmp, given, error, slides=slides, balance=balance, prove=prove)
    if slides:
        return derive_frozen(found, contacts=derive_frozen(found.contacts, sliding=found.contacts.at_bound))
    return found


def _instead_of_laws(
    lmp: Any, given: Commands | None, reason: NotLinearisedError, *, slides: bool, balance: float, prove: bool
) -> Configuration:
    """A Configuration by differences, with the reason among its remarks; or the reason, where it is not proved."""
    why = str(reason).rstrip(".")
    if not can_copy(lmp):
        raise NotLinearisedError(with_one_rank(reason)) from reason
    if slides:
        raise NotTakenError(
            f"{why}; so K is found by differences of forces, which have no choice between sticking and sliding "
            "contacts: leave slides out."
        ) from reason
    try:
        found = _by_differences(lmp, given, balance=balance, prove=prove)
    except NotTakenError:
        if isinstance(reason, NotProvedError):
            raise reason from None
        raise
    found = derive_frozen(found, remarks=(f"K and C are differences of LAMMPS's forces: {why}", *found.remarks))
    if not isinstance(reason, NotProvedError):
        return found
    # differences lack forces on velocities, or between particles far apart, too, and these have been named
    close = found.proof is not None and found.proof <= LARGEST_DIFFERENCE
    if close and found.operator_error <= SMALL_DIFFERENCE:
        return found
    # contacts that slide on one side have no linear motion, and no verdict is given
    if isinstance(reason, OtherStiffnessError) and len(found.one_sided_particles):
        return found
    raise reason


def _by_laws(lmp: Any, given: Commands | None, laws: KnownLaws, *, balance: float, prove: bool) -> Configuration:
    """A Configuration whose contacts have the laws that LAMMPS shows; a NotLinearisedError if something else acts."""
    work = partial(look, lmp, given, open_files())
    deck, fixes, found = in_a_copy(work) if can_copy(lmp) else work()
    try:
        configuration = configuration_by_laws(lmp, deck, found, laws)
    except ValueError as error:  # numbers that no contact at rest has
        advice = lost_histories(deck) or "bring it to rest by faultgouge.relax(lmp), in a command --relax"
        raise NotTakenError(f"The packing moves: {str(error).rstrip('.')}; {advice}.") from error
    remarks = _remarks(lmp, configuration, fixes, found["v"], found["omega"])
    configuration = derive_frozen(configuration, remarks=(*configuration.remarks, *remarks))
    contacts = configuration.contacts
    rests = not configuration.residual > BALANCE * force_scale(configuration)
    proves = prove and can_copy(lmp) and rests
    if not proves:
        check_holding(fixes)
    check_friction(contacts, rests=rests)
    refuse_motion(configuration, balance, deck)
    return _proved(lmp, configuration, deck, fixes) if proves else configuration


def _remarks(
    lmp: Any, configuration: Configuration, fixes: dict[str, str], velocity: Floats, rotation: Floats
) -> tuple[str, ...]:
    """Sentences on what moves, which a packing at rest leaves out; velocities have the shape (N, 3)."""
    held = held_remarks(configuration, velocity, rotation, float(lmp.extract_global("dt")))
    adapts = (
        f"fix {name} (adapt) may change sizes or laws as LAMMPS runs on: this is said of those that hold now"
        for name, style in fixes.items()
        if style.startswith("adapt")
    )
    return (*held, *motion_remarks(configuration, velocity), *adapts, *drag_remarks(fixes))


def _proved(lmp: Any, configuration: Configuration, commands: Commands, fixes: dict[str, str]) -> Configuration:
    """A Configuration with its proof."""
    return derive_frozen(
        configuration, proof=prove_motion(lmp, configuration, fixes, extrapolates=commands.style == OWN)
    )


def _by_differences(lmp: Any, given: Commands | None, *, balance: float, prove: bool) -> Configuration:
    """A Configuration whose K and C are differences of LAMMPS's forces, on one rank."""
    still = still_particles(lmp, given)
    made = configuration_by_differences(lmp, still)
    made = derive_frozen(made, remarks=_remarks(lmp, made, still.fixes, still.velocity, still.rotation))
    refuse_motion(made, balance, still.commands)
    proves = prove and made.residual <= BALANCE * force_scale(made)
    if not proves:
        return made
    made = _proved(lmp, made, still.commands, still.fixes)
    if not len(made.one_sided_particles):
        return made
    return derive_frozen(made, remarks=(*made.remarks, push_remark(lmp, made)))
