"""The dynamics of the disks in LAMMPS from rest, which `Engine.undamped` starts, with only the damping of the packing.

Friction may fall with velocity (weaken.in).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np

from ...analysis import Packing
from ...analysis.arrays import Floats
from .lammps_state import PERIODS_AWAY, LammpsState


class MotionState(NamedTuple):
    """Positions and velocities in the course of an undamped run: `position` (N, 2) with its low part in compensated
    arithmetic, `velocity` (N, 2), angular velocity `spin` (N,), and the friction coefficient at that moment."""

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
    """A run under way from a packing, in a LAMMPS in which deck parts have made the integrator and the forces; its
    forces at the start are computed. Friction may fall with the velocity of the upper layer, which a spring may draw.
    """

    def __init__(self, engine: LammpsState, packing: Packing, weakening: Weakening | None, drawn: bool) -> None:
        self._engine, self._packing, self._weakening, self._drawn = engine, packing, weakening, drawn
        self._lammps = engine._lammps
        self._weaken()
        engine.command("thermo 0")
        engine.command("run 0 post no")

    @property
    def time_step(self) -> float:
        """Time step, time."""
        return float(self._lammps.extract_global("dt"))

    @property
    def steps(self) -> int:
        """Time steps so far."""
        return self._engine.steps

    @property
    def drawn(self) -> tuple[float, float]:
        """Force of the spring on each disk of the layer that it draws, and displacement of the layer, length."""
        return float(self._lammps.extract_fix("drive", 0, 0)), float(self._lammps.extract_fix("drive", 0, 1, 0))

    def advance(self, steps: int) -> MotionState:
        """Go on by so many steps."""
        self._engine.command(f"run {steps} pre no post no")
        law = self._packing.law
        friction = law.mu if self._weakening is None else self._lammps.extract_fix("weaken", 0, 0)
        position, low, velocity = self._engine.motion()
        spin = velocity[:, 2] if law.frictional else np.zeros(len(velocity))
        return MotionState(position, low, velocity[:, :2], spin, float(friction))

    def work(self, steps: int) -> tuple[MotionState, float]:
        """The last steps of a run, and the work of all forces meanwhile by the trapezoidal rule (deck part work.in)."""
        engine = self._engine
        # windows of fix ave/time end at multiples of their length
        engine.command(f"reset_timestep {(engine.steps + steps - 1) // steps * steps}")
        engine.include("work.in", work_steps=steps)
        engine.command("run 0 post no")
        first = engine.number("power_now")
        motion = self.advance(steps)
        mean, last = float(self._lammps.extract_fix("power", 0, 0)), engine.number("power_now")
        return motion, (mean * steps + 0.5 * (first - last)) * self.time_step

    def halt_above(self, velocity: float) -> None:
        """End every run from here on once the upper layer is faster than this, length / time (deck part halt.in)."""
        self._engine.include("halt.in", halt_velocity=float(velocity))
        self._engine.command("run 0 post no")

    def state(self) -> dict[str, Floats]:
        """All that the run has at this moment, by LAMMPS's names, for `resume`."""
        periods = {PERIODS_AWAY: self._engine.gather(PERIODS_AWAY, 3)} if self._drawn else {}
        return self._engine.checkpoint() | periods

    def resume(self, step: int, state: Mapping[str, Floats]) -> None:
        """Continue from the state of a run at a step; the run may be that of another engine.

        Forces are computed anew. A run that is continued elsewhere is the same to the bit as one that resumes its own
        state at the same steps.
        """
        self._engine.write_checkpoint(state)
        self._weaken()  # anew: the fix would remember the friction that the last forces of this instance had
        self._engine.command(f"reset_timestep {step}")
        self._engine.command("run 0 post no")

    def _weaken(self) -> None:
        if self._weakening is not None:
            self._engine.include("weaken.in", **asdict(self._weakening))
