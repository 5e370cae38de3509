"""The dynamics of the disks in LAMMPS from rest, with only the damping of the packing.

`Engine.undamped` starts it: deck part undamped.in with a force on some disks (push.in), a signal (signal.in), and
friction that falls with velocity (weaken.in).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from ...analysis import Packing
from ...analysis.arrays import Floats
from ...analysis.files.signal_files import write_table
from ...analysis.responses.signals import Signal
from .decks import Decks
from .lammps_state import LammpsState
from .plain_file_names import shared_folder

PERIODS_AWAY = "image"
"""Name in the state of a drawn layer: by how many periods each disk has moved from its beginning."""


class MotionState(NamedTuple):
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

    def kinetic_energy(self, packing: Packing) -> float:
        """Kinetic energy of translation and rotation of a packing's disks, mass length^2 / time^2."""
        inertia = packing.inertia_factor * packing.mass * packing.radius**2
        return float(0.5 * (packing.mass @ np.sum(self.velocity**2, axis=1) + inertia @ self.spin**2))


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


class Dynamics:
    """A run under way.

    Parameters
    ----------
    decks : Decks
        LAMMPS.
    lammps_state : LammpsState
        That of its disks.
    packing : Packing
        From which the run starts. Rattlers are held still: nothing would stop them.
    weakening : Weakening, optional
        Friction that falls with the velocity of the upper layer; constant by default.
    """

    def __init__(self, decks: Decks, lammps_state: LammpsState, packing: Packing, weakening: Weakening | None) -> None:
        self._decks, self._state, self._packing, self._weakening = decks, lammps_state, packing, weakening
        self._drawn = False

    @contextmanager
    def integrate(self, time_step: float | None, drag_time: float | None, rattlers: bool = False) -> Iterator[None]:
        """Velocity Verlet with the damping of the packing (deck part undamped.in), of all disks or of all but rattlers.

        By default the time step is that of the deck part.
        """
        still = self._packing.rattlers[:0] if rattlers else self._packing.rattlers
        with ExitStack() as groups:
            mobile = groups.enter_context(self._decks.all_but(still)) if len(still) else "all"
            given = {"dt": time_step, "tau": drag_time}
            given = {name: value for name, value in given.items() if value is not None}
            self._decks.include("undamped.in", mobile=mobile, **given)
            yield
            self._decks.command("unfix move")
            self._decks.command("variable tau delete")
            if self._packing.law.damped:
                law = "${kn} ${kt} ${mu} exponent ${exponent} history ${history} ${compensated}"
                self._decks.command(f"pair_style mindlin/smooth {law}")
                if self._decks.lammps.has_id("fix", "floor"):  # `explain` takes the floor away
                    self._decks.command("fix_modify floor damping no")

    @contextmanager
    def push_cosine(self, amplitude: float, omega: float, target: str) -> Iterator[None]:
        """The force a cos(omega t) along x on each disk of a group (deck part push.in)."""
        self._decks.include("push.in", amplitude=amplitude, omega=omega, target=target)
        yield
        self._decks.command("unfix push")

    @contextmanager
    def apply_signal(self, signal: Signal, on: str, target: str, communicator: MPI.Comm) -> Iterator[None]:
        """A signal (deck part signal.in), as a table that all ranks can read."""
        with shared_folder(communicator) as folder:
            table = folder / "signal.txt"
            if communicator.rank == 0:
                write_table(signal, table)
            communicator.barrier()
            self._decks.include("signal.in", signal=table, scale=1.0, stretch=1.0, on=on, target=target)
        yield
        self._decks.command("unfix force")

    @contextmanager
    def draw(self, spring: float | str, stages: Sequence[tuple[float, float]]) -> Iterator[None]:
        """A spring whose far end moves draws the upper layer (deck part spring.in).

        Parameters
        ----------
        spring : float or "rigid"
            Stiffness for each disk of the layer, force / length.
        stages : sequence of (float, float)
            Velocities of the far end, each with its time; one alone goes on for ever.
        """
        if len(stages) == 1:
            self._decks.include("spring.in", spring=spring, velocity=stages[0][0])
        else:
            words = " ".join(f"{velocity!r} {time!r}" for velocity, time in stages)
            self._decks.command(f'variable protocol index "{words}"')
            self._decks.include("spring.in", spring=spring)
            self._decks.command("variable protocol delete")
        self._drawn = True
        yield
        self._drawn = False
        self._decks.command("unfix drive")

    def stop_strays(self) -> None:
        """Stop the disks of the bed that were squeezed out above the layer (deck part stray.in)."""
        self._decks.include("stray.in")

    @property
    def time_step(self) -> float:
        """Time step, time."""
        return float(self._decks.lammps.extract_global("dt"))

    @property
    def drawn(self) -> tuple[float, float]:
        """Force of the spring on each disk of the layer that it draws, and displacement of the layer, length."""
        fix = self._decks.lammps.extract_fix
        return float(fix("drive", 0, 0)), float(fix("drive", 0, 1, 0))

    def begin(self) -> None:
        """Compute the forces at the start, for `advance`."""
        self._weaken()
        self._decks.command("thermo 0")
        self._decks.command("run 0 post no")

    @property
    def steps(self) -> int:
        """Time steps so far."""
        return self._decks.steps

    def advance(self, steps: int) -> MotionState:
        """Go on by so many steps."""
        self._decks.command(f"run {steps} pre no post no")
        law = self._packing.law
        friction = law.mu if self._weakening is None else self._decks.lammps.extract_fix("weaken", 0, 0)
        position, low, velocity = self._state.motion()
        spin = velocity[:, 2] if law.frictional else np.zeros(len(velocity))
        return MotionState(position, low, velocity[:, :2], spin, float(friction))

    def work(self, steps: int) -> tuple[MotionState, float]:
        """Go on by so many steps, and the work of all forces meanwhile by the trapezoidal rule (deck part work.in)."""
        # windows of fix ave/time end at multiples of their length
        self._decks.command(f"reset_timestep {(self.steps + steps - 1) // steps * steps}")
        self._decks.include("work.in", work_steps=steps)
        self._decks.command("run 0 post no")
        first = self._decks.number("power_now")
        motion = self.advance(steps)
        last = self._decks.number("power_now")
        lammps = self._decks.lammps
        mean = float(lammps.extract_fix("power", 0, 0))
        for command in ("unfix power", "uncompute power", "variable power delete"):
            self._decks.command(command)
        if self._packing.law.frictional:
            self._decks.command("uncompute work_spin")
        return motion, (mean * steps + 0.5 * (first - last)) * float(lammps.extract_global("dt"))

    @contextmanager
    def halt_above(self, velocity: float) -> Iterator[None]:
        """End the run once the upper layer is faster than this, length / time (deck part halt.in)."""
        self._decks.include("halt.in", halt_velocity=float(velocity))
        self._decks.command("run 0 post no")
        yield
        self._decks.command("unfix halt")
        self._decks.command("uncompute halt_velocity")

    def state(self) -> dict[str, Floats]:
        """All that the run has at this moment, by LAMMPS's names, for `resume`."""
        periods = {PERIODS_AWAY: self._state.periods()} if self._drawn else {}
        return self._state.checkpoint() | periods

    def resume(self, step: int, state: Mapping[str, Floats]) -> None:
        """Continue from the state of a run at a step; the run may be that of another engine.

        Forces are computed anew. A run that is continued elsewhere is the same to the bit as one that resumes its own
        state at the same steps.
        """
        self._state.write_checkpoint({name: values for name, values in state.items() if name != PERIODS_AWAY})
        if PERIODS_AWAY in state:
            self._state.write_periods(state[PERIODS_AWAY])
        self._weaken()  # anew: the fix would remember the friction that the last forces of this instance had
        self._decks.command(f"reset_timestep {step}")
        self._decks.command("run 0 post no")

    def _weaken(self) -> None:
        if self._weakening is not None:
            self._decks.include("weaken.in", **asdict(self._weakening))
