"""Stiff and extreme cases: each holds within a stated bound, or is refused in one sentence.

No case may give a NaN, a hang, a crash or a wrong number without a message. The cases are in `cases`, one module for
each kind of difficulty; this module runs them. extremes.json and extremes.md are written again after every case, so
that a case that crashes the program is the missing case. Runs with LAMMPS use all ranks; their number changes no
figure. Rank 0 writes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from itertools import groupby
from pathlib import Path
from typing import Any

from mpi4py import MPI

from ...analysis import FaultgougeError
from ...analysis.files.atomic_write import make_folder, write_json, write_text
from ...figures.pages import render
from ...figures.style import report_failure, save
from .cases import dynamics, eigenvalues, geometry, loads, restarts
from .cases.case import Case, Outcome
from .draw import extremes_figure

Say = Callable[[str], None]

CASES: tuple[Case, ...] = tuple(
    case for module in (loads, geometry, dynamics, eigenvalues, restarts) for case in module.CASES
)


class ExtremeCasesError(FaultgougeError):
    """Cases that failed, in one sentence."""


def extremes(
    output: Path,
    quick: bool = False,
    say: Say = print,
    progress: Callable[[Sequence[Case]], Iterable[Case]] = lambda cases: cases,
    cases: Sequence[Case] = CASES,
) -> dict[str, Any]:
    """Try the cases and leave extremes.json, extremes.md and extremes.png in a folder.

    Parameters
    ----------
    output : Path
        The folder, made if need be.
    quick : bool
        Only the small part of the cases.

    Returns
    -------
    dict
        What extremes.json holds: each case's name, group, status, figure, bound and what it says.
    """
    root = MPI.COMM_WORLD.rank == 0
    if root:
        make_folder(output, "extremes.json", "extremes.md")
    chosen = [case for case in cases if case.quick or not quick]
    done: list[tuple[Case, Outcome]] = []
    for case in progress(chosen):
        outcome = case.outcome()
        done.append((case, outcome))
        if outcome.status == "fails":
            say(f"{case.group}, {case.name}: {outcome.says}")
        if root:
            _write(done, output)
    if root:
        with report_failure(f"{output}/extremes.png", say):
            save(extremes_figure(done), output / "extremes")
    return _as_dict(done)


def check(result: dict[str, Any]) -> None:
    """Raise ExtremeCasesError if a case of a result has failed."""
    failed = [case["name"] for case in result["cases"] if case["status"] == "fails"]
    if failed:
        raise ExtremeCasesError(f"{len(failed)} of {len(result['cases'])} cases failed: {'; '.join(failed)}")


def _write(done: Sequence[tuple[Case, Outcome]], output: Path) -> None:
    """Write extremes.json and extremes.md with the results so far."""
    write_json(output / "extremes.json", _as_dict(done), allow_nan=False)
    statuses = [outcome.status for _, outcome in done]
    groups = [(name, list(members)) for name, members in groupby(done, lambda each: each[0].group)]
    drawn = output / "ramps.txt"  # of `python -m fuzz.ramps`, beside its picture
    ramps = drawn.read_text() if drawn.exists() else ""
    page = render(__package__ or "", "extremes.md.j2", done=done, statuses=statuses, groups=groups, ramps=ramps)
    write_text(output / "extremes.md", page)


def _as_dict(done: Sequence[tuple[Case, Outcome]]) -> dict[str, Any]:
    return {"cases": [{"name": case.name, "group": case.group} | asdict(outcome) for case, outcome in done]}
