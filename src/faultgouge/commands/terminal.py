"""The parts that commands share: common options, and output.

Results go to files and to standard output, as JSON or in words; progress and messages go to standard error. Rank 0
alone speaks.
"""

from __future__ import annotations

import inspect
import json
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from contextlib import contextmanager, nullcontext
from functools import wraps
from math import isfinite
from pathlib import Path
from threading import Event, Thread
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, ParamSpec, TypeVar, get_type_hints

import typer

from ..analysis.counted import counted
from ..mpi_rank import is_root
from ..signal_guard import holds, keeps

if TYPE_CHECKING:
    from faultgouge.analysis import Configuration, Packing
    from faultgouge.analysis.responses.growth_of_run import GrowthOfRun
    from faultgouge.analysis.responses.slips import Slip
    from faultgouge.pywrap import Equilibrium, Record, Scene
    from faultgouge.pywrap.scenes.scene import Task

T = TypeVar("T")
P = ParamSpec("P")

LAYER = "faultgouge examples scene"
RAMPED = f"{LAYER} && faultgouge ramp scene.toml"
"""With which examples of commands begin: each runs in an empty folder."""

SECONDS_BETWEEN_LINES = 60.0
"""Seconds between two lines of progress off a terminal."""

ScenePath = Annotated[
    Path,
    typer.Argument(metavar="SCENE", help="The scene, a TOML file; `faultgouge init` writes one.", show_default=False),
]
Out = Annotated[Path, typer.Option("-o", "--output", help="The file to write; an interrupted run continues.")]
Folder = Annotated[Path, typer.Option("-o", "--output", help="The folder to write; an interrupted study continues.")]
NewFolder = Annotated[Path, typer.Option("-o", "--output", help="The folder for numbers, pictures and page.")]
Workers = Annotated[
    int | None,
    typer.Option(min=1, metavar="N", show_default=False, help="Number of processes; all cores by default."),
]


def refuse_scene(file: Path) -> Path:
    """Refuse a scene where a stored packing is read."""
    if file.suffix == ".toml":
        raise typer.BadParameter(
            f"{file} is a scene, and this command reads a stored packing: run `faultgouge ramp {file} -o run.h5`, and "
            "give run.h5"
        )
    return file


PackingFile = Annotated[
    Path,
    typer.Argument(
        metavar="FILE",
        help="What `ramp`, `perturb`, `drive` or `import` has written (.h5), or NAME.disks from the dumps of a deck.",
        show_default=False,
        callback=refuse_scene,
    ),
]
Time = Annotated[float | None, typer.Option("--time", metavar="T", help="Of drive.h5: the state nearest to this time.")]
Frame = Annotated[int, typer.Option(help="Number of the equilibrium; negative numbers count from the last.")]
if TYPE_CHECKING:
    SceneFile = Scene
else:
    SceneFile = ScenePath
"""The argument SCENE of a `command` that reads its scene."""
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


class Answer(NamedTuple):
    """What a command has to say.

    Attributes
    ----------
    says : sequence of str
        Lines of the result for people, in place of which --json prints `result`.
    result : dict, optional
        The result for programs.
    written : str
        What was written: a line after the result, with --json on standard error.
    fails : callable, optional
        Called in the end; raises the error of a result that is a failure.
    """

    says: Sequence[str] = ()
    result: dict[str, Any] | None = None
    written: str = ""
    fails: Callable[[], object] | None = None


