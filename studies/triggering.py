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

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from mpi4py import MPI

from ..analysis import FaultgougeError, Onset, Packing, fit_growth, spectrum
from ..analysis.arrays import Floats
from ..analysis.files.atomic_write import write_json
from ..analysis.responses.growth import JUMP_SHARE, LINEAR_RANGE, PowerLaw, fit_power_law
from ..analysis.responses.normal_form import NormalForm
from ..analysis.responses.response import linear_response
from ..analysis.windows.pair_over_load import normal_forms
from ..pywrap import Engine, Equilibrium, Sample, Scene
from ..pywrap.lammps.dynamics import Weakening
from ..pywrap.runs.path_error import with_path_error
from ..pywrap.runs.scene_path import next_equilibrium
from ..pywrap.runs.undamped import perturb, weakening_of
from ..pywrap.scenes.command_sections import UNDAMPED_SECTIONS
from ..pywrap.scenes.validation import require_section
from .onset import first_window
from .packing_tools import Start, path_from
from .result_rows import Row
from .statistics import quartiles, share, sign_test
from .study import Say, task

if TYPE_CHECKING:
    from .sweep.sweep_plan import Sweep

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

FORECAST_TIMES = 2000
"""Times at which the linear motion is looked at."""

RISES_IN_DECADES = (5, 10)
"""Rises in decades whose shares are given; the paper's figure 5 has 12."""

Series = dict[str, Floats]
"""The samples of a run, with one array of shape (T,) for each field of `Sample`."""


class Forecast(NamedTuple):
    """The linear motion after friction has weakened: the largest D within the window of the jump, length^2; decades
    from the jump to the largest D of the whole run, without bound where a pair grows; decades from the jump to the D at
    which the motion ceases to be linear; growth rate of D of the fastest motion, 1 / time, 0 if none grows."""

    jump: float
    growth: float
    room: float
    rate: float


class Triggering(NamedTuple):
    """Undamped runs from one equilibrium, which is linearly stable.

    `weakening` is mu(v), with v_0 the largest velocity of the unperturbed run if the scene gives none. `runs` by name:
    unperturbed; perturbed; erupting, with mu(v) as well; control, the same at a force where the packing is stable with
    the weakened friction, too, if one is known. `foreseen` is what linear theory says of the run with mu(v) after
    friction has weakened, and `outcome` what this run shows, see `judge`.
    """

    scene: Scene
    start: Equilibrium
    weakening: Weakening
    runs: dict[str, Series]
    foreseen: Forecast
    outcome: Row

    def largest(self, *names: str) -> dict[str, float]:
        """The largest D of runs, length^2, by name."""
        return {name: float(self.runs[name]["msd"].max()) for name in names or self.runs}


class Sensitivity(NamedTuple):
    """Response of the pair that is about to coalesce: distances 1 - F_x/F_x^c from the onset, shape (n,), the pair at
    these distances, and the fit of the undamped amplitude over the distance."""

    distance: Floats
    pairs: tuple[NormalForm, ...]
    fit: PowerLaw


def series_of(samples: Iterable[Sample]) -> Series:
    """The samples of a run as arrays of shape (T,)."""
    rows = [vars(sample) for sample in samples]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def follow(
    scene: Scene,
    start: Equilibrium,
    below: Equilibrium | None,
    early: tuple[int, int] = (200, 200),
    communicator: MPI.Comm | None = None,
    store: Callable[[str, Series], None] = lambda name, series: None,
) -> Triggering:
    """The runs from an equilibrium, the control from the one below, and what the run with mu(v) shows.

    The scene has [perturb], the perturbation and the length of the runs, and [friction], mu(v). `early` are samples at
    times that grow geometrically, of the perturbed runs and of the one whose friction falls: the layer passes the
    velocities over which the friction falls early in a run, within a small share of its length. `store` is called with
    the name and the samples of each run as it ends.
    """
    settings, friction = require_section(scene.perturb, "perturb"), require_section(scene.friction, "friction")
    runs: dict[str, Series] = {}

    def run(name: str, start: Equilibrium, amplitude: float, early: int, weakening: Weakening | None = None) -> Series:
        one = scene.model_copy(update={"perturb": settings.model_copy(update={"fx": start.fx, "amplitude": amplitude})})
        runs[name] = series_of(perturb(one, start, early=early, communicator=communicator, weakening=weakening))
        store(name, runs[name])
        return runs[name]

    quiet = run("unperturbed", start, 0.0, 200)  # as `perturb` calibrates v_0
    v0 = np.abs(quiet["layer_velocity"]).max() if isinstance(friction.v0, str) else friction.v0
    weakening = weakening_of(friction, float(v0))
    run("perturbed", start, settings.amplitude, early[0])
    erupting = run("erupting", start, settings.amplitude, early[1], weakening)
    if below is not None:
        run("control", below, settings.amplitude, early[0], weakening)
    # the motion from the moment on at which the layer exceeds v_0; of the whole run if there is no such moment
    length = float(erupting["time"][-1])
    left = max(length - (time_of_crossing(erupting, weakening.v0) or 0.0), JUMP_SHARE * length)
    foreseen = forecast(start, start.packing.law.mu * friction.mu_ss, left, JUMP_SHARE * length)
    return Triggering(scene, start, weakening, runs, foreseen, judge(erupting, weakening.v0, foreseen))


