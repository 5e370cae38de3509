"""A page that shows a ramp or an undamped run in a browser, without a network: `faultgouge view`.

Bokeh draws and its JavaScript is part of the page. Arrays are for drawing: float32, in base64. `view.js` passes them to
Bokeh as the slider moves. `followed_pairs` finds the pair of eigenvalues that the page follows, and the verdicts.
"""

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import to_hex

from faultgouge.analysis import BadInputError, Configuration, Packing
from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.files.atomic_write import write_text
from faultgouge.analysis.motion.hysteresis import layer_displacement

from .followed_pairs import SECONDS_OF_1000, FollowedPair, Progress, RampEigenvalues, follow_eigenvalues
from .packing import LEAST_SHARE, PackingArtist, View
from .style import EDGE, FLOOR, INK, MOBILIZATION

if TYPE_CHECKING:
    from bokeh.plotting import figure

FIRST, SECOND, OTHERS = "#0072b2", "#d55e00", "#8a949c"
"""The two of the pair, and all other eigenvalues: told apart by the colour-blind, on white and on black."""

SOURCE_COLUMNS = {
    "disks": "x y radius face",
    "marks": "x0 y0 x1 y1",
    "chains": "x0 y0 x1 y1 px share",
    "others": "re im",
    "members": "re im colour",
    "now": "fx real imaginary colour",
    "here": "moved fx",
}
"""What `view.js` fills anew at each load: sources of data and their columns."""


class ViewError(BadInputError):
    """A page that cannot be made, in one sentence."""


def check_library() -> None:
    """Refuse before any work if Bokeh is not installed."""
    try:
        import bokeh  # noqa: F401 - only whether it is there
    except ImportError as error:
        raise ViewError("view needs Bokeh, which is not installed: pip install 'faultgouge[view]'") from error


def equally_spaced(count: int, most: int) -> list[int]:
    """Which of some equilibria a page shows: all, or so many of them, the first and the last among these."""
    return sorted({round(k) for k in np.linspace(count - 1, 0, min(count, most))})


def loads_shown(disks: int) -> int:
    """How many loads a page of so many disks has by default: 60, or as many as take a minute, but six at least."""
    return max(min(60, round(60 / SECONDS_OF_1000 * (1000 / disks) ** 3)), 6)


def write_view(
    packings: Sequence[Packing | Configuration],
    path: Path,
    title: str,
    series: dict[str, Any] | None = None,
    progress: Progress = iter,
) -> None:
    """Write the page.

    Parameters
    ----------
    packings : sequence of Packing or Configuration
        Equilibria in order of their load, all with the same disks.
    path : Path
        The page to write.
    title : str
        What the file is.
    series : dict, optional
        Columns time and msd of an undamped run from the last equilibrium.
    progress : callable
        Wraps the packings while their eigenvalues are computed.

    Raises
    ------
    ViewError
        If Bokeh is not installed.
    """
    check_library()
    from bokeh.document import Document
    from bokeh.embed import file_html
    from bokeh.events import DocumentReady
    from bokeh.models import ColumnDataSource, CustomJS
    from bokeh.resources import INLINE

    course = follow_eigenvalues(packings, progress)
    if not course.pairs:
        raise ViewError("the packing has fewer than two modes, so that no two can meet")
    pair = course.pairs[0]
    ramp = [each for each in packings if isinstance(each, Packing)]
    moved = layer_displacement(ramp)[:, 0] if ramp else np.zeros(len(packings))
    frames = [_frame(packing, course, pair, k) | {"moved": moved[k]} for k, packing in enumerate(packings)]
    sources = {
        name: ColumnDataSource({column: [] for column in columns.split()}, name=name)
        for name, columns in SOURCE_COLUMNS.items()
    }
    plots = [_packing_plot(packings, sources), _plane(pair, sources)]
    if len(packings) > 1:
        plots += _curves(packings, pair, sources)
        plots.append(_cycle(packings, moved, sources))
    if series is not None:
        plots.append(_growth(series))
    document = Document()
    for plot in plots:
        document.add_root(plot)
    folder = files(__package__ or "")
    script = CustomJS(args={"frames": frames, "plots": plots, **sources}, code=(folder / "view.js").read_text())
    document.js_on_event(DocumentReady, script)
    page = file_html(
        document,
        INLINE,
        title=title,
        template=(folder / "view.html.j2").read_text(),
        template_variables={
            "count": len(packings),
            "colours": (FIRST, SECOND),
            "yellow": "Yellow: upper layer." if ramp else "Red: walls, and disks that are held.",
        },
    )
    write_text(path, page)


