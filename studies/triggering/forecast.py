"""Prediction of linear theory, before any run, for a packing with weakened friction.

If friction falls from mu to a smaller value, the disks do not move at once, but the tangential forces change: the
packing is out of balance by f, and moves as :math:`M \\ddot q + K q = f` from rest, with f and K those of the smaller
mu. This motion contains both the jump and, if K has complex eigenvalues, the growth after the jump. It holds while
displacements are small against overlaps.

`choose_seed` selects, from a list of seeds, packings with visible growth. It makes no run.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ...analysis import NoEquilibriumError, OnsetError, spectrum
from ...analysis.motion.response import LinearMotion
from ...pywrap import Equilibrium, Scene, SceneError, reach
from ...pywrap.onset.undamped import onset_run
from ...pywrap.scenes.validation import require_section
from ..packing_tools import with_seed

JUMP_SHARE = 0.05
"""Share of the run with mu(v) that shows the jump, from the moment on at which friction weakens: 10 of 200 time units,
where the slowest modes of 100 disks have periods of 6, and the fastest pairs have just begun to stand out."""

SAMPLES = 2000
"""Times at which the linear motion is looked at."""

LINEAR = 0.1
"""Root of D, in units of the smallest overlap, up to which the motion may be linear: of eight runs that were made
before the rule, D stopped at 0.7 to 31 times the square of that."""

BELOW = 1e-3
"""How far below the onset the load of the rule is, relative."""

LEAST_ROOM = 4.5
"""Decades of D, from the jump to the end of linear motion, that the rule asks for."""

LEAST_GROWTH = 4.0
"""Decades by which D grows in the linear motion, from the jump to the end of the run, that the rule asks for."""


@dataclass(frozen=True)
class Forecast:
    """The linear motion after friction has weakened.

    Attributes
    ----------
    jump : float
        Largest D within the window of the jump, length^2.
    growth : float
        Decades from the jump to the largest D of the whole run; without bound, where a pair grows.
    room : float
        Decades from the jump to the D at which the motion ceases to be linear.
    rate : float
        Growth rate of D of the fastest motion, 1 / time; 0 if none grows.
    """

    jump: float
    growth: float
    room: float
    rate: float


def forecast(start: Equilibrium, mu: float, time: float, window: float | None = None) -> Forecast:
    """Jump and growth of an equilibrium whose friction coefficient becomes `mu`, in the `time` that follows.

    The jump is what happens within `window`, by default `JUMP_SHARE` of the time.
    """
    packing = start.packing
    weak = replace(packing, law=replace(packing.law, mu=mu))
    times = time * np.arange(1, SAMPLES + 1) / SAMPLES
    with np.errstate(over="ignore"):
        msd = LinearMotion.of(weak).response(times, force=weak.net_force - packing.net_force).msd
    msd = np.fmin(msd, np.finfo(float).max)
    first = float(msd[times <= (JUMP_SHARE * time if window is None else window)].max(initial=msd[0]))
    return Forecast(
        jump=first,
        growth=float(np.log10(msd.max() / first)),
        room=float(np.log10((LINEAR * packing.smallest_overlap) ** 2 / first)),
        rate=spectrum(weak).growth_rate(),
    )


def choose_seed(scene: Scene, seeds: Iterable[int]) -> Iterator[dict[str, Any]]:
    """Try seeds until one is found whose packing erupts, by the rule; the last one that is yielded is it.

    The load is a thousandth below the first onset. The rule: with the weakened friction, D grows by `LEAST_GROWTH`
    decades after its jump in the time of the scene's run, and has `LEAST_ROOM` decades for that, by the linear theory;
    and the packing has an onset for the weakened friction at a lower load, below which the control is.

    Parameters
    ----------
    scene : Scene
        With [ramp], [perturb] for the time, and [friction]; its seed and fx do not matter.
    seeds : iterable of int
        In the order in which they are tried.

    Yields
    ------
    dict
        seed; says : why it is not the one, empty for the one that is; fx : the load, None if there is no onset;
        forecast : of a run there, as a dict, or None.
    """
    for seed in seeds:
        found = _try_seed(with_seed(scene, seed), seed)
        yield found
        if not found["says"]:
            return


def _try_seed(scene: Scene, seed: int) -> dict[str, Any]:
    friction, time = require_section(scene.friction, "friction"), require_section(scene.perturb, "perturb").time
    mu = scene.law.mus[0]
    try:
        fx = float(f"{(1 - BELOW) * onset_run(scene, mu).onset.fx_c:.5g}")
        *_, start = reach(scene, fx)
        foreseen = forecast(start, mu * friction.mu_ss, time)
        says = _falls_short(foreseen)
        if not says and onset_run(scene, mu * friction.mu_ss).onset.fx_c >= fx:
            says = "the onset of the weakened friction is not below it"
    except (OnsetError, NoEquilibriumError, SceneError) as error:
        return {"seed": seed, "says": str(error), "fx": None, "forecast": None}
    return {"seed": seed, "says": says, "fx": fx, "forecast": asdict(foreseen)}


def _falls_short(foreseen: Forecast) -> str:
    if foreseen.room < LEAST_ROOM:
        return f"a jump {foreseen.room:.1f} decades below the end of linear motion"
    if foreseen.growth < LEAST_GROWTH:
        return f"a growth by {foreseen.growth:.1f} decades"
    return ""