def command(
    app: typer.Typer,
    example: str,
    *,
    name: str | None = None,
    reads: str | None = None,
    task: Task | None = None,
    kept: str | None = None,
    records: bool = False,
    as_json: bool = True,
    hidden: bool = False,
) -> Callable[[Callable[P, Answer | None]], Callable[P, Answer | None]]:
    """Make a function a command: its scene is read, its folder is locked, and its answer is printed, on rank 0.

    An error that the function raises is printed in one sentence by :mod:`faultgouge.exit_status`; `say`, `status` and
    `progress` show how far the work is.

    Parameters
    ----------
    app : typer.Typer
        The commands of the module.
    example : str
        Of the help.
    name : str, optional
        Of the command; by default that of the function.
    reads, task : str, optional
        The argument `scene`, of type `SceneFile`, is read as this command reads it, before anything is written; a task
        that would never end is refused.
    kept : str, optional
        The option `output` is a folder, which is made and kept from other runs; and what an interrupt leaves in it, in
        words that name it as {output}.
    records : bool
        The option `output` is the file of a `Record`, which is none of the files of the scene.
    as_json : bool
        Whether the command has the option --json.
    """

    def register(work: Callable[P, Answer | None]) -> Callable[P, Answer | None]:
        own = inspect.signature(work)

        @wraps(work)
        def run(*args: Any, as_json: bool = False, **options: Any) -> None:
            given = own.bind(*args, **options)
            given.apply_defaults()
            if reads is not None:
                path = given.arguments["scene"]
                given.arguments["scene"] = read_scene(path, reads, task)
                if records:
                    check_output(given.arguments["output"], path, *stored_files(given.arguments["scene"]))
                    hold_lock(given.arguments["output"])
            if kept is not None:
                keeps(kept.format(**given.arguments), given.arguments["output"])
            with nullcontext() if kept is None else lock_folder(given.arguments["output"]):
                answer = work(*given.args, **given.kwargs) or Answer()
            if as_json and answer.result is not None:
                print_json(answer.result)
            for line in () if as_json else answer.says:
                print_line(line)
            if answer.written:
                (say if as_json else print_line)(answer.written)
            if answer.fails is not None:
                answer.fails()

        flag = inspect.Parameter("as_json", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=AsJson)
        hints = get_type_hints(work, include_extras=True)
        parameters = [each.replace(annotation=hints[key]) for key, each in own.parameters.items()]
        parameters += [flag] if as_json else []
        vars(run)["__signature__"] = own.replace(parameters=parameters, return_annotation=None)
        run.__annotations__ = {each.name: each.annotation for each in parameters}
        app.command(name, epilog=f"Example: {example}", hidden=hidden)(run)
        return work

    return register


def read_scene(path: Path, command: str, task: Task | None = None) -> Scene:
    """The part of a scene file that a command reads; a task that would never end is refused."""
    from faultgouge.analysis.files.formats import READERS
    from faultgouge.pywrap.scenes.scene import Scene, refuse_endless

    if path.suffix == ".h5":
        raise typer.BadParameter(f"{path} is a stored run, and {command} reads a scene: give its .toml file")
    if path.suffix in READERS:
        name_it = 'write file = "packing.h5" under [packing] of the scene'
        convert = f"convert it by `faultgouge import {path} -o packing.h5`, and {name_it}"
        raise typer.BadParameter(f"{path} is a packing, and {command} reads a scene: {convert}")
    scene = Scene.from_toml(path, command=command)
    if task is not None:
        refuse_endless(scene, task)
    return scene


def stored_files(scene: Scene) -> list[Path]:
    """The files that a scene names."""
    return [path for paths in scene.files.values() for path in paths]


def stored_packing(file: Path, frame: int = -1) -> Packing | Configuration:
    """A packing of a run.h5, or of the dumps that decks write; a run.h5 that holds a configuration has no other."""
    from faultgouge.analysis import BadInputError, RunFile, read_dump
    from faultgouge.analysis.files.configuration_file import holds_configuration, read_configuration
    from faultgouge.stored_files import packing_in

    if holds_configuration(file):
        if frame not in (-1, 0):
            raise BadInputError(f"{file} has one packing, and no frame {frame}: leave --frame out.")
        return read_configuration(file)
    if file.suffix == ".disks":
        return read_dump(file, frame=frame)
    with RunFile(file) as run:
        if not run.complete:
            names = ("state",) if run.attributes.get("task") == "drive" else ("equilibrium", "equilibria")
            stored = counted(len(run), *names)
            say(f"{file} is of a run that is not finished: {stored}, up to F_x = {run.fx[-1]:g}")
        return packing_in(run, frame)


def stored_series(file: Path) -> dict[str, Any] | None:
    """The time series of the undamped run in a perturb.h5; None of another file, or where the run has not begun."""
    from faultgouge.analysis import RunFile

    if file.suffix == ".disks":
        return None
    with RunFile(file) as run:
        series = run.series("undamped") if "undamped" in run.names_of_series else None
        is_run = run.attributes.get("task") == "perturb"
    return series if is_run and series is not None and len(series["time"]) > 1 else None


def stored_drive(file: Path) -> tuple[dict[str, Any], list[Slip]] | None:
    """The series of a drive.h5 and its slips; None of another file."""
    from faultgouge.analysis import RunFile
    from faultgouge.pywrap.runs.drive import SERIES, drive_of, slips_in

    if file.suffix == ".disks":
        return None
    with RunFile(file) as run:
        if drive_of(run) is None or SERIES not in run.names_of_series:
            return None
        return run.series(SERIES), slips_in(run)


def frame_at(file: Path, frame: int, time: float | None) -> int:
    """The number of the state of a drive.h5 nearest to a time; without a time, the frame."""
    if time is None:
        return frame
    from faultgouge.analysis import BadInputError, RunFile
    from faultgouge.pywrap.runs.drive import drive_of

    if not isfinite(time):
        raise BadInputError(f"--time {time:g} is no time: give a number")
    if file.suffix != ".disks":
        with RunFile(file) as run:
            if drive_of(run) is not None:
                return int(abs(run.observable("time") - time).argmin())
    raise BadInputError(f"{file} has no states in time: --time chooses a state of a drive.h5; give --frame")


