"""Stiff and extreme cases: each holds within a stated bound, or is refused in one sentence.

Never a NaN, a hang, a crash or a quiet wrong number. The cases are in `stability_cases`, a module for each kind of
trouble; here they are run, and their table and picture written. stability.json and stability.md are written anew after
every case, so that a case which takes the program down is the one that is missing. Runs with LAMMPS use all ranks,
whose number changes no figure; rank 0 writes.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from itertools import groupby
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from mpi4py import MPI

from .figures import INK, STYLE, save
from .stability_cases import dynamics, eigenvalues, geometry, loads, restarts
from .stability_cases.case import Case, Outcome

Say = Callable[[str], None]

CASES: tuple[Case, ...] = tuple(
    case for module in (loads, geometry, dynamics, eigenvalues, restarts) for case in module.CASES
)

COLOURS = {"holds": "C1", "refused": "C2", "fails": "C0"}

LOWEST = 1e-6
"""Left end of the picture, in units of the bound; what is smaller, such as an exact zero, is drawn there."""


class StabilityError(RuntimeError):
    """Cases that failed, in one sentence."""


def no_progress(cases: Sequence[Case]) -> Iterable[Case]:
    """Show nothing."""
    return cases


def stability(
    output: Path,
    quick: bool = False,
    say: Say = print,
    progress: Callable[[Sequence[Case]], Iterable[Case]] = no_progress,
    cases: Sequence[Case] = CASES,
) -> dict[str, Any]:
    """Try the cases and leave stability.json, stability.md and stability.png in a folder.

    Parameters
    ----------
    output : Path
        The folder, made if need be.
    quick : bool
        Only the small part of the cases.
    say : callable
        Takes a line of progress.
    progress : callable
        Wraps the cases to show how far it is.
    cases : sequence of Case
        What to try.

    Returns
    -------
    dict
        What stability.json holds: each case's name, group, status, figure, bound and what it says.
    """
    root = MPI.COMM_WORLD.rank == 0
    if root:
        output.mkdir(parents=True, exist_ok=True)
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
        save(stability_figure(done), output / "stability")
    return _as_dict(done)


def check(result: dict[str, Any]) -> None:
    """Raise StabilityError if a case of a result has failed."""
    failed = [case["name"] for case in result["cases"] if case["status"] == "fails"]
    if failed:
        raise StabilityError(f"{len(failed)} of {len(result['cases'])} cases failed: {'; '.join(failed)}")


@matplotlib.rc_context(fname=STYLE)
def stability_figure(done: Sequence[tuple[Case, Outcome]]) -> Figure:
    """Every case, and how far within its bound it is.

    Parameters
    ----------
    done : sequence of (Case, Outcome)
        Cases of one group stand together.

    Returns
    -------
    Figure
        A row for each case; a disc at its figure over its bound, a square beyond the bound's line for a refusal.
    """
    columns = _columns(done)
    rows = max(sum(len(group) + 1.5 for group in column) for column in columns)
    figure = Figure(figsize=(3.6 * len(columns), 0.105 * rows + 0.7), layout="constrained")
    for axes, column in zip(figure.subplots(1, len(columns), squeeze=False)[0], columns, strict=True):
        names: dict[float, str] = {}
        place = 0.0
        for group in column:
            axes.text(LOWEST, place, f" {group[0][0].group}", fontsize=7, style="italic", va="center")
            place += 1
            for case, outcome in group:
                names[place] = case.name
                _draw(axes, place, outcome)
                place += 1
            place += 0.5
        axes.axvline(1, color=INK, linewidth=0.8)
        axes.set(xscale="log", xlim=(0.4 * LOWEST, 30), ylim=(rows - 0.5, -1), xlabel="figure / bound")
        axes.set_yticks(list(names), [_typeset(name) for name in names.values()], fontsize=5.5)
        axes.set_xticks([LOWEST, 1e-4, 1e-2, 1], ["0", "$10^{-4}$", "$10^{-2}$", "1"])
        axes.tick_params(axis="y", length=0, which="both")
        axes.minorticks_off()
    marks = [
        Line2D([], [], color=COLOURS[status], marker="s" if status == "refused" else "o", linestyle="")
        for status in COLOURS
    ]
    count = {status: sum(outcome.status == status for _, outcome in done) for status in COLOURS}
    legend = [f"{count['holds']} hold", f"{count['refused']} refused, as they should be", f"{count['fails']} fail"]
    figure.legend(marks, legend, loc="outside upper center", ncols=3)
    return figure


def _typeset(name: str) -> str:
    return (
        re.sub(r"([kFf])_([a-z]+)(\^c)?", r"$\1_{\2}\3$", name)
        .replace("mu =", r"$\mu$ =")
        .replace("eps =", r"$\epsilon$ =")
    )


def _draw(axes: Any, place: float, outcome: Outcome) -> None:
    colour = COLOURS[outcome.status]
    if outcome.figure is None or outcome.bound is None:
        axes.plot(8, place, "s" if outcome.status == "refused" else "X", color=colour)
        return
    ratio = outcome.figure / outcome.bound if outcome.bound > 0 else (0.0 if outcome.figure == 0 else np.inf)
    ratio = float(np.clip(ratio, LOWEST, 8))
    axes.plot([LOWEST, ratio], [place, place], color=colour, linewidth=0.6, alpha=0.5)
    axes.plot(ratio, place, "o", color=colour)


def _columns(done: Sequence[tuple[Case, Outcome]]) -> list[list[list[tuple[Case, Outcome]]]]:
    """The groups in two columns of about the same height, or in one if there are few."""
    groups = [list(members) for _, members in groupby(done, lambda each: each[0].group)]
    if len(done) < 30:
        return [groups]
    heights = np.cumsum([len(group) for group in groups])
    split = int(np.argmin(np.abs(heights - heights[-1] / 2))) + 1
    return [groups[:split], groups[split:]] if split < len(groups) else [groups]


def _write(done: Sequence[tuple[Case, Outcome]], output: Path) -> None:
    """stability.json and stability.md with what there is."""
    (output / "stability.json").write_text(json.dumps(_as_dict(done), indent=1, allow_nan=False) + "\n")
    (output / "stability.md").write_text(_page(done))


def _as_dict(done: Sequence[tuple[Case, Outcome]]) -> dict[str, Any]:
    return {"cases": [{"name": case.name, "group": case.group} | asdict(outcome) for case, outcome in done]}


def _page(done: Sequence[tuple[Case, Outcome]]) -> str:
    count = {status: sum(outcome.status == status for _, outcome in done) for status in COLOURS}
    lines = [
        "# Stiff and extreme cases",
        "",
        f"{len(done)} cases: {count['holds']} hold, {count['refused']} refused in one sentence, as they should be, "
        f"{count['fails']} fail. A case holds if its figure does not exceed its bound. The same numbers come out on "
        "any number of ranks.",
        "",
        "![figure over bound of every case](stability.png)",
        "",
    ]
    for name, members in groupby(done, lambda each: each[0].group):
        lines += [
            f"## {name[0].upper()}{name[1:]}",
            "",
            "| case | | figure | bound | what it says |",
            "|---|---|---|---|---|",
        ]
        for case, outcome in members:
            figure, bound = ("" if number is None else f"{number:.2g}" for number in (outcome.figure, outcome.bound))
            says = outcome.says.replace("|", "\\|")
            lines.append(f"| {case.name} | {outcome.status} | {figure} | {bound} | {says} |")
        lines.append("")
    return "\n".join(lines)
