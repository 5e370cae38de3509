r"""The paper's protocol on one packing, from the scene to a folder with its figures, numbers and report.

Settle, raise F_x from equilibrium to equilibrium for each friction coefficient, find the onset F_x^c at which two real
eigenvalues coalesce; then start undamped dynamics from an equilibrium above the onset and compare the growth of the
mean square displacement D(t), which starts from rounding noise, with the rate 2 |Im omega| of the spectrum. If the
scene asks for it, a minute perturbation just below the onset follows (:mod:`~faultgouge.studies.triggering`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analysis import Onset, OnsetError, Packing, RunFile, Spectrum, fit_growth, spectrum
from ...analysis.counted import counted
from ...analysis.files.atomic_write import check_own, make_folder, write_json, write_text
from ...analysis.packing.solid_fraction import solid_fraction, solid_fraction_below_top
from ...analysis.responses.growth import PLATEAU_SHARE, growing_range
from ...analysis.responses.normal_form import LEAST_CROSSOVER
from ...analysis.responses.response import layer_force, linear_response
from ...figures import PairCurve
from ...figures.packing import draw_packing
from ...figures.pages import render
from ...figures.pair import draw_pair
from ...figures.series import draw_growth
from ...pywrap import Record, Sample, Scene, SceneError, reach
from ...pywrap.onset import ONSET_DISTANCES, load_at_onset, onset_run
from ...pywrap.runs.undamped import ACCURATE_SHARE, perturb, time_step
from ...pywrap.scenes.run_sections import Perturb
from ...pywrap.scenes.units import dashpot, real_units
from ...pywrap.scenes.validation import require_section
from ...pywrap.settling.settle import settle_bed
from ..packing_tools import unit_of_time
from ..study import Say, draw_all
from ..triggering import (
    GROWTH_FACTOR,
    Sensitivity,
    Series,
    Triggering,
    equilibrium_at,
    follow,
    sensitivity,
    series_of,
    weakened_rate,
)
from .triggering_figures import triggering_figures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EFOLDS = 48.0
"""Length of the undamped run in units of 1/rate: D grows by up to 20 decades in it."""

MOST_RUN_STEPS = 3_000_000
"""Steps of the undamped run, at the most: about 20 s for 100 disks."""

EARLY_SAMPLES = 2000, 20_000
"""Samples of the triggered runs at times that grow geometrically. The friction falls within some twenty time steps
after a thousand; so many samples of that run include each step up to there."""

ABOVE_NOISE = 1e3
"""Factor of the perturbation that is compared with the linear response: a million times in D."""

COMPARED_TIME = 50.0
"""Length of the run that is compared with linear response, in `unit_of_time`: a few hundred periods of the pair."""

Triggered = tuple[Triggering, Sensitivity, dict[str, Any]]
"""What is triggered: the runs, the response on the way to the onset, and their numbers for summary.json."""


def reproduce(scene: Scene, output: Path, say: Say = print, triggered: Scene | None = None) -> dict[str, Any]:
    """Run the protocol and write figures, run.h5, summary.json and report.md to a folder.

    Parameters
    ----------
    scene : Scene
        With a section [ramp] and one or more friction coefficients.
    output : Path
        The folder, created if needed. Ramps are written to run.h5 (first friction coefficient) and run-mu*.h5.
    say : callable
        Called with a line of progress.
    triggered : Scene, optional
        Another scene, with [perturb] and [friction], of which the packing is triggered; its ramps are written to
        triggered.h5 and triggered-mu*.h5. By default the packing of `scene` is triggered, if that has these sections.

    Returns
    -------
    dict
        The contents of summary.json.
    """
    make_folder(output, "summary.json", "report.md")
    runs = _ramps(scene, output / "run.h5", say)
    say("undamped run above the onset")
    growth = growth_run(scene, runs[0], output / "run.h5")
    fitted = growth["measured"]
    say(f"growth rate of D: {fitted and f'{fitted.rate:.6g}'} measured, {growth['predicted']:.6g} predicted")
    summary = summary_of(scene, runs, growth)
    write_json(output / "summary.json", summary)  # what follows may fail
    figures: dict[str, Callable[[], Figure]] = {"figure1": partial(draw_packing, growth["start"].packing)}
    figures["figure3"] = partial(draw_pair, [PairCurve.of_onset(run) for run in runs])
    if fitted is not None:
        figures["figure4"] = partial(draw_growth, growth["time"], growth["msd"], growth["predicted"], fitted)
    draw_all(figures, output, say)
    shaken, another = triggered or scene, None
    found: Triggered | str = "The scene has no sections [perturb] and [friction], so that nothing is triggered"
    if shaken.perturb is not None and shaken.friction is not None:
        path = output / ("run.h5" if triggered is None else "triggered.h5")
        if triggered is not None:
            say("the packing to be triggered")
            another = _ramps(triggered, path, say)
        found = _trigger(shaken, another or runs, path, say)
        summary["triggering"] = {"says": found} if isinstance(found, str) else found[2]
        if another is not None:
            onsets = [{"mu": run.mu, "onset": run.as_dict()} for run in another]
            summary["triggering"] |= {"scene": shaken.resolved(), "onsets": onsets}
    if isinstance(found, str):
        say(f"{found.rstrip('.')}: no figures 2 and 5")
    else:
        draw_all(triggering_figures(found[0]), output, say)
    write_json(output / "summary.json", summary)
    write_text(output / "report.md", report(scene, runs, growth, found, another))
    return summary


def _ramps(scene: Scene, path: Path, say: Say) -> list[Onset]:
    """Ramp and onset for each friction coefficient, the first in the file of that name, the others beside it."""
    # a packing that settles with friction is another one for each coefficient
    bed = None if getattr(scene.packing, "settle_friction", False) else settle_bed(scene)
    runs = list[Onset]()
    for mu in scene.law.mus:
        say(f"mu = {mu:g}: ramp and onset")
        runs.append(recorded_ramp(scene, mu, path.with_stem(f"{path.stem}-mu{mu:g}") if runs else path, bed))
        say(f"mu = {mu:g}: {runs[-1].describe()}")
    return runs


def recorded_ramp(scene: Scene, mu: float, path: Path, bed: Packing | None = None) -> Onset:
    """Ramp and onset for one friction coefficient, from a settled bed; every equilibrium goes to the file."""
    one = scene.model_copy(update={"law": scene.law.model_copy(update={"mu": mu})})
    near = ONSET_DISTANCES * require_section(scene.ramp, "ramp").first
    check_own(path)
    path.unlink(missing_ok=True)
    with Record(path, one) as record:
        run = onset_run(one, mu, reached=record.append, near_onset=near, bed=bed)
        record.finish()
    return run


def growth_run(scene: Scene, run: Onset, path: Path) -> dict[str, Any]:
    """An undamped run where the ramp shows the fastest growth by one pair; its series goes to the file of the ramp.

    Returns
    -------
    dict
        start, spectrum : the equilibrium where it begins, and its spectrum; time, msd : D(t), shape (T,); time_step :
        of the run; predicted : growth rate of D from the spectrum and the time step's dispersion, 1 / time; measured :
        the Growth that is fitted to D(t), None where D does not grow far enough above its noise.
    """

    def dominance(modes: Spectrum) -> float:
        """Growth rate of the fastest pair less the rate of the second pair; 0 of a packing that buckles."""
        first, second, *_ = [*sorted((pair.growth_rate for pair in modes.pairs), reverse=True), 0.0, 0.0]
        return 0.0 if len(modes.negative) else first - second

    candidates = [(each, spectrum(each.packing)) for each in run.equilibria if each.fx > run.fx_c]
    start, modes = max(candidates, key=lambda each: dominance(each[1]))
    if not dominance(modes):
        none = f"no load of the ramp lies in a window of complex eigenvalues, the first begins at F_x = {run.fx_c:.6g}"
        raise SceneError(f"{none}: take a smaller ramp.step, so that a run above the onset has where to start")
    dt = time_step(start.packing)
    predicted = modes.growth_rate(dt)
    length = min(EFOLDS / predicted, MOST_RUN_STEPS * dt)
    settings = Perturb(fx=start.fx, time=length, inertia_factor=scene.inertia_factor)
    # disks that have moved by a tenth of the smallest overlap certainly move otherwise than the spectrum says
    ceiling = (0.1 * start.packing.smallest_overlap) ** 2
    samples: list[Sample] = []
    for sample in perturb(scene.model_copy(update={"perturb": settings}), start, samples=4000, early=0):
        samples.append(sample)
        if sample.msd > 1e6 * ceiling:
            break
    series, measured = series_of(samples), None
    with RunFile(path, "a") as file:
        file.append_series("undamped", **series)
    time, msd = series["time"], series["msd"]
    with suppress(ValueError):
        measured = fit_growth(time, msd, *growing_range(time, msd, min(ceiling, PLATEAU_SHARE * float(msd.max()))))
    found = {"start": start, "spectrum": modes, "time": time, "msd": msd}
    return found | {"time_step": dt, "predicted": predicted, "measured": measured}


def _trigger(scene: Scene, runs: list[Onset], path: Path, say: Say) -> Triggered | str:
    """A perturbation between the onsets of the weakened and of the static friction, at perturb.fx, or where the onsets
    say without it; or why there is nothing to trigger. The series go to the file.

    A further run, "strong", has a perturbation `ABOVE_NOISE` as strong, for a shorter time: its D stands out of the
    noise of doubles, and is compared with the linear response to it.
    """
    settings, mu_ss = require_section(scene.perturb, "perturb"), require_section(scene.friction, "friction").mu_ss
    run, fx = runs[0], settings.fx
    try:
        fx = load_at_onset(scene, {run.mu: run for run in runs}) if fx is None else fx
    except (SceneError, OnsetError) as error:
        return str(error)
    settings = settings.model_copy(update={"fx": fx})
    scene = scene.model_copy(update={"perturb": settings})
    say(f"triggering at F_x = {fx:g}")
    # exact but for the product's rounding
    weakened = [each for each in runs if np.isclose(each.mu, run.mu * mu_ss, rtol=1e-12)]
    if weakened and weakened[0].windows[0].kind != "start" and fx <= weakened[0].fx_c:
        lower = f"F_x = {fx:g} is below the onset {weakened[0].fx_c:g} of the weakened friction, too"
        return f"{lower}: no window between the two, and nothing to erupt."
    *_, start = reach(scene, fx)  # to the bit the equilibrium of `perturb`, with its v_0
    packing = start.packing
    modes = spectrum(packing)
    if modes.is_stable is False:
        what = f"{counted(len(modes.pairs), 'complex pair')} and {counted(len(modes.negative), 'negative eigenvalue')}"
        return f"At F_x = {fx:g} the packing has {what} already: nothing is stable there to be triggered."
    below = equilibrium_at(scene, run.equilibria, max(0.0, 2 * weakened[0].fx_c - fx)) if weakened else None

    def store(name: str, series: Series) -> None:
        with RunFile(path, "a") as file:
            file.append_series(name, **series)

    found = follow(scene, start, below, EARLY_SAMPLES, store=store)
    amplitude, time = ABOVE_NOISE * settings.amplitude, min(settings.time, COMPARED_TIME * unit_of_time(packing))
    stronger = scene.model_copy(update={"perturb": settings.model_copy(update={"amplitude": amplitude, "time": time})})
    strong = found.runs["strong"] = series_of(perturb(stronger, start, early=EARLY_SAMPLES[0]))
    store("strong", strong)
    force, dt = layer_force(packing, amplitude), time_step(packing, settings.time_step)
    response = linear_response(packing, strong["time"], force=force, omega=settings.omega or 0.0, dt=dt)
    sensitive, most = sensitivity(run), found.largest("unperturbed", "perturbed", "erupting")
    near = [pair for pair in sensitive.pairs if pair.amplitude() >= LEAST_CROSSOVER]  # which damping may halve
    plateaus = None
    if len(near) > 1:  # undamped amplitudes of the nearest and the farthest pair, and the ratio of epsilon^(-1/2)
        one, far = sorted((near[0], near[-1]), key=lambda pair: pair.epsilon)
        theory = float(np.sqrt(far.epsilon / one.epsilon))
        plateaus = {"measured": one.amplitude() / far.amplitude(), "theory": theory}
    numbers = {
        **{"fx": start.fx, "v0": found.weakening.v0, "v_ss": found.weakening.v_ss, "largest_D": most},
        "rise_in_decades": float(np.log10(most["erupting"] / most["perturbed"])),
        "perturbation_shows": most["perturbed"] >= GROWTH_FACTOR * most["unperturbed"],
        **found.outcome,
        "forecast": found.foreseen._asdict(),
        "largest_D_of_the_control": found.largest("control")["control"] if below else None,
        "rate_of_the_control": weakened_rate(below.packing, mu_ss) if below else None,
        "linear_response_deviation": float(np.abs(strong["msd"] - response.msd).max() / strong["msd"].max()),
        "smallest_mu": float(found.runs["erupting"]["friction"].min()),
        **{"amplitude_exponent": sensitive.fit.exponent, "amplitude_exponent_error": sensitive.fit.error},
        "distances": [float(sensitive.distance.min()), float(sensitive.distance.max())],
        "half_gain_time_over_tau_d": [pair.half_gain_time() / pair.tau_d for pair in near],
        "plateaus": plateaus,
    }
    return found, sensitive, numbers


def summary_of(scene: Scene, runs: list[Onset], growth: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers for summary.json."""
    fitted, ramps = growth["measured"], list[dict[str, Any]]()
    for run in runs:
        first, *_, last = run.equilibria
        row: dict[str, Any] = {"mu": run.mu, "equilibria": len(run.equilibria)}
        row |= {"evaluations": [each.evaluations for each in run.equilibria]}
        row |= {"largest_residual": max(each.residual for each in run.equilibria), "floor": last.floor}
        row |= {"contacts": len(first.packing.contacts), "rattlers": first.packing.rattlers.tolist()}
        row |= {"solid_fraction": solid_fraction(first.packing), "flows_beyond": run.flows_beyond}
        ramps.append(row | {"onset": run.as_dict()})
    grows = {"fx": growth["start"].fx, "time_step": growth["time_step"], "predicted_rate": growth["predicted"]}
    grows |= {"measured": fitted and asdict(fitted), "deviation": fitted and fitted.rate / growth["predicted"] - 1}
    return {"scene": scene.resolved(), "ramps": ramps, "growth": grows}


