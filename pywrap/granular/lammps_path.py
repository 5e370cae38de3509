"""The loading path of a live LAMMPS: at each load its own dynamics relax the packing, with drag.

An equilibrium that the path keeps is a copy of the process (`fork`), which waits with LAMMPS in it. So contact
histories are kept to the bit, as no restart file of LAMMPS can keep them. The instance of the user stays as it was.

**Newton's method.** If no contact slides, a step of the load displaces the particles by :math:`K^{-1}` times the forces
that are out of balance. LAMMPS makes this displacement in one long time step, in which slips advance, and returns the
forces. K of the last equilibrium serves for some iterations. The equilibrium is kept if no contact slides, K has no
negative eigenvalue, and the balance is as close as that of a relaxation. Otherwise another copy of the last equilibrium
relaxes.

**Relaxation.** The load jumps, and a drag takes the energy that the jump sets free. Motion ends soonest at the critical
damping of the slowest mode, where the force out of balance is half of the drag. So the rate of the drag is doubled
where the force is more than twice the drag. The rate is halved where the force is less than a quarter of the drag,
since the packing then creeps, or a loose sphere rolls away.
"""

import os
import shutil
import signal
import weakref
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from multiprocessing.reduction import recv_handle, send_handle
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NoReturn

import numpy as np
from scipy.sparse import csc_array, eye_array

from ...analysis import Configuration, negative_eigenvalues, stiffness_matrix
from ...analysis.arrays import Floats, derive_frozen
from ...analysis.errors import FaultgougeError, place_in_user_code
from ...analysis.factors.sparse_lu import general_lu
from ...parent_death import end_with
from ..load_path import LoadPath
from .balance import check_balance
from .configuration_by_laws import KnownLaws
from .from_lammps import take_configuration
from .granular_commands import INTEGRATORS, NotTakenError, read_commands, without_suffix
from .instance_queries import OpenFile, explain_error, log_file, log_of, open_files, require_instance
from .lammps_arrays import owned_array, rows_of, set_velocity
from .look_in_a_copy import can_copy, in_a_copy, interrupts_wait, quieten, silent_copy
from .relax import DRAG_RATE, REST_SHARE, bring_to_rest

MOST_ITERATIONS = 10
"""Iterations of Newton's method, each of which must halve the residual until rounding stops it: six are the rule."""

DISPLACEMENT_STEP = 1e6
"""Length of a step in which particles are displaced, in time steps: so slow that dashpots have no share in forces."""


def lammps_path(
    lmp: Any,
    apply: Callable[[Any, float], object] | str,
    *,
    commands: Iterable[str] | None = None,
    slides: bool = False,
    balance: float = REST_SHARE,
    steps: int = 1_000_000,
) -> "LoadPath[RelaxedCopy]":
    """The loading path of LAMMPS's own packing, for :func:`~faultgouge.analysis.find_onset`.

    ``path(value)`` is the Configuration in equilibrium at a value, with `fx` the value and `load_error` the shift of
    the value that sets as much out of balance as the relaxation has left. ``path.climb(values)`` yields the equilibria
    at increasing values, up to the last one before the packing flows. The end of a ``with`` block, ``path.close()`` or
    the end of the program ends the copies of the process.

    Parameters
    ----------
    lmp : lammps.lammps
        The instance, where the path begins; on one rank and one thread. The instance does not change.
    apply : callable or str
        ``apply(lmp, value)`` sets the load, whatever was set before; or the name of a variable of style equal or
        internal, on which a fix of the deck depends.
    commands, slides
        As of :func:`~faultgouge.pywrap.from_lammps`.
    balance : float
        Largest residual at rest, as a share of the mean contact force; not negative.
    steps : int
        Time steps after which a packing that is not at rest flows.

    Raises
    ------
    NotTakenError
        If the instance has several ranks or threads. ``path(value)`` raises it as `from_lammps` does, with the proof at
        the first value alone, and where a load changes no force.
    BadInputError
        If `balance` is no such number.
    NoEquilibriumError
        By ``path(value)``, where the packing flows: its particles have moved by their diameter in the mean, or do not
        come to rest.
    """
    require_instance(lmp, "lammps_path")
    if not can_copy(lmp):
        raise NotTakenError("lammps_path keeps copies of the process: use one rank and one thread.")
    check_balance(balance)
    given = None if commands is None else list(commands)
    return LoadPath(CopiesSolver(_Relaxation(lmp, apply, given, slides, balance, steps)))


@dataclass(frozen=True)
class RelaxedCopy:
    """An equilibrium, and the copy of the process that is there."""

    packing: Configuration
    process: Connection

    @property
    def fx(self) -> float:
        """The load."""
        return self.packing.fx


