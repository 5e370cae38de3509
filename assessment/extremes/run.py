"""Try the stiff and extreme cases: each holds within its stated bound, or is refused in one sentence.

No case may give a NaN, a hang, a crash or a wrong number without a message. extremes.json and extremes.md are written
again after every case, so that a case that crashes the program is the missing case. Runs with LAMMPS use all ranks;
their number changes no figure. Rank 0 writes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from mpi4py import MPI

from ...analysis import FaultgougeError
from ...analysis.files.atomic_write import make_folder
from ...figures.style import INK, report_failure, save, styled
from ..results import AssessmentError, reason_of, write_results
from .cases import Case, cases

LOWEST, BEYOND = 1e-6, 8.0
"""Ends of the picture, in units of the bound; what is smaller, such as an exact zero, or larger is drawn there."""

Outcome = dict[str, Any]
"""name, group, status ("holds", "refused" or "fails"), figure, bound, says: the criterion, or the sentence."""


def extremes(
    output: Path,
    quick: bool = False,
    say: Callable[[str], None] = print,
    progress: Callable[[Sequence[Case]], Iterable[Case]] = lambda cases: cases,
    wanted: Sequence[Case] | None = None,
) -> dict[str, Any]:
    """Try the cases, or the quick ones alone, and leave extremes.json, extremes.md and extremes.png in a folder, which
    is made if need be; returns what extremes.json holds."""
    root, done = MPI.COMM_WORLD.rank == 0, list[Outcome]()
    if root:
        make_folder(output, "extremes.json", "extremes.md")
    for case in progress([case for case in wanted or cases() if case.quick or not quick]):
        done.append(try_case(case))
        if done[-1]["status"] == "fails":
            say(f"{case.group}, {case.name}: {done[-1]['says']}")
        if root:
            drawn = output / "ramps.txt"  # of `python -m fuzz.ramps`, beside its picture
            ramps = drawn.read_text() if drawn.exists() else ""
            write_results(output, "extremes", __package__ or "", {"cases": done}, ramps=ramps)
    if root:
        with report_failure(f"{output}/extremes.png", say):
            save(extremes_figure(done), output / "extremes")
    return {"cases": done}


def try_case(case: Case) -> Outcome:
    """The outcome of a case. Any error is a failure of this case alone, unless the ranks have lost each other."""
    about: Outcome = {"name": case.name, "group": case.group, "status": "fails", "figure": None, "bound": None}
    try:
        figure, bound, says = case.run()
    except Exception as error:
        if getattr(error, "one_rank", False):
            raise
        said, sentence = str(error).strip(), isinstance(error, ValueError | FaultgougeError)
        if sentence and "\n" not in said and case.refusal and case.refusal in said:
            return about | {"status": "refused", "says": said}
        return about | {"says": reason_of(error)}
    if case.refusal:
        return about | {"says": f"it was not refused, expected: {case.refusal}"}
    if not isfinite(figure):
        return about | {"bound": float(bound), "says": f"not a number; {says}"}
    status = "holds" if figure <= bound else "fails"
    return about | {"status": status, "figure": float(figure), "bound": float(bound), "says": says}


def check(result: dict[str, Any]) -> None:
    """Raise AssessmentError if a case of a result has failed."""
    failed = [case["name"] for case in result["cases"] if case["status"] == "fails"]
    if failed:
        raise AssessmentError(f"{len(failed)} of {len(result['cases'])} cases failed: {'; '.join(failed)}")


@styled
def extremes_figure(done: Sequence[Outcome]) -> Figure:
    """A row for each case: a mark at its figure over its bound, and beyond the bound's line for a refusal."""
    figure = Figure(figsize=(5.4, 0.135 * len(done) + 1.2), layout="constrained")
    axes = figure.add_subplot()
    statuses = ("holds", "hold", "oC1"), ("refused", "refused, as they should be", "sC2"), ("fails", "fail", "XC0")
    with np.errstate(divide="ignore", invalid="ignore"):
        figures, bounds = np.array([(each["figure"], each["bound"]) for each in done], dtype=float).T
        ratios = np.clip(np.nan_to_num(figures / bounds), LOWEST, BEYOND)
        ratios[np.isnan(figures)] = BEYOND
    for status, words, style in statuses:
        rows = np.flatnonzero([each["status"] == status for each in done])
        axes.plot(ratios[rows], rows, style[0], color=style[1:], label=f"{len(rows)} {words}")
        if status != "refused":
            axes.hlines(rows, LOWEST, ratios[rows], color=style[1:], linewidth=0.6, alpha=0.5)
    axes.axvline(1, color=INK, linewidth=0.8)
    axes.set(xscale="log", xlim=(0.4 * LOWEST, 30), ylim=(len(done), -1), xlabel="figure / bound")
    axes.set_yticks(range(len(done)), [each["name"] for each in done], fontsize=7)
    axes.set_xticks([LOWEST, 1e-4, 1e-2, 1], ["0", "$10^{-4}$", "$10^{-2}$", "1"])
    axes.tick_params(axis="x", labeltop=True)  # the picture is longer than a screen
    axes.minorticks_off()
    figure.legend(loc="outside upper center", ncols=3)
    return figure
