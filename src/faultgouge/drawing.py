"""Draw a packing or a mode of it, of an object or of a file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from .analysis import BadInputError
from .analysis.has_configuration import HasConfiguration
from .stored_files import takes_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@takes_file
def draw(
    packing: HasConfiguration,
    ax: Axes | None = None,
    mode: int | Literal["pair"] | None = None,
    color: str = "mobilised",
    caption: bool = False,
) -> Figure:
    """Draw a packing with its force chains, or a mode of it.

    Parameters
    ----------
    packing : Packing, Configuration, str or Path
        The packing, or the file of one.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a figure of its own, with a legend, by default.
    mode : int or "pair", optional
        A mode by its number, counted by the real part of the eigenvalue from 0; "pair": the fastest growing complex
        pair, or the two real modes that are closest to meeting, of which `ax` shows the first.
    color : {"mobilised", "slip", "force", "none"}
        What the colour of a contact shows, without a mode.
    caption : bool
        Whether to print load and numbers of contacts above, in a new figure.

    Returns
    -------
    Figure
        The figure of the axes.

    Raises
    ------
    BadInputError
        If `ax` is no axes, or the packing has no such mode.

    Examples
    --------

    >>> start = faultgouge.settle("three_disks.toml").packing
    >>> faultgouge.draw(start).savefig("packing.png")
    >>> print(faultgouge.draw(start, mode=0).axes[0].get_title())
    mode 0: $\\lambda = 383.589$
    participation ratio 0.99, rotation 28 % of the kinetic energy
    """
    from .figures import draw_mode, draw_packing

    if mode is None:
        return draw_packing(packing, ax, color, caption)
    if mode != "pair" and not isinstance(mode, int):
        raise BadInputError(f"draw takes the number of a mode, or 'pair', and not mode = {mode!r}.")
    return draw_mode(packing, None if mode == "pair" else mode, ax)
