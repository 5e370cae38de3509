"""The table of stated and true errors of onsets that the report shows, computed or stated anew.

    python -m research.coverage [--rows table.jsonl] [--scenes 60] [--restate]

Each draw becomes a row as soon as it is computed, and the same command resumes an interrupted run.
"""

import argparse
import json
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import get_args

from faultgouge.analysis import NoEquilibriumError
from faultgouge.assessment.work_precision.coverage.stated_errors import (
    INCREMENTS_AT_ONCE,
    REFINEMENT,
    TABLE,
    CoverageCase,
    Dissipation,
    FirstOnset,
    draw_scene,
    read,
    restate_case,
)
from faultgouge.pywrap import Engine, settle

SCENES = 60
"""Of either kind that have an onset and contacts that change before it."""


def compute_cases(number: int) -> list[CoverageCase]:
    """The undamped and the damped case of a draw."""
    scene = draw_scene(number)
    bare = scene.model_copy(update={"damping": None})
    assert scene.ramp is not None
    step = scene.ramp.step
    undamped, damped = (
        CoverageCase(
            kind, number, getattr(scene.packing, "disks", 100), scene.law.mus[0], scene.precision, step, fresh=True
        )
        for kind in get_args(Dissipation)
    )
    try:
        start = settle(bare)
    except NoEquilibriumError:
        return [undamped, damped]
    with Engine(start.packing) as engine:
        undamped = _compare_case(FirstOnset(bare, engine, start), undamped)
        if undamped.changes or number == 0:  # a damped search takes ten times the time, and its onset is near
            damped = _compare_case(FirstOnset(scene, engine, start), damped)
    return [undamped, damped]


def _compare_case(onset: FirstOnset, case: CoverageCase) -> CoverageCase:
    """The case with what its onset states and the limit of small increments, if contacts change before the onset."""
    found = onset.first_window()
    changes = 0 if found is None else onset.changes(found[0], found[1].fx_onset)
    if found is None or not changes:
        return case
    fx_c, stated = onset.whole(*found)
    case = replace(case, changes=changes, fx_c=fx_c, stated=stated)
    before = found[1].fx_onset - INCREMENTS_AT_ONCE * case.increment
    coarser, finest = (onset.first_window(finer, before) for finer in (REFINEMENT // 2, REFINEMENT))
    if coarser is None or finest is None:
        return case
    limit = finest[1].fx_onset
    return replace(case, limit=limit, uncertain=abs(coarser[1].fx_onset - limit))


def cases(path: Path, scenes: int) -> Iterator[CoverageCase]:
    """Yield cases until enough scenes of either kind count: first those of the file, then new ones, which it adds."""
    known = read(path)
    counts = dict.fromkeys(get_args(Dissipation), 0)
    number = 0
    while min(counts.values()) < scenes:
        found = [case for case in known if case.number == number]
        if not found:
            found = compute_cases(number)
            with path.open("a") as file:
                file.write("".join(json.dumps(asdict(case)) + "\n" for case in found))
        for case in found:
            counts[case.kind] += case.counts
            yield case
        number += 1


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=Path, default=TABLE, help="the file, which is gone on with")
    parser.add_argument("--scenes", type=int, default=SCENES, help="of either kind")
    parser.add_argument("--restate", action="store_true", help="only state the errors of the file anew")
    chosen = parser.parse_args()
    if chosen.restate:
        anew = [restate_case(case) if case.counts else case for case in read(chosen.rows)]
        chosen.rows.write_text("".join(json.dumps(asdict(case)) + "\n" for case in anew))
    for case in cases(chosen.rows, chosen.scenes):
        if case.counts:
            print(
                f"{case.kind} {case.number}: {case.changes} changes, F_x^c = {case.fx_c:.9g}, true error "
                f"{case.true:.2g} (+- {case.uncertain:.2g}), stated {case.stated:.2g}: {case.share:.3g}",
                flush=True,
            )


if __name__ == "__main__":
    main()
