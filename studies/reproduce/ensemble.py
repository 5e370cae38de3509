"""`reproduce --ensemble M`: a sweep of the task "triggering" over M seeds, and its summary in numbers and words.

See :mod:`~faultgouge.studies.sweep.triggering` for what is examined, and :mod:`~faultgouge.studies.statistics` for
shares, intervals and distributions.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...analysis.digits import with_uncertainty
from ...analysis.files.wholefile import write_text
from ...figures.pages import lines
from ...figures.style import save, spared
from ...pywrap import Scene, SceneError
from ...pywrap.scenes.packing_section import GeneratedPacking
from ...pywrap.scenes.refusals import needed
from ..statistics import quartiles, share
from ..sweep.compute import Progress, Say, run_sweep
from ..sweep.points import Sweep
from ..sweep.tasks import TASKS
from ..sweep.triggering import Eruption, RampEnd, economical, frictions
from .ensemble_figure import ensemble_figure

RISES = (5, 10)
"""Rises in decades whose shares are given; the paper's figure 5 has 12."""


@dataclass(frozen=True)
class Member:
    """What was found for one packing: a row of the sweep.

    Attributes
    ----------
    seed : int
        Of its loose start.
    ramps, lowered, eruption
        As the task "triggering" has them.
    says : str or None
        What went wrong, if something did; what is there then was found before.
    seconds : float
        Wall time.
    """

    seed: int
    ramps: tuple[RampEnd, ...] = ()
    lowered: bool | None = None
    eruption: Eruption | None = None
    says: str | None = None
    seconds: float = 0.0

    @classmethod
    def from_row(cls, row: dict[str, Any]) -> Member:
        """A member from a row of results.jsonl."""
        found = row["result"]
        ramps = tuple(RampEnd(**each) for each in found.get("ramps", ()))
        eruption = Eruption(**found["eruption"]) if found.get("eruption") else None
        seed = row["values"]["packing.seed"]
        return cls(seed, ramps, found.get("lowered"), eruption, row["says"], row["seconds"])


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
    needed(scene.ramp, "ramp")
    first, scene = scene.packing.seed, economical(scene)
    mapping = {"task": "triggering", "sweep": {"packing.seed": f"{first}:{first + members - 1}"}}
    sweep = Sweep.from_mapping(mapping | {"scene": scene.resolved()}, TASKS)
    rows = run_sweep(
        sweep, output, say=say, progress=lambda ended, count: progress(_told(ended, say), count), workers=workers
    )
    if not rows:
        return {}
    found = [Member.from_row(row) for row in rows]
    result = summary(scene, found)
    write_text(output / "ensemble.json", json.dumps(result, indent=1) + "\n")
    with spared(f"{output}/ensemble.png", say):
        ramps, eruptions = [member.ramps for member in found], [member.eruption for member in found]
        save(ensemble_figure(ramps, eruptions), output / "ensemble")
    for line in lines(__package__ or "", "ensemble.j2", result=result):
        say(line)
    return result


def _told(rows: Iterable[dict[str, Any]], say: Say) -> Iterator[dict[str, Any]]:
    for row in rows:
        say(sentence(Member.from_row(row)))
        yield row


def summary(scene: Scene, members: list[Member]) -> dict[str, Any]:
    """Numbers for ensemble.json."""
    ramped = [member for member in members if len(member.ramps) == len(frictions(scene))]
    eruptions = [member.eruption for member in ramped if member.eruption is not None]
    rises, controls = [each.rise for each in eruptions], [each.control_rise for each in eruptions]
    decided = [member.lowered for member in ramped if member.lowered is not None]
    return {
        "scene": scene.resolved(),
        "seeds": sorted(member.seed for member in members),
        "failed": [{"seed": each.seed, "says": each.says} for each in members if each.says is not None],
        "onsets": [_onset_summary(ends) for ends in zip(*(member.ramps for member in ramped), strict=True)],
        "lowered": share(sum(decided), len(decided)),
        "lowered_unknown": len(ramped) - len(decided),
        "rises": _rises(rises),
        "control_rises": _rises(controls),
        "rise_quartiles": _quartiles(rises),
        "control_rise_quartiles": _quartiles(controls),
        "unstable_when_weakened": share(sum(each.rate > 0 for each in eruptions), len(eruptions)),
        "grows": share(sum(each.grows for each in eruptions), len(eruptions)),
    }


def _rises(values: list[float]) -> dict[str, Any]:
    return {str(decades): share(sum(each >= decades for each in values), len(values)) for decades in RISES}


def _quartiles(values: list[float]) -> list[float] | None:
    return np.quantile(values, [0.25, 0.5, 0.75]).tolist() if values else None


def _onset_summary(ends: Sequence[RampEnd]) -> dict[str, Any]:
    return {
        "mu": ends[0].mu,
        "found": share(sum(end.ends == "onset" for end in ends), len(ends)),
        "none_until": sum(end.ends == "until" for end in ends),
        "flows": sum(end.ends == "flows" for end in ends),
        "quartiles": quartiles([end.reach for end in ends], [end.ends == "onset" for end in ends]),
    }


def sentence(member: Member) -> str:
    """What was found for one packing, in one line."""
    parts = [
        f"mu = {end.mu:g}: "
        + {
            "onset": f"F_x^c = {with_uncertainty(end.reach, end.error or 0.0)}",
            "until": f"no onset up to {end.reach:g}",
            "flows": f"no onset, flows beyond {end.reach:g}",
        }[end.ends]
        for end in member.ramps
    ]
    if member.eruption is not None:
        found = member.eruption
        parts.append(
            f"D rises {found.rise:.1f} decades at {found.fx:.6g} (control: {found.control_rise:.1f}) and "
            f"{'grows' if found.grows else 'does not grow'} after its jump"
        )
    if member.says is not None:
        parts.append(f"failed: {member.says}")
    return f"seed {member.seed}: {'; '.join(parts)} ({member.seconds:.0f} s)"
