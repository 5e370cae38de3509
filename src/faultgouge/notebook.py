"""Packings in a notebook: a cell that ends with a packing shows its picture."""

from io import BytesIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from faultgouge.analysis import Packing


def picture(packing: "Packing") -> bytes:
    """The packing with its force chains, as a PNG."""
    from faultgouge.figures import draw_packing

    stream = BytesIO()
    draw_packing(packing).savefig(stream, format="png", dpi=150)
    return stream.getvalue()


def show_packings() -> None:
    """Tell a running IPython how a packing looks. Nothing is imported before a packing is shown."""
    from IPython import get_ipython

    shell = get_ipython()
    if shell is not None:
        pictures = shell.display_formatter.formatters["image/png"]
        pictures.for_type_by_name("faultgouge.analysis.packing.packing", "Packing", picture)
