r"""Remote triggering: a linearly stable packing just below its onset that erupts once friction weakens with velocity.

Between the onsets of two friction coefficients, mu mu_ss and mu, a packing is stable with the larger and unstable with
the smaller one. Three undamped runs from the same equilibrium show what a minute perturbation a cos(omega t) does
there: nothing without it; a small bounded response with it; and an eruption where it sets the upper layer into motion
that is fast enough to weaken the friction, mu(v), of all contacts.

A rise of D alone is no instability. As soon as mu(v) has fallen, every contact that carries tangential load carries
less of it, and the equilibrium is elsewhere: D *jumps* to the square of that distance, in a packing that is stable with
the weakened friction as well. A control run says how far: mu(v) at a force as far below the onset of the weakened
friction as the run is above it. What tells an instability from the jump is that D *grows* on after it.

Closer and closer to the onset, the response of the pair that is about to coalesce grows as
:math:`\epsilon^{-1/2}`, and damping cuts it off where its time tau falls below :math:`\tau_d`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from ...analysis import RunFile, fit_growth
from ...analysis.motion.power_law import PowerLaw, fit_power_law
from ...analysis.motion.response import Response, layer_force, linear_response
from ...analysis.onset.pair_form import PairForm, pair_forms
from ...analysis.packing.packing import Floats
from ...analysis.spectrum.normal_form import LEAST_CROSSOVER
from ...pywrap import Engine, Equilibrium, Sample, Scene
from ...pywrap.lammps.dynamics import Weakening
from ...pywrap.onset.undamped import OnsetRun
from ...pywrap.runs.path import next_equilibrium
from ...pywrap.runs.undamped import perturb, time_step, weakening_of
from ...pywrap.scenes.refusals import needed
from ...pywrap.scenes.sections import Friction
from .forecast import JUMP_SHARE, Forecast, forecast

EARLY = 2000
"""Samples of each run at times that grow geometrically: the layer passes the velocities over which the friction falls
early in a run, within a small share of its length."""

FALL = 20_000
"""The same of the run whose friction falls: within some twenty time steps after a thousand, and this many samples take
each step up to there."""

SENSITIVE = 1e-2
"""Largest distance 1 - F_x/F_x^c at which the response is compared with its power law: further off, the pair is no
longer the whole of it."""

GROWTH_FACTOR = 2.0
"""Factor from the jump to the largest D from which on D has grown. Without an instability, the phases in which many
modes happen to meet change the maximum by some ten percent."""

ABOVE_NOISE = 1e3
"""How much stronger the perturbation is that is compared with the linear response: a million times in D."""

COMPARED_TIME = 50.0
"""Length of that run, time: a few hundred periods of the pair."""


Series = dict[str, Floats]
"""What a run yields, one array a field of `Sample`, shape (T,)."""


@dataclass(frozen=True, eq=False)
class Triggering:
    """Three undamped runs from one equilibrium.

    Attributes
    ----------
    scene : Scene
        With [perturb] and [friction].
    start : Equilibrium
        Linearly stable.
    weakening : Weakening
        mu(v), with v_0 the largest velocity of the unperturbed run.
    runs : dict
        By name: unperturbed; perturbed; erupting, with mu(v) as well; control, the same at a force where the packing
        is stable with the weakened friction, too, if one is known; strong, with a perturbation `ABOVE_NOISE` as
        strong, for a shorter time: its D stands out of the noise of doubles and is compared with the linear response.
    response : Response
        Of the linearised packing to that perturbation, time step included.
    foreseen : Forecast
        Of the run with mu(v), by linear theory.
    sensitive : Sensitivity
        The response on the way to the onset.
    """

    scene: Scene
    start: Equilibrium
    weakening: Weakening
    runs: dict[str, Series]
    response: Response
    foreseen: Forecast
    sensitive: Sensitivity

    @property
    def crossing(self) -> float | None:
        """The time at which the layer of the run with mu(v) first exceeds v_0, or None."""
        run = self.runs["erupting"]
        faster = np.abs(run["layer_velocity"]) > self.weakening.v0
        return float(run["time"][np.argmax(faster)]) if faster.any() else None


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Response of the pair that is about to coalesce, over the distance from the onset.

    Attributes
    ----------
    distance : ndarray, shape (n,)
        1 - F_x/F_x^c.
    pairs : tuple of PairForm
        The pair at these distances.
    fit : PowerLaw
        Of the undamped amplitude over the distance.
    """

    distance: Floats
    pairs: tuple[PairForm, ...]
    fit: PowerLaw

    @property
    def amplitude(self) -> Floats:
        """Undamped amplitudes in units of the start, shape (n,)."""
        return np.array([pair.amplitude() for pair in self.pairs])

    @property
    def near(self) -> tuple[PairForm, ...]:
        """The pairs of which damping may take half of the response."""
        return tuple(pair for pair in self.pairs if pair.amplitude() >= LEAST_CROSSOVER)


def series_of(samples: Iterable[Sample]) -> Series:
    """What a run yields, as arrays of shape (T,)."""
    rows = [vars(sample) for sample in samples]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def largest(run: Series) -> float:
    """The largest D of a run, length^2."""
    return float(run["msd"].max())


def calibrated(friction: Friction, unperturbed: Series) -> Weakening:
    """mu(v) with the v_0 of the scene, or with the largest velocity of the layer in an unperturbed run."""
    v0 = np.abs(unperturbed["layer_velocity"]).max() if isinstance(friction.v0, str) else friction.v0
    return weakening_of(friction, float(v0))


