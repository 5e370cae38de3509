"""Pictures of research."""

from collections.abc import Callable, Mapping
from pathlib import Path

from matplotlib.figure import Figure

from faultgouge.figures import save_as


def draw_all(figures: Mapping[str, Callable[[], Figure]], folder: Path) -> None:
    """Draw pictures as PNG, by their names."""
    for name, figure in figures.items():
        save_as(figure(), folder / f"{name}.png")
