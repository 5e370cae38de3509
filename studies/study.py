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
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from mpi4py import MPI

from ..analysis.files.atomic_write import make_folder, write_json, write_text
from ..pywrap import Scene
from ..pywrap.scenes.units import real_units
from ..pywrap.scenes.validation import Section
from .executors import MapRows, Progress, Say, open_executor
from .packing_tools import Start
from .result_rows import Row, Rows

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .sweep.sweep_plan import Sweep

Result = dict[str, Any]

Figures = Mapping[str, Callable[[], "Figure"]]
"""Functions that draw the pictures, by file name."""

TaskRow = Callable[[Scene, Start], Row]
"""A task: a scene, and the function mu -> settled packing -> a row."""

Gather = Callable[["Sweep", Sequence[Row], Path, Say], Sequence[str]]
"""What a task makes of all rows of a sweep in a folder; it returns lines for a terminal."""


class Work(NamedTuple):
    """Inputs of a study besides the scene: known rows, a map over missing rows, and the output of messages."""

    rows: Rows
    map_rows: MapRows
    say: Say
    progress: Progress


def draw_all(figures: Figures, folder: Path, say: Say) -> None:
    """Draw in the style of the package and save pictures; one that fails is reported, and the others are drawn."""
    from ..figures.style import report_failure, save, styled

    for name, figure in figures.items():
        with report_failure(f"{name}.png", say):
            save(styled(figure)(), folder / name)


@dataclass(frozen=True)
class SceneStudy:
    """A study of one scene, which is called with the scene and a folder; attributes as of `study`."""

    name: str
    compute: Callable[[Scene, Work], Result]
    reads: tuple[str, ...]
    needs: tuple[str, ...]
    section: type[Section] | None
    check: Callable[[Scene], object]
    figures: Callable[[Result, Rows], Figures]
    page: Callable[[Result], Result] | None
    beside: str
    row: TaskRow | None
    counts: str
    kept: str

    def __call__(
        self, scene: Scene, output: Path, say: Say = print, progress: Progress = lambda results, _: results
    ) -> Result:
        """Compute the missing rows, and write numbers, pictures and page into a folder; make the folder if need be.

        Under `mpiexec -n K` all K ranks call this; one hands out the work, the others take it.

        Returns
        -------
        dict
            What NAME.json holds; empty on ranks other than 0.

        Raises
        ------
        SceneError
            If the scene does not say what is needed.
        OnsetError, NoEquilibriumError
            If the packing has no onset, or bears none of the loads.
        """
        from ..figures.pages import render

        self.check(scene)
        pool: Any
        with open_executor(workers=1) as pool:
            if MPI.COMM_WORLD.rank != 0:
                return {}
            map_rows: MapRows = map if pool is None else partial(pool.map, unordered=True)
            make_folder(output, f"{self.name}.json", f"{self.name}.md")
            rows = Rows(output / f"{self.name}.jsonl", scene, self.beside)
            found = self.compute(scene, Work(rows, map_rows, say, progress))
        real = real_units(scene)
        result = {"scene": scene.resolved(), "units": None if real is None else real.as_dict()} | found
        write_json(output / f"{self.name}.json", result)
        draw_all(self.figures(result, rows), output, say)
        if self.page is not None:
            names = {"result": result, "units": result["units"], **self.page(result)}
            write_text(output / f"{self.name}.md", render(__package__ or "", f"{self.name}.md.j2", **names))
        return result


@dataclass(frozen=True)
class SweepTask:
    """A task of a sweep, which is called with a scene and a function mu -> settled packing; attributes as of `task`."""

    name: str
    row: TaskRow
    reads: tuple[str, ...]
    needs: tuple[str, ...]
    section: type[Section] | None
    gather: Gather | None
    writes: Mapping[str, str]
    of_run: Callable[[Path, Path, Say, Progress], Sequence[str]] | None

    def __call__(self, scene: Scene, start: Start) -> Row:
        """The row of a scene."""
        return self.row(scene, start)


def study(
    *,
    reads: Iterable[str],
    needs: Iterable[str] = (),
    section: type[Section] | None = None,
    check: Callable[[Scene], object] = lambda scene: None,
    figures: Callable[[Result, Rows], Figures] = lambda result, rows: {},
    page: Callable[[Result], Result] | None = None,
    beside: str = "output",
    row: TaskRow | None = None,
    counts: str = "rows",
    kept: str = "what was found so far",
    example: str | None = None,
) -> Callable[[Callable[[Scene, Work], Result]], SceneStudy]:
    """Register a study of one scene; its name is that of the function and of the file, and its help the docstring.

    Parameters
    ----------
    reads, needs : iterable of str
        Sections of a scene that the study reads besides its own, and those that it cannot do without.
    section : type of Section, optional
        Its own section, [NAME].
    check : callable
        Raises SceneError for a scene without what is needed.
    figures : callable
        Contents of NAME.json, rows -> the functions that draw the pictures, by file name.
    page : callable, optional
        For a page NAME.md: contents of NAME.json -> the names of the template NAME.md.j2, beside the file, but
        `result`, which is these contents, and `units`.
    beside : str
        A section of the scene that may change while the stored rows remain valid.
    row : callable, optional
        The study as a task of a sweep.
    counts, kept : str
        What the progress counts, and what an interrupt leaves.
    example : str, optional
        The example of the help.
    """

    def register(compute: Callable[[Scene, Work], Result]) -> SceneStudy:
        name = compute.__name__
        own = () if section is None else (name,)
        every = (*reads, *own)
        return SceneStudy(name, compute, every, tuple(needs), section, check, figures, page, beside, row, counts, kept)

    return register


def task(
    *,
    reads: Iterable[str],
    needs: Iterable[str] = (),
    section: type[Section] | None = None,
    gather: Gather | None = None,
    writes: Mapping[str, str] = MappingProxyType({}),
    of_run: Callable[[Path, Path, Say, Progress], Sequence[str]] | None = None,
    example: str | None = None,
) -> Callable[[TaskRow], SweepTask]:
    """Register a task of a sweep; its name is that of the function and of the file.

    Parameters
    ----------
    reads, needs, section
        As of `study`.
    gather : callable, optional
        What is made of all rows.
    writes : mapping
        The files that `gather` writes besides pictures, and the heads of those that are tables: files of others of
        these names are refused before work begins.
    of_run : callable, optional
        What the command does with a stored run, FILE.h5, in place of a scene.
    example : str, optional
        The example of the help: with it the task is a command, too, which takes a scene or a sweep of this task.
    """

    def register(row: TaskRow) -> SweepTask:
        name = row.__name__
        own = () if section is None else (name,)
        return SweepTask(name, row, (*reads, *own), tuple(needs), section, gather, writes, of_run)

    return register
