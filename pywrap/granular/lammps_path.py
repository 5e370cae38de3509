"""The loading path of a live LAMMPS: at each load its own dynamics relax the packing, with drag.

An equilibrium from which the path goes on is a copy of the process (`fork`), which waits with LAMMPS in it. So contact
histories are kept to the bit, as no restart file of LAMMPS can keep them, and the instance of the user stays as it was.
Of many copies most are ended: an equilibrium whose copy is asked for again is reached once more, by the same loads from
the copy before.
"""

import os
import shutil
import signal
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from multiprocessing.reduction import recv_handle, send_handle
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NoReturn

import numpy as np

from ...analysis import Configuration
from ...analysis.arrays import derive_frozen
from ...analysis.errors import FaultgougeError, place_in_user_code
from ...parent_death import end_with, outlive
from ..load_path import LoadPath
from .balance import check_balance
from .from_lammps import take_configuration
from .granular_commands import NotTakenError, read_commands
from .lammps_arrays import by_id
from .look_in_a_copy import (
    OpenFile,
    explain_error,
    in_a_copy,
    interrupts_wait,
    log_file,
    open_files,
    quieten,
    require_instance,
    silent_copy,
)
from .relax import DRAG_RATE, REST_SHARE, bring_to_rest

MOST_COPIES = 48
"""Copies of the process that wait: a process and a descriptor each, of which a system may allow some hundreds."""


