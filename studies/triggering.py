r"""Remote triggering: a linearly stable packing just below its onset that erupts once friction weakens with velocity.

Between the onsets of two friction coefficients, mu mu_ss and mu, a packing is stable with the larger coefficient and
unstable with the smaller. Three undamped runs from the same equilibrium show the effect of a minute perturbation a
cos(omega t). Without the perturbation nothing happens. With the perturbation there is a small bounded response. If the
perturbation makes the upper layer move fast enough to weaken the friction, mu(v), of all contacts, there is an
eruption.

A rise of D alone does not prove an instability. As soon as mu(v) falls, the tangential force of every loaded contact
falls, and the equilibrium shifts: D *jumps* to the square of this shift, even in a packing that is stable with the
weakened friction. A control run shows how far: mu(v) at a force as far below the onset of the weakened friction as the
run is above it. The jump counts from the moment at which the layer exceeds v_0: before, nothing has weakened. In an
instability, unlike a mere jump, D continues to *grow*, beyond the jump that linear theory predicts, at a fitted rate
that agrees with that of the spectrum with the weakened friction (:func:`judge`).

A perturbation below the rounding noise triggers nothing: the layer then exceeds v_0 by chance, or because v_0 is that
noise.

Towards the onset, the response of the pair that is about to coalesce grows as :math:`\epsilon^{-1/2}`, and damping
limits the response if its time tau is below :math:`\tau_d`.

**The forecast.** If friction falls from mu to a smaller value, the disks do not move at once, but the tangential forces
change: the packing is out of balance by f, and moves as :math:`M \ddot q + K q = f` from rest, with f and K those of
the smaller mu. This motion contains both the jump and, if K has complex eigenvalues, the growth after the jump. It
holds while displacements are small against overlaps (:func:`forecast`).

**The task of a sweep.** The packing is ramped for every friction coefficient of the scene, and for the weakened
friction :math:`\mu \mu_{ss}` (without [friction] in the scene, for the last coefficient), each as in
:mod:`~faultgouge.studies.onset`. Weakening lowers the onset if :math:`F_x^c(\mu \mu_{ss}) < F_x^c(\mu)`, which may be
known even if one of the two is censored. If both are known and there is a window between them, undamped runs from its
middle show whether the packing erupts, beside the control. The *rise* is the distance in decades between the largest D
of the perturbed run and of the one with mu(v). The pair may also be real again at the middle of the window, or grow too
slowly for the length of the run; the rate is therefore stored as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from mpi4py import MPI

from ..analysis import FaultgougeError, Growth, Onset, Packing, RunFile, fit_growth, spectrum
from ..analysis.arrays import Floats
from ..analysis.files.atomic_write import write_json
from ..analysis.responses.growth_of_run import JUMP_SHARE, LINEAR_RANGE
from ..analysis.responses.normal_form import LEAST_CROSSOVER, NormalForm
from ..analysis.responses.power_law import PowerLaw, fit_power_law
from ..analysis.responses.response import LinearMotion, Response, layer_force, linear_response
from ..analysis.windows.pair_over_load import normal_forms
from ..pywrap import Engine, Equilibrium, Sample, Scene
from ..pywrap.lammps.dynamics import Weakening
from ..pywrap.runs.path_error import with_path_error
from ..pywrap.runs.scene_path import next_equilibrium, scene_path
from ..pywrap.runs.undamped import perturb, time_step, weakening_of
from ..pywrap.scenes.command_sections import UNDAMPED_SECTIONS
from ..pywrap.scenes.sections import Friction, Perturb
from ..pywrap.scenes.validation import require_section
from .executors import Say
from .onset import first_window
from .packing_tools import Start, unit_of_time
from .result_rows import Row
from .statistics import quartiles, share, sign_test
from .study import task

if TYPE_CHECKING:
    from .sweep.sweep_plan import Sweep

EARLY_SAMPLES = 2000
"""Samples of each run at times that grow geometrically: the layer passes the velocities over which the friction falls
early in a run, within a small share of its length."""

SAMPLES_OF_FALL = 20_000
"""Such samples of the run whose friction falls. The friction falls within some twenty time steps after a thousand; so
many samples include each step up to there."""

LARGEST_DISTANCE = 1e-2
"""Largest distance 1 - F_x/F_x^c at which the response is compared with its power law: farther off, other modes
contribute."""

GROWTH_FACTOR = 2.0
"""Factor between two largest D from which on they differ. Without an instability, the phases in which many modes happen
to meet change the maximum by some ten percent."""

RATE_TOLERANCE = 0.25
"""Largest relative difference between the fitted rate and that of the spectrum of an instability, beside three standard
errors. The spectrum is that of the start; after the jump the disks lie elsewhere, and the rate of a pair near its onset
changes by some ten percent."""

ABOVE_NOISE = 1e3
"""Factor of the perturbation that is compared with the linear response: a million times in D."""

COMPARED_TIME = 50.0
"""Length of the run that is compared with linear response, in `unit_of_time`: a few hundred periods of the pair."""


Series = dict[str, Floats]
"""The samples of a run, with one array of shape (T,) for each field of `Sample`."""


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
        What linear theory says of the run with mu(v) after friction has weakened.
    outcome : TriggeringOutcome
        What the run with mu(v) shows.
    control_rate : float or None
        Growth rate of D with the weakened friction where the control starts, from the spectrum; 0 if it is stable.
    sensitive : Sensitivity
        The response on the way to the onset.
    """

    scene: Scene
    start: Equilibrium
    weakening: Weakening
    runs: dict[str, Series]
    response: Response
    foreseen: Forecast
    outcome: TriggeringOutcome
    control_rate: float | None
    sensitive: Sensitivity


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Response of the pair that is about to coalesce, over the distance from the onset.

    Attributes
    ----------
    distance : ndarray, shape (n,)
        1 - F_x/F_x^c.
    pairs : tuple of NormalForm
        The pair at these distances.
    fit : PowerLaw
        Of the undamped amplitude over the distance.
    """

    distance: Floats
    pairs: tuple[NormalForm, ...]
    fit: PowerLaw

    @property
    def amplitude(self) -> Floats:
        """Undamped amplitudes in units of the start, shape (n,)."""
        return np.array([pair.amplitude() for pair in self.pairs])

    @property
    def near(self) -> tuple[NormalForm, ...]:
        """The pairs whose response damping may halve."""
        return tuple(pair for pair in self.pairs if pair.amplitude() >= LEAST_CROSSOVER)

    @property
    def plateaus(self) -> dict[str, float] | None:
        """Ratio of the undamped amplitudes of the nearest and the farthest pair of `near`, and ratio of epsilon^(-1/2).

        None if `near` has fewer than two pairs.
        """
        if len(self.near) < 2:
            return None
        near, far = sorted((self.near[0], self.near[-1]), key=lambda pair: pair.epsilon)
        theory = float(np.sqrt(far.epsilon / near.epsilon))
        return {"measured": near.amplitude() / far.amplitude(), "theory": theory}


def series_of(samples: Iterable[Sample]) -> Series:
    """The samples of a run as arrays of shape (T,)."""
    rows = [vars(sample) for sample in samples]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def differs(run: Series, other: Series) -> bool:
    """Whether the largest D of a run is `GROWTH_FACTOR` times the largest D of another run, or more."""
    return largest(run) >= GROWTH_FACTOR * largest(other)


def largest(run: Series) -> float:
    """The largest D of a run, length^2."""
    return float(run["msd"].max())


def calibrate_weakening(friction: Friction, unperturbed: Series) -> Weakening:
    """mu(v) with the v_0 of the scene, or with the largest velocity of the layer in an unperturbed run."""
    v0 = np.abs(unperturbed["layer_velocity"]).max() if isinstance(friction.v0, str) else friction.v0
    return weakening_of(friction, float(v0))


def time_of_crossing(run: Series, v0: float) -> float | None:
    """The time at which the layer of a run first exceeds v_0, or None."""
    faster = np.abs(run["layer_velocity"]) > v0
    return float(run["time"][np.argmax(faster)]) if faster.any() else None


Verdict = Literal["does not weaken", "too short", "jump alone", "grows", "unexplained"]


@dataclass(frozen=True)
class TriggeringOutcome:
    """The outcome of a run with mu(v).

    Attributes
    ----------
    verdict : str
        "does not weaken" : the layer never exceeds v_0. "too short" : the run ends before the jump is over. "jump
        alone" : D stays within `GROWTH_FACTOR` of the larger of the jump and the one foreseen. "grows" : it goes
        beyond both, at a rate that agrees with the spectrum's. "unexplained" : it goes beyond both, at no such rate.
    crossing : float or None
        When the layer first exceeds v_0, time.
    jump : float or None
        Largest D within the `JUMP_SHARE` of the run that follows, length^2.
    growth : float or None
        Decades from the jump to the largest D afterwards.
    fitted : Growth or None
        Of D from ten times the jump to a tenth of its largest value, where there is a decade between.
    """

    verdict: Verdict
    crossing: float | None = None
    jump: float | None = None
    growth: float | None = None
    fitted: Growth | None = None


def judge(run: Series, v0: float, foreseen: Forecast) -> TriggeringOutcome:
    """Whether a run with mu(v) shows an instability, or the jump of the equilibrium alone.

    Parameters
    ----------
    run : dict of ndarray
        The run.
    v0 : float
        Velocity of the layer above which friction weakens, length / time.
    foreseen : Forecast
        Of linear theory with the weakened friction.
    """
    when = time_of_crossing(run, v0)
    if when is None:
        return TriggeringOutcome("does not weaken")
    time, msd = run["time"], run["msd"]
    over = when + JUMP_SHARE * time[-1]
    if over >= time[-1]:
        return TriggeringOutcome("too short", when)
    jump = float(msd[(time >= when) & (time <= over)].max())
    later = time >= when
    top = float(msd[later].max())
    try:
        fitted = fit_growth(time[later], msd[later], 10 * jump, 0.1 * top)
    except ValueError:
        fitted = None
    verdict: Verdict = "unexplained"
    if top < GROWTH_FACTOR * max(jump, foreseen.jump):
        verdict = "jump alone"
    elif fitted is not None and foreseen.rate > 0:
        off = abs(fitted.rate - foreseen.rate)
        verdict = "grows" if off <= max(RATE_TOLERANCE * foreseen.rate, 3 * fitted.error) else "unexplained"
    return TriggeringOutcome(verdict, when, jump, float(np.log10(top / jump)), fitted)


def foresee(start: Equilibrium, mu: float, run: Series, v0: float) -> Forecast:
    """The forecast from the moment on at which the layer exceeds v_0; of the whole run if there is no such moment."""
    length = float(run["time"][-1])
    left = length - (time_of_crossing(run, v0) or 0.0)
    return forecast(start, mu, max(left, JUMP_SHARE * length), JUMP_SHARE * length)


def trigger(scene: Scene, start: Equilibrium, below: Equilibrium | None, ramp: Onset, path: Path) -> Triggering:
    """Three runs, each written to run.h5 as it ends, and the linear response of the last.

    Parameters
    ----------
    scene : Scene
        With [perturb], the perturbation and the length of the runs, and [friction], mu(v).
    start : Equilibrium
        At perturb.fx.
    below : Equilibrium or None
        Where the control starts.
    ramp : Onset
        Of the packing, with its first onset.
    path : Path
        run.h5 of the ramp; gets the series unperturbed, perturbed, erupting, control and strong.
    """
    settings, friction = require_section(scene.perturb, "perturb"), require_section(scene.friction, "friction")
    runs: dict[str, Series] = {}

    def run(
        name: str,
        amplitude: float,
        weakening: Weakening | None = None,
        time: float = settings.time,
        start: Equilibrium = start,
        early: int = EARLY_SAMPLES,
    ) -> None:
        one = settings.model_copy(update={"amplitude": amplitude, "time": time})
        series = series_of(perturb(scene.model_copy(update={"perturb": one}), start, early=early, weakening=weakening))
        with RunFile(path, "a") as file:
            file.append_series(name, **series)
        runs[name] = series

    run("unperturbed", 0.0, early=200)  # as `perturb` calibrates v_0
    weakening = calibrate_weakening(friction, runs["unperturbed"])
    run("perturbed", settings.amplitude)
    run("erupting", settings.amplitude, weakening, early=SAMPLES_OF_FALL)
    if below is not None:
        run("control", settings.amplitude, weakening, start=below)
    packing, amplitude = start.packing, ABOVE_NOISE * settings.amplitude
    run("strong", amplitude, time=min(settings.time, COMPARED_TIME * unit_of_time(packing)))
    response = linear_response(
        packing,
        runs["strong"]["time"],
        force=layer_force(packing, amplitude),
        omega=settings.omega or 0.0,
        dt=time_step(packing, settings.time_step),
    )
    foreseen = foresee(start, packing.law.mu * friction.mu_ss, runs["erupting"], weakening.v0)
    outcome = judge(runs["erupting"], weakening.v0, foreseen)
    steady = None if below is None else weakened_rate(below.packing, friction.mu_ss)
    return Triggering(scene, start, weakening, runs, response, foreseen, outcome, steady, sensitivity(ramp))


def weakened_rate(packing: Packing, mu_ss: float) -> float:
    """Fastest growth rate of D with friction mu mu_ss in the same configuration, 1 / time; 0 if it is stable."""
    law = replace(packing.law, mu=mu_ss * packing.law.mu)
    limit = law.slip_limit(packing.geometry.overlap)
    slip = np.clip(packing.contacts.slip, -limit, limit)
    return spectrum(replace(packing, law=law, contacts=replace(packing.contacts, slip=slip))).growth_rate()


def equilibrium_at(
    scene: Scene, path: Sequence[Equilibrium], fx: float, communicator: MPI.Comm | None = None
) -> Equilibrium:
    """The equilibrium at a load, from the equilibrium of a path next below."""
    below = max((each for each in path if each.fx <= fx), key=lambda each: each.fx)
    with Engine(below.packing, communicator) as engine:
        return below if below.fx == fx else next_equilibrium(engine, below, fx, scene)


def sensitivity(run: Onset) -> Sensitivity:
    """The pair of the first onset, at the equilibria that the run has just below it."""
    first = run.windows[0]
    below = sorted((fx for fx in run.between if fx < first.fx_onset), reverse=True)
    # nearer than a hundred times the onset's own error, the distance is not known
    nearest, furthest = 100 * first.error, LARGEST_DISTANCE * first.fx_onset
    below = [fx for fx in below if nearest < first.fx_onset - fx < furthest]
    pairs = tuple(normal_forms([run.between[fx] for fx in below], first.eigenvalue))
    distance = 1 - np.array(below) / first.fx_onset
    return Sensitivity(distance, pairs, fit_power_law(distance, [pair.amplitude() for pair in pairs]))


def summary(triggering: Triggering) -> dict[str, Any]:
    """Numbers for summary.json."""
    sensitive, runs = triggering.sensitive, triggering.runs
    erupting, strong = runs["erupting"], runs["strong"]["msd"]
    most = {name: largest(runs[name]) for name in ("unperturbed", "perturbed", "erupting")}
    outcome = triggering.outcome
    return {
        "fx": triggering.start.fx,
        "v0": triggering.weakening.v0,
        "v_ss": triggering.weakening.v_ss,
        "largest_D": most,
        "rise_in_decades": float(np.log10(most["erupting"] / most["perturbed"])),
        "perturbation_shows": differs(runs["perturbed"], runs["unperturbed"]),
        "verdict": outcome.verdict,
        "weakens_at": outcome.crossing,
        "jump": outcome.jump,
        "growth_in_decades": outcome.growth,
        "growth_after_the_jump": None if outcome.fitted is None else asdict(outcome.fitted),
        "forecast": asdict(triggering.foreseen),
        "largest_D_of_the_control": largest(runs["control"]) if "control" in runs else None,
        "rate_of_the_control": triggering.control_rate,
        "linear_response_deviation": float(np.abs(strong - triggering.response.msd).max() / strong.max()),
        "smallest_mu": float(erupting["friction"].min()),
        "amplitude_exponent": sensitive.fit.exponent,
        "amplitude_exponent_error": sensitive.fit.error,
        "distances": [float(sensitive.distance.min()), float(sensitive.distance.max())],
        "half_gain_time_over_tau_d": [pair.half_gain_time() / pair.tau_d for pair in sensitive.near],
        "plateaus": sensitive.plateaus,
    }


FORECAST_TIMES = 2000
"""Times at which the linear motion is looked at."""


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
    times = time * np.arange(1, FORECAST_TIMES + 1) / FORECAST_TIMES
    with np.errstate(over="ignore"):
        msd = LinearMotion.of(weak).response(times, force=weak.net_force - packing.net_force).msd
    msd = np.fmin(msd, np.finfo(float).max)
    first = float(msd[times <= (JUMP_SHARE * time if window is None else window)].max(initial=msd[0]))
    return Forecast(
        jump=first,
        growth=float(np.log10(msd.max() / first)),
        room=float(np.log10((LINEAR_RANGE * packing.smallest_overlap) ** 2 / first)),
        rate=spectrum(weak).growth_rate(),
    )


def rise_in_decades(eruption: Row, of: str = "weakening") -> float:
    """Decades between the largest D of the perturbed run and of the run with mu(v), or of the "control"."""
    return float(np.log10(eruption[of] / eruption["perturbed"]))


def grows(eruption: Row) -> bool:
    """Whether D goes on to grow after the jump, at the rate of the spectrum with the weakened friction."""
    return bool(eruption["verdict"] == "grows")


def _examination(scene: Scene, start: Start) -> Iterator[Row]:
    """The results of each stage, so that a stage that fails loses none of the earlier ones."""
    ramps: list[Row] = []
    paths: list[tuple[Equilibrium, ...]] = []
    for mu in frictions(scene):
        end, path = first_onset(scene, mu, start)
        paths.append(path)
        ramps.append(end)
        yield {"ramps": [*ramps]}
    if len(ramps) < 2:
        return
    strong, weak = ramps[0], ramps[-1]
    lowered = sign_test(strong, weak)
    yield {"lowered": lowered}
    if lowered and strong["ends"] == "onset" and scene.perturb is not None and scene.friction is not None:
        window = weak["reach"], strong["reach"]
        yield {"eruption": eruption(scene, paths[0], window, scene.perturb, scene.friction)}


def frictions(scene: Scene) -> tuple[float, ...]:
    """The scene's friction coefficients: the first one weakens, and the last one is its weakened value."""
    if scene.friction is None:
        return scene.law.mus
    weak = scene.friction.mu_ss * scene.law.mus[0]
    # 0.8 * 0.7 is not 0.56 to the last bit
    return (*(mu for mu in scene.law.mus if not np.isclose(mu, weak, rtol=1e-12, atol=0.0)), weak)


