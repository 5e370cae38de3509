"""What commands share: their decorator, options, and output.

A command yields its results: lines for people, and the document that --json prints in their place. Results go to
standard output, progress and messages to standard error. Rank 0 alone speaks.
"""

from __future__ import annotations

import inspect
import json
import re
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager, nullcontext
from functools import wraps
from math import isfinite
from pathlib import Path
from threading import Event, Thread
from typing import TYPE_CHECKING, Annotated, Any, ParamSpec, TypeAlias, TypeVar

import typer
from typer import Argument, Option
from typer.models import CommandInfo

from ..signal_guard import holds, is_root, keeps

if TYPE_CHECKING:
    from faultgouge.analysis import Configuration, Packing
    from faultgouge.pywrap import Equilibrium, Scene

T = TypeVar("T")
P = ParamSpec("P")

LAYER = "faultgouge examples scene"
RAMPED = f"{LAYER} && faultgouge ramp scene.toml"
"""With which examples of commands begin: each runs in an empty folder."""

SECONDS_BETWEEN_LINES = 60.0
"""Seconds between two lines of progress off a terminal."""

Results: TypeAlias = Iterator[str | dict[str, Any]]
"""What a command yields: lines for people, and the document for --json."""

COMMANDS: dict[str, CommandInfo] = {}
"""The commands by name, in the order of the help."""

Out = Annotated[Path, Option("-o", "--output", help="The file to write; an interrupted run continues.")]
Folder = Annotated[Path, Option("-o", "--output", help="The folder to write; an interrupted study continues.")]
NewFolder = Annotated[Path, Option("-o", "--output", help="The folder for numbers, pictures and page.")]
Workers = Annotated[int | None, Option(min=1, metavar="N", help="Number of processes; all cores by default.")]
Time = Annotated[float | None, Option("--time", metavar="T", help="Of drive.h5: the state nearest to this time.")]
Frame = Annotated[int, Option(help="Number of the equilibrium; negative numbers count from the last.")]
AsJson = Annotated[bool, Option("--json", help="Print the result as JSON.")]
if TYPE_CHECKING:
    SceneFile = Scene
else:
    SceneFile = Annotated[Path, Argument(metavar="SCENE", help="The scene, a TOML file; `faultgouge init` writes one.")]
"""The argument SCENE of a command that reads its scene."""


def refuse_scene(file: Path) -> Path:
    """Refuse a scene where a stored packing is read."""
    if file.suffix == ".toml":
        run = f"run `faultgouge ramp {file} -o run.h5`, and give run.h5"
        raise typer.BadParameter(f"{file} is a scene, and this command reads a stored packing: {run}")
    return file


OF_PACKING = "What `ramp`, `perturb`, `drive` or `import` has written (.h5), or NAME.disks from the dumps of a deck."
PackingFile = Annotated[Path, Argument(metavar="FILE", help=OF_PACKING, callback=refuse_scene)]


def command(
    example: str,
    *,
    reads: str | None = None,
    writes: str = "",
    kept: str = "",
    alone: bool = False,
    as_json: bool = False,
) -> Callable[[Callable[P, Results]], Callable[P, Results]]:
    """Make a function a command: its scene is read, its output is kept from others, and what it yields is printed.

    An error that the function raises is printed in one sentence by :mod:`faultgouge.cli`. The argument `scene`, of type
    `SceneFile`, is read as the command `reads` reads it, before anything is written. The option `output` is what
    `locked` calls `writes`, and `kept` says what an interrupt leaves of it, in words that name it as {output}. With
    `alone` rank 0 alone works. With `as_json` the command has the option --json, and lines that follow the document go
    to standard error.
    """

    def register(work: Callable[P, Results]) -> Callable[P, Results]:
        own = inspect.signature(work, eval_str=True)

        @wraps(work)
        def run(as_json: bool = False, **given: Any) -> None:
            from faultgouge.analysis.files.atomic_write import FORMAT, FORMAT_KEY

            if alone and not is_root():
                return
            inputs = [given[key] for key in ("file", "scene") if isinstance(given.get(key), Path)]
            if reads is not None:
                given["scene"] = scene = read_scene(given["scene"], reads)
                inputs += [path for paths in scene.files.values() for path in paths]
            output = given["output"] if writes else None
            speak: Callable[[str], object] = (lambda line: None) if as_json else print_line
            with nullcontext() if output is None else locked(output, *inputs, kind=writes):
                if kept:
                    keeps(kept.format(output=output))
                for result in work(**given):  # type: ignore[call-arg]
                    if isinstance(result, str):
                        speak(result)
                    elif as_json:
                        print_line(json.dumps({FORMAT_KEY: FORMAT, **result}, indent=1))
                        speak = say

        flag = inspect.Parameter("as_json", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=AsJson)
        parameters = [*own.parameters.values(), *([flag] if as_json else [])]
        vars(run)["__signature__"] = own.replace(parameters=parameters, return_annotation=None)
        run.__annotations__ = {each.name: each.annotation for each in parameters}
        called, help_ = work.__name__.rstrip("_"), inspect.getdoc(work) or ""
        first = " ".join(re.split(r"(?<=[.?])\s", help_)[0].split())  # the overview has it in full
        COMMANDS[called] = CommandInfo(called, callback=run, short_help=first, epilog=f"Example: {example}")
        return work

    return register


