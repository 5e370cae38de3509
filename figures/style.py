"""One style for all figures: the style sheet, the colours with a meaning, and files that are the same to the byte.

Figures have a white background, also on a dark page.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from faultgouge.analysis import BadInputError
from faultgouge.analysis.files.atomic_write import MARK, replace_whole

STYLE = str(files(__package__) / "faultgouge.mplstyle")

BULK, UPPER, EDGE, FLOOR, INK = "#dfe5ea", "#f2c14e", "#8a949c", "#c0392b", "#333333"

MOBILIZATION = LinearSegmentedColormap.from_list("mobilization", ["#14213d", "#3d6a9e", "#b56576", "#f07d1a"])

styled = matplotlib.rc_context(fname=STYLE)
"""Decorator: what the function draws is drawn in the style, and no setting leaks out. A line keeps its colour wherever
the figure is saved if the colour is `to_hex("C0")`: matplotlib looks up "C0" itself only when the line is drawn."""


def figure_of(axes: Axes) -> Figure:
    """The figure, itself or through subfigures, that holds the axes."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    return figure


def require_axes(axes: object) -> None:
    """Refuse what is no matplotlib axes in a sentence, with what may have been meant."""
    if axes is not None and not isinstance(axes, Axes):
        cure = "draw(packing).savefig(path) writes a file"
        raise BadInputError(f"draw takes matplotlib's Axes, and no {type(axes).__name__}: {cure}.")


@contextmanager
def report_failure(what: str, say: Callable[[str], None]) -> Iterator[None]:
    """Print the failure of a picture as one sentence, and go on: no computed number is lost."""
    try:
        yield
    except Exception as error:  # whatever it is: the numbers are worth more than their picture
        reason = (str(error).splitlines() or ["no reason given"])[0]
        say(f"{what} was not drawn ({type(error).__name__}: {reason}); all numbers are there")


@styled
def save(figure: Figure, stem: str | Path) -> tuple[Path, Path]:
    """Write a figure as PNG (200 dots an inch) and SVG, the same bytes for the same figure.

    Parameters
    ----------
    figure : Figure
        What to write.
    stem : str or Path
        Path without ending; its folder exists.

    Returns
    -------
    tuple of Path
        The PNG and the SVG.
    """
    stem = Path(stem)
    png, svg = stem.with_name(stem.name + ".png"), stem.with_name(stem.name + ".svg")
    save_as(figure, png)
    engine = figure.get_layout_engine()
    figure.set_layout_engine("none")  # the SVG keeps the layout of the PNG, which takes as long as the drawing
    save_as(figure, svg)
    figure.set_layout_engine(engine or "none")
    return png, svg


@styled
def save_as(figure: Figure, path: Path) -> None:
    """Write a figure in the format that its name ends in: png, svg or pdf; the same bytes for the same figure."""
    about = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}, ".png": {"Comment": MARK}}
    with replace_whole(path) as new:
        figure.savefig(new, metadata=about.get(path.suffix.lower()))
