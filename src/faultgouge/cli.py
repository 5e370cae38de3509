"""The command ``faultgouge``.

Results go to files and, with --json, to standard output; progress and messages go to standard error, from rank 0
alone. Exit codes: 1 for a computation that failed, 2 for bad input. What is heavy is imported by the command that
needs it.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer
from rich.console import Console

if TYPE_CHECKING:
    from faultgouge.pywrap import Equilibrium, Record, Scene

T = TypeVar("T")

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help="Remote triggering in a stressed layer of frictional disks: simulate with LAMMPS, analyse, reproduce.",
    epilog="Example: [bold]faultgouge reproduce -o results[/bold]",
)

ScenePath = Annotated[Path, typer.Argument(metavar="SCENE", help="The scene, a TOML file.", show_default=False)]
Out = Annotated[Path, typer.Option("-o", "--output", help="The file to write; an interrupted one is continued.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


@app.command(epilog="Example: [bold]faultgouge settle paper.toml -o run.h5[/bold]")
def settle(scene: ScenePath, output: Out = Path("run.h5")) -> None:
    """Settle the packing of a scene under its load, at F_x = 0."""
    from faultgouge.pywrap import Record

    wanted = _scene(scene)
    with Record(output, wanted) as record:
        packing = _settled(wanted, record).packing
    assert record.last is not None
    _say(
        f"{len(packing)} disks, {len(packing.contacts)} contacts, {len(packing.rattlers)} rattlers; "
        f"residual {record.last.residual:.2g} (rounding floor {record.last.floor:.2g}); written to {output}"
    )


@app.command(epilog="Example: [bold]mpiexec -n 2 faultgouge ramp paper.toml -o run.h5[/bold]")
def ramp(scene: ScenePath, output: Out = Path("run.h5"), as_json: AsJson = False) -> None:
    """Raise F_x from equilibrium to equilibrium, each stored as it is reached."""
    from faultgouge.pywrap import Record, SceneError
    from faultgouge.pywrap import ramp as ramp_up
    from faultgouge.pywrap.stages import loads

    wanted = _scene(scene)
    if wanted.ramp is None:
        raise SceneError(f"{scene}: the scene has no section [ramp]: add it, with step and until")
    with Record(output, wanted) as record:
        start = _settled(wanted, record)
        total, done = len(loads(wanted.ramp)), round(start.fx / wanted.ramp.step) + 1
        dumps = output.with_suffix("") if wanted.output is not None and wanted.output.dumps else None
        for equilibrium in _progress(ramp_up(wanted, start, dumps=dumps), "equilibria", total, done):
            record.append(equilibrium)
    assert record.last is not None
    _say(f"F_x = {record.last.fx:g} reached, {record.last.residual:.2g} on a disk; written to {output}")
    if as_json:
        _print_json({"equilibria": _equilibria(output)})


@app.command(epilog="Example: [bold]faultgouge perturb paper.toml -o run.h5[/bold]")
def perturb(scene: ScenePath, output: Out = Path("perturb.h5"), as_json: AsJson = False) -> None:
    """Run undamped from the equilibrium at perturb.fx, with or without a perturbation, and record D(t)."""
    from faultgouge.pywrap import Record, SceneError, reach
    from faultgouge.pywrap import perturb as run_undamped
    from faultgouge.pywrap.stages import calibrated, weakening_of

    wanted = _scene(scene)
    if wanted.perturb is None:
        raise SceneError(f"{scene}: the scene has no section [perturb]: add it, with fx and time")
    if output.exists():
        raise SceneError(f"{output} exists: an undamped run starts from rest, so give another name or delete it")
    with Record(output, wanted) as record:
        *_, start = _progress(reach(wanted, wanted.perturb.fx), "equilibria")
        weakening = None
        if wanted.friction is not None:
            v0 = wanted.friction.v0
            with _status("calibrating v0"):
                threshold = calibrated(wanted, start) if isinstance(v0, str) else v0
            weakening = weakening_of(wanted.friction, threshold)
            _say(f"v0 = {threshold:.3g}, v_ss = {weakening.v_ss:.3g}")
        watch = record.append_motion if wanted.output is not None and wanted.output.trajectory else None
        run = run_undamped(wanted, start, weakening=weakening, watch=watch)
        record.append(start)
        batch = []
        for sample in _progress(run, "samples"):
            batch.append(sample)
            if len(batch) == 100:
                record.append_series(batch)
                batch = []
        record.append_series(batch)
    _say(f"D = {sample.msd:.3g} after t = {sample.time:g}; written to {output}")
    if as_json:
        from faultgouge.analysis import RunFile

        with RunFile(output) as file:
            _print_json({name: column.tolist() for name, column in file.series("undamped").items()})


@app.command(epilog="Example: [bold]faultgouge spectrum run.h5 --json[/bold]")
def spectrum(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="run.h5, or NAME.disks of a deck's dumps.")],
    frame: Annotated[int, typer.Option(help="Which equilibrium; negative ones count from the last.")] = -1,
    as_json: AsJson = False,
) -> None:
    """Eigenvalues of a stored packing, its complex pairs and its rattlers."""
    from faultgouge.analysis import RunFile, read_dump
    from faultgouge.analysis import spectrum as eigenvalues_of

    if file.suffix == ".disks":
        packing = read_dump(file, frame=frame)
    else:
        with RunFile(file) as run:
            packing = run.packing(frame)
    result = eigenvalues_of(packing)
    pairs: list[dict[str, Any]] = [
        {
            "eigenvalue": [pair.eigenvalue.real, pair.eigenvalue.imag],
            "condition": pair.condition,
            "overlap": pair.overlap,
            "growth_rate": pair.growth_rate,
            "frequency": pair.frequency,
        }
        for pair in result.pairs
    ]
    if as_json:
        _print_json(
            {
                "eigenvalues": [[value.real, value.imag] for value in result.eigenvalues.tolist()],
                "pairs": pairs,
                "rattlers": result.rattlers.tolist(),
                "fx": packing.fx,
                "residual": packing.residual,
                "noise_pairs": result.noise_pairs,
            }
        )
        return
    real = result.eigenvalues.real
    print(
        f"F_x = {packing.fx:g}: {len(real)} eigenvalues from {real.min():.6g} to {real.max():.6g}, "
        f"{len(result.rattlers)} rattlers left out"
    )
    for pair in pairs:
        print(
            f"complex pair {pair['eigenvalue'][0]:.10g} +- {pair['eigenvalue'][1]:.10g} i: "
            f"D grows as exp({pair['growth_rate']:.6g} t), |y^H x| = {pair['overlap']:.2g}"
        )
    if not pairs:
        print("no complex pair: linearly stable")
    if result.noise_pairs:
        print(f"{result.noise_pairs} pairs have imaginary parts within their rounding error and count as real")


@app.command(epilog="Example: [bold]faultgouge onset paper.toml --json[/bold]")
def onset(
    scene: ScenePath,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Also write the JSON to this file.")] = None,
    modes: Annotated[
        str | None,
        typer.Option(
            metavar="FIRST:STOP",
            help="Search these modes alone, counted by frequency from 0: of 100,000 disks a part is what one has time "
            "for. 0:600 are the 600 lowest.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """The onset F_x^c and the windows of complex eigenvalues, for each friction coefficient of the scene."""
    from faultgouge.studies.onsets import onset_run

    wanted, part = _scene(scene), None if modes is None else _modes(modes)
    found = []
    for mu in wanted.law.mus:
        with _status(f"mu = {mu:g}") as say:
            run = onset_run(wanted, mu, modes=part, watch=partial(_under_way, say, f"mu = {mu:g}"))
        found.append({"mu": mu} | run.onset.as_dict() | {"flows_beyond": run.flows_beyond})
        among = "" if part is None else f" among the modes {part[0]}:{part[1]}"
        _say(f"mu = {mu:g}: F_x^c = {run.onset.fx_c:.12g} +- {run.onset.error:.1g}{among}")
        for below, above in run.onset.doubtful:
            _say(
                f"a pair was expected to become complex between F_x = {below:.6g} and {above:.6g}, and was not found: "
                "an earlier onset may hide there; take smaller increments to be sure"
            )
    result = found[0] | ({"each_mu": found} if len(found) > 1 else {})
    if output and _is_root():
        output.write_text(json.dumps(result, indent=1) + "\n")
    if as_json:
        _print_json(result)


@app.command(epilog="Example: [bold]faultgouge explain paper.toml[/bold]")
def explain(scene: ScenePath, as_json: AsJson = False) -> None:
    """What a scene includes, what it leaves out, why, and what each part costs.

    Every part is switched off, or on, in LAMMPS, and measured: ratios of times
    with their quartiles, and whether what both compute agrees to the bit. It
    takes some ten seconds.
    """
    from faultgouge.studies.explain import explain as explain_scene

    wanted = _scene(scene)
    with _status("switching features off and on"):
        explanation = explain_scene(wanted)
    if as_json:
        _print_json(explanation.as_dict())
    elif _is_root():
        from faultgouge.studies.explanation_table import explanation_table

        console = Console(highlight=False)
        # a file or a pipe has no width, and a table of 80 columns is hard to read
        Console(highlight=False, width=max(console.width, 150)).print(explanation_table(explanation))


@app.command(epilog="Example: [bold]faultgouge reproduce -o results[/bold]")
def reproduce(
    scene: Annotated[
        Path | None, typer.Argument(metavar="[SCENE]", help="Another scene than the one that ships.")
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="The folder for figures, numbers and report.")] = Path(
        "results"
    ),
    ensemble: Annotated[
        int, typer.Option(min=0, metavar="M", help="Instead, onsets and eruptions of M packings of the scene.")
    ] = 0,
) -> None:
    """The paper's protocol on one packing: figures 1, 3, 4, numbers and a report.

    With --ensemble M: how generic that is, from M packings that differ in their
    seeds. An interrupted ensemble goes on, and grows with a larger M. A packing
    takes a minute at the most on one core; of several ranks one hands out the
    work, so that mpiexec -n 5 faultgouge reproduce --ensemble 100 keeps 4 cores
    busy.
    """
    from importlib.resources import files

    wanted = _scene(scene or Path(str(files("faultgouge") / "scenes" / "paper.toml")))
    if ensemble:
        from faultgouge.studies.ensemble import economical
        from faultgouge.studies.ensemble import ensemble as examine_packings

        def progress(members: Iterable[T], count: int) -> Iterator[T]:
            return _progress(members, "packings", count)

        examine_packings(economical(wanted), ensemble, output, _say, progress)
        _say(f"written: {output}/ensemble.json")
        return

    from faultgouge.studies.reproduce import reproduce as run_protocol

    run_protocol(wanted, output, _say)
    _say(f"written: {output}/report.md")


@app.command(epilog="Example: [bold]faultgouge report --quick -o report[/bold]")
def report(
    output: Annotated[Path, typer.Option("-o", "--output", help="The folder for report, figures and numbers.")] = Path(
        "report"
    ),
    quick: Annotated[bool, typer.Option("--quick", help="Fewer points: a minute instead of ten.")] = False,
) -> None:
    """Error against run time: which method to take when, for six tasks, with figures and numbers."""
    from faultgouge.studies.report import report as run_studies

    run_studies(output, quick, _say, lambda runs, name: _progress(runs, name, len(runs)))
    _say(f"written: {output}/report.md")


@app.command(epilog="Example: [bold]mpiexec -n 2 faultgouge stability -o stability[/bold]")
def stability(
    output: Annotated[Path, typer.Option("-o", "--output", help="The folder for table, picture and numbers.")] = Path(
        "stability"
    ),
    quick: Annotated[bool, typer.Option("--quick", help="The small part of the cases.")] = False,
    as_json: AsJson = False,
) -> None:
    """Stiff and extreme cases: each holds within a stated bound, or is refused in one sentence."""
    from faultgouge.studies.stability import check
    from faultgouge.studies.stability import stability as try_cases

    result = try_cases(output, quick, _say, lambda cases: _progress(cases, "cases", len(cases)))
    _say(f"{len(result['cases'])} cases tried; written: {output}/stability.md")
    if as_json:
        _print_json(result)
    check(result)


def main() -> None:
    """Run the command; what goes wrong is said in one sentence."""
    # one thread for BLAS: its threads cost more than they bring at these sizes, and change the last digits of a solve
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    try:
        app(standalone_mode=False)
    except KeyboardInterrupt:
        _stop("interrupted: what was written is kept, and the same command goes on from there", 130)
    except Exception as error:
        _stop(_sentence(error), _exit_code(error), alone=_is_parallel() and _of_one_rank(error))


def _of_one_rank(error: Exception) -> bool:
    """Whether the other ranks do not know of it, and wait: for LAMMPS, or for rank 0, which alone writes files."""
    return isinstance(error, OSError) or getattr(error, "one_rank", False)


def _exit_code(error: Exception) -> int:
    """2 for bad input, 1 for a computation that failed."""
    if hasattr(error, "exit_code"):  # typer's own: usage errors and exits
        return int(error.exit_code)
    names = {base.__name__ for base in type(error).__mro__}
    return 2 if names & {"SceneError", "PackingFileError"} else 1


def _sentence(error: Exception) -> str:
    show = getattr(error, "format_message", None)
    if show:
        return str(show()).strip()
    expected = {
        "SceneError",
        "PackingFileError",
        "NoEquilibriumError",
        "EngineError",
        "OnsetError",
        "LostPairError",
        "SliceError",
        "ReportError",
        "StabilityError",
        "OSError",
    }
    if {base.__name__ for base in type(error).__mro__} & expected:
        return str(error).strip()
    place = error.__traceback__
    while place is not None and place.tb_next is not None:
        place = place.tb_next
    where = f"{Path(place.tb_frame.f_code.co_filename).name}:{place.tb_lineno}" if place else "unknown place"
    return f"this should not have happened ({type(error).__name__} at {where}: {error}): please report it"


def _stop(sentence: str, code: int, alone: bool = False) -> None:
    if sentence and (alone or _is_root()):
        Console(stderr=True, soft_wrap=True, highlight=False).print("[bold red]Error:[/bold red] ", end="")
        print(sentence, file=sys.stderr, flush=True)
    if alone:
        from mpi4py import MPI

        MPI.COMM_WORLD.Abort(code)
    sys.exit(code)


def _is_root() -> bool:
    return int(os.environ.get("PMI_RANK", "0")) == 0


def _is_parallel() -> bool:
    return int(os.environ.get("PMI_SIZE", "1")) > 1


def _scene(path: Path) -> Scene:
    from faultgouge.pywrap.scene import Scene

    return Scene.from_toml(path)


def _equilibria(path: Path) -> list[dict[str, Any]]:
    from faultgouge.analysis import RunFile

    with RunFile(path) as file:
        names = ("fx", "residual", "floor", "evaluations")
        rows = zip(*(file.observable(name).tolist() for name in names), strict=True)
        return [
            dict(zip(names, row, strict=True)) | {"contacts": len(file.packing(k).contacts)}
            for k, row in enumerate(rows)
        ]


def _print_json(value: dict[str, Any]) -> None:
    if _is_root():
        print(json.dumps(value, indent=1))


def _say(message: str) -> None:
    if _is_root():
        print(message, file=sys.stderr)


def _settled(scene: Scene, record: Record) -> Equilibrium:
    """The last equilibrium of a file; in a new one the settled packing, which is then in it."""
    from faultgouge.pywrap import settle

    if record.last is None:
        with _status("settling") as say:
            record.append(settle(scene, watch=lambda what: say(f"settling: {what}")))
    assert record.last is not None
    return record.last


def _under_way(say: Callable[[str], None], what: str, now: str) -> None:
    say(f"{what}: {now}")


def _modes(text: str) -> tuple[int, int]:
    """FIRST:STOP as numbers."""
    first, _, stop = text.partition(":")
    if not (first.isdecimal() and stop.isdecimal() and int(first) < int(stop)):
        raise typer.BadParameter(
            f"--modes {text}: give the first mode and the first one beyond, as in --modes 0:600 for the 600 lowest"
        )
    return int(first), int(stop)


@contextmanager
def _status(what: str) -> Iterator[Callable[[str], None]]:
    """A line on a terminal while something is under way; what is yielded replaces its text."""
    console = Console(stderr=True)
    if not (_is_root() and console.is_terminal):
        yield lambda what: None
        return
    with console.status(what) as status:
        yield status.update


def _progress(items: Iterable[T], what: str, total: int | None = None, done: int = 0) -> Iterator[T]:
    """The items, with a progress bar on a terminal."""
    console = Console(stderr=True)
    if not (_is_root() and console.is_terminal):
        yield from items
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(what, total=total, completed=done)
        for item in items:
            progress.advance(task)
            yield item
