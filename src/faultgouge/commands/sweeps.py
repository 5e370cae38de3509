"""The commands sweep, merge and modes: studies of many scenes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..analysis.counted import counted
from ..mpi_rank import is_root
from ..signal_guard import keeps
from .terminal import Folder, Workers, lock_folder, print_line, progress, say, table_of

if TYPE_CHECKING:
    from faultgouge.studies.sweep.sweep_plan import Sweep

app = typer.Typer()

KEPT = "{}/results.jsonl has the scenes that have ended; the same command continues from there"
"""What is said of an interrupted sweep in a folder."""

Shard = Annotated[
    str, typer.Option(metavar="K/N", help="Only part K of N, for job arrays; each part needs its own folder.")
]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Print the remaining work, and how long it takes by the rows that are there.")
]


@app.command(epilog="Example: faultgouge sweep genericity.toml -o sweep")
def sweep(
    file: Annotated[Path, typer.Argument(metavar="SWEEP", help="The sweep, a TOML file.", show_default=False)],
    output: Folder = Path("sweep"),
    shard: Shard = "1/1",
    workers: Workers = None,
    dry_run: DryRun = False,
) -> None:
    """Run one task for every scene of a product of keys: results.jsonl, the table results.csv, and a picture.

    A sweep names a task (onset, triggering, ..., or a function of your own as
    "file.py:function"). Section [sweep] has lists of values or ranges for any keys
    of a scene, as in "packing.seed" = "1:200". Sections [scene.SECTION] have the
    keys that all scenes share. Each result is written as soon as it is known, and
    the same command continues an interrupted sweep. A scene that fails is a row with
    its error sentence, and is tried again, unless it is refused or has no
    equilibrium. If every scene has failed, the exit code is 1. With several ranks,
    possibly on several machines, one rank distributes the work: mpiexec -n 5 keeps 4
    cores busy.
    """
    from faultgouge.studies.sweep.draw import draw_sweep
    from faultgouge.studies.sweep.run_sweep import require_result, run_sweep
    from faultgouge.studies.sweep.sweep_plan import Sweep
    from faultgouge.studies.sweep.tasks import TASKS

    wanted, part = Sweep.from_toml(file, TASKS), _shard(shard)
    _warn_of_seeds(wanted)
    if dry_run:
        _print_rest(wanted, part, output)
        return
    keeps(KEPT.format(output), output)
    rows = run_sweep(wanted, output, part, say, lambda ended, count: progress(ended, "scenes", count), workers)
    if is_root():
        failed = sum(row["says"] is not None for row in rows)
        print_line(
            f"{counted(len(rows), 'scene')}, {failed} of them failed; "
            f"written: {output}/results.csv{draw_sweep(rows, output, say)}"
        )
        _summarise(wanted.task, rows, output)
        require_result(rows)


@app.command(epilog="Example: faultgouge merge shard1 shard2 shard3 -o whole")
def merge(
    parts: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Folders of `sweep --shard`.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The folder to write.")] = Path("merged"),
) -> None:
    """Join the shards of a sweep; the table is that of an undivided sweep.

    The shards are only read, and may still be running. Rows that the folder DIR of -o
    has are kept. A row with a result goes before one with an error; two different
    results of one scene are an error.
    """
    from faultgouge.studies.sweep.draw import draw_sweep
    from faultgouge.studies.sweep.run_sweep import merge as merge_parts

    if is_root():
        sweep, rows = merge_parts(parts, output, print_line)
        draw_sweep(rows, output, say)
        _summarise(sweep.task, rows, output)


def _summarise(task: str, rows: list[dict[str, Any]], output: Path) -> None:
    """Print the shares over all scenes of the task "triggering", and write summary.json."""
    if task != "triggering":
        return
    from faultgouge.analysis.files.atomic_write import write_json
    from faultgouge.studies.sweep.triggering_summary import in_words, summary

    numbers = summary(rows)
    write_json(output / "summary.json", numbers)
    for line in in_words(numbers):
        print_line(line)


def _print_rest(sweep: Sweep, part: tuple[int, int], output: Path) -> None:
    """The work that is left of a part, and how long it takes."""
    from faultgouge.studies.sweep.run_sweep import RESULTS_FILE, missing_points, read_results
    from faultgouge.studies.sweep.sweep_plan import shard
    from faultgouge.studies.sweep.tasks import remaining_work

    if is_root():
        known = read_results(output / RESULTS_FILE)
        for line in remaining_work(missing_points(shard(sweep.points, part), known), known.values()):
            print_line(line)


def _warn_of_seeds(sweep: Sweep) -> None:
    """Say where a seed stands for several packings."""
    from faultgouge.studies.sweep.seeds import other_packings

    if is_root() and (sentence := other_packings(sweep)):
        say(sentence)


def _shard(text: str) -> tuple[int, int]:
    """K/N as numbers."""
    part, _, of = text.partition("/")
    if not (part.isdecimal() and of.isdecimal() and 1 <= int(part) <= int(of)):
        raise typer.BadParameter(f"--shard {text}: give the part and the number of parts, as in --shard 1/3")
    return int(part), int(of)


@app.command(epilog="Example: faultgouge modes modes.toml -o modes")
def modes(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="SCENE|SWEEP|drive.h5",
            help="A scene, a sweep of the task modes, or a run of `drive`.",
            show_default=False,
        ),
    ],
    output: Folder = Path("modes"),
    shard: Shard = "1/1",
    workers: Workers = None,
    dry_run: DryRun = False,
) -> None:
    """Compute the complex modes along the ramp: their number, growth rates, and the loss that would stop them.

    At each load of the section [modes] the command computes all eigenvalues: the
    share of complex modes, the largest growth rate, and the least Q, the quality
    factor below which dissipation stops all growth. It writes modes.json, modes.csv,
    pictures over the load and of the plane of frequencies, and a film of this plane.
    For a sweep, the pictures show medians over packings.

    Of a drive.h5 the command computes the eigenvalues of each stored state, with the
    stiffness of the spring: complex pairs, growth with and without dissipation, and
    the lowest eigenvalue, with the contacts at Coulomb's bound all sticking, and all
    sliding. It writes cycle.json, cycle.csv and a picture.
    """
    from faultgouge.studies.cycle.study import holds_drive
    from faultgouge.studies.modes.study import modes as count_modes
    from faultgouge.studies.modes.study import read_modes_sweep
    from faultgouge.studies.sweep.run_sweep import require_result

    if holds_drive(file):
        _along_cycles(file, output)
        return
    wanted, part = read_modes_sweep(file), _shard(shard)
    _warn_of_seeds(wanted)
    if dry_run:
        _print_rest(wanted, part, output)
        return
    keeps(KEPT.format(output), output)
    result = count_modes(wanted, output, part, say, lambda rows, count: progress(rows, "scenes", count), workers)
    if is_root() and not result:
        print_line("this part of the sweep has no scenes")
    elif is_root():
        _show_modes(result["rows"])
        failed = [each["says"] for each in result["packings"] if each["says"] is not None]
        print_line(f"packings: {len(result['packings'])}, failed: {len(failed)}; written: {output}/modes.json")
        for sentence in failed[:1]:
            print_line(f"the first that failed: {sentence}")
        short = [each for each in result["packings"] if each["says"] is None and each["ends"] != "until"]
        for each in short[:1]:
            why = "an eigenvalue is negative" if each["ends"] == "turning point" else "there is no equilibrium"
            print_line(
                f"packings whose branch ends before the last load, so that loads are left out: {len(short)}; the first "
                f"of them goes to F_x = {each['reach']:g}, and {why} at the next load"
            )
        require_result(result["packings"])


def _along_cycles(file: Path, output: Path) -> None:
    """The eigenvalues of the states of a driven run, and those before its slips as a table."""
    from faultgouge.studies.cycle.study import cycle

    if not is_root():
        return
    keeps(f"{output}/cycle.json has the states so far; the same command continues from there", output)
    with lock_folder(output):
        result = cycle(file, output, say, lambda frames, count: progress(frames, "states", count))
    states, rows = result["states"], []
    for number, slip in enumerate(result["slips"], 1):
        before = [state for state in states if state["time"] <= slip["begins"]][-1]
        rows.append([str(number), *(_cell(before[name]) for name in COLUMNS_BEFORE_SLIPS)])
    if rows:
        print_line(table_of(("slip", *COLUMNS_BEFORE_SLIPS.values()), rows))
    moving = sum(not state["rests"] for state in states)
    print_line(
        f"{counted(len(states), 'state')}, {moving} of them not in equilibrium (the flag rests), "
        f"{counted(len(rows), 'slip')}; written: {output}/cycle.json, cycle.csv, cycle.png"
    )


COLUMNS_BEFORE_SLIPS = {
    "time": "begins",
    "force": "F",
    "at_bound": "at the bound",
    "pairs_sticking": "pairs",
    "undamped_sticking": "undamped",
    "damped_sticking": "damped, stick",
    "damped_sliding": "damped, slide",
    "lowest_sticking": "lowest, stick",
    "lowest_sliding": "lowest, slide",
}
"""Columns of the table of states before slips, with their headings."""


def _cell(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def _show_modes(rows: list[dict[str, Any]]) -> None:
    """The loads of a packing, or the first of many, as a table."""
    first = [row for row in rows if (row["disks"], row["seed"]) == (rows[0]["disks"], rows[0]["seed"])]
    lines = []
    for row in first:
        numbers = str(row["pairs"]), f"{row['share']:.3f}", _cell(row["growth_rate"]), _cell(row["least_q"])
        lines.append((f"{row['fx_over_fy']:g}", *numbers))
    if lines:
        print_line(table_of(("F_x/F_y", "complex pairs", "share", "growth rate of D", "least Q"), lines))