def first_onset(scene: Scene, mu: float, start: Start) -> tuple[Row, tuple[Equilibrium, ...]]:
    """How the ramp of a scene ends for one friction coefficient, with its equilibria up to there.

    Returns
    -------
    row : dict
        mu; ends : "onset", a window of complex eigenvalues, "until", the last F_x of the scene, or "flows", no
        equilibrium beyond `reach`; reach : the largest F_x up to which there is no window, force per disk of the upper
        layer: the onset, if there is one; error : uncertainty of the onset, or None.
    path : tuple of Equilibrium
    """
    rest = start(mu)
    with Engine(rest.packing, MPI.COMM_SELF) as engine:
        path = scene_path(engine, rest, scene)
        ends, reach, found = first_window(path, scene)
        error = None
        if found is not None:
            whole = with_path_error(found, path)
            reach, error = whole.fx_c, whole.error
        return {"mu": mu, "ends": ends, "reach": reach, "error": error}, tuple(path.equilibria)


def eruption(
    scene: Scene,
    path: tuple[Equilibrium, ...],
    window: tuple[float, float],
    settings: Perturb,
    friction: Friction,
) -> Row:
    """The runs in a window between two onsets, and the control; path leads up to the upper one.

    Returns
    -------
    dict
        fx, fx_control : the middle of the window, and the control below it, force per disk of the upper layer; rate :
        growth rate of D with the weakened friction at fx, from the spectrum, 1 / time, 0 if it is stable; unperturbed,
        perturbed, weakening, control : largest D, length^2, of the three runs at fx, and with mu(v) at fx_control;
        verdict, weakens_at, jump : whether D grows after its jump, when friction weakens, and the largest D shortly
        after that (`TriggeringOutcome` of :mod:`~faultgouge.studies.triggering.compute`); fitted_rate : of D after the
        jump, or None; foreseen_jump : by linear theory, length^2; perturbation_shows : whether the perturbed run
        differs from the unperturbed one.
    """
    middle = 0.5 * (window[0] + window[1])
    loads = middle, max(0.0, 2 * window[0] - middle)
    start, below = (equilibrium_at(scene, path, fx, MPI.COMM_SELF) for fx in loads)

    def run(start: Equilibrium, amplitude: float, weakening: Weakening | None = None) -> Series:
        changes = {"fx": start.fx, "amplitude": amplitude}
        one = scene.model_copy(update={"perturb": settings.model_copy(update=changes)})
        return series_of(perturb(one, start, communicator=MPI.COMM_SELF, weakening=weakening))

    quiet = run(start, 0.0)
    weakening = calibrate_weakening(friction, quiet)
    perturbed, weakened = run(start, settings.amplitude), run(start, settings.amplitude, weakening)
    foreseen = foresee(start, friction.mu_ss * start.packing.law.mu, weakened, weakening.v0)
    outcome = judge(weakened, weakening.v0, foreseen)
    return {
        "fx": start.fx,
        "fx_control": below.fx,
        "rate": weakened_rate(start.packing, friction.mu_ss),
        "unperturbed": largest(quiet),
        "perturbed": largest(perturbed),
        "weakening": largest(weakened),
        "control": largest(run(below, settings.amplitude, weakening)),
        "verdict": outcome.verdict,
        "weakens_at": outcome.crossing,
        "jump": outcome.jump,
        "fitted_rate": None if outcome.fitted is None else outcome.fitted.rate,
        "foreseen_jump": foreseen.jump,
        "perturbation_shows": differs(perturbed, quiet),
    }


