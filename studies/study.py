"""The frame of studies: how a study registers itself, the files that it writes, and how it goes on after an interrupt.

A study is one file of this folder, with its page beside it. In the file stand its physics, its section of a scene, the
numbers, the pictures, and a function of the name of the file with one of two decorators:

- `study`: the function takes a scene and its `Work`, and returns the contents of NAME.json. The command ``faultgouge
  NAME SCENE -o FOLDER`` is there without further lines. Results are stored row by row in NAME.jsonl, and rows of the
  same scene are not computed again. NAME.json, pictures and NAME.md are written at the end.
- `task`: the function takes a scene and its settled packing, and returns one row: a task of ``faultgouge sweep``.

:mod:`faultgouge.registered` finds studies by the names of their files. To draw, a study imports matplotlib within its
functions: a scene with the section of a study imports the study's file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from mpi4py import MPI
from mpi4py.futures import MPICommExecutor

from ..analysis.files.atomic_write import make_folder, write_json, write_text
from ..pywrap import Scene, settle
from ..pywrap.scenes.units import real_units
from ..pywrap.scenes.validation import Section
from .packing_tools import Start
from .result_rows import Row, Rows, source_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .sweep.sweep_plan import Sweep

Say = Callable[[str], None]
"""A function that prints a line of text."""

Progress = Callable[[Iterable[Any], int], Iterable[Any]]
"""A function that takes results as they come, with their number, and passes them on."""

MapRows = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]
"""`map`, whose results may come in any order."""

Result = dict[str, Any]

Figures = Mapping[str, Callable[[], "Figure"]]
"""Functions that draw the pictures, by file name."""

TaskRow = Callable[[Scene, Start], Row]
"""A task: a scene, and the function mu -> settled packing -> a row."""

Gather = Callable[["Sweep", Sequence[Row], Path, Say], Sequence[str]]
"""What a task makes of all rows of a sweep in a folder; it returns lines for a terminal."""


class Work(NamedTuple):
    """Inputs of a study besides the scene: rows that are known, and where new ones go; mu -> the settled packing of the
    scene; a map over missing rows; and the output of messages."""

    rows: Rows
    start: Start
    map_rows: MapRows = map
    say: Say = lambda line: None
    progress: Progress = lambda results, _: results


def draw_all(figures: Figures, folder: Path, say: Say) -> None:
    """Draw in the style of the package and save pictures; one that fails is reported, and the others are drawn."""
    from ..figures.style import report_failure, save, styled

    for name, figure in figures.items():
        with report_failure(f"{name}.png", say):
            save(styled(figure)(), folder / name)


@dataclass(frozen=True, kw_only=True)
class RegisteredStudy:
    """A study, which is called with a scene and a folder; or, of a task, its `row` with a scene and its packing.

    The decorators take all attributes but the first two.

    Attributes
    ----------
    name : str
        The name of the function and of its file; its docstring is the help of the command.
    compute : callable, optional
        Scene, `Work` -> the contents of NAME.json but the scene and its units.
    row : callable, optional
        The task of a sweep: scene, function mu -> settled packing -> a row. A study with ``row=True`` is a task, too,
        whose row is what NAME.json holds.
    reads, needs, section : tuple of str, tuple of str, type of Section, optional
        Sections of a scene that are read besides its own, those that it cannot do without, and its own section, [NAME].
    check : callable
        Raises SceneError for a scene without what is needed.
    figures : callable
        Contents of NAME.json, rows -> the functions that draw the pictures, by file name.
    page : callable, optional
        For a page NAME.md: contents of NAME.json -> the names of the template NAME.md.j2, beside the file, but
        `result`, which is these contents, and `units`.
    beside : str
        A section of the scene that may change while the stored rows remain valid.
    counts, kept : str
        What the progress counts, and what an interrupt leaves.
    example : str, optional
        The example of the help. A task with one is a command, too, which takes a scene or a sweep of this task.
    gather, writes : callable, optional, mapping
        What a task makes of all rows of a sweep; the files that it writes besides pictures, and the heads of those that
        are tables: files of others of these names are refused before work begins.
    of_run : callable, optional
        What the command of a task does with a stored run, FILE.h5, in place of a scene.
    """

    name: str
    compute: Callable[[Scene, Work], Result] | None = None
    row: TaskRow | None = None
    reads: tuple[str, ...]
    needs: tuple[str, ...] = ()
    section: type[Section] | None = None
    check: Callable[[Scene], object] = lambda scene: None
    figures: Callable[[Result, Rows], Figures] = lambda result, rows: {}
    page: Callable[[Result], Result] | None = None
    beside: str = "output"
    counts: str = "rows"
    kept: str = "what was found so far"
    example: str | None = None
    gather: Gather | None = None
    writes: Mapping[str, str] = field(default_factory=dict)
    of_run: Callable[[Path, Path, Say, Progress], Sequence[str]] | None = None

    @property
    def sections(self) -> tuple[str, ...]:
        """All sections of a scene that are read."""
        return (*self.reads, self.name) if self.section else self.reads

    def __call__(
        self, scene: Scene, output: Path, say: Say = print, progress: Progress = lambda results, _: results
    ) -> Result:
        """Compute the missing rows, and write numbers, pictures and page into a folder; make the folder if need be.

        Under `mpiexec -n K` all K ranks call this; one hands out the work, the others take it. Returns what NAME.json
        holds; empty on ranks other than 0. Raises SceneError if the scene does not say what is needed, OnsetError or
        NoEquilibriumError if the packing has no onset, or bears none of the loads.
        """
        from ..figures.pages import render

        assert self.compute is not None
        self.check(scene)
        pool: Any
        with MPICommExecutor(world) if (world := MPI.COMM_WORLD).size > 1 else nullcontext() as pool:
            if world.rank != 0:
                return {}
            make_folder(output, f"{self.name}.json", f"{self.name}.md")
            rows = Rows(output / f"{self.name}.jsonl", source_of(scene, self.beside))
            map_rows: MapRows = map if pool is None else partial(pool.map, unordered=True)
            start = partial(settle, scene, communicator=MPI.COMM_SELF)
            found = self.compute(scene, Work(rows, start, map_rows, say, progress))
        real = real_units(scene)
        result = {"scene": scene.resolved(), "units": None if real is None else real.as_dict()} | found
        write_json(output / f"{self.name}.json", result)
        draw_all(self.figures(result, rows), output, say)
        if self.page is not None:
            names = {"result": result, "units": result["units"], **self.page(result)}
            write_text(output / f"{self.name}.md", render(__package__ or "", f"{self.name}.md.j2", **names))
        return result


def study(*, row: bool = False, **given: Any) -> Callable[[Callable[[Scene, Work], Result]], RegisteredStudy]:
    """Register the function of a study of one scene, with ``row=True`` as the task of a sweep, too; other keywords are
    the attributes of `RegisteredStudy`."""

    def register(compute: Callable[[Scene, Work], Result]) -> RegisteredStudy:
        def of_scene(scene: Scene, start: Start) -> Row:
            made.check(scene)
            return compute(scene, Work(Rows(), start))

        made = RegisteredStudy(name=compute.__name__, compute=compute, row=of_scene if row else None, **given)
        return made

    return register


def task(**given: Any) -> Callable[[TaskRow], RegisteredStudy]:
    """Register the function of a task of a sweep; keywords are the attributes of `RegisteredStudy`."""
    return lambda row: RegisteredStudy(name=row.__name__, row=row, **given)
