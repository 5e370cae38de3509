"""A LAMMPS instance that contains one packing.

The instance is set up by the deck part ``system.in``, the same file that ``lmp -in`` runs, and driven by its companions
(:mod:`~faultgouge.pywrap.lammps.decks`). A `Packing` is transferred into LAMMPS and back, bitwise
(:mod:`~faultgouge.pywrap.lammps.lammps_state`). All methods are collective over the ranks of the communicator, and
every rank sees the whole packing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

from mpi4py import MPI
from numpy.typing import ArrayLike

from ...analysis import Packing
from ...analysis.arrays import Floats
from ...analysis.files.formats.lammps_data import box_heights
from ...analysis.responses.signals import Signal
from .data_file import data_file, sort_contacts
from .decks import Decks
from .dynamics import Dynamics, Weakening
from .instance import lammps_instance
from .lammps_state import LammpsState
from .plain_file_names import decks_folder, move_files, shared_folder
from .trial_state import Trial

STEPS_A_LOOK = 1000
"""Time steps between two looks at the forces."""


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


class Engine:
    """A LAMMPS instance that contains one packing.

    Parameters
    ----------
    packing : Packing
        Initial positions, angles, slips, law and load. The arithmetic is compensated if the packing is compensated.
    communicator : mpi4py.MPI.Comm, optional
        The ranks that share the packing; all of them by default.
    log : Path, optional
        File for LAMMPS's log; none by default.

    Raises
    ------
    EngineError
        If the plugin is missing, or LAMMPS refuses the packing.
    """

    def __init__(self, packing: Packing, communicator: MPI.Comm | None = None, log: Path | None = None) -> None:
        self.communicator = communicator or MPI.COMM_WORLD
        self._decks = Decks(lammps_instance(self.communicator, log))
        self._state = LammpsState(self._decks, packing)
        self._kept: Trial | None = None
        self._load(packing)

    def __enter__(self) -> Engine:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._decks.lammps.close()

    @property
    def lammps(self) -> Any:
        """The LAMMPS instance, for its data and for commands that the driver does not cover."""
        self._state.end_displacements()
        return self._decks.lammps

    @property
    def packing(self) -> Packing:
        """The present configuration, with its slips and its load."""
        return self._state.read().packing

    @property
    def net_force(self) -> Floats:
        """Forces in LAMMPS, (Fx.., Fy.., T/R..), shape (3N,), load included."""
        return self._state.net_force()

    def set_fx(self, fx: float) -> None:
        """Set the force along x on each disk of the upper layer."""
        self._state.set_fx(fx)

    def restore(self, packing: Packing) -> None:
        """Restore the disks, slips and load of a packing bitwise."""
        self._state.end_displacements()
        self._state.write(packing)
        self.set_fx(packing.fx)

    def settle(
        self, force_tolerance: float, gather: float = 1.0, viscosity: float | None = None, steps: int = 10_000_000
    ) -> None:
        """Settle a loose packing under the load (deck parts gather.in, bed.in).

        Parameters
        ----------
        force_tolerance : float
            Largest force on a disk.
        gather : float
            Fraction of its height to which the loose packing is first brought down evenly; 1 for not at all.
        viscosity : float, optional
            Viscosity of the damping, mass / time; by default that of the decks.
        steps : int
            Largest number of time steps in each stage.
        """
        self._state.end_displacements()
        self._decks.variables(force_tolerance=force_tolerance, chunk=STEPS_A_LOOK, chunks=steps // STEPS_A_LOOK)
        if viscosity is not None:
            self._decks.variables(viscosity=viscosity)
        if gather < 1:
            self._decks.include("gather.in", gather=gather)
        self._decks.include("bed.in")

    def damp(self, packing: Packing, force_tolerance: float, steps: int, viscosity: float | None = None) -> None:
        """Run viscously damped dynamics from a packing at rest (deck part damp.in), for at most `steps` steps.

        By default the viscosity is that of the previous call, or of `settle`.
        """
        self.restore(packing)
        if viscosity is not None:
            self._decks.variables(viscosity=viscosity)
        self._decks.include(
            "damp.in", force_tolerance=force_tolerance, chunk=STEPS_A_LOOK, chunks=steps // STEPS_A_LOOK
        )

    def relax(
        self,
        force_tolerance: float,
        damping: float = 1.0,
        time_step: float | None = None,
        chunk: int = 1000,
        steps: int = 10_000_000,
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
            Steps between two checks of the forces.
        steps : int
            Largest number of time steps.
        """
        self._state.end_displacements()
        self._decks.command("variable relax_step delete")  # the variable of an earlier call
        if time_step is not None:
            self._decks.variables(relax_step=time_step)
        start = self._decks.steps
        self._decks.include(
            "relax.in", force_tolerance=force_tolerance, damping=damping, chunk=chunk, chunks=steps // chunk
        )
        return Relaxation(
            residual=self._decks.number("residual"),
            status=str(self._decks.lammps.extract_variable("relaxed")),
            steps=self._decks.steps - start,
        )

    def displace(self, base: Packing, displacement: Floats) -> Packing:
        """Move the disks from a configuration along a straight path and advance the slips along it.

        For LAMMPS the displacement is the motion in one time step of length one. The result does not depend on the
        configuration before the call: any number of trials may start from one base, and each is bitwise independent of
        the others.

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
        return self.try_displacement(base, displacement).packing

    def try_displacement(self, base: Packing, displacement: Floats) -> Trial:
        """The same as `displace`, but returned as a `Trial`, for many displacements in turn."""
        return self._state.displace(base, displacement)

    def keep(self, trial: Trial) -> Packing:
        """The packing of a trial, for displacements from this packing, with LAMMPS's own arrays to the bit."""
        self._kept = trial
        self._state.keep(trial)
        return trial.packing

    def trial_of(self, packing: Packing) -> Trial:
        """The trial that `keep` got with this packing; without such a trial one of the packing, forces unknown."""
        if self._kept is None or self._kept.packing is not packing:
            self._kept = Trial.of(packing)
        return self._kept

    def dump(self, stem: Path) -> None:
        """Write the configuration as LAMMPS dumps in full precision (deck part write.in): STEM.disks and others.

        The output depends only on the configuration, not on its history.
        """
        bottom, top = box_heights(self.packing)
        self._state.end_displacements()
        self._decks.command(f"change_box all y final {bottom!r} {top!r} units box")
        self._decks.command("reset_timestep 0")
        with shared_folder(self.communicator) as folder:
            self._decks.include("write.in", name=folder / "dump", fx=self._state.fx)
            self.communicator.barrier()
            if self.communicator.rank == 0:
                sort_contacts(folder / "dump.contacts")
                move_files(folder, stem)

    @contextmanager
    def undamped(
        self,
        time_step: float,
        amplitude: float = 0.0,
        omega: float = 0.0,
        target: ArrayLike | None = None,
        weakening: Weakening | None = None,
        signal: Signal | None = None,
        on: Literal["layer", "floor"] = "layer",
        drag_time: float | None = None,
    ) -> Iterator[Dynamics]:
        """Run dynamics from rest, with only the damping of the packing.

        Parameters
        ----------
        time_step : float
            Time step of velocity Verlet, time.
        amplitude : float
            Amplitude a of the force a cos(omega t) along x on each disk of the target; 0 for none.
        omega : float
            Angular frequency of the force, 1 / time.
        target : array_like of int, optional
            The disks on which the force acts; the upper layer by default.
        weakening : Weakening, optional
            Friction that falls with the velocity of the upper layer; constant by default.
        signal : Signal, optional
            A further force along x (deck part signal.in); none by default.
        on : {"layer", "floor"}
            Meaning of the signal: the force on each disk of the target, or the acceleration of the floor.
        drag_time : float, optional
            tau of the drag -(m/tau) v and -(I/tau) omega on every disk, time; that of the packing by default.

        Yields
        ------
        Dynamics
            The dynamics, to be continued. Rattlers are held fixed, because nothing would stop them.
        """
        packing = self.packing
        self._state.end_displacements()
        dynamics = Dynamics(self._decks, self._state, packing, weakening)
        with (
            dynamics.integrate(time_step, packing.drag_time if drag_time is None else drag_time),
            ExitStack() as forces,
        ):
            pushed = "top" if target is None else forces.enter_context(self._decks.group("pushed", target))
            if amplitude != 0:
                forces.enter_context(dynamics.push_cosine(amplitude, omega, pushed))
            if signal is not None:
                forces.enter_context(dynamics.apply_signal(signal, on, pushed, self.communicator))
            dynamics.begin()
            yield dynamics

    @contextmanager
    def driven(
        self,
        spring: float | Literal["rigid"],
        stages: Sequence[tuple[float, float]],
        signal: Signal | None = None,
        on: Literal["layer", "floor"] = "layer",
        time_step: float | None = None,
    ) -> Iterator[Dynamics]:
        """Run dynamics from rest in which a spring draws the upper layer, with the damping of the packing.

        Parameters
        ----------
        spring : float or "rigid"
            Stiffness for each disk of the layer, force / length; or the layer moves at the velocity of the far end.
        stages : sequence of (float, float)
            Velocities of the far end, each with its time; the last one goes on.
        signal, on : optional
            A further force along x, as of `undamped`.
        time_step : float, optional
            That of the deck part undamped.in by default.

        Yields
        ------
        Dynamics
            The dynamics, to be continued. All disks move, rattlers included: the layer comes past them.
        """
        packing = self.packing
        self._state.end_displacements()
        dynamics = Dynamics(self._decks, self._state, packing, None)
        with (
            dynamics.integrate(time_step, packing.drag_time, rattlers=True),
            dynamics.draw(spring, stages),
            ExitStack() as forces,
        ):
            if signal is not None:
                forces.enter_context(dynamics.apply_signal(signal, on, "top", self.communicator))
            dynamics.begin()
            yield dynamics

    def _load(self, packing: Packing) -> None:
        law = packing.law
        with shared_folder(self.communicator) as folder:
            data = folder / "packing.data"
            if self.communicator.rank == 0:
                data.write_text(data_file(packing))
            self.communicator.barrier()
            self._decks.variables(
                decks=decks_folder(), data=data, sides="f" if packing.box_length is None else "p", kn=law.kn, kt=law.kt,
                mu=law.mu, exponent=law.exponent, history=law.history, fx=packing.fx, fy=packing.fy,
                inertia=packing.inertia_factor, mass=float(packing.mass.min()),
                diameter=2 * float(packing.radius.min()), precision="compensated" if packing.compensated else "double",
            )  # fmt: skip
            if law.damped:
                self._decks.variables(cn=law.cn, ct=law.ct)
            self._decks.include("system.in")
        self._state.write_masses()
        if law.frictional or packing.compensated:
            self._state.begin_displacements()
            self._decks.command("run 0 post no")  # makes the fixes slips and low
            self.restore(packing)
        else:
            self._state.clear_forces()