RISES_IN_DECADES = (5, 10)
"""Rises in decades whose shares are given; the paper's figure 5 has 12."""

QUARTILES = (0.25, 0.5, 0.75)


def summary_of_rows(rows: Sequence[Row]) -> dict[str, Any]:
    """Summarise the rows of a sweep of the task "triggering" in numbers.

    Parameters
    ----------
    rows : sequence of dict
        As `run_sweep` returns them.

    Returns
    -------
    dict
        onsets : for each friction coefficient how the ramps end, with quartiles of F_x^c; lowered : share in which
        weakening friction lowers the onset; lowered_unknown : how many others do not tell; rises, control_rises : by
        decades, the share of the runs with mu(v) whose D rises by so much, and of the controls; rise_quartiles,
        control_rise_quartiles : decades, or None; unstable_when_weakened, grows, perturbation_shows : shares of the
        scenes with runs. A share is what `share` returns.
    """
    ramps = [end for row in rows for end in row["result"].get("ramps", ())]
    eruptions = [found for row in rows if (found := row["result"].get("eruption"))]
    several = [row for row in rows if len(row["result"].get("ramps", ())) > 1]
    decided = [row["result"]["lowered"] for row in several if row["result"]["lowered"] is not None]
    undecided = [row for row in several if row["result"]["lowered"] is None and row["says"] is None]
    rises, controls = ([rise_in_decades(each, of) for each in eruptions] for of in ("weakening", "control"))

    def at_least(values: list[float]) -> dict[str, Any]:
        return {
            str(decades): share(sum(each >= decades for each in values), len(values)) for decades in RISES_IN_DECADES
        }

    return {
        "onsets": [_ends_of(mu, ramps) for mu in dict.fromkeys(end["mu"] for end in ramps)],
        "lowered": share(sum(decided), len(decided)),
        "lowered_unknown": len(undecided),
        "rises": at_least(rises),
        "control_rises": at_least(controls),
        "rise_quartiles": np.quantile(rises, QUARTILES).tolist() if rises else None,
        "control_rise_quartiles": np.quantile(controls, QUARTILES).tolist() if controls else None,
        "unstable_when_weakened": share(sum(each["rate"] > 0 for each in eruptions), len(eruptions)),
        "grows": share(sum(map(grows, eruptions)), len(eruptions)),
        "perturbation_shows": share(sum(each["perturbation_shows"] for each in eruptions), len(eruptions)),
    }


