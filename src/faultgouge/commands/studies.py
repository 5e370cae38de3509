"""The commands explain, reproduce, report, extremes, trigger and eruptions, which write studies and reports."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from ..mpi_rank import is_root
from ..signal_guard import keeps
from .terminal import (
    AsJson,
    Folder,
    NewFolder,
    ScenePath,
    lock_folder,
    print_json,
    print_line,
    progress,
    read_scene,
    say,
    status,
)

app = typer.Typer()


@app.command(epilog="Example: faultgouge explain paper.toml")
def explain(
    scene: ScenePath,
    timed: Annotated[bool, typer.Option("--time", help="Measure what each part costs: some ten seconds.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON, with the costs.")] = False,
) -> None:
    """Explain what a scene includes, what it leaves out, and why.

    The command switches every part off, or on, in LAMMPS, and compares the two
    runs to the bit. With --time it also measures the ratios of their times.
    """
    from faultgouge.assessment.explain.explain import explain as explain_scene

    wanted = read_scene(scene, "explain", "settle")
    with status("switching features off and on"):
        explanation = explain_scene(wanted, timed or as_json)
    if as_json:
        print_json(explanation.as_dict())
    elif is_root():
        from rich.console import Console

        from faultgouge.assessment.explain.explanation_table import explanation_table, in_words, units_in_words

        if explanation.units is not None:
            print_line(units_in_words(explanation.units))
        print_line(f"{in_words(explanation)}\n")
        console = Console(highlight=False)
        # a file or a pipe has no width, and a table of 80 columns is hard to read
        Console(highlight=False, width=max(console.width, 150)).print(explanation_table(explanation))


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


@app.command(epilog="Example: faultgouge report --quick -o report")
def report(
    output: NewFolder = Path("report"),
    quick: Annotated[bool, typer.Option("--quick", help="Fewer points: a minute instead of ten.")] = False,
) -> None:
    """Measure error against run time: which method to use when, for six tasks, with figures and numbers."""
    from faultgouge.assessment.work_precision import report as run_studies

    keeps(
        f"{output} has the studies that were finished; the same command starts from the beginning and replaces them",
        output,
    )
    with lock_folder(output):
        run_studies(output, quick, say, lambda name, runs: progress(runs, name, len(runs)))
    print_line(f"written: {output}/report.md")


Quick = Annotated[bool, typer.Option("--quick", help="About half of the cases, in a few seconds.")]


@app.command(epilog="Example: mpiexec -n 2 faultgouge extremes -o extremes")
def extremes(output: NewFolder = Path("extremes"), quick: Quick = False, as_json: AsJson = False) -> None:
    """Test stiff and extreme cases: each holds within a stated bound, or is refused in one sentence."""
    from faultgouge.assessment.extremes import check
    from faultgouge.assessment.extremes import extremes as try_cases

    keeps(
        f"{output} has the cases that were finished; the same command starts from the beginning and replaces them",
        output,
    )
    with lock_folder(output):
        result = try_cases(output, quick, say, lambda cases: progress(cases, "cases", len(cases)))
    counts = Counter(case["status"] for case in result.get("cases", ()))
    (say if as_json else print_line)(
        f"{counts.total()} cases: {counts['holds']} hold, {counts['refused']} are refused in a sentence, "
        f"{counts['fails']} fail; written: {output}/extremes.md"
    )
    if as_json:
        print_json(result)
    check(result)


@app.command(hidden=True)
def stability(
    file: Annotated[Path | None, typer.Argument(show_default=False)] = None,
    output: NewFolder = Path("stability"),
    quick: Quick = False,
    as_json: AsJson = False,
) -> None:
    """The name of `extremes` until version 1, with the JSON under its old name, too."""
    if file is not None:
        raise typer.BadParameter(
            f"stability takes no file: `faultgouge spectrum {file}` says whether a packing is stable"
        )
    say("faultgouge stability is called faultgouge extremes now: stability is what spectrum tells of a packing")
    try:
        extremes(output, quick, as_json)
    finally:
        if is_root() and (output / "extremes.json").exists():
            from faultgouge.analysis.files.atomic_write import write_whole

            write_whole(output / "stability.json", (output / "extremes.json").read_bytes())


@app.command(epilog="Example: mpiexec -n 3 faultgouge trigger trigger.toml -o trigger")
def trigger(scene: ScenePath, output: Folder = Path("trigger"), as_json: AsJson = False) -> None:
    """Compute the critical amplitude of a wave over its frequency and the distance of the layer from the onset.

    The amplitude is predicted from the stiffness, the damping and the masses, and
    for some pairs measured by bisection in LAMMPS. The scene must give friction.v0,
    the velocity above which friction weakens. With several ranks, one rank
    distributes the runs.
    """
    from faultgouge.studies.trigger import trigger_map

    _into_folder(trigger_map, scene, output, "trigger", "bisections", "what was found so far", as_json)


@app.command(epilog="Example: mpiexec -n 3 faultgouge eruptions eruptions.toml -o eruptions")
def eruptions(scene: ScenePath, output: Folder = Path("eruptions"), as_json: AsJson = False) -> None:
    """Measure the size of eruptions: undamped runs from rest at each load of [eruptions], and how the growth ends.

    With several ranks, one rank distributes the loads.
    """
    from faultgouge.studies.eruptions import eruptions as run_all

    _into_folder(run_all, scene, output, "eruptions", "runs", "the runs that were over", as_json)


def _into_folder(
    study: Callable[..., dict[str, Any]], scene: Path, output: Path, name: str, what: str, kept: str, as_json: bool
) -> None:
    """Run a study of a scene that goes on in its folder; `what` is counted, and `kept` is what an interrupt leaves."""
    wanted = read_scene(scene, name)
    keeps(f"{output}/{name}.jsonl has {kept}; the same command continues from there", output)
    with lock_folder(output):
        result = study(wanted, output, say, lambda results, count: progress(results, what, count))
    (say if as_json else print_line)(f"written: {output}/{name}.md")
    if as_json:
        print_json(result)
