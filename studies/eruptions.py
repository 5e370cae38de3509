r"""The size of eruptions: undamped runs from rest at many loads, until they are over.

Above its onset a packing at rest is unstable. The rounding of the coordinates is a sufficient perturbation: D grows
from it at the rate :math:`2 |\mathrm{Im}\,\omega|` of the spectrum (:math:`2\,\mathrm{Re}\,s` with dissipation), by ten
and more decades, and then levels off. The largest D is the size of the eruption at that load.

**Over.** A run is over at time t when two conditions hold: the largest D of its second half, (t/2, t], is at most 1.5
times that of the quarter before, (t/4, t/2]; and t is long enough for D to grow by `DECADES_OF_D` decades at the rate
of the spectrum. A stable packing is observed for `QUIET_TIME` units of time and then reported as stable, unless D
*rises* nevertheless. A run that is not over in the time of the scene is cut off, and its size is a lower bound. A layer
that has slid by the diameter of a disk *flows*.

**What ends the growth** is determined when D first reaches a tenth of its largest value. Each sample examines the
contacts: *opens* if an initial contact has opened by then; *slides* if none has opened, but a contact slides at its
Coulomb bound that did not slide initially; and *law* if neither has happened: the growth then ends by the curvature of
the contact law alone. A contact that opens and closes between two samples is missed.

**Energy.** The tangential force has no potential, and energy is not conserved. But the balance of work holds: the
kinetic energy changes by the work of all forces, load included. Each run ends with `WORK_STEPS` steps in which this
work is summed. Without drag, which is not a force in LAMMPS, the error of the balance is of the order of the time step
squared. The noise floor is the largest D of the first time unit, before any growth.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import numpy as np
from mpi4py import MPI
from pydantic import Field
from threadpoolctl import threadpool_limits

from ..analysis import NoEquilibriumError, Packing, mean_square_displacement, nearest_image, spectrum
from ..analysis.counted import counted
from ..analysis.responses.growth import NOISE_FACTOR, unstable_rates
from ..pywrap import Engine, Equilibrium, Scene, SceneError
from ..pywrap.runs.ramp_loads import ramp_loads
from ..pywrap.runs.undamped import time_step
from ..pywrap.scenes.command_sections import PATH, section_of
from ..pywrap.scenes.validation import FORCE, TIME, Positive, Section, require_section
from .packing_tools import contact_pairs, path_from, unit_of_time
from .result_rows import Row, Rows, row_columns
from .study import Figures, Result, Work, study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DECADES_OF_D = 24.0
"""Decades of D between its noise, 1e-27 in the first steps, and the square of a tenth of an overlap."""

QUIET_TIME = 50.0
"""Times for which a stable packing is watched, in `unit_of_time`."""

SAMPLES_OF_RUN = 400
"""Samples of disks and contacts in a run of the full time, and at least so many in a shorter one."""

LATE_GROWTH_OF_D = 1.5
"""Largest growth of D, from the second quarter to the second half, of a run that is over: D of disks that wander about
at random would double."""

END_OF_GROWTH = 0.1
"""Share of the largest D at which the growth counts as ended."""

WORK_STEPS = 2000
"""Steps over which work is added up: some thirty periods of the fastest mode."""

RISE_OF_D, WALK_FACTOR = 1e4, 10.0
"""D of a linearly stable packing has risen beyond so many times the D of the first time unit, since rounding alone
drifts by a few hundred times in `QUIET_TIME`; and beyond so many times the D of a random walk, one rounding of a
coordinate a time step: strong drag leaves D at 1e-30 in the first time unit, and the walk is at 3e-25 after fifty."""

AMOUNTS, COUNTS = ("time", "msd", "slip", "kinetic_energy"), ("lost", "gained", "sliding")
"""What is sampled, and what of it are numbers of contacts."""

ENDS = {
    "opens": ("a contact opens", "o"),
    "slides": ("a contact slides", "s"),
    "law": ("curvature of the law", "D"),
    "flows": ("the layer flows", "^"),
    "cut off": ("not over yet", "X"),
    "rises": ("D rises, though linearly stable", "v"),
    "stable": ("stable: no growth", "."),
}
"""How a run ends: in words, and the marker in the picture."""


class Eruptions(Section):
    """[eruptions] undamped runs from rest until they are over.

    Attributes
    ----------
    load : tuple of float
        F_x of the equilibria from which the runs start, force on each disk of the upper layer. Loads beyond the last
        equilibrium are left out.
    time : float
        Length of a run at the most, time.
    """

    load: Annotated[tuple[Positive, ...], FORCE, Field(min_length=1, strict=False, description="load, a list of F_x")]
    time: Annotated[Positive, TIME] = 3000.0


StartOfRun = tuple[Packing, float, float]
"""Where a run begins: the equilibrium, its largest force on a disk (contacts that carry less do not count), and the
length of the run at the most, time."""


def growth_rate(packing: Packing) -> float:
    """Growth rate of D, 1 / time, from K or, with dissipation, from K, C and M; 0 for a stable packing."""
    if not packing.damped:
        return spectrum(packing).growth_rate()
    return 2 * float(unstable_rates(packing).real.max(initial=0.0))


def erupt(start: StartOfRun) -> Row:
    """A run from rest until it is over, on this process alone.

    fx: load, force on each disk of the upper layer; damped: whether with dashpots or drag; rate: growth rate of D from
    the spectrum, 1 / time, 0 of a stable packing; time: when the run was over; msd, kinetic_energy: the largest D,
    length^2, and the largest kinetic energy; slip: largest displacement of the upper layer along x, length; lost,
    gained, sliding: most contacts, in any sample, that were open, new, or slid; ended: when D first reached a tenth of
    its largest value, time, None if it did not grow; ends: what ended the growth, one of `ENDS`; noise: largest D of
    the first time unit; balance: kinetic energy less work, in units of the larger of the two and of the kinetic energy;
    series: the samples as columns.
    """
    packing, residual, longest = start
    carrying, contacts, box = packing.loaded(residual), contact_pairs(packing), packing.box_length
    initial, slid = contact_pairs(carrying), contact_pairs(carrying, carrying.sliding)
    with threadpool_limits(1):
        rate, dt, unit = growth_rate(packing), time_step(packing), unit_of_time(packing)
        last = int(longest / dt)
        # close together at first and farther apart later, no two at one step
        spaced = (space(min(100, last), last, SAMPLES_OF_RUN) for space in (np.geomspace, np.linspace))
        samples: list[tuple[float, ...]] = []
        moved, position, done = np.zeros_like(packing.position), packing.position, 0
        over = flows = False
        with Engine(packing, MPI.COMM_SELF) as engine, engine.undamped(dt) as dynamics:
            for at in np.union1d(*(steps.astype(np.int64) for steps in spaced)).tolist():
                motion, done = dynamics.advance(at - done), at
                step = motion.position - position
                step[:, 0] = nearest_image(step[:, 0], box)
                moved, position, now = moved + step, motion.position, engine.packing
                # from step to step, disks move less than half a box; for small D, the difference has more digits
                msd = np.mean(np.sum(moved**2, axis=1))
                if abs(moved).max() < 0.25 * (box or np.inf):
                    low = motion.position_low, packing.position_low
                    msd = mean_square_displacement(motion.position, packing.position, box, *low)
                there, sliding = contact_pairs(now), contact_pairs(now, now.sliding) - slid
                slip = float(moved[packing.top, 0].mean())
                counts = len(initial - there), len(there - contacts), len(sliding & initial)
                samples.append((at * dt, float(msd), slip, motion.kinetic_energy(packing), *counts))
                time, msds, *_ = np.transpose(samples)
                flows, over = abs(slip) > 2 * packing.radius.max(), time[-1] >= QUIET_TIME * unit
                if rate > 0:
                    quarter = msds[(time[-1] / 4 < time) & (time <= time[-1] / 2)].max(initial=0.0)
                    over = msds[time > time[-1] / 2].max() <= LATE_GROWTH_OF_D * quarter
                    over &= time[-1] >= DECADES_OF_D * np.log(10) / rate
                if over or flows:
                    break
            before = dynamics.advance(0).kinetic_energy(packing)
            ended_motion, work = dynamics.work(WORK_STEPS)
            after = ended_motion.kinetic_energy(packing)
    columns = dict(zip((*AMOUNTS, *COUNTS), np.transpose(samples), strict=True))
    series = {name: column.astype(int if name in COUNTS else float).tolist() for name, column in columns.items()}
    noise, ended = float(msds[time <= unit].max(initial=float(msds[0]))), None
    walk = WALK_FACTOR * packing.coordinate_rounding**2 * time[-1] / dt
    ends = "stable" if msds.max() <= max(RISE_OF_D * noise, walk) else "rises"
    if rate > 0:
        place = int(np.argmax(msds >= END_OF_GROWTH * msds.max()))
        opened, slides = (columns[name][: place + 1].any() for name in ("lost", "sliding"))
        ended = float(time[place])
        ends = "cut off" if not over else "opens" if opened else "slides" if slides else "law"
    return {
        **{"fx": packing.fx, "damped": packing.damped, "rate": rate, "time": float(time[-1])},
        **{name: float(np.abs(columns[name]).max()) for name in ("msd", "kinetic_energy", "slip")},
        **{name: int(columns[name].max()) for name in COUNTS},
        **{"ended": ended, "ends": "flows" if flows else ends, "noise": noise},
        **{"balance": float(abs(after - before - work) / max(abs(work), after, before)), "series": series},
    }


def _section(scene: Scene) -> Eruptions:
    """The section of a scene whose ramp reaches its loads."""
    until, settings = require_section(scene.ramp, "ramp").first, section_of(scene, Eruptions)
    if settings is None:
        raise SceneError("the scene has no section [eruptions]: add it, with load, a list of F_x")
    if (last := max(settings.load)) > until:
        raise SceneError(f"eruptions.load goes to {last:g}, and ramp.until = {until:g}: ramp further")
    return settings


def _starts(scene: Scene, rest: Equilibrium, wanted: list[float], time: float) -> tuple[list[StartOfRun], float | None]:
    """The equilibria at the loads that the packing bears, and the last load that it bears if there are more."""
    steps, starts = ramp_loads(scene), list[StartOfRun]()
    with path_from(rest, scene) as path:
        for fx in wanted:
            try:
                for load in steps[(steps > path.equilibria[-1].fx) & (steps < fx)]:
                    path(float(load))
                packing, residual = path(fx), path.equilibria[-1].residual
            except NoEquilibriumError:
                return starts, path.equilibria[-1].fx
            free = replace(packing, law=replace(packing.law, cn=0.0, ct=0.0), drag_time=None)
            starts += [(each, residual, time) for each in (free, packing)[: 1 + (scene.damping is not None)]]
    return starts, None


def _runs(rows: Rows, settings: Eruptions) -> list[Row]:
    """Runs of the length and at the loads of the scene."""
    runs = [row for row in rows.rows if row["fx"] in settings.load and row["longest"] == settings.time]
    return sorted(runs, key=lambda row: (row["fx"], row["damped"]))


def _size_figure(runs: list[Row]) -> Figure:
    """Above the largest D and the largest displacement of the layer squared over F_x, with markers for what ended the
    growth, open ones of damped runs; below the most contacts that are open, slide, or are new."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    from ..figures.series import few_decades
    from ..figures.style import INK

    figure = Figure(figsize=(3.4, 4.2), layout="constrained")
    sizes, contacts = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for ends, damped in dict.fromkeys((run["ends"], run["damped"]) for run in runs):
        (words, marker), face = ENDS[ends], "white" if damped else "C0"
        places = row_columns([run for run in runs if (run["ends"], run["damped"]) == (ends, damped)], "fx", "msd")
        label = f"{words} (damped)" if damped else words
        sizes.plot(*places, marker, color="C0", markersize=4, markerfacecolor=face, label=label)
    free = [row for row in runs if not row["damped"]]
    fx, slip, noise = row_columns(free, "fx", "slip", "noise")
    sizes.plot(fx, slip**2, "_", color="C1", label="(slip of the layer)$^2$")
    sizes.plot(fx, noise, ":", color=INK, linewidth=0.7, label="noise of doubles")
    sizes.set(yscale="log", ylabel="largest $D$")
    few_decades(sizes, 8)
    sizes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    for key, colour, name in (("lost", "C0", "open"), ("sliding", "C2", "slide"), ("gained", "C3", "new")):
        contacts.plot(*row_columns(free, "fx", key), ".-", color=colour, linewidth=0.6, label=name)
    contacts.set(xlabel="$F_x$", ylabel="contacts", xscale="log", ylim=(-0.5, max(5, 1.1 * contacts.dataLim.y1)))
    contacts.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    contacts.legend()
    return figure


