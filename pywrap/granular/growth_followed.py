"""Where a motion that grows ends: LAMMPS's own motion, once contacts have changed.

LAMMPS starts with a small random push, and without drag of its own. Its motion is looked at in windows in which linear
motion grows by `FOLDS_OF_WINDOW` e-folds:

- it *flows* if the root of D passes `FLOWS_FROM` of the mean diameter: particles leave their neighbours;
- it *vibrates* if D has stayed the same in `SAME_WINDOWS` windows; a packing that has come to rest counts as this;
- it *creeps* if D rises on, window by window, in a vibration that carries the packing along.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ...analysis import Configuration, Stability, stable_timestep
from ...analysis.motion.pushes import random_pushes
from ...analysis.progress import report_progress
from .lammps_arrays import owned_array, rows_of, set_velocity
from .look_in_a_copy import in_a_copy, quieten, require_instance

STEP_SHARE, PUSH_OVER_CHANGE = 0.1, 0.1
"""Time step, as a share of the largest stable one; and displacement by the push, as a share of that at which the first
contact changes."""

FOLDS_OF_WINDOW, LOOKS_OF_WINDOW, LEAST_WINDOW = 6.0, 60, 300.0
"""Growth of D in a window, in e-folds, as long as the motion is linear; displacements that a window has; and its length
in stable time steps, at the least: ten periods of a slow mode."""

MOST_STEPS_OF_END = 4_000_000
"""Time steps that are followed: some minutes for fifty particles."""

SAME_WINDOWS, SAME_SHARE, FLOWS_FROM = 4, 0.15, 0.1
"""Windows whose largest D differ by less than this share, of a motion that goes on as it is; and the root of D over the
mean diameter from which on it flows."""

NO_LAMMPS = (
    "what LAMMPS does then is not followed: this packing has no LAMMPS behind it; give a run.h5, or a deck "
    "(`faultgouge stability DECK.in --follow`), or the instance (`stability(packing, follow=lmp)`)"
)
"""Where a file holds particles and contacts alone."""


def follow_by(packing: Any, lmp: Any = None) -> Callable[[Stability], Stability]:
    """What adds to a verdict where the motion that grows ends: `Stability.follow`.

    The plugin moves a Packing. A Configuration needs the instance `lmp` of which it was taken, which moves in a copy of
    the process, and stays as it is.
    """

    c = packing.configuration

    def in_lammps(told: Stability, step: float) -> dict[str, Any]:
        lmp.command("log none")
        quieten(lmp, drag=True)
        lmp.command(f"timestep {step:.17g}")
        return _ends(told, c, lmp, step)

    def follow(told: Stability) -> Stability:
        step = STEP_SHARE * float(stable_timestep(packing))
        if lmp is not None:
            require_instance(lmp, "stability")
            return replace(told, follow=in_a_copy(partial(in_lammps, told, step)))
        if packing is c:
            return replace(told, remarks=(*told.remarks, NO_LAMMPS))
        from mpi4py import MPI

        from ..lammps.engine import Engine

        with Engine(packing, MPI.COMM_SELF) as engine, engine.undamped(step):
            return replace(told, follow=_ends(told, c, engine.lammps, step))

    return follow


def _ends(told: Stability, c: Configuration, lmp: Any, step: float) -> dict[str, Any]:
    """Where the motion of an instance ends, and how: `Stability.follow`."""
    diameter, rate, d = 2 * float(c.radius.mean()), told.growth_rate, c.dimension
    low, high, *_ = lmp.extract_box()
    width = np.where(c.periodic, np.subtract(high, low), np.inf)[:d]
    last = owned_array(lmp, "x")[rows_of(lmp, c), :d].copy()
    moved, moves = np.zeros_like(last), ~np.isin(np.arange(len(c)), c.rattlers)
    changes = told.first_change or (1e-3 * float(c.contacts.overlap.max(initial=diameter))) ** 2
    push = random_pushes(c, 1)[:, 0].reshape(c.axes, len(c)) * moves
    # a push v displaces by v over a frequency, a tenth of the largest
    set_velocity(lmp, c, (PUSH_OVER_CHANGE * np.sqrt(changes) * 0.1 * 2 * STEP_SHARE / step * push).ravel())
    window = max(FOLDS_OF_WINDOW / rate, LEAST_WINDOW * step / STEP_SHARE)
    count, largest = max(round(window / step / LOOKS_OF_WINDOW), 1), list[float]()
    for _ in range(max(MOST_STEPS_OF_END // (count * LOOKS_OF_WINDOW), 3 * SAME_WINDOWS)):
        seen = []
        for _ in range(LOOKS_OF_WINDOW):
            lmp.command(f"run {count} post no")
            now = owned_array(lmp, "x")[rows_of(lmp, c), :d].copy()
            moved += now - last - np.where(np.isfinite(width), width, 0.0) * np.round((now - last) / width)
            last = now
            seen.append(float(np.sum(moved[moves] ** 2) / len(c)))
            if not seen[-1] < (FLOWS_FROM * diameter) ** 2:
                return {"displacement": float(np.sqrt(seen[-1])), "ends": "flows"}
        largest.append(max(seen))
        report_progress(f"LAMMPS goes on: displacement {np.sqrt(largest[-1]):.3g}")
        late = largest[-SAME_WINDOWS:]
        same = len(largest) > SAME_WINDOWS and max(late) - min(late) < SAME_SHARE * max(late)
        if same and late[-1] > PUSH_OVER_CHANGE * changes:
            return {"displacement": float(np.sqrt(max(late))), "ends": "vibrates"}
    rises = largest[-1] > (1 + SAME_SHARE) * largest[-SAME_WINDOWS]
    return {"displacement": float(np.sqrt(largest[-1])), "ends": "creeps" if rises else "vibrates"}
