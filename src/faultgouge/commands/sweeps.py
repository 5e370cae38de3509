"""The commands sweep and merge: studies of many scenes; and the work of a command that runs one task."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import registered
from ..analysis.counted import counted
from ..mpi_rank import is_root
from ..signal_guard import keeps
from .terminal import Folder, Workers, command, print_line, progress, say

if TYPE_CHECKING:
    from faultgouge.studies.sweep.sweep_plan import Sweep

app = typer.Typer()

Shard = Annotated[
    str, typer.Option(metavar="K/N", help="Only part K of N, for job arrays; each part needs its own folder.")
]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Print the remaining work, and how long it takes by the rows that are there.")
]


@command(app, "faultgouge examples sweep && faultgouge sweep sweep.toml -o sweep", as_json=False)
def sweep(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="SWEEP", help="The sweep, a TOML file; `faultgouge examples sweep` has one.", show_default=False
        ),
    ],
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
    run_task(None, file, output, shard, workers, dry_run)


def run_task(task: str | None, file: Path, output: Path, shard: str, workers: int | None, dry_run: bool) -> None:
    """Run a sweep, or a scene or a sweep by the command of one task, and print what there is to say of all rows."""
    from faultgouge.analysis.files.atomic_write import check_own
    from faultgouge.studies.sweep.run_sweep import missing_points, read_results, remaining_work, run_sweep
    from faultgouge.studies.sweep.sweep_plan import Sweep, other_packings, points_of

    wanted = Sweep.from_toml(file) if task is None else Sweep.of_task(file, task)
    part, of = (text.isdecimal() and int(text) for text in shard.partition("/")[::2])
    if not (part and of and part <= of):
        raise typer.BadParameter(f"--shard {shard}: give the part and the number of parts, as in --shard 1/3")
    if is_root() and (sentence := other_packings(wanted)):
        say(sentence)
    if dry_run:
        known = read_results(output / "results.jsonl") if is_root() else {}
        for line in remaining_work(missing_points(points_of(wanted.points, (part, of)), known), known.values()):
            print_line(line)
        return
    for name, head in getattr(registered.study_of(wanted.task), "writes", {}).items():
        check_own(output / name, head)
    keeps(f"{output}/results.jsonl has the scenes that have ended; the same command continues from there", output)
    rows = run_sweep(wanted, output, (part, of), say, lambda rows, count: progress(rows, "scenes", count), workers)
    if is_root():
        _tell(wanted, rows, output, task)


def _tell(sweep: Sweep, rows: list[dict[str, Any]], output: Path, task: str | None = None) -> None:
    """Draw the rows of a sweep, and print how many failed and what its task says of all of them."""
    from faultgouge.studies.sweep.draw import draw_sweep
    from faultgouge.studies.sweep.run_sweep import require_result

    if task is None:
        failed = sum(row["says"] is not None for row in rows)
        print_line(
            f"{counted(len(rows), 'scene')}, {failed} of them failed; "
            f"written: {output}/results.csv{draw_sweep(rows, output, say)}"
        )
    elif not rows:
        print_line("this part of the sweep has no scenes")
    gather = getattr(registered.study_of(sweep.task), "gather", None)
    for line in gather(sweep, rows, output, say) if gather and rows else ():
        print_line(line)
    require_result(rows)


@command(
    app,
    "faultgouge examples sweep && "
    "for k in 1 2; do faultgouge sweep sweep.toml -o $k --shard $k/2; done && faultgouge merge 1 2",
    as_json=False,
)
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
        gather = getattr(registered.study_of(sweep.task), "gather", None)
        for line in gather(sweep, rows, output, say) if gather and rows else ():
            print_line(line)
