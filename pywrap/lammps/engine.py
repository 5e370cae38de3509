"""A LAMMPS instance that contains one packing.

The instance is set up by the deck part ``system.in``, the same file that ``lmp -in`` runs, and driven by its companions
(:mod:`~faultgouge.pywrap.lammps.decks`). A `Packing` is transferred into LAMMPS and back, bitwise
(:mod:`~faultgouge.pywrap.lammps.lammps_state`). All methods are collective over the ranks of the communicator, and
every rank sees the whole packing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike

from ...analysis import Packing
from ...analysis.files.formats.lammps_data import box_heights
from ...analysis.files.signal_files import write_table
from ...analysis.responses.signals import Signal
from .data_file import data_file, sort_contacts
from .dynamics import Dynamics, Weakening
from .instance import lammps_instance
from .lammps_state import LammpsState
from .plain_file_names import decks_folder, move_files, shared_folder
from .trial_state import Trial

STEPS_A_LOOK = 1000
"""Time steps between two looks at the forces."""

MOST_STEPS_OF_DYNAMICS = 10_000_000
"""Time steps of dynamics, unless it is told otherwise."""


@dataclass(frozen=True)
class Relaxation:
    """How a relaxation ended: the largest force, with torque over radius, on a disk, whether the tolerance was reached
    ("yes"), or the rounding of the coordinates ("floor"), or neither ("no"), and the time steps, that is force
    evaluations."""

    residual: float
    status: str
    steps: int


class Engine(LammpsState):
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
        self.communicator, law = communicator or MPI.COMM_WORLD, packing.law
        super().__init__(lammps_instance(self.communicator, log), packing)
        self.kept: Trial | None = None  # the trial at which Newton's method has ended
        data = data_file(packing)
        with shared_folder(self.communicator, lambda folder: (folder / "data").write_text(data)) as folder:
            self.include(
                "system.in", decks=decks_folder(), data=folder / "data",
                sides="f" if packing.box_length is None else "p", kn=law.kn, kt=law.kt, mu=law.mu,
                exponent=law.exponent, history=law.history, fx=packing.fx, fy=packing.fy,
                inertia=packing.inertia_factor, mass=float(packing.mass.min()),
                diameter=2 * float(packing.radius.min()), precision="compensated" if packing.compensated else "double",
                cn=law.cn if law.damped else None, ct=law.ct if law.damped else None,
            )  # fmt: skip
        self.scatter("rmass", packing.mass)
        if law.frictional or packing.compensated:
            self.begin_displacements()
            self.command("run 0 post no")  # makes the fixes slips and low
            self.restore(packing)
        else:
            self.scatter("f", 0.0 * self.gather("x", 3))  # until its first run LAMMPS leaves them uninitialised

    def __enter__(self) -> Engine:
        return self

    def __exit__(self, *error: object) -> None:
        self._lammps.close()

    @property
    def lammps(self) -> Any:
        """The LAMMPS instance, for its data and for commands that the driver does not cover."""
        self.end_displacements()
        return self._lammps

    @property
    def packing(self) -> Packing:
        """The present configuration, with its slips and its load."""
        return self.read().packing

    def restore(self, packing: Packing) -> None:
        """Restore the disks, slips and load of a packing bitwise."""
        self.end_displacements()
        self.write(packing)
        self.set_fx(packing.fx)

    def trial_of(self, packing: Packing) -> Trial:
        """The trial that was `kept` with this packing; without such a trial one of the packing, forces unknown."""
        if self.kept is None or self.kept.packing is not packing:
            self.kept = Trial.of(packing)
        return self.kept

    def settle(
        self,
        force_tolerance: float,
        start: Packing | None = None,
        gather: float = 1.0,
        viscosity: float | None = None,
        steps: int = MOST_STEPS_OF_DYNAMICS,
    ) -> None:
        """Settle a loose packing under the load by viscously damped dynamics (deck parts gather.in, bed.in, damp.in).

        Parameters
        ----------
        force_tolerance : float
            Largest force on a disk.
        start : Packing, optional
            A packing at rest from which damped dynamics go on; by default a bed is laid first, of the present disks.
        gather : float
            Fraction of its height to which the loose packing is first brought down evenly; 1 for not at all.
        viscosity : float, optional
            Viscosity of the damping, mass / time; by default that of the decks.
        steps : int
            Largest number of time steps in each stage.
        """
        if start is None:
            self.end_displacements()
        else:
            self.restore(start)
        chunks = {"chunk": STEPS_A_LOOK, "chunks": steps // STEPS_A_LOOK}
        self.variables(force_tolerance=force_tolerance, viscosity=viscosity, **chunks)
        if gather < 1:
            self.include("gather.in", gather=gather)
        self.include("bed.in" if start is None else "damp.in")

    def relax(
        self,
        force_tolerance: float,
        damping: float = 1.0,
        time_step: float | None = None,
        chunk: int = STEPS_A_LOOK,
        steps: int = MOST_STEPS_OF_DYNAMICS,
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
        self.end_displacements()
        start, limits = self.steps, {"force_tolerance": force_tolerance, "chunk": chunk, "chunks": steps // chunk}
        self.include("relax.in", damping=damping, relax_step=time_step, **limits)
        found = Relaxation(self.number("residual"), self._lammps.extract_variable("relaxed"), self.steps - start)
        self.evaluations += found.steps
        return found

    def dump(self, stem: Path) -> None:
        """Write the configuration as LAMMPS dumps in full precision (deck part write.in): STEM.disks and others.

        The output depends only on the configuration, not on its history.
        """
        bottom, top = box_heights(self.packing)
        self.end_displacements()
        self.command(f"change_box all y final {bottom!r} {top!r} units box")
        self.command("reset_timestep 0")
        with shared_folder(self.communicator) as folder:
            self.include("write.in", name=folder / "dump", fx=self.fx)
            if self.communicator.rank == 0:
                sort_contacts(folder / "dump.contacts")
                move_files(folder, stem)

    @contextmanager
    def undamped(
        self,
        time_step: float | None = None,
        amplitude: float = 0.0,
        omega: float = 0.0,
        target: ArrayLike | None = None,
        weakening: Weakening | None = None,
        signal: Signal | None = None,
        on: Literal["layer", "floor"] = "layer",
        drag_time: float | None = None,
        spring: float | Literal["rigid"] | None = None,
        stages: Sequence[tuple[float, float]] = (),
    ) -> Iterator[Dynamics]:
        """Run dynamics from rest, with only the damping of the packing (deck part undamped.in).

        Parameters
        ----------
        time_step : float, optional
            Time step of velocity Verlet, time; by default that of the deck part.
        amplitude : float
            Amplitude a of the force a cos(omega t) along x on each disk of the target (push.in); 0 for none.
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
        spring : float or "rigid", optional
            A spring whose far end moves draws the upper layer (spring.in): its stiffness for each disk of the layer,
            force / length; or the layer moves at the velocity of the far end.
        stages : sequence of (float, float)
            Velocities of the far end, each with its time; the last one goes on.

        Yields
        ------
        Dynamics
            The dynamics, to be continued. Rattlers are held fixed, because nothing would stop them; a layer that a
            spring draws comes past them, and they move.
        """
        packing, pushed, groups = self.packing, "top", {}
        self.end_displacements()
        if spring is None and len(packing.rattlers):
            groups["still"] = packing.rattlers
        if target is not None:
            pushed, groups["pushed"] = "pushed", np.asarray(target)
        for name, disks in groups.items():
            self.command(f"group {name} id {' '.join(map(str, disks + 1))}")
        undo = [f"group {name} delete" for name in groups]  # after which the engine is as before, the last one first
        if mobile := "mobile" * ("still" in groups):
            self.command("group mobile subtract all still")
            undo.append("group mobile delete")
        drag_time = packing.drag_time if drag_time is None else drag_time
        self.include("undamped.in", mobile=mobile or "all", dt=time_step, tau=drag_time)
        if packing.law.damped:
            law = "${kn} ${kt} ${mu} exponent ${exponent} history ${history} ${compensated}"
            # `explain` takes the floor away
            undo.append('if "$(is_defined(fix,floor))" then "fix_modify floor damping no"')
            undo.append(f"pair_style mindlin/smooth {law}")
        undo += ["variable tau delete", "unfix move"]
        if spring is not None:
            one, several = stages[0][0], " ".join(f"{velocity!r} {time!r}" for velocity, time in stages)
            self.include("spring.in", spring=spring, velocity=one, protocol=several if len(stages) > 1 else None)
            undo.append("unfix drive")
        if amplitude != 0:
            self.include("push.in", amplitude=amplitude, omega=omega, target=pushed)
            undo.append("unfix push")
        if signal is not None:
            with shared_folder(self.communicator, lambda folder: write_table(signal, folder / "signal")) as folder:
                self.include("signal.in", signal=folder / "signal", scale=1.0, stretch=1.0, on=on, target=pushed)
            undo.append("unfix force")
        yield Dynamics(self, packing, weakening, drawn=spring is not None)
        for command in reversed(undo):
            self.command(command)
