"""The commands draw, movie and view: pictures of packings, modes and runs."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from typer import Argument, Option

from ..analysis.counted import counted
from .runs import growth_in
from .terminal import (
    OF_PACKING,
    RAMPED,
    Frame,
    PackingFile,
    Results,
    Time,
    command,
    locked,
    print_line,
    progress,
    refuse_scene,
    say,
    stored_packing,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from faultgouge.figures.film import Film
    from faultgouge.figures.mode import ModeShape

    from ..analysis.has_configuration import HasConfiguration


OF_MODE = "The unstable pair, or the two modes closest to merging; or mode N, by eigenvalue from 0."
WhichMode = Annotated[str | None, Option("--mode", metavar="pair|N", help=OF_MODE)]
WhichColour = Annotated[Literal["mobilised", "slip", "force", "none"], Option(help="|f_t|/(mu f_n), slip/limit, f_n.")]


def modes_of(packing: HasConfiguration, which: str) -> tuple[list[ModeShape], str]:
    """The modes that --mode asks for, and what they are."""
    from faultgouge.figures.mode import modes_of as find_modes

    if which != "pair" and not which.isdecimal():
        raise typer.BadParameter(f"--mode {which}: give pair, or the number of a mode, from 0")
    return find_modes(packing, None if which == "pair" else int(which))


@command(f"{RAMPED} && faultgouge draw run.h5 --mode pair", writes="file", alone=True)
def draw(
    file: PackingFile,
    frame: Annotated[int | None, Option(help="Number of the equilibrium; negative: from the last.")] = None,
    time: Time = None,
    mode: WhichMode = None,
    color: WhichColour = "mobilised",
    output: Annotated[Path, Option("-o", "--output", help="The picture: .png, .svg or .pdf.")] = Path("picture.png"),
) -> Results:
    """Draw a stored packing with its force chains or a mode, a cycle of loads, D(t) of perturb.h5, F(t) of drive.h5.

    Disks are to scale: the upper layer is yellow, rattlers are hollow. Bars are
    contacts, with a width proportional to the normal force. For a mode, arrows are
    displacements and colours rotations; the participation ratio and the share of
    rotation stand above. A ramp with turning points is drawn as F_x over the
    displacement of the upper layer, perturb.h5 as D(t) with the predicted slope, and
    drive.h5 as the force over time with its slips. With --frame, --time or --mode, the
    packing of these files is drawn instead.
    """
    from faultgouge.analysis.files.configuration_file import holds_configuration
    from faultgouge.figures import draw_packing
    from faultgouge.figures.mode import draw_modes
    from faultgouge.figures.packing import in_words
    from faultgouge.figures.style import save_as

    if output.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise typer.BadParameter(f"-o {output}: a picture is a .png, a .svg or a .pdf")
    packing = stored_packing(file, -1 if frame is None else frame, time)
    of_run = mode is frame is time is None and file.suffix != ".disks" and not holds_configuration(file)
    figure = _picture_of_run(file) if of_run else None
    if mode is not None:
        modes, what = modes_of(packing, mode)
        load = f"F_x = {packing.fx:g}: " if packing.top.any() else ""
        yield "\n".join([f"{load}{what}", *(each.plain for each in modes)])
        figure = draw_modes(packing, modes, what)
    elif figure is None:
        yield in_words(packing)
        figure = draw_packing(packing, color=color, caption=True)
    save_as(figure, output)
    yield f"written to {output}"


def _picture_of_run(file: Path) -> Figure | None:
    """The force of a drive, the cycle of a ramp with turning points, or D(t); None of another file."""
    from faultgouge.analysis import RunFile
    from faultgouge.analysis.responses.hysteresis import turning_points
    from faultgouge.figures import draw_cycle
    from faultgouge.figures.series import draw_drive, draw_growth
    from faultgouge.pywrap.runs.drive import SERIES, slips_in

    with RunFile(file) as run:
        if SERIES in run.names_of_series:
            return draw_drive(run.series(SERIES), slips_in(run)[0])
        if turning_points(run.fx):
            return draw_cycle([run.packing(k) for k in range(len(run))])
        if not (growth := growth_in(run)):
            return None
        print_line(growth.says)
        series = run.series("undamped")
        return draw_growth(series["time"], series["msd"], growth.predicted, growth.measured)


@command(f"{RAMPED} && faultgouge movie run.h5 -o ramp.gif", alone=True)
def movie(
    file: PackingFile,
    mode: WhichMode = None,
    frame: Frame = -1,
    color: WhichColour = "mobilised",
    seconds: Annotated[float, Option(min=0.1, max=600, help="Length of the film.")] = 10.0,
    rate: Annotated[float, Option(min=1, max=60, help="Frames per second.")] = 10.0,
    span: Annotated[tuple[float, float] | None, Option(metavar="T0 T1", help="Times of the run to show.")] = None,
    dots: Annotated[int | None, Option(min=30, max=800, help="Dots per inch; 110 for .gif.")] = None,
    output: Annotated[Path | None, Option("-o", "--output", help="film.mp4 or film.gif by default.")] = None,
) -> Results:
    """Make a film of an undamped run, of a mode, or of a ramp.

    From perturb.h5: the run and D(t), of up to 1000 disks, or with trajectory = true
    under [output]. Displacements are magnified by a power of ten, which is printed on the film
    and falls in steps. With --mode: the motion of a mode without its growth. From
    run.h5: the ramp, and F_x over the displacement of the upper layer. From drive.h5:
    its states, to scale, and the force over time. An .mp4 needs
    pip install 'faultgouge[movie]'. Modes of spheres move on the page of `faultgouge view`.
    """
    from faultgouge.analysis import BadInputError
    from faultgouge.figures.film import DOTS, check_name, usual_suffix, write_film
    from faultgouge.figures.motion_films import film_of_modes

    output = output or Path("film").with_suffix(usual_suffix())
    dots = DOTS if dots is None and output.suffix.lower() == ".gif" else dots
    count, packing = max(2, round(seconds * rate)), None if mode is None else stored_packing(file, frame)
    if packing is not None and packing.dimension == 3:
        vectors = "`faultgouge export --mode` has the vectors for ParaView (.vtp) and OVITO (.xyz)"
        shows = f"`faultgouge view` shows their modes in motion, and {vectors}"
        raise BadInputError(f"{file} has spheres, and a film shows disks: {shows}.")
    check_name(output)
    with locked(output, file):
        if packing is None:
            film = _film_of_file(file, count, color, span, dots)
        else:
            modes, periods = modes_of(packing, str(mode)), max(1, round(seconds / 2))
            film = film_of_modes(packing, *modes, count, periods=periods, dots=dots)
        write_film(film, output, rate, lambda frames, total: progress(frames, "frames", total))
    yield "{} of {} x {} dots; written to {}".format(counted(count, "frame"), *film.size, output)


def _film_of_file(file: Path, count: int, color: str, span: tuple[float, float] | None, dots: int | None) -> Film:
    """The run if the file has its trajectory, else its drive or its ramp."""
    from faultgouge.analysis import PackingFileError, RunFile
    from faultgouge.figures.motion_films import Course, RunMotion, film_of_ramp, film_of_run
    from faultgouge.pywrap.runs.drive import SERIES, slips_in

    with RunFile(file) as run:
        if motion := RunMotion.read(run):
            return film_of_run(motion if span is None else motion.between(*span), count, dots=dots)
        driven, shown, course = SERIES in run.names_of_series, [*range(len(run))], None
        if driven:
            first, last = span or (-inf, inf)
            times = run.observable("time")
            shown = [k for k in shown if first <= times[k] <= last]
            if len(shown) < 2:
                says = f"{file} has {len(shown)} of its {len(times)} states between t = {first:g} and {last:g}"
                raise PackingFileError(f"{says}, and a film shows two or more: give a longer --span")
            course = Course.of_drive(run.series(SERIES), slips_in(run)[0], times[shown].tolist(), first, last)
        packings = [run.packing(k) for k in shown]
    if len(packings) < 2:
        raise PackingFileError(f"{file} has one equilibrium and no trajectory: ask for a mode with --mode")
    return film_of_ramp(packings, count, color, dots=dots, course=course, by_way=driven)


@command(f"{RAMPED} && faultgouge view run.h5 -o page.html", writes="file", alone=True)
def view(
    file: Annotated[Path, Argument(metavar="FILE", help=OF_PACKING, callback=refuse_scene)],
    loads: Annotated[int | None, Option(min=1, help="Number of equilibria; by default 60 or fewer.")] = None,
    output: Annotated[Path, Option("-o", "--output", help="The page: .html.")] = Path("page.html"),
) -> Results:
    """Make one page that any browser opens offline: is a packing stable, from load to load?

    The page says at each load whether the packing is stable, and shows how many pairs
    are complex and how fast D grows. A click chooses a pair, whose modes move. It shows
    D(t) if the file contains it. Spheres of a LAMMPS deck can be turned.
    """
    from faultgouge.door import view as write_page

    page = write_page(file, output, loads, say, lambda packings: progress(packings, "loads"))
    yield f"{counted(page.packings, 'packing')}, {output.stat().st_size / 1e6:.1f} MB; written to {output}"
