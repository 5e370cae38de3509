"""The page that `faultgouge view` writes: a stored file, for any browser, offline."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

from .analysis import BadInputError, Configuration, RunFile
from .analysis.has_configuration import HasConfiguration
from .analysis.motion.hysteresis import turning_points
from .figures.browser_page import Axis, equally_spaced, loads_shown, write_view
from .figures.followed_pairs import seconds
from .stored_files import load, packing_in, path_of

Progress = Callable[[Sequence[HasConfiguration]], Iterable[HasConfiguration]]


class ViewedPage(type(Path())):  # type: ignore[misc]  # the class of paths of this system
    """The path of a page, which a notebook shows."""

    def _repr_html_(self) -> str:
        return f'<iframe srcdoc="{escape(self.read_text())}" width="100%" height="640" style="border: 0"></iframe>'


def view(
    file: str | Path,
    output: str | Path = "page.html",
    loads: int | None = None,
    say: Callable[[str], Any] = print,
    progress: Progress = iter,
) -> ViewedPage:
    """Write a page of a stored packing, ramp, undamped run or driven run.

    Parameters
    ----------
    file : str or Path
        A run.h5, drive.h5 or perturb.h5, the dumps of a deck, or what `import` has made of a LAMMPS deck.
    output : str or Path
        The page, .html.
    loads : int, optional
        Number of equilibria on the page, equally spaced; by default as many as take a minute, and 60 at the most.
    say, progress : callable
        Takes a line about long work; wraps the packings while their eigenvalues are computed.

    Returns
    -------
    ViewedPage
        The path of the page; in a notebook the page itself is seen.

    Raises
    ------
    BadInputError
        If the page is no .html.
    PackingFileError
        If the file is missing or damaged.

    Examples
    --------

    >>> page = faultgouge.view("run.h5", "page.html", say=lambda line: None)
    >>> page.read_text()[:15]
    '<!doctype html>'
    """
    path, output = path_of(file, "view"), Path(output)
    if output.suffix.lower() != ".html":
        raise BadInputError(f"-o {output}: a page is an .html")
    last = load(path)
    packings, series, axis = [last], None, None
    if isinstance(last, Configuration):
        particles = "disks" if last.dimension == 2 else "spheres"
        title = f"{path.name}: {len(last)} {particles} as LAMMPS left them"
    elif path.suffix == ".disks":
        title = f"{path.name}: {len(last)} disks, Fₓ = {last.fx:g}"
    else:
        with RunFile(path) as run:
            packings, axis, title = _of_run(run, loads_shown(len(last)) if loads is None else loads)
            series = run.series("undamped") if "undamped" in run.names_of_series else None
    if seconds(packings) > 5:
        say(f"eigenvalues of {len(packings)} loads of {len(packings[0])} disks: about {seconds(packings):.0f} s")
    write_view(packings, output, title, series, progress, axis)
    return ViewedPage(output)


def _of_run(run: RunFile, most: int) -> tuple[list[Any], Axis | None, str]:
    """The packings of a page, what changes from one to the next, and the title of the page."""
    driven = "time" in run.observables
    turns = [] if driven else turning_points(run.fx)
    chosen = sorted({*equally_spaced(len(run), most), *turns})
    packings = [packing_in(run, k) for k in chosen]
    axis = Axis("t", "time of the run", run.observable("time")[chosen]) if driven else None
    ends = [run.fx[k] for k in sorted({0, *turns, len(run) - 1})]
    span = f", Fₓ = {' to '.join(f'{fx:g}' for fx in ends)}" if not driven else ""
    what = "undamped run" if "undamped" in run.names_of_series else "equilibria"
    what = "states of a driven run" if driven else what
    return packings, axis, f"{run.path.name}: {what} of {len(packings[0])} disks{span}"