def read_scene(path: Path, command: str) -> Scene:
    """The part of a scene file that a command reads."""
    from faultgouge.analysis.files.formats import READERS
    from faultgouge.pywrap.scenes.scene import Scene

    if path.suffix in (".h5", *READERS):
        under = f'a packing stands in a scene as file = "{path}" under [packing]'
        raise typer.BadParameter(f"{path} is no scene, and {command} reads one, a .toml file: {under}")
    return Scene.from_toml(path, command=command)


@contextmanager
def locked(output: Path, *inputs: Path, kind: str = "file", head: str = "") -> Iterator[None]:
    """Keep other commands from an output, which can be written and is none of the inputs and no file of others.

    Of the kind "new" it is not there yet; a "run" takes its lock itself; a "folder" is made. A table of the program
    begins with `head`.
    """
    from faultgouge.analysis.files.atomic_write import check_output, lock_of, lock_output, make_folder

    if kind == "new" and output.exists():
        raise typer.BadParameter(f"{output} exists: give another name with -o, or delete it")
    if kind != "folder":
        check_output(output, *inputs, head=head)
    if not is_root():
        yield
        return
    if kind == "folder":
        make_folder(output)
    holds(lock_of(output))  # the guard removes the lock of a work that cannot do so itself
    with nullcontext() if kind == "run" else lock_output(output):
        yield


def stored_packing(file: Path, frame: int = -1, time: float | None = None) -> Packing | Configuration:
    """A packing of the dumps that decks write or of a stored run: that of a frame, or a driven one close to a time."""
    from faultgouge.analysis import BadInputError, RunFile
    from faultgouge.analysis.files.configuration_file import holds_configuration
    from faultgouge.door import load, packing_in

    if time is None and (file.suffix == ".disks" or holds_configuration(file)):
        return load(file, frame)
    with RunFile(file) as run:
        if time is not None:
            if run.attributes.get("task") != "drive":
                raise BadInputError(f"{file} has no states in time: --time chooses a state of a drive.h5; give --frame")
            frame = int(abs(run.observable("time") - time).argmin())
        return packing_in(run, frame)


def plain(value: Any) -> Any:
    """A value as JSON has it: arrays as lists, complex numbers as [re, im], and null for what is not finite."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    if isinstance(value, complex):
        return [value.real, value.imag]
    return None if isinstance(value, float) and not isfinite(value) else value


def print_line(result: str) -> None:
    """Print a line of the result for people, on standard output."""
    if is_root():
        print(result, flush=True)  # before what follows on standard error


def say(message: str) -> None:
    """A line on standard error."""
    if is_root():
        print(message, file=sys.stderr)


def report_fallback(equilibrium: Equilibrium) -> None:
    """Say how an equilibrium was reached, if halved increments did not reach it."""
    if equilibrium.way is not None:
        way = f"{equilibrium.way}, after smaller increments had failed"
        say(f"F_x = {equilibrium.fx:.10g} was reached by {way}: the equilibrium may lie on another branch")


@contextmanager
def status(what: str) -> Iterator[Callable[[str], None]]:
    """A line on a terminal while work is under way; the function that is yielded replaces the text of the line.

    Off a terminal it is a line of the log, every minute. A thread says it: work may be within one call for longer.
    """
    if is_root() and sys.stderr.isatty():
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


@contextmanager
def working(what: str) -> Iterator[Callable[[str], None]]:
    """`status` with the steps that the work reports."""
    from faultgouge.analysis.progress import show_progress

    with status(what) as show, show_progress(show, f"{what}: "):
        yield show


def progress(items: Iterable[T], what: str, total: int | None = None, done: int = 0) -> Iterator[T]:
    """The items, with a `status` that says how many there were, and how long is left."""
    if total is None and isinstance(items, Sized):
        total = len(items)
    among = "" if total is None else f" of {total}"
    begin = time.monotonic()
    with status(f"{what}: {done}{among}") as show:
        for number, item in enumerate(items, done + 1):
            left = 0.0 if total is None else (time.monotonic() - begin) / (number - done) * (total - number)
            show(f"{what}: {number}{among}" + (f", about {left / 60:.0f} min left" if left > 60 else ""))
            yield item