def report(
    scene: Scene, runs: list[Onset], growth: Mapping[str, Any], found: Triggered | str, another: list[Onset] | None
) -> str:
    """report.md of ramps for each friction coefficient, the run above the onset, and the triggering below it.

    `found` is a sentence where there is nothing to trigger; `another` has the ramps of the packing that is triggered,
    if it is another one.
    """
    settled, real, units = runs[0].equilibria[0].packing, real_units(scene), scene.units
    earlier = []  # whether an onset comes before that of larger friction; None where their errors do not tell
    for one, other in pairwise(sorted(runs, key=lambda run: run.mu)):
        apart = other.fx_c - one.fx_c
        earlier.append(None if abs(apart) <= one.error + other.error else apart > 0)
    names: dict[str, Any] = {"triggering": None, "dashpot": None}
    if not isinstance(found, str):
        names |= dict(zip(("triggering", "sensitive", "numbers"), found, strict=True))
        jump = found[2]["jump"]
        names["jumped"] = jump and float(np.log10(jump / found[2]["largest_D"]["perturbed"]))
    if real is not None and units is not None and units.restitution is not None:
        impact = units.si("impact_velocity") / real.velocity(1.0)
        names["dashpot"] = dashpot(scene.law.kn, units.restitution, 1.0, impact)
    names |= {"scene": scene, "packing": settled, "ramp": scene.ramp, "runs": runs, "real": real, "growth": growth}
    names |= {"last": runs[0].equilibria[-1], "earlier": earlier, "says": found, "another": another}
    names |= {"solid_fraction": (solid_fraction(settled), solid_fraction_below_top(settled))}
    names |= {"residual": max(each.residual for run in runs for each in run.equilibria)}
    names |= {"above_noise": ABOVE_NOISE, "time_step_share": ACCURATE_SHARE}
    names |= {"settled_with_friction": getattr(scene.packing, "settle_friction", False)}
    return render(__package__ or "", "report.md.j2", **names)