def lammps_path(
    lmp: Any,
    apply: Callable[[Any, float], object] | str,
    *,
    commands: Iterable[str] | None = None,
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
    commands, balance, steps
        As of `relax`.

    Raises
    ------
    NotTakenError
        If the instance has several ranks or threads. ``path(value)`` raises it as `from_lammps` does, with the proof at
        the first value alone, and where a load changes no force.
    NoEquilibriumError
        By ``path(value)``, where the packing flows: its particles have moved by their diameter in the mean, or do not
        come to rest.
    """
    require_instance(lmp, "lammps_path")
    check_balance(balance)
    given = None if commands is None else read_commands(commands)
    look = partial(take_configuration, lmp, given, {})
    return LoadPath(CopiesSolver(_Relaxation(lmp, apply, look, balance, steps)))


@dataclass(eq=False)
class RelaxedCopy:
    """An equilibrium at a load, and the copy of the process that is there, if it still waits."""

    fx: float
    packing: Configuration
    process: Connection | None


class CopiesSolver:
    """LAMMPS's own equilibria, each in a copy of the process; `close` or the end of the program ends the copies."""

    def __init__(self, relaxation: "_Relaxation") -> None:
        self._folder = TemporaryDirectory(prefix="faultgouge")
        self._first, there = Pipe()
        self._ahead: list[RelaxedCopy] = []
        files = open_files()
        with interrupts_wait():
            self._child = silent_copy()
            if self._child == 0:
                self._first.close()
                _wait_for_loads(relaxation, there, Path(self._folder.name), files)
        there.close()

    def close(self) -> None:
        """End all copies of the process."""
        if self._first.closed:
            return
        for copy in filter(None, (self._first, *(each.process for each in self._ahead))):
            with suppress(OSError):
                copy.send(None)  # another copy of this process may keep the connection open
            copy.close()
        os.waitpid(self._child, 0)
        self._folder.cleanup()

    def solve(self, load: float, below: RelaxedCopy | None, beside: RelaxedCopy | None, ahead: bool) -> RelaxedCopy:
        """As of :class:`~faultgouge.pywrap.load_path.LoadPath`: only a copy that is `ahead` waits for more."""
        if self._first.closed:
            raise NotTakenError("The path is closed: ask it inside of its `with` block, or make a new one.")
        here, found = _ask(self._process_of(below), load)
        if isinstance(found, FaultgougeError):
            here.close()
            raise found
        made = RelaxedCopy(load, found, here)
        if ahead:
            self._ahead.append(made)
            self._end_some(made)
        else:
            here.close()
        return made

    def _process_of(self, wanted: RelaxedCopy | None) -> Connection:
        """The process of an equilibrium; if it has ended, the loads from the last one that waits once more."""
        if wanted is None:
            return self._first
        if wanted.process is None:
            before = self._ahead.index(wanted) - 1
            wanted.process, _ = _ask(self._process_of(self._ahead[before] if before >= 0 else None), wanted.fx)
            self._end_some(wanted)
        return wanted.process

    def _end_some(self, kept: RelaxedCopy) -> None:
        """End every second copy where there are too many, but for one and the last one."""
        waits = [each for each in self._ahead if each.process is not None]
        for each in waits[:-1:2] if len(waits) > MOST_COPIES else ():
            if each is not kept and each.process is not None:
                each.process.close()
                each.process = None


def _ask(there: Connection, value: float) -> tuple[Connection, Any]:
    """Have a copy of the process copy itself and go to a load; the new copy, and what it finds."""
    here, end = Pipe()
    copy = 0
    try:
        with interrupts_wait():
            there.send(value)
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


def _wait_for_loads(relaxation: "_Relaxation", there: Connection, folder: Path, files: dict[int, OpenFile]) -> NoReturn:
    """The life of the first copy of the process, and of all copies of it, each of which relaxes at one load."""
    try:
        _own_log(relaxation.lmp, folder, files)
        quieten(relaxation.lmp)
        while (load := there.recv()) is not None:
            end, this, files = Connection(recv_handle(there)), os.getpid(), open_files()
            with suppress(ChildProcessError):  # copies that have ended
                while os.waitpid(-1, os.WNOHANG)[0]:
                    pass
            if silent_copy() == 0:
                end_with(this)  # which ends with the path, while this copy relaxes
                there.close()
                there = end
                there.send(os.getpid())
                _own_log(relaxation.lmp, folder, files)
                found = relaxation.result(load)
                outlive()  # from now on it ends with the path, where the connection ends
                there.send(found)
            else:
                end.close()  # else nobody sees that the copy has died
    except (EOFError, OSError):  # the path is closed
        pass
    finally:
        os._exit(0)


def _own_log(lmp: Any, folder: Path, files: dict[int, OpenFile]) -> None:
    """Go on in a copy of the log, where there is one: copies of a process must not write to the same file."""
    if before := log_file(lmp, files):
        own = folder / f"log.{os.getpid()}"
        shutil.copyfile(before[0], own)
        lmp.command(f'log "{own}" append')


@dataclass
class _Relaxation:
    """LAMMPS and how it comes to rest; `look` takes the packing as it stands."""

    lmp: Any
    apply: Callable[[Any, float], object] | str
    look: Callable[..., Configuration]
    balance: float
    steps: int
    found: Configuration | None = None  # the equilibrium where LAMMPS stands
    rate: float = DRAG_RATE

    def result(self, value: float) -> Configuration | FaultgougeError:
        """The equilibrium at a value, by a run with drag until the packing rests; or why there is none."""
        lmp, first = self.lmp, self.found is None
        try:
            self.set(value)
            rest = self.balance, self.steps, self.rate, f" at {value:.10g}"
            found, self.rate = bring_to_rest(lmp, self.look, self.look(), *rest)
            if first:  # all others are forked from it; a proof may show that laws do not serve
                found = self.look(prove=True)
                self.look = partial(self.look, differences=found.operators == "differences")
            self.found = found
            change = in_a_copy(lambda: self.force_change(value))
        except FaultgougeError as error:
            return error
        except Exception as error:  # LAMMPS, and a user's function, raise any error
            return NotTakenError(f"At {value:g}: {explain_error(error)}")
        if change == 0.0:
            cure = "does apply set it, or a fix read the variable?"
            return NotTakenError(f"No force changes with the load at {value:g}: {cure}")
        return derive_frozen(found, fx=value, load_error=found.residual / change)

    def set(self, value: float) -> None:
        """Set the load."""
        if not isinstance(self.apply, str):
            try:
                self.apply(self.lmp, value)
            except FaultgougeError:
                raise
            except (Exception, SystemExit) as error:  # of whatever kind: the function is the user's
                failed = f"apply failed with {type(error).__name__}: {error}"
                what = explain_error(error) if str(error).startswith("ERROR") else failed
                raise NotTakenError(f"At {value:g}: {what.rstrip('.')}{place_in_user_code(error)}.") from None
        elif self.lmp.set_internal_variable(self.apply, value) != 0:
            self.lmp.command(f"variable {self.apply} equal {value:.17g}")

    def force_change(self, value: float) -> float:
        """Largest change of a force per value, of particles that stay where they are."""
        step, forces = 1e-4 * max(abs(value), 1e-2), []
        for each in (value, value + step):
            self.set(each)
            self.lmp.command("run 0 post no")
            forces += by_id(self.lmp, "f")
        change = float(np.linalg.norm(forces[1] - forces[0], axis=1).max())
        # forces have a rounding of 1e-16 of themselves, and of 1e-12 where overlaps are small beside coordinates
        return change / step if change > 1e-11 * np.abs(forces[0]).max() else 0.0