class CopiesSolver:
    """LAMMPS's own equilibria, each in a copy of the process; `close` or the end of the program ends the copies."""

    def __init__(self, relaxation: "_Relaxation") -> None:
        folder = TemporaryDirectory(prefix="faultgouge")
        self._first, there = Pipe()
        self._ahead: list[Connection] = []
        files = open_files()
        with interrupts_wait():
            first = silent_copy()
            if first == 0:
                self._first.close()
                _wait_for_loads(relaxation, there, Path(folder.name), files)
            self._end = weakref.finalize(self, _end, self._first, self._ahead, first, os.getpid(), folder)
        there.close()

    def solve(self, load: float, below: RelaxedCopy | None, beside: RelaxedCopy | None, ahead: bool) -> RelaxedCopy:
        """As of :class:`~faultgouge.pywrap.load_path.EquilibriumSolver`: only a copy that is `ahead` waits for more."""
        if not self._end.alive:
            raise NotTakenError("The path is closed: ask it inside of its `with` block, or make a new one.")
        there = self._first if below is None else below.process
        here, found = _ask(there, load, relaxes=False)
        if found is None:
            here.close()
            here, found = _ask(there, load, relaxes=True)
        if isinstance(found, FaultgougeError):
            here.close()
            try:
                raise found
            finally:
                del found  # its traceback has this frame, and so this solver
        if ahead:
            self._ahead.append(here)
        else:
            here.close()
        return RelaxedCopy(found, here)

    def close(self) -> None:
        """End all copies of the process."""
        self._end()


def _ask(there: Connection, value: float, *, relaxes: bool) -> tuple[Connection, Any]:
    """Have a copy of the process copy itself and go to a load; the new copy, and what it finds."""
    here, end = Pipe()
    copy = 0
    try:
        with interrupts_wait():
            there.send((value, relaxes))
            send_handle(there, end.fileno(), 0)
            end.close()
            copy = here.recv()
        return here, here.recv()
    except KeyboardInterrupt:
        if copy:
            os.kill(copy, signal.SIGKILL)
        raise
    except EOFError:
        return here, NotTakenError(f"LAMMPS ended without a word while it relaxed at {value:g}.")


def _end(begin: Connection, ahead: list[Connection], first: int, owner: int, folder: "TemporaryDirectory[str]") -> None:
    """End the copies of this process, which have this solver, too, and must not end it."""
    if os.getpid() != owner:
        return
    for copy in (begin, *ahead):
        with suppress(OSError):
            copy.send(None)  # another copy of this process may keep the connection open
        copy.close()
    os.waitpid(first, 0)
    folder.cleanup()


def _wait_for_loads(relaxation: "_Relaxation", there: Connection, folder: Path, files: dict[int, OpenFile]) -> NoReturn:
    """The life of the first copy of the process, and of all copies of it, each of which relaxes at one load."""
    try:
        _own_log(relaxation.lmp, folder, files)
        quieten(relaxation.lmp)
        while (load := there.recv()) is not None:
            end, this, files = Connection(recv_handle(there)), os.getpid(), open_files()
            if silent_copy() == 0:
                end_with(this)  # which ends with the path, also while this copy relaxes
                there.close()
                there = end
                there.send(os.getpid())
                _own_log(relaxation.lmp, folder, files)
                there.send(relaxation.result(*load))
            else:
                end.close()  # else nobody sees that the copy has died
    except (EOFError, OSError):  # the path is closed
        pass
    finally:
        os._exit(0)


def _own_log(lmp: Any, folder: Path, files: dict[int, OpenFile]) -> None:
    """Go on in a copy of the log, where there is one: copies of a process must not write to the same file."""
    before = log_file(lmp, files)
    if before is not None:
        own = folder / f"log.{os.getpid()}"
        shutil.copyfile(before.path, own)
        lmp.command(f'log "{own}" append')