def in_words(numbers: dict[str, Any]) -> list[str]:
    """The summary as lines for a terminal."""
    from ..figures.pages import lines

    return lines(__package__ or "", "triggering.j2", result=numbers)


def _ends_of(mu: float, ramps: Sequence[Row]) -> dict[str, Any]:
    ends = [each["ends"] for each in ramps if each["mu"] == mu]
    found = [each == "onset" for each in ends]
    return {
        "mu": mu,
        "found": share(sum(found), len(found)),
        "none_until": ends.count("until"),
        "flows": ends.count("flows"),
        "quartiles": quartiles([each["reach"] for each in ramps if each["mu"] == mu], found),
    }


def _gather(sweep: Sweep, rows: Sequence[Row], output: Path, say: Say) -> list[str]:
    """Shares over all scenes: summary.json, and lines for a terminal."""
    numbers = summary_of_rows(rows)
    write_json(output / "summary.json", numbers)
    return in_words(numbers)


@task(reads=UNDAMPED_SECTIONS, needs=("ramp",), gather=_gather, writes={"summary.json": ""})
def triggering(scene: Scene, start: Start) -> Row:
    """Onsets for several friction coefficients, and the runs between them. An error is the row's "says", beside the
    results of the stages before.

    Returns
    -------
    dict
        ramps : what `first_onset` finds for each friction coefficient, the scene's first one first and what it weakens
        to last; lowered : whether weakening friction lowers the onset, None if that cannot be known; eruption : what
        `eruption` finds, None without a window between the two onsets, or without [perturb] in the scene.
    """
    row: Row = {"ramps": [], "lowered": None, "eruption": None}
    require_section(scene.ramp, "ramp")
    try:
        for found in _examination(scene, start):
            row |= found
    except (FaultgougeError, ValueError) as error:  # ValueError: of LAPACK
        row["says"] = str(error)
    return row
