"""`reproduce --ensemble M`: a sweep of the task "triggering" over M seeds, and its summary in numbers and words.

See :mod:`~faultgouge.studies.sweep.triggering` for what is examined, and :mod:`~faultgouge.studies.statistics` for
shares, intervals and distributions.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...analysis.files.atomic_write import write_json
from ...analysis.uncertain_digits import with_uncertainty
from ...figures.pages import lines
from ...pywrap import Scene, SceneError
from ...pywrap.scenes.packing_section import GeneratedPacking
from ...pywrap.scenes.validation import require_section
from ..executors import Progress, Say
from ..statistics import quartiles, share
from ..study import draw_all
from ..sweep.run_sweep import run_sweep
from ..sweep.sweep_plan import Sweep
from ..sweep.table import Row
from ..sweep.tasks import TASKS
from ..sweep.triggering import economical, frictions, grows, rise_in_decades
from .ensemble_figure import ensemble_figure

RISES = (5, 10)
"""Rises in decades whose shares are given; the paper's figure 5 has 12."""

QUARTILES = (0.25, 0.5, 0.75)


def ensemble(
    scene: Scene,
    members: int,
    output: Path,
    say: Say = print,
    progress: Progress = lambda rows, _: rows,
    workers: int | None = 1,
) -> dict[str, Any]:
    """Examine the packings of the seeds seed, ..., seed + members - 1 of a scene.

    Leaves what a sweep leaves, and ensemble.json and a figure. Increments and undamped runs are no longer than
    `economical` has them.

    Parameters
    ----------
    scene : Scene
        With a generated packing and [ramp]; with [friction] and [perturb] for eruptions. perturb.fx is not used.
    members : int
        Number of packings M.
    output, say, progress, workers
        As of `run_sweep`.

    Returns
    -------
    dict
        What ensemble.json holds; empty on ranks other than 0.

    Raises
    ------
    SceneError
        If the scene has no generated packing or no section [ramp].
    """
    if not isinstance(scene.packing, GeneratedPacking):
        raise SceneError("an ensemble needs packings of several seeds, and the scene has a stored one: give a seed")
    require_section(scene.ramp, "ramp")
    first, scene = scene.packing.seed, economical(scene)
    mapping = {"task": "triggering", "sweep": {"packing.seed": f"{first}:{first + members - 1}"}}
    sweep = Sweep.from_mapping(mapping | {"scene": scene.resolved()}, TASKS)

    def told(row: Row) -> Row:
        say(sentence(row))
        return row

    rows = run_sweep(sweep, output, (1, 1), say, lambda ended, count: progress(map(told, ended), count), workers)
    if not rows:
        return {}
    result = summary(scene, rows)
    write_json(output / "ensemble.json", result)
    draw_all({"ensemble": lambda: ensemble_figure([row["result"] for row in rows])}, output, say)
    for line in lines(__package__ or "", "ensemble.j2", result=result):
        say(line)
    return result


VERDICTS = {
    "grows": "D grows after its jump, at the rate of the spectrum",
    "jump alone": "a jump, and no growth after it",
    "unexplained": "D rises after its jump, and not at the rate of the spectrum",
    "too short": "the layer exceeds v0 too late in the run to tell a jump from growth",
    "does not weaken": "the layer does not exceed v0",
}
"""What the run with mu(v) of a packing shows, in words."""


def summary(scene: Scene, rows: list[Row]) -> dict[str, Any]:
    """Numbers for ensemble.json, from the rows of the sweep."""
    count = len(frictions(scene))
    ramped = [row["result"] for row in rows if len(row["result"].get("ramps", ())) == count]
    eruptions = [each["eruption"] for each in ramped if each["eruption"]]
    rises, controls = ([rise_in_decades(each, of) for each in eruptions] for of in ("weakening", "control"))
    decided = [each["lowered"] for each in ramped if each["lowered"] is not None]

    def at_least(values: list[float]) -> dict[str, Any]:
        return {str(decades): share(sum(each >= decades for each in values), len(values)) for decades in RISES}

    return {
        "scene": scene.resolved(),
        "seeds": sorted(row["values"]["packing.seed"] for row in rows),
        "failed": [
            {"seed": row["values"]["packing.seed"], "says": row["says"]} for row in rows if row["says"] is not None
        ],
        "onsets": [_onset_summary(ends) for ends in zip(*(each["ramps"] for each in ramped), strict=True)],
        "lowered": share(sum(decided), len(decided)),
        "lowered_unknown": len(ramped) - len(decided),
        "rises": at_least(rises),
        "control_rises": at_least(controls),
        "rise_quartiles": np.quantile(rises, QUARTILES).tolist() if rises else None,
        "control_rise_quartiles": np.quantile(controls, QUARTILES).tolist() if controls else None,
        "unstable_when_weakened": share(sum(each["rate"] > 0 for each in eruptions), len(eruptions)),
        "grows": share(sum(map(grows, eruptions)), len(eruptions)),
        "perturbation_shows": share(sum(each["perturbation_shows"] for each in eruptions), len(eruptions)),
    }


def _onset_summary(ramps: Sequence[Row]) -> dict[str, Any]:
    ends, found = [each["ends"] for each in ramps], [each["ends"] == "onset" for each in ramps]
    return {
        "mu": ramps[0]["mu"],
        "found": share(sum(found), len(found)),
        "none_until": ends.count("until"),
        "flows": ends.count("flows"),
        "quartiles": quartiles([each["reach"] for each in ramps], found),
    }


def sentence(row: Row) -> str:
    """What was found for one packing, in one line."""
    parts = []
    for end in row["result"].get("ramps", ()):
        words = {
            "onset": f"F_x^c = {with_uncertainty(end['reach'], end['error'] or 0.0)}",
            "until": f"no onset up to {end['reach']:g}",
            "flows": f"no onset, flows beyond {end['reach']:g}",
        }
        parts.append(f"mu = {end['mu']:g}: {words[end['ends']]}")
    found = row["result"].get("eruption")
    if found:
        parts.append(
            f"D rises {rise_in_decades(found):.1f} decades at {found['fx']:.6g} "
            f"(control: {rise_in_decades(found, 'control'):.1f}): "
            f"{VERDICTS[found['verdict']]}"
            + ("" if found["perturbation_shows"] else ", and the perturbation drowns in rounding")
        )
    if row["says"] is not None:
        parts.append(f"failed: {row['says']}")
    return f"seed {row['values']['packing.seed']}: {'; '.join(parts)} ({row['seconds']:.0f} s)"
