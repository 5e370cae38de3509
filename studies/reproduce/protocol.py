"""The paper's protocol on one packing, from the scene to a folder with its figures, numbers and report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...analysis import Onset, OnsetError
from ...analysis.files.atomic_write import make_folder, write_json, write_text
from ...figures import PairCurve
from ...pywrap import Scene, SceneError
from ...pywrap.onset import load_at_onset
from ...pywrap.scenes.validation import require_section
from ...pywrap.settling.settle import settle_bed
from ..executors import Say
from ..study import draw_all
from ..triggering import Triggering
from ..triggering import summary as triggering_summary
from .compute import growth_run, recorded_ramp, summary_of, triggering_run
from .draw import figures
from .page import report
from .triggering_figures import figures as triggering_figures


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
    rate = "none" if growth.measured is None else f"{growth.measured.rate:.6g}"
    say(f"growth rate of D: {rate} measured, {growth.predicted:.6g} predicted")
    summary = summary_of(scene, runs, growth)
    write_json(output / "summary.json", summary)  # what follows may fail
    draw_all(figures([PairCurve.of_onset(run) for run in runs], growth), output, say)
    shaken, found, another = triggered or scene, None, None
    if shaken.perturb is not None and shaken.friction is not None:
        path = output / ("run.h5" if triggered is None else "triggered.h5")
        if triggered is not None:
            say("the packing to be triggered")
            another = _ramps(triggered, path, say)
        found = _trigger(shaken, another or runs, path, say)
        if isinstance(found, str):
            say(f"{found.rstrip('.')}: no figures 2, 5 and 6")
            summary["triggering"] = {"says": found}
        else:
            draw_all(triggering_figures(found), output, say)
            summary["triggering"] = triggering_summary(found)
        if another is not None:
            onsets = [{"mu": run.mu, "onset": run.as_dict()} for run in another]
            summary["triggering"] |= {"scene": shaken.resolved(), "onsets": onsets}
    else:
        say("the scene has no sections [perturb] and [friction]: no figures 2, 5 and 6")
    write_json(output / "summary.json", summary)
    write_text(output / "report.md", report(scene, runs, growth, found, another))
    return summary


def _trigger(scene: Scene, runs: list[Onset], path: Path, say: Say) -> Triggering | str:
    """The triggering at perturb.fx, or where the onsets say without it; or why there is nothing to trigger."""
    perturb = require_section(scene.perturb, "perturb")
    fx = perturb.fx
    if fx is None:
        try:
            fx = load_at_onset(scene, {run.mu: run for run in runs})
        except (SceneError, OnsetError) as error:
            return str(error)
        scene = scene.model_copy(update={"perturb": perturb.model_copy(update={"fx": fx})})
    say(f"triggering at F_x = {fx:g}")
    return triggering_run(scene, runs, path)


def _ramps(scene: Scene, path: Path, say: Say) -> list[Onset]:
    """Ramp and onset for each friction coefficient, the first in the file of that name, the others beside it."""
    # a packing that settles with friction is another one for each coefficient
    shared = not getattr(scene.packing, "settle_friction", False)
    if shared:
        say("settling")
    bed, runs = settle_bed(scene) if shared else None, []
    for number, mu in enumerate(scene.law.mus):
        say(f"mu = {mu:g}: {'' if shared else 'settling, '}ramp and onset")
        here = path if number == 0 else path.with_stem(f"{path.stem}-mu{mu:g}")
        runs.append(recorded_ramp(scene, mu, here, bed))
        say(f"mu = {mu:g}: {runs[-1].describe()}")
    return runs
