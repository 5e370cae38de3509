"""The table of stated and true errors of onsets computed, or stated anew, and the page made from it.

python -m research.coverage.make compute SCENES   until SCENES scenes of either kind count; goes on with the table
python -m research.coverage.make restate          the onsets and stated errors of the table by the present code
python -m research.coverage.make page             README.md and its picture, from the table
python -m research.coverage.make check            some of the cases stated anew, and compared

From the folder of the repository.
"""

import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, get_args

from matplotlib.figure import Figure

from faultgouge.figures import INK, render, styled
from research.coverage.cases import CoverageCase, Dissipation, compute_cases, read, restate_case
from research.pictures import draw_all

HERE = Path(__file__).parent
TABLE = HERE / "tables" / "onsets.jsonl"

ROWS_SHOWN = 12
"""Cases of the page's table, those with the largest shares."""

CHECKED_DISKS, CHECKED = 20, 6
"""Disks of the cases that are checked, a second or two each, and how many are."""


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


@styled
def stated_over_true(counting: Sequence[CoverageCase]) -> Figure:
    """Stated over true errors, with a colour for each kind of onset; open markers came after the rule was chosen."""
    figure = Figure(figsize=(4.6, 3.6), layout="constrained")
    axes = figure.subplots()
    errors = [each for case in counting for each in (case.true, case.stated or 0.0)]
    smallest, largest = 0.3 * min(each for each in errors if each > 0), 3 * max(errors)
    axes.plot([smallest, largest], [smallest, largest], color=INK, linewidth=0.8)
    axes.fill_between([smallest, largest], [smallest, largest], largest, color=INK, alpha=0.06, linewidth=0)
    axes.text(0.06, 0.94, "covered", transform=axes.transAxes, va="top")
    axes.set(xscale="log", yscale="log", xlim=(smallest, largest), ylim=(smallest, largest), aspect="equal")
    axes.set(xlabel="true error of $F_x^c$", ylabel="stated error of $F_x^c$")
    for number, kind in enumerate(dict.fromkeys(case.kind for case in counting)):
        for fresh in (False, True):
            of_it = [case for case in counting if case.kind == kind and case.fresh == fresh]
            true, stated = [max(case.true, smallest) for case in of_it], [case.stated or smallest for case in of_it]
            style: dict[str, Any] = {"color": f"C{number}", "fillstyle": "none" if fresh else "full", "markersize": 4}
            label = f"{kind}, {'drawn later' if fresh else 'first draws'}"
            axes.plot(true, stated, "os"[number], label=label, clip_on=False, **style)
    axes.legend(loc="lower right")
    return figure


def write_page(folder: Path = HERE, table: Path = TABLE) -> Path:
    """Write README.md of a folder from a table."""
    counting = [case for case in read(table) if case.counts]
    worst = sorted(counting, key=lambda case: -case.share)[:ROWS_SHOWN]
    (folder / "README.md").write_text(render("research.coverage", "README.md.j2", cases=counting, worst=worst))
    return folder / "README.md"


def check() -> list[str]:
    """Cases that the present code states otherwise, of some small ones."""
    small = [case for case in read(TABLE) if case.counts and case.disks <= CHECKED_DISKS]
    pairs = [(case, restate_case(case)) for case in small[:: len(small) // CHECKED]]
    return [
        f"{old.kind} {old.number}: {new.fx_c}, before {old.fx_c}, share {new.share:.3g}"
        for old, new in pairs
        if not new.holds or new.changes != old.changes
    ]


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["compute", scenes]:
            for found in cases(TABLE, int(scenes)):
                print(f"{found.kind} {found.number}: {f'share {found.share:.3g}' if found.counts else '-'}", flush=True)
        case ["restate"]:
            anew = [restate_case(each) if each.counts else each for each in read(TABLE)]
            TABLE.write_text("".join(json.dumps(asdict(each)) + "\n" for each in anew))
        case ["page"]:
            shown = [each for each in read(TABLE) if each.counts]
            draw_all({"stated": lambda: stated_over_true(shown)}, HERE / "pictures")
            print(write_page())
        case ["check"]:
            print(check() or "the same")
        case _:
            sys.exit(__doc__)
