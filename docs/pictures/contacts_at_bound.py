"""The pictures of docs/contacts_at_bound.md: D beside LAMMPS's, and which contacts slide.

python docs/pictures/contacts_at_bound.py, from the folder of the repository; two minutes
"""

import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from faultgouge.analysis import Configuration, Packing, one_sided_motion
from faultgouge.analysis.arrays import Floats, derive_frozen
from faultgouge.figures.packing import PackingArtist
from faultgouge.figures.style import INK, STYLE, save_as

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[1]))  # research

CASES = (
    ("(a) rests", "granular hertz, mindlin/force", 0.3, 40.0, 1),
    ("(b) grows", "gran/hertz/history", 0.25, 4.0, 1),
)
"""Fifty spheres of LAMMPS's laws: slope, dashpots, seed."""

PUSH, STEP = 1e-9, 5e-4

SLIDES = (2, 0.3, 0.9, 4.0)
"""Seed, F_x/F_y, restitution of the layer whose contacts slide, and how long the load has risen."""


def motions(law: str, slope: float, gamma: float, seed: int) -> tuple[Configuration, Floats, Floats, Floats]:
    """A packing at rest, times, and D over the push squared of LAMMPS and of one-sided motion."""
    from faultgouge.pywrap import from_lammps
    from faultgouge.pywrap.granular.lammps_arrays import owned_array, rows_of, set_velocity
    from research.lammps_laws.compute import pour, rest

    with TemporaryDirectory() as folder:
        lmp = pour(law, 3, 50, 0.5, seed, Path(folder) / "log", gamma)
        lmp.command(f"variable slope equal {slope}")
        rest(lmp)
        lmp.command("run 40000 post no")
        here = from_lammps(lmp)
        velocity = np.random.default_rng(0).standard_normal((len(here), 3))
        times = np.arange(0.25, 12.1, 0.25)
        for name in ("drag", "spin"):
            lmp.command(f"unfix {name}")
        lmp.command(f"timestep {STEP}")
        place = owned_array(lmp, "x")[rows_of(lmp, here)].copy()
        start = np.zeros((here.axes, len(here)))
        start[:3] = PUSH * velocity.T
        set_velocity(lmp, here, start.ravel())
        course = []
        for _ in times:
            lmp.command(f"run {round(times[0] / STEP)} post no")
            moved = owned_array(lmp, "x")[rows_of(lmp, here)] - place
            course.append(np.mean(np.sum(moved**2, axis=1)) / PUSH**2)
        lmp.close()
    found = one_sided_motion(here, velocity, times=times).mean_square_displacement
    grip = derive_frozen(here.contacts, friction=10 * here.contacts.friction)
    sticking = one_sided_motion(derive_frozen(here, contacts=grip), velocity, times=times).mean_square_displacement
    return here, times, np.array(course), np.array([found, sticking])


def draw_motion(axes: Axes, title: str, law: str, slope: float, gamma: float, seed: int) -> None:
    """D of LAMMPS as points, of one-sided motion and of sticking contacts as lines."""
    here, times, course, (found, sticking) = motions(law, slope, gamma, seed)
    axes.semilogy(times, course, "o", markersize=3, color="C0", label="LAMMPS")
    axes.semilogy(times, found, color=INK, linewidth=1.0, label="one-sided")
    axes.semilogy(times, sticking, color="C3", linewidth=0.8, linestyle="--", label="all stick")
    bound = int(here.contacts.at_bound.sum())
    axes.set_title(f"{title}: {bound} of {len(here.contacts)} at the bound", loc="left", fontsize=8)
    axes.set(xlabel="$t$", xlim=(0, times[-1]))
    axes.text(0.5, 0.03, law.replace("granular ", ""), transform=axes.transAxes, ha="center", fontsize=7)


@matplotlib.rc_context(fname=STYLE)
def motion_figure() -> Figure:
    """D after a push, over the push squared."""
    figure = Figure(figsize=(6.8, 2.8), layout="constrained")
    for axes, case in zip(figure.subplots(1, len(CASES)), CASES, strict=True):
        draw_motion(axes, *case)
    figure.axes[0].set_ylabel("$D$ over push$^2$")
    figure.axes[-1].legend(loc="upper left", frameon=False, fontsize=7)
    return figure


def layer() -> Packing:
    """The layer whose contacts slide, with its dashpots."""
    from faultgouge.pywrap import Scene, settle
    from faultgouge.pywrap.scenes.units import dashpot
    from research.laws.both_laws import as_slider, at_loads
    from research.modes.loss import impact_velocity, with_dashpots

    seed, share, restitution, _ = SLIDES
    scene = Scene.from_mapping(
        {
            "packing": {"seed": seed, "width": 11.9},
            "law": {"kn": 2e5, "history": "coulomb"},
            "load": {"fy": 3.0},
            "ramp": {"step": 3e-3, "until": 3.0 * share},
            "modes": {"fx_over_fy": [share]},
        }
    )
    start = settle(scene)
    found: list[Packing] = []
    at_loads(scene, replace(start, packing=as_slider(start.packing)), lambda packing: found.append(packing) or {})
    return with_dashpots(found[0], dashpot(scene.law.kn, restitution, 1.0, impact_velocity(scene)))


@matplotlib.rc_context(fname=STYLE)
def sliding_figure() -> Figure:
    """Force chains, and the contacts at the bound by how much force their sliders have taken away."""
    packing = layer()
    rise = np.zeros((len(packing), 2))
    rise[packing.top, 0] = 1.0
    slid = one_sided_motion(packing, rise=rise, times=[SLIDES[-1]]).slid[-1]
    bound = np.flatnonzero(packing.configuration.contacts.one_sided)
    figure = Figure(figsize=(5.0, 4.6), layout="constrained")
    axes = figure.add_subplot()
    artist = PackingArtist(axes, packing, "none", points=72 * 4.2 / 12.5)
    taken = np.full(len(packing.contacts), np.nan)
    taken[bound] = slid
    scale = matplotlib.colors.Normalize(0, float(slid.max()))
    colours = np.array([INK] * len(packing.contacts), dtype=object)
    for contact in bound:
        colours[contact] = matplotlib.colors.to_hex(matplotlib.colormaps["autumn_r"](scale(taken[contact])))
    shown = artist.view.contact
    widths = np.maximum(artist.chains.get_linewidths(), np.where(np.isin(shown, bound), 2.5, 0.0))
    artist.chains.set(colors=colours[shown], linewidths=widths)
    bar = figure.colorbar(matplotlib.cm.ScalarMappable(scale, "autumn_r"), ax=axes, shrink=0.6, aspect=28, pad=0.02)
    bar.set_label("force $p$ that the slider has taken away, over the rate")
    return figure


if __name__ == "__main__":
    save_as(motion_figure(), HERE / "contacts_at_bound_motion.png")
    save_as(sliding_figure(), HERE / "contacts_at_bound_sliding.png")