def growth_in(file: Path, series: dict[str, Any]) -> GrowthOfRun:
    """Growth of D in the undamped run of a perturb.h5, beside the spectrum's prediction at the time step of the run."""
    from faultgouge.analysis import RunFile
    from faultgouge.analysis.responses.growth_of_run import growth_of_run
    from faultgouge.pywrap.runs.undamped import time_step

    with RunFile(file) as run:
        packing, settings = run.packing(), json.loads(run.attributes.get("scene", "{}")).get("perturb") or {}
    dt = time_step(packing, settings.get("time_step"))
    return growth_of_run(packing, series["time"], series["msd"], series["friction"], dt)


def check_output(output: Path, *inputs: Path, head: str = "") -> None:
    """Refuse a file that cannot be written, or is one of the inputs, or of others, before any work."""
    from faultgouge.analysis.files.atomic_write import check_output as check

    check(output, *inputs, head=head)


def hold_lock(output: Path) -> None:
    """Have the guard remove the lock of a file that a run writes, if the run cannot do so itself."""
    from faultgouge.analysis.files.atomic_write import lock_of

    if is_root() and (lock := lock_of(output)):
        holds(lock)


def lock_output(context: typer.Context, output: Path, *inputs: Path, head: str = "") -> None:
    """`check_output`, and keep other runs from the file until the command ends, on rank 0."""
    from faultgouge.analysis.files.atomic_write import lock_output as lock

    check_output(output, *inputs, head=head)
    if is_root():
        hold_lock(output)
        context.with_resource(lock(output))


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Make a folder for results, and keep other runs out of it, on rank 0."""
    from faultgouge.analysis.files.atomic_write import lock_output, make_folder

    if not is_root():
        yield
        return
    make_folder(folder)
    with lock_output(folder):
        yield


def print_json(value: dict[str, Any]) -> None:
    """The result on standard output, the same as in a file."""
    from faultgouge.analysis.files.atomic_write import FORMAT, FORMAT_KEY

    if is_root():
        print(json.dumps({FORMAT_KEY: FORMAT, **value}, indent=1))


def print_line(result: str) -> None:
    """Print a line of the result for people, on standard output; `print_json` prints the result for programs
    instead."""
    if is_root():
        print(result, flush=True)  # before what follows on standard error


def say(message: str) -> None:
    """A line on standard error."""
    if is_root():
        print(message, file=sys.stderr)


def say_remark(record: Record) -> None:
    """Say what is not known of a file that goes on."""
    if record.remark:
        say(record.remark)


def report_fallback(equilibrium: Equilibrium) -> None:
    """Say how an equilibrium was reached, if halved increments did not reach it."""
    if equilibrium.way is not None:
        say(
            f"F_x = {equilibrium.fx:.10g} was reached by {equilibrium.way}, after smaller increments had failed: the "
            "equilibrium may lie on another branch"
        )


@contextmanager
def status(what: str) -> Iterator[Callable[[str], None]]:
    """A line on a terminal while work is under way; the function that is yielded replaces the text of the line.

    Off a terminal it is a line of the log, every minute. A thread says it: work may be within one call for longer.
    """
    if not is_root():
        yield lambda what: None
        return
    if sys.stderr.isatty():
        from rich.console import Console

        with Console(stderr=True).status(what) as line:
            yield line.update
        return
    latest, ended = deque([what], maxlen=1), Event()

    def speak() -> None:
        while not ended.wait(SECONDS_BETWEEN_LINES):
            say(latest[0])

    thread = Thread(target=speak, daemon=True)
    thread.start()
    try:
        yield latest.append
    finally:
        ended.set()
        thread.join()


def progress(items: Iterable[T], what: str, total: int | None = None, done: int = 0) -> Iterator[T]:
    """The items, with a progress bar on a terminal; off a terminal with a line a minute. Both say how long is left."""
    if total is None and isinstance(items, Sized):
        total = len(items)
    if not sys.stderr.isatty() or not is_root():
        among = "" if total is None else f" of {total}"
        begin = time.monotonic()
        with status(f"{what}: {done}{among}") as show:
            for number, item in enumerate(items, done + 1):
                left = 0.0 if total is None else (time.monotonic() - begin) / (number - done) * (total - number)
                show(f"{what}: {number}{among}" + (f", about {left / 60:.0f} min left" if left > 60 else ""))
                yield item
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total, completed=done)
        for item in items:
            bar.advance(task)
            yield item
