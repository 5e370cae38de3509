"""The frame of a study of one scene that goes on in its folder: refuse, compute, write, draw, fill the page.

What a study found is kept row by row in NAME.jsonl, and rows of the same scene are not computed again. NAME.json,
pictures and NAME.md are written in the end.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..analysis.files.wholefile import make_folder, write_text
from ..figures.pages import render
from ..figures.style import spared
from ..pywrap import Scene
from ..pywrap.onset.sharing import Progress, Say, Share, shared_out
from ..pywrap.scenes.units import real_units
from .rows import Rows

Result = dict[str, Any]


@dataclass(frozen=True)
class Work:
    """What the computing part of a study is given beside the scene.

    Attributes
    ----------
    rows : Rows
        What is known, and where what is found goes.
    share, say, progress
        As :mod:`~faultgouge.pywrap.onset.sharing` has them.
    """

    rows: Rows
    share: Share
    say: Say
    progress: Progress


@dataclass(frozen=True)
class Study:
    """A study, which is called with a scene and a folder.

    Attributes
    ----------
    package : str
        `__package__` of the study, whose folder has the template NAME.md.j2.
    name : str
        Of its files.
    beside : str
        A section of the scene that may change without making what was found worthless.
    check : callable
        Raises SceneError for a scene without what is needed.
    compute : callable
        Scene and `Work` to what NAME.json holds beside the scene and its units.
    draw : callable
        Saves the pictures: takes what NAME.json holds, the rows and the folder.
    page : callable
        From what NAME.json holds, what the template names beside `result`, which is that, and its `units`.
    """

    package: str
    name: str
    beside: str
    check: Callable[[Scene], object]
    compute: Callable[[Scene, Work], Result]
    draw: Callable[[Result, Rows, Path], None]
    page: Callable[[Result], Result]

    def __call__(
        self, scene: Scene, output: Path, say: Say = print, progress: Progress = lambda results, _: results
    ) -> Result:
        """Compute what is missing, and leave numbers, pictures and page in a folder, which is made if need be.

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
        with shared_out() as share:
            if share is None:
                return {}
            make_folder(output)
            rows = Rows(output / f"{self.name}.jsonl", scene, self.beside)
            found = self.compute(scene, Work(rows, share, say, progress))
        real = real_units(scene)
        result = {"scene": scene.resolved(), "units": None if real is None else real.as_dict()} | found
        write_text(output / f"{self.name}.json", json.dumps(result, indent=1) + "\n")
        with spared(f"{self.name}: a picture", say):
            self.draw(result, rows, output)
        page = render(self.package, f"{self.name}.md.j2", result=result, units=result["units"], **self.page(result))
        write_text(output / f"{self.name}.md", page)
        return result
