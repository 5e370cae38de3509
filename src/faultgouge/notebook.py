"""Pictures in a notebook: if a cell ends with a packing or a figure, the notebook shows its picture."""

import sys
from io import BytesIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def png(figure: "Figure") -> bytes:
    """A figure as a PNG."""
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=150)
    return stream.getvalue()


def show_pictures() -> None:
    """Tell a running IPython how packings and figures look. Nothing is imported before one of them is shown."""
    from IPython import get_ipython

    shell = get_ipython()
    if shell is not None:
        pictures = shell.display_formatter.formatters["image/png"]
        of_packing = "faultgouge.analysis.packing.packing", "Packing"
        pictures.for_type_by_name(*of_packing, lambda each: png(sys.modules["faultgouge"].draw(each)))
        # pyplot, where it is in use, shows figures in its own way
        if "matplotlib.pyplot" not in sys.modules:
            pictures.for_type_by_name("matplotlib.figure", "Figure", png)