def time_of_crossing(run: Series, v0: float) -> float | None:
    """The time at which the layer of a run first exceeds v_0, or None."""
    faster = np.abs(run["layer_velocity"]) > v0
    return float(run["time"][np.argmax(faster)]) if faster.any() else None


def judge(run: Series, v0: float, foreseen: Forecast) -> Row:
    """Whether a run with mu(v) shows an instability, or the jump of the equilibrium alone.

    Friction weakens where the layer is faster than v_0, length / time; the forecast is that of the weakened friction.

    verdict: "does not weaken", the layer never exceeds v_0; "too short", the run ends before the jump is over; "jump
    alone", D stays within `GROWTH_FACTOR` of the larger of the jump and the one foreseen; "grows", it goes beyond both,
    at a rate that agrees with the spectrum's; "unexplained", it goes beyond both, at no such rate. weakens_at: when the
    layer first exceeds v_0, time, or None. jump: largest D within the `JUMP_SHARE` of the run that follows, length^2,
    or None. growth_in_decades: from the jump to the largest D afterwards, or None. growth_after_the_jump: the numbers
    of a Growth, of D from ten times the jump to a tenth of its largest value; None unless there is a decade between.
    """
    time, msd, when = run["time"], run["msd"], time_of_crossing(run, v0)
    found: Row = {"weakens_at": when, "jump": None, "growth_in_decades": None, "growth_after_the_jump": None}
    if when is None or (over := when + JUMP_SHARE * time[-1]) >= time[-1]:
        return found | {"verdict": "does not weaken" if when is None else "too short"}
    later = time >= when
    jump, top, verdict = float(msd[later & (time <= over)].max()), float(msd[later].max()), "unexplained"
    found |= {"jump": jump, "growth_in_decades": float(np.log10(top / jump))}
    with suppress(ValueError):
        fitted = fit_growth(time[later], msd[later], 10 * jump, 0.1 * top)
        found["growth_after_the_jump"] = asdict(fitted)
        if abs(fitted.rate - foreseen.rate) <= max(RATE_TOLERANCE * foreseen.rate, 3 * fitted.error):
            verdict = "grows" if foreseen.rate > 0 else verdict
    return found | {"verdict": "jump alone" if top < GROWTH_FACTOR * max(jump, foreseen.jump) else verdict}


def forecast(start: Equilibrium, mu: float, time: float, window: float | None = None) -> Forecast:
    """Jump and growth of an equilibrium whose friction coefficient becomes `mu`, in the `time` that follows.

    The jump is what happens within `window`, by default `JUMP_SHARE` of the time.
    """
    packing = start.packing
    weak = replace(packing, law=replace(packing.law, mu=mu))
    times = time * np.arange(1, FORECAST_TIMES + 1) / FORECAST_TIMES
    with np.errstate(over="ignore"):
        msd = linear_response(weak, times, force=weak.net_force - packing.net_force).msd
    msd = np.fmin(msd, np.finfo(float).max)
    first = float(msd[times <= (JUMP_SHARE * time if window is None else window)].max(initial=msd[0]))
    room = (LINEAR_RANGE * packing.smallest_overlap) ** 2 / first
    return Forecast(first, float(np.log10(msd.max() / first)), float(np.log10(room)), spectrum(weak).growth_rate())


def weakened_rate(packing: Packing, mu_ss: float) -> float:
    """Fastest growth rate of D with friction mu mu_ss in the same configuration, 1 / time; 0 if it is stable."""
    law = replace(packing.law, mu=mu_ss * packing.law.mu)
    slip = law.clamped(packing.geometry.overlap, packing.contacts.slip)
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
    # nearer than a hundred times the onset's own error, the distance is not known
    nearest, furthest = 100 * first.error, LARGEST_DISTANCE * first.fx_onset
    below = sorted((fx for fx in run.between if nearest < first.fx_onset - fx < furthest), reverse=True)
    pairs = tuple(normal_forms([run.between[fx] for fx in below], first.eigenvalue))
    distance = 1 - np.array(below) / first.fx_onset
    return Sensitivity(distance, pairs, fit_power_law(distance, [pair.amplitude() for pair in pairs]))


