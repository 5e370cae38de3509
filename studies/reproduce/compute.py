r"""The paper's protocol on one packing: ramps, onsets, growth, and the numbers of its summary.

Settle, raise F_x from equilibrium to equilibrium for each friction coefficient, find the onset F_x^c at which two real
eigenvalues coalesce; then start undamped dynamics from an equilibrium above the onset and compare the growth of the
mean square displacement D(t), which starts from rounding noise, with the rate 2 |Im omega| of the spectrum. If the
scene asks for it, a minute perturbation just below the onset follows (`triggering`).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...analysis import Growth, Onset, Packing, RunFile, Spectrum, fit_growth, solid_fraction, spectrum
from ...analysis.arrays import Floats
from ...analysis.counted import counted
from ...analysis.files.atomic_write import check_own
from ...analysis.responses.growth import growing_range
from ...analysis.responses.growth_of_run import PLATEAU_SHARE
from ...pywrap import Equilibrium, Record, Sample, Scene, SceneError, reach
from ...pywrap.onset import ONSET_DISTANCES, onset_run
from ...pywrap.runs.undamped import perturb, time_step
from ...pywrap.scenes.sections import Perturb
from ...pywrap.scenes.validation import require_section
from ..triggering import Triggering, equilibrium_at, series_of, trigger

EFOLDS = 48.0
"""Length of the undamped run in units of 1/rate: D grows by up to 20 decades in it."""

MOST_RUN_STEPS = 3_000_000
"""Steps of the undamped run, at the most: about 20 s for 100 disks."""


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


def triggering_run(scene: Scene, runs: list[Onset], path: Path) -> Triggering | str:
    """A perturbation between the onsets of the weakened and of the static friction, or why there is nothing to trigger.

    The series go to run.h5.
    """
    run, mu_ss = runs[0], require_section(scene.friction, "friction").mu_ss
    fx = require_section(scene.perturb, "perturb").fx
    assert fx is not None  # the protocol has chosen it
    # exact but for the product's rounding
    weakened = [each for each in runs if np.isclose(each.mu, run.mu * mu_ss, rtol=1e-12)]
    if weakened and weakened[0].windows[0].kind != "start" and fx <= weakened[0].fx_c:
        return (
            f"F_x = {fx:g} is below the onset {weakened[0].fx_c:g} of the weakened friction, too: no "
            "window between the two, and nothing to erupt."
        )
    *_, start = reach(scene, fx)  # to the bit the equilibrium of `perturb`, with its v_0
    modes = spectrum(start.packing)
    if modes.is_stable is False:
        what = f"{counted(len(modes.pairs), 'complex pair')} and {counted(len(modes.negative), 'negative eigenvalue')}"
        return f"At F_x = {fx:g} the packing has {what} already: nothing is stable there to be triggered."
    lower = max(0.0, 2 * weakened[0].fx_c - fx) if weakened else None
    control = None if lower is None else equilibrium_at(scene, run.equilibria, lower)
    return trigger(scene, start, control, run, path)


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


def growth_run(scene: Scene, run: Onset, path: Path) -> GrowthRun:
    """An undamped run where the ramp shows the fastest growth by one pair."""
    candidates = [each for each in run.equilibria if each.fx > run.fx_c]
    spectra = [spectrum(each.packing) for each in candidates]
    best = int(np.argmax([_dominance(each) for each in spectra]))
    start, modes = candidates[best], spectra[best]
    if not _dominance(modes):
        first = run.windows[0]
        raise SceneError(
            f"no load of the ramp lies in a window of complex eigenvalues, of which the first begins at "
            f"F_x = {first.fx_onset:.6g}: take a smaller ramp.step, so that a run above the onset has where to start"
        )
    dt = time_step(start.packing)
    predicted = modes.growth_rate(dt)
    settings = Perturb(
        fx=start.fx, time=min(EFOLDS / predicted, MOST_RUN_STEPS * dt), inertia_factor=scene.inertia_factor
    )
    # disks that have moved by a tenth of the smallest overlap certainly move otherwise than the spectrum says
    ceiling = (0.1 * start.packing.smallest_overlap) ** 2
    samples: list[Sample] = []
    with RunFile(path, "a") as file:
        for sample in perturb(scene.model_copy(update={"perturb": settings}), start, samples=4000, early=0):
            samples.append(sample)
            if sample.msd > 1e6 * ceiling:
                break
        series = series_of(samples)
        file.append_series("undamped", **series)
    time, msd = series["time"], series["msd"]
    try:
        measured = fit_growth(time, msd, *growing_range(time, msd, min(ceiling, PLATEAU_SHARE * float(msd.max()))))
    except ValueError:
        measured = None
    return GrowthRun(start, time, msd, modes, dt, predicted, measured)


def _dominance(modes: Spectrum) -> float:
    """Growth rate of the fastest pair less the rate of the second pair; 0 of a packing that buckles."""
    if len(modes.negative):
        return 0.0
    rates = sorted((pair.growth_rate for pair in modes.pairs), reverse=True)
    return rates[0] - (rates[1] if len(rates) > 1 else 0.0) if rates else 0.0


def summary_of(scene: Scene, runs: list[Onset], growth: GrowthRun) -> dict[str, Any]:
    """Numbers for summary.json."""
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
                "solid_fraction": solid_fraction(run.equilibria[0].packing),
                "flows_beyond": run.flows_beyond,
                "onset": run.as_dict(),
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
