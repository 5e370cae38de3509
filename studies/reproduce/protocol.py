"""The paper's protocol on one packing, from the scene to a folder with its figures, numbers and report."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...analysis.digits import with_uncertainty
from ...analysis.wholefile import make_folder, write_text
from ...pywrap import Scene
from .compute import growth_run, pair_curve, recorded_ramp, summary_of, triggering_run
from .draw import figures, triggering_figures
from .page import report

Say = Callable[[str], None]


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
    make_folder(output)
    runs = []
    for number, mu in enumerate(scene.law.mus):
        say(f"mu = {mu:g}: settling, ramp and onset")
        path = output / ("run.h5" if number == 0 else f"run-mu{mu:g}.h5")
        runs.append(recorded_ramp(scene, mu, path))
        say(f"mu = {mu:g}: F_x^c = {with_uncertainty(runs[-1].onset.fx_c, runs[-1].onset.error)}")
    say("undamped run above the onset")
    growth = growth_run(scene, runs[0], output / "run.h5")
    say(f"growth rate of D: {growth.rate} measured, {growth.predicted:.6g} predicted")
    figures([pair_curve(run) for run in runs], growth, output)
    summary, triggered = summary_of(scene, runs, growth), None
    if scene.perturb is not None and scene.friction is not None:
        say(f"triggering at F_x = {scene.perturb.fx:g}")
        triggered = triggering_run(scene, scene.perturb, scene.friction, runs, output / "run.h5")
        triggering_figures(triggered, runs[0].mu, output)
        summary["triggering"] = triggered.as_dict()
    write_text(output / "summary.json", json.dumps(summary, indent=1) + "\n")
    write_text(output / "report.md", report(scene, runs, growth, triggered))
    return summary
