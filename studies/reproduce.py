r"""The paper's protocol on one packing: its figures, numbers, and a report in plain words.

Settle, raise F_x from equilibrium to equilibrium for each friction coefficient, find the onset F_x^c where two real
eigenvalues coalesce; then start undamped dynamics from an equilibrium above the onset and compare the growth of the
mean square displacement D(t), which starts from rounding noise, with the rate 2 |Im omega| of the spectrum. Where the
scene asks for it, a minute perturbation just below the onset follows (`triggering`).
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..analysis import (
    Growth,
    Packing,
    RunFile,
    Spectrum,
    discrete_frequency,
    fit_growth,
    follow,
    spectrum,
)
from ..pywrap import Engine, Equilibrium, Record, Sample, Scene, SceneError
from ..pywrap.scene import Friction, Perturb
from ..pywrap.stages import next_equilibrium, perturb, time_step
from .onsets import OnsetRun, onset_run
from .triggering import figures, sensitivity, trigger, words
from .triggering import summary as triggering_summary

Floats = NDArray[np.float64]
Say = Callable[[str], None]

EFOLDS = 48.0
"""Length of the undamped run in units of 1/rate: D grows by up to 20 decades in it."""

LONGEST_RUN = 3_000_000
"""Steps of the undamped run, at the most: about 20 s for 100 disks."""

NEAR_ONSET = np.concatenate([-np.geomspace(1e-3, 1e-7, 13), [0.0], np.geomspace(1e-6, 1e-3, 7)])
"""Distances from the onset at which there are further equilibria, in units of the ramp's last F_x: for figure 3, and
below the onset for the response over the distance."""


@dataclass(frozen=True, eq=False)
class GrowthRun:
    """An undamped run above the onset.

    Attributes
    ----------
    start : Equilibrium
        Where it began.
    time, msd : ndarray, shape (T,)
        D(t).
    spectrum : Spectrum
        Of the equilibrium.
    time_step : float
        Of the run.
    predicted : float
        Growth rate of D from the spectrum and the time step's dispersion, 1/time.
    measured : Growth or None
        Fitted to D(t); None where D does not grow far enough between its noise and where it levels off.
    """

    start: Equilibrium
    time: Floats
    msd: Floats
    spectrum: Spectrum
    time_step: float
    predicted: float
    measured: Growth | None


def reproduce(scene: Scene, output: Path, say: Say = print) -> dict[str, Any]:
    """Run the protocol and leave figures, run.h5, summary.json and report.md in a folder.

    Parameters
    ----------
    scene : Scene
        With a section [ramp] and one or more friction coefficients.
    output : Path
        The folder, made if need be. Ramps are written to run.h5 (first friction coefficient) and run-mu*.h5.
    say : callable
        Takes a line of progress.

    Returns
    -------
    dict
        What summary.json holds.
    """
    output.mkdir(parents=True, exist_ok=True)
    runs = []
    for number, mu in enumerate(scene.law.mus):
        say(f"mu = {mu:g}: settling, ramp and onset")
        path = output / ("run.h5" if number == 0 else f"run-mu{mu:g}.h5")
        runs.append(_recorded(scene, mu, path))
        say(f"mu = {mu:g}: F_x^c = {runs[-1].onset.fx_c:.10g} +- {runs[-1].onset.error:.1g}")
    say("undamped run above the onset")
    growth = _growth(scene, runs[0], output / "run.h5")
    say(f"growth rate of D: {_rate(growth)} measured, {growth.predicted:.6g} predicted")
    _figures(runs, growth, output)
    summary = _summary(scene, runs, growth)
    more: list[str] = []
    if scene.perturb is not None and scene.friction is not None:
        say(f"triggering at F_x = {scene.perturb.fx:g}")
        more, summary["triggering"] = _triggering(scene, scene.perturb, scene.friction, runs, output)
    (output / "summary.json").write_text(json.dumps(summary, indent=1) + "\n")
    (output / "report.md").write_text(_report(scene, runs, growth, more))
    return summary


def _triggering(
    scene: Scene, settings: Perturb, friction: Friction, runs: list[OnsetRun], output: Path
) -> tuple[list[str], dict[str, Any]]:
    """Lines of the report and numbers; figures and series are written."""
    run = runs[0]
    # exact but for the product's rounding
    weakened = [each for each in runs if np.isclose(each.mu, run.mu * friction.mu_ss, rtol=1e-12)]
    if weakened and settings.fx <= weakened[0].onset.fx_c:
        says = (
            f"F_x = {settings.fx:g} is below the onset {weakened[0].onset.fx_c:g} of the weakened friction, too: no "
            "window between the two, and nothing to erupt."
        )
        return ["## Triggering", "", says, ""], {"says": says}
    if settings.fx >= run.onset.fx_c:
        says = f"F_x = {settings.fx:g} is above the onset {run.onset.fx_c:g}: nothing is stable there to be triggered."
        return ["## Triggering", "", says, ""], {"says": says}
    start = _equilibrium_at(scene, run, settings.fx)
    control = _equilibrium_at(scene, run, max(0.0, 2 * weakened[0].onset.fx_c - settings.fx)) if weakened else None
    triggering = trigger(scene, start, control, settings, friction, output / "run.h5")
    sensitive = sensitivity(run)
    figures(triggering, sensitive, run.mu, output)
    return words(triggering, sensitive, settings, run.mu), triggering_summary(triggering, sensitive)


def _recorded(scene: Scene, mu: float, path: Path) -> OnsetRun:
    one = scene.model_copy(update={"law": scene.law.model_copy(update={"mu": mu})})
    path.unlink(missing_ok=True)
    with Record(path, one) as record:
        return onset_run(one, mu, reached=record.append, near_onset=NEAR_ONSET * _last_load(scene))


def _last_load(scene: Scene) -> float:
    if scene.ramp is None:
        raise SceneError("the scene has no section [ramp]: add it, with step and until")
    return scene.ramp.until


def _growth(scene: Scene, run: OnsetRun, path: Path) -> GrowthRun:
    """An undamped run where the ramp shows the fastest growth by one pair."""
    candidates = [each for each in run.equilibria if each.fx > run.onset.fx_c]
    spectra = [spectrum(each.packing) for each in candidates]
    best = int(np.argmax([_dominance(each) for each in spectra]))
    start, modes = candidates[best], spectra[best]
    dt = time_step(start.packing)
    fastest = max(modes.pairs, key=lambda pair: pair.growth_rate)
    predicted = float(2 * np.abs(discrete_frequency(fastest.eigenvalue, dt).imag))
    settings = Perturb(fx=start.fx, time=min(EFOLDS / predicted, LONGEST_RUN * dt), inertia_factor=scene.inertia_factor)
    # disks that have moved by a tenth of the smallest overlap certainly move otherwise than the spectrum says
    ceiling = (0.1 * start.packing.loaded(start.residual).geometry.overlap.min()) ** 2
    samples: list[Sample] = []
    with RunFile(path, "a") as file:
        for sample in perturb(scene.model_copy(update={"perturb": settings}), start, samples=4000, early=0):
            samples.append(sample)
            if sample.msd > 1e6 * ceiling:
                break
        file.append_series("undamped", **{key: [getattr(s, key) for s in samples] for key in vars(samples[0])})
    time, msd = np.array([s.time for s in samples]), np.array([s.msd for s in samples])
    try:
        measured = fit_growth(time, msd, *_growing(msd, ceiling))
    except ValueError:
        measured = None
    return GrowthRun(start, time, msd, modes, dt, predicted, measured)


def _rate(growth: GrowthRun) -> str:
    return "none" if growth.measured is None else f"{growth.measured.rate:.6g}"


def _growing(msd: Floats, ceiling: float) -> tuple[float, float]:
    """Bounds of D between which one pair grows alone: above the noise of all modes, below where D levels off.

    The noise is what D shows in the first quarter of its way to the ceiling; three decades above it, the fastest pair
    has left the others behind. Three decades below its largest value D has not levelled off.
    """
    upper = min(ceiling, 1e-3 * float(msd.max()))
    way = int(np.argmax(msd >= upper))
    return 1e3 * float(np.median(msd[: max(way // 4, 1)])), upper


def _dominance(modes: Spectrum) -> float:
    """Growth rate of the fastest pair, less that of the second: how fast it gets ahead."""
    rates = sorted((pair.growth_rate for pair in modes.pairs), reverse=True)
    return rates[0] - (rates[1] if len(rates) > 1 else 0.0) if rates else 0.0


def _pair_curve(run: OnsetRun) -> Any:
    from .figures import PairCurve

    first = run.onset.windows[0]
    packings = {each.fx: each.packing for each in run.equilibria} | run.between
    reach = 2.0 * first.fx_onset
    path = [packings[fx] for fx in sorted(packings) if fx <= reach]
    fx = np.array([packing.fx for packing in path])
    values = follow(path)
    beyond = values[np.searchsorted(fx, first.fx_onset, side="right")]
    split = np.abs(beyond - first.eigenvalue) + np.where(beyond.imag == 0, np.inf, 0.0)
    up = int(np.nanargmin(split))
    down = int(np.nanargmin(np.abs(beyond - beyond[up].conj())))
    return PairCurve(mu=run.mu, fx=fx, eigenvalues=values[:, [up, down]], fx_c=first.fx_onset)


def _figures(runs: list[OnsetRun], growth: GrowthRun, output: Path) -> None:
    from .figures import coalescence_figure, growth_figure, packing_figure, save

    save(packing_figure(growth.start.packing), output / "figure1")
    save(coalescence_figure([_pair_curve(run) for run in runs]), output / "figure3")
    measured = growth.measured
    if measured is None:
        return
    figure = growth_figure(
        growth.time,
        growth.msd,
        window=(measured.start, measured.end),
        predicted_rate=growth.predicted,
        measured_rate=measured.rate,
    )
    save(figure, output / "figure4")


def _summary(scene: Scene, runs: list[OnsetRun], growth: GrowthRun) -> dict[str, Any]:
    return {
        "scene": scene.resolved(),
        "ramps": [
            {
                "mu": run.mu,
                "equilibria": len(run.equilibria),
                "evaluations": [each.evaluations for each in run.equilibria],
                "largest_residual": max(each.residual for each in run.equilibria),
                "floor": run.equilibria[-1].floor,
                "contacts": len(run.equilibria[0].packing.contacts),
                "rattlers": run.equilibria[0].packing.rattlers.tolist(),
                "flows_beyond": run.flows_beyond,
                "onset": run.onset.as_dict(),
            }
            for run in runs
        ],
        "growth": {
            "fx": growth.start.fx,
            "time_step": growth.time_step,
            "predicted_rate": growth.predicted,
            "measured": asdict(growth.measured) if growth.measured else None,
            "deviation": growth.measured.rate / growth.predicted - 1 if growth.measured else None,
        },
    }


def _equilibrium_at(scene: Scene, run: OnsetRun, fx: float) -> Equilibrium:
    below = max((each for each in run.equilibria if each.fx <= fx), key=lambda each: each.fx)
    with Engine(below.packing) as engine:
        return below if below.fx == fx else next_equilibrium(engine, below, fx, scene)


def _report(scene: Scene, runs: list[OnsetRun], growth: GrowthRun, more: list[str]) -> str:
    packing, ramp = runs[0].equilibria[0].packing, scene.ramp
    assert ramp is not None  # there are runs
    lines = [
        "# The paper's protocol on one packing",
        "",
        "What was run is the protocol of Charan, Pomyalov and Procaccia, *Generic Mechanism for Remote Triggering of",
        "Earthquakes*. The paper's packing is not public, and another packing has another onset, so that its",
        "F_x^c = 0.0091 is no number to hit; what carries over is the mechanism.",
        "",
        "## What was run",
        "",
        f"A layer of {len(packing)} disks, {packing.top.sum()} of them in the upper layer, settled under",
        f"F_y = {packing.fy:g} on each disk of the upper layer: {len(packing.contacts)} contacts, "
        f"{len(packing.rattlers)} rattlers (disks that touch nothing, left out of the spectrum).",
        f"Then F_x was raised to {runs[0].equilibria[-1].fx:g} in steps of {ramp.step:g}, from equilibrium to "
        f"equilibrium ({ramp.method}).",
        f"The largest force left on a disk is {max(e.residual for run in runs for e in run.equilibria):.1e}; the "
        f"rounding of the coordinates alone leaves about {runs[0].equilibria[-1].floor:.1e}"
        + ("." if packing.compensated else ", so that the paper's 1e-15"),
        *([] if packing.compensated else ['needs `precision = "compensated"` in the scene.']),
        "",
        "![the packing](figure1.png)",
        "",
        "## What was found",
        "",
        "| mu | F_x^c | error | double eigenvalue | how the window begins | windows up to the end of the ramp |",
        "|---|---|---|---|---|---|",
        *(_onset_row(run) for run in runs),
        "",
        *_onset_words(runs),
        "",
        "![real parts coalesce, imaginary parts bifurcate](figure3.png)",
        "",
        f"At F_x = {growth.start.fx:g}, above the onset, undamped dynamics from rest (step {growth.time_step:.3g}) "
        "multiplies its own rounding noise:",
        *_growth_words(growth),
        "",
        *more,
        "## What the paper leaves open, and what was taken",
        "",
        *(f"- {line}" for line in _assumptions(scene, packing)),
        "",
        "Numbers: summary.json. Every equilibrium: run.h5 (H5MD).",
        "",
    ]
    return "\n".join(lines)


def _onset_row(run: OnsetRun) -> str:
    first = run.onset.windows[0]
    return (
        f"| {run.mu:g} | {first.fx_onset:.12g} | {first.error:.1g} | {first.eigenvalue:.8g} | {first.kind} | "
        f"{len(run.onset.windows)} |"
    )


def _growth_words(growth: GrowthRun) -> list[str]:
    predicted = f"the spectrum predicts 2 |Im omega| = {growth.predicted:.6g}"
    measured = growth.measured
    if measured is None:
        return [f"D(t) reaches {growth.msd.max():.1e}, not far enough above its noise for a rate; {predicted}."]
    return [
        f"D(t) grows by {measured.decades:.1f} decades at the rate {measured.rate:.6g} +- {measured.error:.1g}; "
        f"{predicted}, a difference of {100 * (measured.rate / growth.predicted - 1):+.2f} %.",
        "",
        "![D(t)](figure4.png)",
    ]


def _onset_words(runs: list[OnsetRun]) -> list[str]:
    lines = []
    for run in runs:
        if run.flows_beyond is not None:
            lines.append(
                f"For mu = {run.mu:g} no equilibrium was found beyond F_x = {run.flows_beyond:g}: the layer flows."
            )
    order = sorted(runs, key=lambda run: run.mu)
    rising = all(a.onset.fx_c < b.onset.fx_c for a, b in pairwise(order))
    if len(order) > 1:
        lines.append(
            "As in the paper, the onset comes earlier for smaller mu."
            if rising
            else "Unlike in the paper, the onset does not come earlier for smaller mu in this packing."
        )
    return lines


def _assumptions(scene: Scene, packing: Packing) -> list[str]:
    periodic = packing.box_length is not None
    return [
        f"side boundaries: {'periodic in x, width ' + format(packing.box_length, 'g') if periodic else 'open'}",
        "upper layer: free disks, the constant force on each, no bond between them",
        f"inertia: I_0 = {packing.inertia_factor:g} in I = I_0 m R^2 (a uniform disk has 1/2)",
        f"tangential stiffness: k_t = {packing.law.kt:.10g}, k_n = {packing.law.kn:g}",
        "settling: "
        + (
            "with friction, so that the packing carries tangential load at F_x = 0"
            if getattr(scene.packing, "settle_friction", False)
            else "without friction, which then begins with zero slips, so that K is symmetric at F_x = 0; every disk "
            "is pulled down first, so that the upper layer comes to lie on the bed"
        ),
        "time step of undamped runs: 0.05 of the stability limit 2/omega_max; damping in relaxation only",
        "f_min: the force on a disk, with torque over radius, in the units of k_n and F_y; what was reached is said "
        "above",
        "stability operator: the exact derivative of the forces, with the turning of the tangent that the paper's "
        "Eq. 14 leaves out",
        "units: mass of a disk 1, diameter of a small disk 1, k_n as given",
    ]
