"""The paper's protocol on one packing, from the scene to a folder with its figures, numbers and report."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...analysis.digits import with_uncertainty
from ...analysis.files.wholefile import make_folder, write_text
from ...figures.style import spared
from ...pywrap import Scene
from ...pywrap.onset.undamped import OnsetRun
from ..triggering.draw import figures as triggering_figures
from .compute import growth_run, onsets_of, pair_curve, recorded_ramp, summary_of, triggering_run
from .draw import figures
from .page import report

Say = Callable[[str], None]


def reproduce(scene: Scene, output: Path, say: Say = print, triggered: Scene | None = None) -> dict[str, Any]:
    """Run the protocol and leave figures, run.h5, summary.json and report.md in a folder.

    Parameters
    ----------
    scene : Scene
        With a section [ramp] and one or more friction coefficients.
    output : Path
        The folder, made if need be. Ramps are written to run.h5 (first friction coefficient) and run-mu*.h5.
    say : callable
        Takes a line of progress.
    triggered : Scene, optional
        Another packing, with [perturb] and [friction], which is the one that is triggered; its ramps are written to
        triggered.h5 and triggered-mu*.h5. By default it is the packing of `scene`, if that has these sections.

    Returns
    -------
    dict
        What summary.json holds.
    """
    make_folder(output)
    runs = _ramps(scene, output / "run.h5", say)
    say("undamped run above the onset")
    growth = growth_run(scene, runs[0], output / "run.h5")
    say(f"growth rate of D: {growth.rate} measured, {growth.predicted:.6g} predicted")
    summary, found = summary_of(scene, runs, growth), None
    _write(summary, output)  # what follows may fail
    with spared("a figure of the onset", say):
        figures([pair_curve(run) for run in runs], growth, output)
    shaken = triggered or scene
    if shaken.perturb is not None and shaken.friction is not None:
        if triggered is not None:
            say("the packing to be triggered")
        path = output / ("run.h5" if triggered is None else "triggered.h5")
        onsets = runs if triggered is None else _ramps(triggered, path, say)
        say(f"triggering at F_x = {shaken.perturb.fx:g}")
        found = triggering_run(shaken, onsets, path)
        if found.triggering is not None:
            with spared("a figure of the triggering", say):
                triggering_figures(found.triggering, output)
        summary["triggering"] = found.as_dict()
        if triggered is not None:
            summary["triggering"] |= {"scene": triggered.resolved(), "onsets": onsets_of(onsets)}
    _write(summary, output)
    write_text(output / "report.md", report(scene, runs, growth, found))
    return summary


def _write(summary: dict[str, Any], output: Path) -> None:
    write_text(output / "summary.json", json.dumps(summary, indent=1) + "\n")


def _ramps(scene: Scene, path: Path, say: Say) -> list[OnsetRun]:
    """Ramp and onset for each friction coefficient, the first in the file of that name, the others beside it."""
    runs = []
    for number, mu in enumerate(scene.law.mus):
        say(f"mu = {mu:g}: settling, ramp and onset")
        here = path if number == 0 else path.with_stem(f"{path.stem}-mu{mu:g}")
        runs.append(recorded_ramp(scene, mu, here))
        say(f"mu = {mu:g}: F_x^c = {with_uncertainty(runs[-1].onset.fx_c, runs[-1].onset.error)}")
    return runs
