"""Figures of the gallery: faultgouge uses no pyplot, so that figures are found in the variables of a script."""

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst

from faultgouge.figures.style import save_as


def scraper(block: tuple[Any, ...], block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save the figures that have come since the last block, and return the reStructuredText that shows them."""
    seen = block_vars.setdefault("figures", [])
    paths = []
    for value in list(block_vars["example_globals"].values()):
        if isinstance(value, Figure) and not any(value is each for each in seen):
            seen.append(value)
            path = Path(next(block_vars["image_path_iterator"]))
            save_as(value, path)
            paths.append(str(path))
    return figure_rst(paths, gallery_conf["src_dir"])
