"""The commands explain, reproduce, report, extremes, sweep, merge, and those of the studies that register themselves.

A study of `faultgouge.studies` says by its decorator what its command is (:mod:`faultgouge.registered`): a study of one
scene, or a task that runs for a scene or a sweep.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option
from typer.models import CommandInfo

from .. import registered
from ..analysis.counted import counted
from ..signal_guard import is_root, keeps
from .terminal import (
    COMMANDS,
    Folder,
    NewFolder,
    Results,
    SceneFile,
    Workers,
    command,
    locked,
    print_line,
    progress,
    read_scene,
    say,
    status,
)

if TYPE_CHECKING:
    from faultgouge.studies.sweep.sweep_plan import Sweep

FINISHED = "{{output}} has the {} that were finished; the same command starts from the beginning and replaces them"
TRIED = FINISHED.format("cases")
Shard = Annotated[str, Option(metavar="K/N", help="Part K of N, for job arrays, in a folder of its own.")]


def study_command(name: str) -> CommandInfo | None:
    """The command of a study; None if no study of this name has one."""
    about = registered.description(name)
    if about is None or not about.given.get("example"):
        return None
    example, made = about.given["example"], dict[str, Any]()
    if about.kind == "study":
        words = about.given.get("kept", "what was found so far")
        kept = f"{{output}}/{name}.jsonl has {words}; the same command continues from there"
        made = {"reads": name, "writes": "folder", "kept": kept, "as_json": True}

        def run(scene: SceneFile, output: Folder = Path(name)) -> Results:
            study = registered.study_of(name)
            yield study(scene, output, say, lambda rows, count: progress(rows, study.counts, count))
            yield f"written: {output}/{name}.{'md' if study.page else 'json'}"
    else:
        of_run = "of_run" in about.given
        metavar = "SCENE|SWEEP|drive.h5" if of_run else "SCENE|SWEEP"

        def run(  # type: ignore[misc]
            file: Path, output: Folder = Path(name), shard: Shard = "1/1", workers: Workers = None
        ) -> Results:
            if not (of_run and file.suffix == ".h5"):
                yield from _run_task(name, file, output, shard, workers)
            elif is_root():
                keeps(f"{output} has the states so far; the same command continues from there")
                with locked(output, kind="folder"):
                    study = registered.study_of(name)
                    yield from study.of_run(file, output, say, lambda rows, count: progress(rows, "states", count))

        run.__annotations__["file"] = Annotated[Path, Argument(metavar=metavar, help="A scene, or a sweep of it.")]
    run.__name__, run.__doc__ = name, about.says
    command(example, **made)(run)
    return COMMANDS.pop(name)


@command("faultgouge examples scene && faultgouge explain scene.toml", reads="explain", as_json=True)
def explain(scene: SceneFile) -> Results:
    """Explain what a scene includes, what it leaves out, and why.

    The command sets the run of the scene up in LAMMPS, takes no step, and says
    which parts LAMMPS has loaded.
    """
    from faultgouge.assessment.explain import explain as explain_scene
    from faultgouge.assessment.explain import in_words

    with status("setting up the run"):
        found = explain_scene(scene)
    yield from in_words(found)
    yield found


@command("faultgouge reproduce -o results", kept=FINISHED.format("parts"), writes="folder")
def reproduce(
    scene: Annotated[Path | None, Argument(metavar="[SCENE]", help="A scene of your own.")] = None,
    output: NewFolder = Path("results"),
) -> Results:
    """Run the paper's protocol on one packing: figures, numbers and a report.

    Without a scene, figures 1, 3 and 4 show paper.toml. Figure 5 shows
    triggered.toml, a packing in which the growth comes from the instability.
    """
    from importlib.resources import files

    shipped = Path(str(files("faultgouge") / "scenes"))
    wanted = read_scene(scene or shipped / "paper.toml", "reproduce")
    from faultgouge.studies.reproduce import reproduce as run_protocol

    triggered = read_scene(shipped / "triggered.toml", "reproduce") if scene is None else None
    run_protocol(wanted, output, say, triggered)
    yield f"written: {output}/report.md"


@command("faultgouge report --quick -o report", kept=FINISHED.format("studies"), writes="folder")
def report(
    output: NewFolder = Path("report"),
    quick: Annotated[bool, Option("--quick", help="Fewer points: half a minute instead of two.")] = False,
) -> Results:
    """Measure error against run time: which method to use when, for four tasks, with figures and numbers."""
    from faultgouge.assessment.work_precision.run import report as run_studies

    run_studies(output, quick, say, lambda name, runs: progress(runs, name, len(runs)))
    yield f"written: {output}/report.md"


@command("mpiexec -n 2 faultgouge extremes -o extremes", kept=TRIED, writes="folder", as_json=True)
def extremes(
    output: NewFolder = Path("extremes"),
    quick: Annotated[bool, Option("--quick", help="About half of the cases, in a few seconds.")] = False,
) -> Results:
    """Test stiff and extreme cases: each holds within a stated bound, or is refused in one sentence."""
    from faultgouge.assessment.extremes.run import check
    from faultgouge.assessment.extremes.run import extremes as try_all

    result = try_all(output, quick, say, lambda cases: progress(cases, "cases", len(cases)))
    counts = Counter(case["status"] for case in result["cases"])
    yield result
    of = f"{counts['holds']} hold, {counts['refused']} are refused in a sentence, {counts['fails']} fail"
    yield f"{counts.total()} cases: {of}; written: {output}/extremes.md"
    check(result)


@command("faultgouge examples sweep && faultgouge sweep sweep.toml -o sweep")
def sweep(
    file: Annotated[Path, Argument(metavar="SWEEP", help="A TOML file; `faultgouge examples sweep` has one.")],
    output: Folder = Path("sweep"),
    shard: Shard = "1/1",
    workers: Workers = None,
) -> Results:
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
    yield from _run_task(None, file, output, shard, workers)


def _run_task(task: str | None, file: Path, output: Path, shard: str, workers: int | None) -> Results:
    """Run a sweep, or a scene or a sweep by the command of one task, and tell what there is to say of all rows."""
    from faultgouge.analysis.files.atomic_write import check_own
    from faultgouge.studies.sweep.draw import draw_sweep
    from faultgouge.studies.sweep.run_sweep import require_result, run_sweep
    from faultgouge.studies.sweep.sweep_plan import Sweep, other_packings

    wanted = Sweep.from_toml(file) if task is None else Sweep.of_task(file, task)
    part, of = (text.isdecimal() and int(text) for text in shard.partition("/")[::2])
    if not (part and of and part <= of):
        raise typer.BadParameter(f"--shard {shard}: give the part and the number of parts, as in --shard 1/3")
    if is_root() and (sentence := other_packings(wanted)):
        say(sentence)
    for name, head in getattr(registered.study_of(wanted.task), "writes", {}).items():
        check_own(output / name, head)
    keeps(f"{output}/results.jsonl has the scenes that have ended; the same command continues from there")
    rows = run_sweep(wanted, output, (part, of), say, lambda rows, count: progress(rows, "scenes", count), workers)
    if not is_root():
        return
    if task is None:
        failed = sum(row["says"] is not None for row in rows)
        drawn = draw_sweep(rows, output, say)
        yield f"{counted(len(rows), 'scene')}, {failed} of them failed; written: {output}/results.csv{drawn}"
    elif not rows:
        yield "this part of the sweep has no scenes"
    yield from _gather(wanted, rows, output)
    require_result(rows)


def _gather(sweep: Sweep, rows: list[dict[str, Any]], output: Path) -> Results:
    """What the task of a sweep makes of all its rows."""
    gather = getattr(registered.study_of(sweep.task), "gather", None)
    yield from gather(sweep, rows, output, say) if gather and rows else ()


@command(
    "faultgouge examples sweep && "
    "for k in 1 2; do faultgouge sweep sweep.toml -o $k --shard $k/2; done && faultgouge merge 1 2",
    alone=True,
)
def merge(
    parts: Annotated[list[Path], Argument(metavar="DIR...", help="Folders of `sweep --shard`.")],
    output: Annotated[Path, Option("-o", "--output", help="The folder to write.")] = Path("merged"),
) -> Results:
    """Join the shards of a sweep; the table is that of an undivided sweep.

    The shards are only read, and may still be running. Rows that the folder DIR of -o
    has are kept. A row with a result goes before one with an error; two different
    results of one scene are an error.
    """
    from faultgouge.studies.sweep.draw import draw_sweep
    from faultgouge.studies.sweep.run_sweep import merge as merge_parts

    sweep, rows = merge_parts(parts, output, print_line)
    draw_sweep(rows, output, say)
    yield from _gather(sweep, rows, output)
