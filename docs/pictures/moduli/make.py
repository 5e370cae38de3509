"""The pictures of docs/moduli.md: python docs/pictures/moduli/make.py, from the folder of the repository."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from faultgouge.analysis import Material, dispersion, elastic_moduli, spheres_of_material, vibrations
from faultgouge.figures import save_as, styled
from faultgouge.figures.series import draw_vibrations, draw_waves
from faultgouge.figures.style import BULK, EDGE, FLOOR, INK

HERE = Path(__file__).parent


def packing():
    """Spheres of two sizes near the places of a crystal, in contact with their neighbours, with dashpots."""
    rng, edge, cells = np.random.default_rng(0), 1.38, 5
    faces = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]]) / 2
    place = edge * np.concatenate([faces + np.array(cell) for cell in np.ndindex(cells, cells, cells)])
    place += rng.uniform(-0.03, 0.03, place.shape)
    radius = rng.uniform(0.49, 0.51, len(place))
    material = Material(1000.0, 0.25, density=1.0, restitution=0.9)
    return spheres_of_material(place, radius, material, box=cells * edge * np.eye(3), periodic=[True] * 3)


@styled
def signs() -> Figure:
    """f_n and f_t on the first sphere of a row."""
    figure = Figure(figsize=(3.5, 2.1), layout="constrained")
    axes = figure.add_subplot()
    for centre, name, face in (((-0.95, 0), "2", "white"), ((0.95, 0), "1", BULK)):
        axes.add_patch(Circle(centre, 1.0, facecolor=face, edgecolor=EDGE, linewidth=1))
        axes.text(centre[0] * 1.25, -0.35, name, ha="center", va="center", fontsize=11, color=INK)
    shape = {"width": 0.035, "head_width": 0.14, "length_includes_head": True, "zorder": 4}
    axes.arrow(0, 0, 0.75, 0, color=INK, **shape)
    axes.arrow(0, 0, 0, 0.6, color=FLOOR, **shape)
    axes.arrow(-0.55, -0.62, 1.1, 0, color=EDGE, **shape)
    axes.text(0.8, 0.1, "$f_n\\,\\mathbf{n}$", fontsize=10, color=INK)
    axes.text(-0.34, 0.4, "$\\mathbf{f}_t$", fontsize=10, color=FLOOR)
    axes.text(0.0, -1.12, "$\\mathbf{n}$, from 2 to 1", fontsize=8, color=EDGE, ha="center")
    axes.set(aspect="equal", xlim=(-2.05, 2.05), ylim=(-1.2, 1.08))
    axes.set_axis_off()
    return figure


if __name__ == "__main__":
    here = packing()
    save_as(draw_vibrations(vibrations(here)), HERE / "density.png")
    save_as(draw_waves(dispersion(here, 0, 4), elastic_moduli(here)), HERE / "waves.png")
    save_as(signs(), HERE / "signs.png")