def _frame(packing: Packing | Configuration, course: RampEigenvalues, pair: FollowedPair, k: int) -> dict[str, Any]:
    """The arrays of one load, in float32."""
    view, contacts = View.of(packing, margin=0.5 * packing.radius.max()), packing.contacts
    force = packing.normal_force
    modes = pair.modes[k]
    arrays = {
        "x": view.place[:, 0],
        "y": view.place[:, 1],
        "disk": view.disk,
        "radius": packing.radius[view.disk],
        "angle": np.zeros(len(view.disk)) if isinstance(packing, Configuration) else packing.angle[view.disk],
        "x0": view.start[:, 0],
        "y0": view.start[:, 1],
        "x1": view.end[:, 0],
        "y1": view.end[:, 1],
        "i": contacts.i[view.contact],
        "j": contacts.j[view.contact],
        "width": 0.5 * packing.radius.min() * (force / force.max(initial=np.finfo(float).tiny))[view.contact],
        "share": np.maximum(packing.mobilised, LEAST_SHARE)[view.contact],
        "re": course.values[k].real,
        "im": course.values[k].imag,
        "pair": np.concatenate([pair.eigenvalues[k].real, pair.eigenvalues[k].imag]),
        "modes": np.stack([modes.real, modes.imag], axis=1).ravel(),
    }
    faces = PackingArtist.faces(packing)[view.disk]
    return {
        "fx": packing.fx,
        "face": [{"white": None}.get(str(face), str(face)) for face in faces],
        "known": bool(np.isfinite(pair.eigenvalues[k]).all()),
        "verdict": " ".join(course.verdicts[k].sentences),
        **{name: np.asarray(array, dtype=np.float32) for name, array in arrays.items()},
    }


def _plot(name: str, x: str, y: str, **more: Any) -> "figure":
    from bokeh.plotting import figure

    tools: dict[str, Any] = {"tools": "pan,wheel_zoom,box_zoom,reset", "toolbar_location": "above"}
    plot = figure(name=name, x_axis_label=x, y_axis_label=y, sizing_mode="stretch_both", **{**tools, **more})
    plot.toolbar.logo = None
    plot.toolbar.autohide = True
    # from the start: of what is painted once, half a pixel stays at two edges
    plot.background_fill_color = plot.border_fill_color = plot.outline_line_color = None
    return plot