def _course_figure(runs: list[Row]) -> Figure:
    """D(t) of the undamped runs, coloured by their load."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    from ..figures.series import few_decades, positive

    figure = Figure(figsize=(4.4, 2.7), layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", xlabel="$t$", ylabel="$D(t)$")
    for run, colour in zip(runs, colormaps["viridis"](np.linspace(0, 0.9, len(runs))), strict=True):
        shown = positive(run["series"]["time"], run["series"]["msd"])
        axes.plot(*shown, color=colour, linewidth=0.7, label=f"{run['fx']:g}")
    few_decades(axes, 8)
    axes.legend(title="$F_x$", ncols=1 + len(runs) // 12, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _figures(result: Result, rows: Rows) -> Figures:
    runs = [row for row in _runs(rows, Eruptions.model_validate(result["scene"]["eruptions"])) if not row["damped"]]
    return {"sizes": lambda: _size_figure(result["runs"]), "courses": lambda: _course_figure(runs)}


def _page(result: Result) -> Result:
    runs, damping = result["runs"], result["scene"].get("damping") or {}
    free, beside = [run for run in runs if not run["damped"]], {run["fx"]: run for run in runs if run["damped"]}
    unstable = [run for run in runs if run["ends"] != "stable"]
    noisy = [run for run in unstable if run["msd"] <= NOISE_FACTOR * run["noise"]]
    grown = [run["msd"] for run in free if run in unstable and run not in noisy]
    return {
        "runs": runs,
        "words": {ends: words for ends, (words, _) in ENDS.items()},
        "beside": [(run, beside[run["fx"]]) for run in free if run["fx"] in beside],
        "damping": ", ".join(f"{key} = {value:g}" for key, value in damping.items() if value),
        "decades": float(np.log10(max(grown) / min(grown))) if grown else 0.0,
        "small": len(noisy),
        "criterion": (LATE_GROWTH_OF_D, DECADES_OF_D, QUIET_TIME),
    }


@study(
    reads=PATH,
    needs=("ramp", "eruptions"),
    section=Eruptions,
    check=_section,
    figures=_figures,
    page=_page,
    beside="eruptions",
    row=True,
    counts="runs",
    kept="the runs that were over",
    example="faultgouge examples eruptions && mpiexec -n 3 faultgouge eruptions eruptions.toml -o eruptions",
)
def eruptions(scene: Scene, work: Work) -> Result:
    """Measure the size of eruptions: undamped runs from rest at each load of [eruptions], and how the growth ends.

    With several ranks, one rank distributes the loads.
    """
    settings, rows, flows_beyond = _section(scene), work.rows, None
    kinds = (False,) if scene.damping is None else (False, True)

    def known(fx: float, damped: bool) -> bool:
        return rows.find(fx=fx, longest=settings.time, damped=damped) is not None

    missing = [fx for fx in settings.load if not all(known(fx, damped) for damped in kinds)]
    if missing:
        # through the known loads as well, so that the path, and with it the last digits, is that of one run
        loads = sorted(fx for fx in settings.load if fx <= max(missing))
        starts, flows_beyond = _starts(scene, work.start(scene.law.mus[0]), loads, settings.time)
        if flows_beyond is not None:
            work.say(f"no equilibrium beyond F_x = {flows_beyond:g}: the loads above are left out")
        starts = [each for each in starts if not known(each[0].fx, each[0].damped)]
        for found in work.progress(work.map_rows(erupt, starts), len(starts)):
            rows.append(longest=settings.time, **found)
            size = f"D up to {found['msd']:.2g}, the layer slips by {found['slip']:.2g}"
            ends = f"{counted(found['lost'], 'contact')} open; {found['ends']} after t = {found['time']:.4g}"
            work.say(f"F_x = {found['fx']:g}: {size}, {ends}")
    runs, left_out = _runs(rows, settings), ("scene", "version", "series", "longest")
    if not runs:
        raise NoEquilibriumError(f"the packing bears none of the loads: it flows beyond F_x = {flows_beyond:g}")
    return {"runs": [{key: value for key, value in row.items() if key not in left_out} for row in runs]}