def eruption(scene: Scene, path: Sequence[Equilibrium], window: tuple[float, float]) -> Row:
    """The runs in a window between two onsets, and the control; path leads up to the upper one.

    fx, fx_control: the middle of the window, and the control below it, force per disk of the upper layer; rate: growth
    rate of D with the weakened friction at fx, from the spectrum, 1 / time, 0 if it is stable; unperturbed, perturbed,
    weakening, control: largest D, length^2, of the three runs at fx, and with mu(v) at fx_control; verdict, weakens_at,
    jump: whether D grows after its jump, when friction weakens, and the largest D shortly after that (`judge`);
    fitted_rate: of D after the jump, or None; foreseen_jump: by linear theory, length^2; perturbation_shows: whether
    the perturbed run differs from the unperturbed one.
    """
    middle = 0.5 * (window[0] + window[1])
    loads = middle, max(0.0, 2 * window[0] - middle)
    start, below = (equilibrium_at(scene, path, fx, MPI.COMM_SELF) for fx in loads)
    found = follow(scene, start, below, communicator=MPI.COMM_SELF)
    most, outcome = found.largest(), found.outcome
    fitted = outcome["growth_after_the_jump"]
    return {
        **{"fx": start.fx, "fx_control": below.fx},
        "rate": weakened_rate(start.packing, require_section(scene.friction, "friction").mu_ss),
        **{name.replace("erupting", "weakening"): each for name, each in most.items()},
        **{key: outcome[key] for key in ("verdict", "weakens_at", "jump")},
        "fitted_rate": fitted and fitted["rate"],
        "foreseen_jump": found.foreseen.jump,
        "perturbation_shows": most["perturbed"] >= GROWTH_FACTOR * most["unperturbed"],
    }


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
    tell = [(row["result"]["lowered"], row["says"] is None) for row in several]
    lowered = [each for each, whole in tell if whole or each is not None]
    numbers: dict[str, Any] = {"onsets": []}

    def share_of(marks: Sequence[bool]) -> dict[str, Any]:
        return share(sum(marks), len(marks))

    for mu in dict.fromkeys(end["mu"] for end in ramps):
        ends, reach = zip(*((end["ends"], end["reach"]) for end in ramps if end["mu"] == mu), strict=True)
        found = [each == "onset" for each in ends]
        flows = {"none_until": ends.count("until"), "flows": ends.count("flows")}
        numbers["onsets"].append({"mu": mu, "found": share_of(found), **flows, "quartiles": quartiles(reach, found)})
    numbers["lowered"] = share_of([each for each in lowered if each is not None])
    numbers["lowered_unknown"] = lowered.count(None)
    for run, name in (("weakening", "rise"), ("control", "control_rise")):
        rises = [float(np.log10(each[run] / each["perturbed"])) for each in eruptions]
        numbers[f"{name}s"] = {str(n): share_of([rise >= n for rise in rises]) for n in RISES_IN_DECADES}
        numbers[f"{name}_quartiles"] = np.quantile(rises, (0.25, 0.5, 0.75)).tolist() if rises else None
    return numbers | {
        "unstable_when_weakened": share_of([each["rate"] > 0 for each in eruptions]),
        "grows": share_of([each["verdict"] == "grows" for each in eruptions]),
        "perturbation_shows": share_of([each["perturbation_shows"] for each in eruptions]),
    }


def in_words(numbers: dict[str, Any]) -> list[str]:
    """The summary as lines for a terminal."""
    from ..figures.pages import lines

    return lines(__package__ or "", "triggering.j2", result=numbers)


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
        ramps : for each friction coefficient, the scene's first one first and what it weakens to last: mu; ends :
        "onset", a window of complex eigenvalues, "until", the last F_x of the scene, or "flows", no equilibrium beyond
        `reach`; reach : the onset, or the largest F_x up to which there is none, force per disk of the upper layer;
        error : uncertainty of the onset, or None. lowered : whether weakening friction lowers the onset, None if that
        cannot be known; eruption : what `eruption` finds, None without a window between the two onsets, or without
        [perturb] in the scene.
    """
    require_section(scene.ramp, "ramp")
    row: Row = {"ramps": [], "lowered": None, "eruption": None}
    frictions, friction, paths = scene.law.mus, scene.friction, list[list[Equilibrium]]()
    if friction is not None:
        weak = friction.mu_ss * frictions[0]
        # 0.8 * 0.7 is not 0.56 to the last bit
        frictions = (*(mu for mu in frictions if not np.isclose(mu, weak, rtol=1e-12, atol=0.0)), weak)
    try:
        for mu in frictions:
            with path_from(start(mu), scene) as path:
                ends, reach, found = first_window(path, scene)
                whole = None if found is None else with_path_error(found, path)
                paths.append(path.equilibria)
            reach, error = (reach, None) if whole is None else (whole.fx_c, whole.error)
            row["ramps"].append({"mu": mu, "ends": ends, "reach": reach, "error": error})
        first, last = row["ramps"][0], row["ramps"][-1]
        if len(paths) > 1:
            row["lowered"] = sign_test(first, last)
        if row["lowered"] and first["ends"] == "onset" and scene.perturb is not None and friction is not None:
            row["eruption"] = eruption(scene, paths[0], (last["reach"], first["reach"]))
    except (FaultgougeError, ValueError) as error:  # ValueError: of LAPACK
        row["says"] = str(error)
    return row