def jump(run: Series) -> float:
    """The largest D in the first `JUMP_SHARE` of a run, length^2."""
    return float(run["msd"][run["time"] <= JUMP_SHARE * run["time"][-1]].max())


def trigger(scene: Scene, start: Equilibrium, below: Equilibrium | None, ramp: OnsetRun, path: Path) -> Triggering:
    """The runs, written to run.h5 as they end, and the linear response beside the last.

    Parameters
    ----------
    scene : Scene
        With [perturb], the perturbation and the length of the runs, and [friction], mu(v).
    start : Equilibrium
        At perturb.fx.
    below : Equilibrium or None
        Where the control starts.
    ramp : OnsetRun
        Of the packing, with its first onset.
    path : Path
        run.h5 of the ramp; gets the series unperturbed, perturbed, erupting, control and strong.
    """
    settings, friction = needed(scene.perturb, "perturb"), needed(scene.friction, "friction")
    runs: dict[str, Series] = {}

    def run(
        name: str,
        amplitude: float,
        weakening: Weakening | None = None,
        time: float = settings.time,
        start: Equilibrium = start,
        early: int = EARLY,
    ) -> None:
        one = settings.model_copy(update={"amplitude": amplitude, "time": time})
        series = series_of(perturb(scene.model_copy(update={"perturb": one}), start, early=early, weakening=weakening))
        with RunFile(path, "a") as file:
            file.append_series(name, **series)
        runs[name] = series

    run("unperturbed", 0.0, early=200)  # as `perturb` calibrates v_0
    weakening = calibrated(friction, runs["unperturbed"])
    run("perturbed", settings.amplitude)
    run("erupting", settings.amplitude, weakening, early=FALL)
    if below is not None:
        run("control", settings.amplitude, weakening, start=below)
    packing, amplitude = start.packing, ABOVE_NOISE * settings.amplitude
    run("strong", amplitude, time=min(settings.time, COMPARED_TIME))
    response = linear_response(
        packing,
        runs["strong"]["time"],
        force=layer_force(packing, amplitude),
        omega=settings.omega or 0.0,
        dt=time_step(packing, settings.time_step),
    )
    foreseen = forecast(start, packing.law.mu * friction.mu_ss, settings.time)
    return Triggering(scene, start, weakening, runs, response, foreseen, sensitivity(ramp))


def equilibrium_at(
    scene: Scene, path: Sequence[Equilibrium], fx: float, communicator: MPI.Comm | None = None
) -> Equilibrium:
    """The equilibrium at a load, from the last one of a path that is not beyond."""
    below = max((each for each in path if each.fx <= fx), key=lambda each: each.fx)
    with Engine(below.packing, communicator) as engine:
        return below if below.fx == fx else next_equilibrium(engine, below, fx, scene)


def sensitivity(run: OnsetRun) -> Sensitivity:
    """The pair of the first onset, at the equilibria that the run has just below it."""
    first = run.onset.windows[0]
    below = sorted((fx for fx in run.between if fx < first.fx_onset), reverse=True)
    # nearer than a hundred times the onset's own error, the distance is not known
    nearest, furthest = 100 * first.error, SENSITIVE * first.fx_onset
    below = [fx for fx in below if nearest < first.fx_onset - fx < furthest]
    pairs = tuple(pair_forms([run.between[fx] for fx in below], first.eigenvalue))
    distance = 1 - np.array(below) / first.fx_onset
    return Sensitivity(distance, pairs, fit_power_law(distance, [pair.amplitude() for pair in pairs]))


def summary(triggering: Triggering) -> dict[str, Any]:
    """Numbers for summary.json."""
    sensitive, runs = triggering.sensitive, triggering.runs
    erupting, strong = runs["erupting"], runs["strong"]["msd"]
    most = {name: largest(runs[name]) for name in ("unperturbed", "perturbed", "erupting")}
    growth = float(np.log10(most["erupting"] / jump(erupting)))
    return {
        "fx": triggering.start.fx,
        "v0": triggering.weakening.v0,
        "v_ss": triggering.weakening.v_ss,
        "largest_D": most,
        "rise_in_decades": float(np.log10(most["erupting"] / most["perturbed"])),
        "jump": jump(erupting),
        "grows_after_the_jump": bool(growth >= np.log10(GROWTH_FACTOR)),
        "growth_in_decades": growth,
        "growth_after_the_jump": _fitted(erupting),
        "forecast": asdict(triggering.foreseen),
        "largest_D_of_the_control": largest(runs["control"]) if "control" in runs else None,
        "linear_response_deviation": float(np.abs(strong - triggering.response.msd).max() / strong.max()),
        "smallest_mu": float(erupting["friction"].min()),
        "amplitude_exponent": sensitive.fit.exponent,
        "amplitude_exponent_error": sensitive.fit.error,
        "distances": [float(sensitive.distance.min()), float(sensitive.distance.max())],
        "half_gain_time_over_tau_d": [pair.half_gain_time() / pair.tau_d for pair in sensitive.near],
    }


def _fitted(run: Series) -> dict[str, float] | None:
    """Growth of D from ten times the jump to a tenth of its largest value; None if there is no decade between."""
    try:
        return asdict(fit_growth(run["time"], run["msd"], 10 * jump(run), 0.1 * largest(run)))
    except ValueError:
        return None
