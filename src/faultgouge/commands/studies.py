"""The commands explain, reproduce, report and extremes, and those of the studies that register themselves.

A study of `faultgouge.studies` says by its decorator what its command is (:mod:`faultgouge.registered`): a study of one
scene, or a task that runs for a scene or a sweep.
"""

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer
from typer.models import CommandInfo

from .. import registered
from ..mpi_rank import is_root
from ..signal_guard import keeps
from .sweeps import DryRun, Shard, run_task
from .terminal import (
    Answer,
    Folder,
    NewFolder,
    SceneFile,
    Workers,
    command,
    lock_folder,
    print_line,
    progress,
    read_scene,
    say,
    status,
)

app = typer.Typer()

REPLACED = "; the same command starts from the beginning and replaces them"


def names_of_commands() -> list[str]:
    """The names of the studies that are commands."""
    return [name for name in registered.names() if find_command(name)]


def find_command(name: str) -> CommandInfo | None:
    """The command of a study; None if no study of this name has one."""
    about = registered.description(name)
    if about is None or not about.given.get("example"):
        return None
    own, example = typer.Typer(), about.given["example"]
    if about.kind == "study":
        words = about.given.get("kept", "what was found so far")
        kept = f"{{output}}/{name}.jsonl has {words}; the same command continues from there"

        def study(scene: SceneFile, output: Folder = Path(name)) -> Answer:
            run = registered.study_of(name)
            result = run(scene, output, say, lambda rows, count: progress(rows, run.counts, count))
            return Answer(result=result, written=f"written: {output}/{name}.{'md' if run.page else 'json'}")

        study.__doc__ = about.says
        command(own, example, name=name, reads=name, kept=kept)(study)
    else:
        metavar, argument = "SCENE|SWEEP", f"A scene, or a sweep of the task {name}."
        if "of_run" in about.given:
            metavar, argument = "SCENE|SWEEP|drive.h5", f"A scene, a sweep of the task {name}, or a run of `drive`."

        def task(
            file: Annotated[Path, typer.Argument(metavar=metavar, help=argument, show_default=False)],
            output: Folder = Path(name),
            shard: Shard = "1/1",
            workers: Workers = None,
            dry_run: DryRun = False,
        ) -> None:
            if file.suffix == ".h5" and (of_run := registered.study_of(name).of_run) is not None:
                keeps(f"{output} has the states so far; the same command continues from there", output)
                if is_root():
                    with lock_folder(output):
                        for line in of_run(file, output, say, lambda rows, count: progress(rows, "states", count)):
                            print_line(line)
                return
            run_task(name, file, output, shard, workers, dry_run)

        task.__doc__ = about.says
        command(own, example, name=name, as_json=False)(task)
    return own.registered_commands[0]


@command(app, "faultgouge explain scene.toml", reads="explain", task="settle")
def explain(scene: SceneFile) -> Answer:
    """Explain what a scene includes, what it leaves out, and why.

    The command sets the run of the scene up in LAMMPS, takes no step, and compares
    what LAMMPS has loaded with and without each part.
    """
    from faultgouge.assessment.explain import explain as explain_scene
    from faultgouge.assessment.explain import in_words

    with status("setting up the run with and without each part"):
        found = explain_scene(scene)
    return Answer(in_words(found), found)


@app.command(epilog="Example: faultgouge reproduce -o results")
def reproduce(
    scene: Annotated[
        Path | None, typer.Argument(metavar="[SCENE]", help="A scene of your own, in place of that of the package.")
    ] = None,
    output: NewFolder = Path("results"),
) -> None:
    """Run the paper's protocol on one packing: figures, numbers and a report.

    Without a scene, figures 1, 3 and 4 show paper.toml. Figure 5 shows
    triggered.toml, a packing in which the growth comes from the instability.
    """
    from importlib.resources import files

    shipped = Path(str(files("faultgouge") / "scenes"))
    wanted = read_scene(scene or shipped / "paper.toml", "reproduce", "reproduce")
    from faultgouge.studies.reproduce import reproduce as run_protocol

    keeps(f"what is in {output} so far is kept; the same command starts from the beginning and replaces it", output)
    triggered = read_scene(shipped / "triggered.toml", "reproduce") if scene is None else None
    with lock_folder(output):
        run_protocol(wanted, output, say, triggered)
    print_line(f"written: {output}/report.md")


@command(
    app,
    "faultgouge report --quick -o report",
    kept="{output} has the studies that were finished" + REPLACED,
    as_json=False,
)
def report(
    output: NewFolder = Path("report"),
    quick: Annotated[bool, typer.Option("--quick", help="Fewer points: half a minute instead of two.")] = False,
) -> Answer:
    """Measure error against run time: which method to use when, for seven tasks, with figures and numbers."""
    from faultgouge.assessment.work_precision.run import report as run_studies

    run_studies(output, quick, say, lambda name, runs: progress(runs, name, len(runs)))
    return Answer(written=f"written: {output}/report.md")


Quick = Annotated[bool, typer.Option("--quick", help="About half of the cases, in a few seconds.")]
TRIED = "{output} has the cases that were finished" + REPLACED


@command(app, "mpiexec -n 2 faultgouge extremes -o extremes", kept=TRIED)
def extremes(output: NewFolder = Path("extremes"), quick: Quick = False) -> Answer:
    """Test stiff and extreme cases: each holds within a stated bound, or is refused in one sentence."""
    return try_cases(output, quick)


def try_cases(output: Path, quick: bool) -> Answer:
    """What `extremes` does in a folder."""
    from faultgouge.assessment.extremes.run import check, extremes

    result = extremes(output, quick, say, lambda cases: progress(cases, "cases", len(cases)))
    counts = Counter(case["status"] for case in result["cases"])
    written = (
        f"{counts.total()} cases: {counts['holds']} hold, {counts['refused']} are refused in a sentence, "
        f"{counts['fails']} fail; written: {output}/extremes.md"
    )
    return Answer(result=result, written=written, fails=lambda: check(result))