@dataclass
class _Relaxation:
    """LAMMPS and how it comes to rest; fields as of `lammps_path`, and what copies of this process have, too."""

    lmp: Any
    apply: Callable[[Any, float], object] | str
    commands: list[str] | None
    slides: bool
    balance: float
    steps: int
    laws: KnownLaws = field(default_factory=dict)
    found: Configuration | None = None  # the equilibrium where LAMMPS stands
    rate: float = DRAG_RATE

    def result(self, value: float, relaxes: bool) -> Configuration | FaultgougeError | None:
        """The equilibrium at a value, or why there is none; None if Newton's method, when asked for, cannot serve."""
        try:
            self.set(value)
            found = self.relax(value) if relaxes else self.displace_to_balance()
            if found is None:
                return None
            # the first of all others, which are forked from it
            self.found = found = self.look(prove=True) if self.found is None else found
            change = in_a_copy(lambda: self.force_change(value))
        except Exception as error:  # LAMMPS, and a user's function, raise any error
            if not relaxes:
                return None  # particles that nothing holds fly off: the relaxation has its own words for it
            return (
                error if isinstance(error, FaultgougeError) else NotTakenError(f"At {value:g}: {explain_error(error)}")
            )
        if change == 0.0:
            return NotTakenError(
                f"No force changes with the load at {value:g}: does apply set it, or a fix read the variable?"
            )
        return derive_frozen(found, fx=value, load_error=found.residual / change)

    def set(self, value: float) -> None:
        """Set the load."""
        if not isinstance(self.apply, str):
            try:
                self.apply(self.lmp, value)
            except FaultgougeError:
                raise
            except (Exception, SystemExit) as error:  # of whatever kind: the function is the user's
                of_lammps = str(error).startswith("ERROR")
                what = explain_error(error) if of_lammps else f"apply failed with {type(error).__name__}: {error}"
                raise NotTakenError(f"At {value:g}: {what.rstrip('.')}{place_in_user_code(error)}.") from None
        elif self.lmp.set_internal_variable(self.apply, value) != 0:
            self.lmp.command(f"variable {self.apply} equal {value:.17g}")

    def look(self, *, prove: bool = False) -> Configuration:
        """The packing as it stands, moving or not."""
        # a proof may have shown at the first load that laws do not serve
        differences = self.found is not None and self.found.operators == "differences"
        return take_configuration(
            self.lmp,
            self.commands,
            self.laws,
            slides=self.slides,
            balance=np.inf,
            prove=prove,
            differences=differences,
        )

    def force_change(self, value: float) -> float:
        """Largest change of a force per value, of particles that stay where they are."""
        step = 1e-4 * max(abs(value), 1e-2)
        forces = []
        for each in (value, value + step):
            self.set(each)
            self.lmp.command("run 0 post no")
            forces.append(owned_array(self.lmp, "f")[np.argsort(owned_array(self.lmp, "id"))])
        change = float(np.linalg.norm(forces[1] - forces[0], axis=1).max())
        # forces have a rounding of 1e-16 of themselves, and of 1e-12 where overlaps are small beside coordinates
        return change / step if change > 1e-11 * np.abs(forces[0]).max() else 0.0

    def displace_to_balance(self) -> Configuration | None:
        """Newton's method from the equilibrium where LAMMPS stands; None if it cannot serve."""
        start, lmp = self.found, self.lmp
        if start is None or start.contacts.at_bound.any() or start.operators == "differences":
            return None
        if not np.array_equal(start.contacts.closing, start.contacts.parting):
            return None
        stiffness = stiffness_matrix(start)
        # a coordinate that no contact feels has a zero row, and does not move
        solver = general_lu(csc_array(stiffness + 1e-9 * abs(stiffness).max() * eye_array(start.coordinates)))
        files = open_files()
        given = self.commands or in_a_copy(lambda: log_of(lmp, files)) or []
        fixes = read_commands(given, log=self.commands is None).fixes
        moving = {name: line for name, line in fixes.items() if without_suffix(line.split()[3]) in INTEGRATORS}
        for name in moving:
            lmp.command(f"unfix {name}")
        lmp.command("fix faultgouge_moves all nve/noforce")
        step = float(lmp.extract_global("dt"))
        lmp.command(f"timestep {DISPLACEMENT_STEP * step:.17g}")
        allowed = self.balance * float(start.contacts.normal_force.mean())
        left = _iterate(lmp, start, solver.solve, DISPLACEMENT_STEP * step, 1e-4 * allowed)
        for line in ("unfix faultgouge_moves", *moving.values(), f"timestep {step:.17g}"):
            lmp.command(line)
        if left > allowed:
            return None
        found = self.look()
        good = found.residual <= self.balance * found.contacts.normal_force.mean()
        good = good and not found.contacts.at_bound.any() and len(negative_eigenvalues(found)) == 0
        return found if good else None

    def relax(self, value: float) -> Configuration:
        """Run with drag until the packing rests."""
        found, self.rate = bring_to_rest(
            self.lmp, self.look, self.look(), self.balance, self.steps, self.rate, f" at {value:.10g}"
        )
        return found


def _iterate(lmp: Any, start: Configuration, solve: Callable[[Floats], Floats], step: float, wanted: float) -> float:
    """Displace the particles by Newton's method until forces are small, or fall slowly; the largest that is left.

    Parameters
    ----------
    lmp : lammps.lammps
        An instance in which nothing but their velocities moves the particles.
    start : Configuration
        Where the particles were at first.
    solve : callable
        Displacements that would take forces away, by K of the start.
    step : float
        Length of a time step: one for each displacement.
    wanted : float
        Size of small forces.
    """
    sizes: list[float] = []
    while True:
        set_velocity(lmp, start, np.zeros(start.coordinates))
        lmp.command("run 0 post no")
        rows = rows_of(lmp, start)
        torque = owned_array(lmp, "torque")[rows] / start.radius[:, None]
        on_coordinates = start.join_vectors(owned_array(lmp, "f")[rows], torque)
        forces = np.where(np.tile(start.free, start.axes), on_coordinates, 0.0)
        sizes.append(float(np.linalg.norm(forces.reshape(start.axes, -1), axis=0).max()))
        slow = len(sizes) > 1 and sizes[-1] > 0.5 * sizes[-2]
        if sizes[-1] <= wanted or slow or len(sizes) > MOST_ITERATIONS:
            return sizes[-1]
        set_velocity(lmp, start, solve(forces) / step)
        lmp.command("run 1 post no")