def _packing_plot(packings: Sequence[Packing | Configuration], sources: dict[str, Any]) -> "figure":
    """Disks and force chains; the floor."""
    from bokeh.models import BoxAnnotation, ColorBar, LogColorMapper

    views = [View.of(packing) for packing in packings]
    left, right = min(view.left for view in views), max(view.right for view in views)
    bottom = min(view.bottom for view in views)
    top = max(float((packing.position[:, 1] + packing.radius).max()) for packing in packings)
    top += 0.6 * float(packings[0].radius.min())
    more = {"x_range": (left, right), "y_range": (bottom, top), "tools": "", "toolbar_location": None}
    plot = _plot("packing", "", "", **more)
    plot.axis.visible = False
    plot.grid.visible = False
    plot.min_border = 0
    plot.aspect_ratio = (right - left) / (top - bottom)
    plot.sizing_mode = "scale_width"
    plot.circle("x", "y", radius="radius", source=sources["disks"], fill_color="face", line_color=EDGE, line_width=0.6)
    colours = LogColorMapper([to_hex(MOBILIZATION(k / 255)) for k in range(256)], low=LEAST_SHARE, high=1)
    plot.segment("x0", "y0", "x1", "y1", source=sources["marks"], line_color=INK, line_width=1.2)
    chains = {"line_width": "px", "line_cap": "round", "line_color": {"field": "share", "transform": colours}}
    plot.segment("x0", "y0", "x1", "y1", source=sources["chains"], **chains)
    for wall in views[0].walls:
        side = [["right", "left"], ["top", "bottom"]][wall.axis][wall.sign < 0]
        beyond: dict[str, Any] = {side: wall.place}
        plot.add_layout(BoxAnnotation(**beyond, fill_color=FLOOR, fill_alpha=1, line_color=None, level="overlay"))
    bar = ColorBar(color_mapper=colours, height=8, title="mobilised friction |fₜ| / (μ fₙ)", title_standoff=4)
    bar.background_fill_color = None
    plot.add_layout(bar, "below")
    return plot


def _plane(pair: FollowedPair, sources: dict[str, Any]) -> "figure":
    """The plane of eigenvalues about the pair, with the way of the pair."""
    known = pair.eigenvalues[np.isfinite(pair.eigenvalues).all(axis=1)]
    low, high = float(known.real.min()), float(known.real.max())
    margin = 0.15 * (high - low) or 0.05 * abs(high)
    most = 1.3 * float(known.imag.max()) or margin
    plot = _plot("plane", "Re λ", "Im λ", x_range=(low - margin, high + margin), y_range=(-most, most))
    for member, colour in enumerate((FIRST, SECOND)):
        way = pair.eigenvalues[:, member].astype(np.complex64)
        plot.line(way.real, way.imag, line_color=colour, line_alpha=0.5, line_width=1.5)
    plot.scatter("re", "im", source=sources["others"], size=6, fill_color=OTHERS, line_color=None)
    plot.scatter("re", "im", source=sources["members"], size=13, fill_color="colour", line_color=None)
    return plot


def _curves(packings: Sequence[Packing | Configuration], pair: FollowedPair, sources: dict[str, Any]) -> list["figure"]:
    """Real and imaginary parts of the pair over the load."""
    fx = np.array([packing.fx for packing in packings])
    plots: list[figure] = []
    for name, label, part in (("real", "Re λ", pair.eigenvalues.real), ("imaginary", "Im λ", pair.eigenvalues.imag)):
        more = {"x_range": plots[0].x_range} if plots else {}
        plot = _plot(name, "Fₓ", label, **more)
        for member, colour in enumerate((FIRST, SECOND)):
            plot.line(fx, part[:, member].astype(np.float32), line_color=colour, line_width=2)
        plot.scatter("fx", name, source=sources["now"], size=11, fill_color="colour", line_color=None)
        plots.append(plot)
    return plots


def _cycle(packings: Sequence[Packing | Configuration], moved: Floats, sources: dict[str, Any]) -> "figure":
    """F_x over the displacement of the upper layer."""
    plot = _plot("cycle", "displacement of the upper layer", "Fₓ")
    plot.line(moved, [packing.fx for packing in packings], line_color=OTHERS, line_width=2)
    plot.scatter("moved", "fx", source=sources["here"], size=11, fill_color=FIRST, line_color=None)
    return plot


def _growth(series: dict[str, Any]) -> "figure":
    """D(t) of an undamped run, on a logarithmic axis."""
    seen = series["msd"] > 0
    plot = _plot("growth", "t", "D(t)", y_axis_type="log")
    time, msd = (np.asarray(series[name][seen], dtype=np.float32) for name in ("time", "msd"))
    plot.line(time, msd, line_color=SECOND, line_width=1.5)
    return plot
