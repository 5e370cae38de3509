"""The frame of studies: the files that every study writes, and the continuation of an interrupted study of one scene.

A study of one scene stores its results row by row in NAME.jsonl, and does not compute rows of the same scene again.
NAME.json, pictures and NAME.md are written at the end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure
from mpi4py import MPI

from ..analysis.files.atomic_write import make_folder, write_json, write_text
from ..figures.pages import render
from ..figures.style import report_failure, save
from ..pywrap import Scene
from ..pywrap.scenes.units import real_units
from .executors import MapRows, Progress, Say, open_executor
from .result_rows import Rows

Result = dict[str, Any]

Figures = Mapping[str, Callable[[], Figure]]
"""Functions that draw the pictures, by file name."""


def draw_all(figures: Figures, folder: Path, say: Say) -> None:
    """Draw and save pictures; a picture that fails is reported, and the others are drawn."""
    for name, figure in figures.items():
        with report_failure(f"{name}.png", say):
            save(figure(), folder / name)


class Work(NamedTuple):
    """Inputs of a study besides the scene: known rows, a map over missing rows, and the output of messages."""

    rows: Rows
    map_rows: MapRows
    say: Say
    progress: Progress


@dataclass(frozen=True)
class SceneStudy:
    """A study of one scene, which is called with the scene and a folder.

    Attributes
    ----------
    package, name : str
        `__package__` of the study, whose folder has the template NAME.md.j2, and NAME.
    beside : str
        A section of the scene that may change while the stored rows remain valid.
    check : callable
        Raises SceneError for a scene without what is needed.
    compute : callable
        Scene, `Work` -> the contents of NAME.json but the scene and its units.
    figures : callable
        Contents of NAME.json, rows -> the functions that draw the pictures.
    page : callable
        Contents of NAME.json -> the names of the template but `result`, which is these contents, and `units`.
    """

    package: str
    name: str
    beside: str
    check: Callable[[Scene], object]
    compute: Callable[[Scene, Work], Result]
    figures: Callable[[Result, Rows], Figures]
    page: Callable[[Result], Result]

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
        names = {"result": result, "units": result["units"], **self.page(result)}
        write_json(output / f"{self.name}.json", result)
        draw_all(self.figures(result, rows), output, say)
        write_text(output / f"{self.name}.md", render(self.package, f"{self.name}.md.j2", **names))
        return result
