"""The commands draw, movie and view: pictures of packings, modes and runs."""

from __future__ import annotations

from enum import Enum
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..analysis.counted import counted
from ..mpi_rank import is_root
from .terminal import (
    Frame,
    PackingFile,
    Time,
    frame_at,
    growth_in,
    lock_output,
    print_line,
    progress,
    refuse_scene,
    say,
    stored_drive,
    stored_packing,
    stored_series,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from faultgouge.analysis import Configuration, Packing
    from faultgouge.figures.film import Film
    from faultgouge.figures.mode import ModeShape

    from ..analysis.has_configuration import HasConfiguration

app = typer.Typer()


class Colour(str, Enum):
    """Quantity that the colour of a contact shows."""

    MOBILISED = "mobilised"
    SLIP = "slip"
    FORCE = "force"
    NONE = "none"


WhichMode = Annotated[
    str | None,
    typer.Option(
        "--mode",
        metavar="pair|N",
        help="The unstable pair, or before the onset the two modes closest to merging; or mode N, counted by "
        "eigenvalue from 0.",
    ),
]
WhichColour = Annotated[
    Colour, typer.Option(help="Colour of the contacts: |f_t|/(mu f_n), slip over its limit, f_n, or none.")
]


@app.command(epilog="Example: faultgouge draw run.h5 --mode pair -o mode.svg")
def draw(
    context: typer.Context,
    file: PackingFile,
    frame: Annotated[
        int | None,
        typer.Option(
            help="Number of the equilibrium, by default the last; negative numbers count from the end.",
            show_default=False,
        ),
    ] = None,
    time: Time = None,
    mode: WhichMode = None,
    color: WhichColour = Colour.MOBILISED,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="The picture: .png, .svg or .pdf.", show_default=True)
    ] = Path("picture.png"),
) -> None:
    """Draw a stored packing with its force chains or a mode, a cycle of loads, D(t) of perturb.h5, F(t) of drive.h5.

    Disks are to scale: the upper layer is yellow, rattlers are hollow. Bars are
    contacts, with a width proportional to the normal force. For a mode, arrows are
    displacements and colours rotations; the participation ratio and the share of
    rotation stand above. A ramp with turning points is drawn as F_x over the
    displacement of the upper layer, perturb.h5 as D(t) with the predicted slope, and
    drive.h5 as the force over time with its slips. With --frame, --time or --mode, the
    packing of these files is drawn instead.
    """
    if output.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise typer.BadParameter(f"-o {output}: a picture is a .png, a .svg or a .pdf")
    from faultgouge.analysis import Packing

    lock_output(context, output, file)
    number, series, cycle, driven = frame_at(file, -1 if frame is None else frame, time), None, [], None
    packing = stored_packing(file, number)
    if isinstance(packing, Packing) and frame is None and time is None and mode is None:
        driven = stored_drive(file)
        series, cycle = stored_series(file), [] if driven else _cycle(file)
    if not is_root():
        return
    from faultgouge.figures import draw_cycle, draw_packing
    from faultgouge.figures.mode import draw_modes
    from faultgouge.figures.packing import in_words
    from faultgouge.figures.series import draw_drive, draw_growth
    from faultgouge.figures.style import save_as

    if driven is not None:
        figure = draw_drive(*driven)
    elif cycle:
        figure = draw_cycle(cycle)
    elif series is not None:
        growth = growth_in(file, series)
        print_line(growth.says)
        figure = draw_growth(series["time"], series["msd"], growth.predicted, growth.measured)
    elif mode is None:
        print_line(in_words(packing))
        figure = draw_packing(packing, color=color.value, caption=True)
    else:
        modes, what = modes_of(packing, mode)
        load = f"F_x = {packing.fx:g}: " if packing.top.any() else ""
        print_line("\n".join([f"{load}{what}", *(each.plain for each in modes)]))
        figure = draw_modes(packing, modes, what)
    save_as(figure, output)
    print_line(f"written to {output}")


@app.command(epilog="Example: faultgouge movie perturb.h5 -o eruption.gif")
def movie(
    context: typer.Context,
    file: PackingFile,
    mode: WhichMode = None,
    frame: Frame = -1,
    color: WhichColour = Colour.MOBILISED,
    seconds: Annotated[float, typer.Option(min=0.1, max=600, help="Length of the film.")] = 10.0,
    rate: Annotated[float, typer.Option(min=1, max=60, help="Frames per second.")] = 10.0,
    span: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="T0 T1", help="First and last time of the run to show; all by default."),
    ] = None,
    dots: Annotated[
        int | None,
        typer.Option(min=30, max=800, help="Dots per inch: 110 for .gif, 1080 lines for .mp4.", show_default=False),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="The film: .mp4 or .gif; of spheres .xyz or .pvd. By default film.mp4, or film.gif without "
            "imageio-ffmpeg.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Make a film of an undamped run, of a mode, or of a ramp.

    From perturb.h5: the run and D(t), of up to 1000 disks, or with trajectory = true
    under [output]. Displacements are magnified by a power of ten, which is printed on the film
    and falls in steps. With --mode: the motion of a mode without its growth. From
    run.h5: the ramp, and F_x over the displacement of the upper layer. From drive.h5:
    its states, to scale, and the force over time. An .mp4 needs
    pip install 'faultgouge[movie]'. A mode of spheres is written as frames for OVITO
    (.xyz) or ParaView (.pvd).
    """
    from faultgouge.analysis import Configuration
    from faultgouge.figures.film import DOTS, check_name, usual_suffix, write_film

    output = output or Path("film").with_suffix(usual_suffix())
    if dots is None and output.suffix.lower() == ".gif":
        dots = DOTS
    packing = None if mode is None else stored_packing(file, frame)
    count = max(2, round(seconds * rate))
    periods = max(1, round(seconds / 2))
    if isinstance(packing, Configuration) and packing.dimension == 3:
        _frames_of_spheres(context, packing, str(mode), output, count, periods)
        return
    check_name(output)
    lock_output(context, output, file)
    if not is_root():
        return
    from faultgouge.figures.film import film_of_modes

    film: Film
    if mode is not None and packing is not None:
        modes, what = modes_of(packing, mode)
        film = film_of_modes(packing, modes, what, count, periods=periods, dots=dots)
    else:
        film = _film_of_file(file, count, color.value, span, dots)
    write_film(film, output, rate, lambda frames, total: progress(frames, "frames", total))
    width, height = film.size
    print_line(f"{counted(count, 'frame')} of {width} x {height} dots; written to {output}")


@app.command(epilog="Example: faultgouge view run.h5 -o page.html")
def view(
    context: typer.Context,
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="run.h5, perturb.h5, or NAME.disks from the dumps of a deck.",
            show_default=False,
            callback=refuse_scene,
        ),
    ],
    loads: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Number of equilibria on the page, equally spaced; 60 by default, and fewer for more than 380 disks.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="The page: .html.")] = Path("page.html"),
) -> None:
    """Make one page that any browser opens offline: is a packing stable, from load to load?

    The page says at each load whether the packing is stable, and shows how many pairs
    are complex and how fast D grows. A click chooses a pair, whose modes move. It shows
    D(t) if the file contains it. Spheres of a LAMMPS deck can be turned.
    """
    if output.suffix.lower() != ".html":
        raise typer.BadParameter(f"-o {output}: a page is an .html")
    from faultgouge.browser_view import view as write_page
    from faultgouge.stored_files import load

    load(file)
    lock_output(context, output, file)
    if not is_root():
        return
    count = 0

    def shown(packings: Sequence[HasConfiguration]) -> Iterable[HasConfiguration]:
        nonlocal count
        count = len(packings)
        return progress(packings, "loads")

    write_page(file, output, loads, say, shown)
    print_line(f"{counted(count, 'packing')}, {output.stat().st_size / 1e6:.1f} MB; written to {output}")


def _frames_of_spheres(
    context: typer.Context, configuration: Configuration, which: str, output: Path, count: int, periods: int
) -> None:
    """The motion of a mode of spheres, for programs that show spheres."""
    from faultgouge.analysis import BadInputError
    from faultgouge.analysis.files.formats import ModeVectors, write_mode_frames

    if output.suffix not in (".xyz", ".pvd"):
        raise BadInputError(
            f"-o {output}: a mode of spheres moves in OVITO (.xyz) or ParaView (.pvd); give one of these."
        )
    lock_output(context, output)
    if is_root():
        (mode, *others), _ = modes_of(configuration, which)
        if others:
            raise BadInputError("--mode pair: the packing has no complex pair; give the number of a mode, from 0")
        vectors = ModeVectors(f"mode_{mode.number}", mode.eigenvalue, mode.displacement)
        write_mode_frames(output, configuration, vectors, count, periods)
        print_line(f"{counted(count, 'frame')} of {mode.plain}; written to {output}")


def _cycle(file: Path) -> list[Packing]:
    """The equilibria of a ramp with turning points; none of another file."""
    from faultgouge.analysis import RunFile
    from faultgouge.analysis.motion.hysteresis import turning_points

    if file.suffix == ".disks":
        return []
    with RunFile(file) as run:
        return [run.packing(k) for k in range(len(run))] if turning_points(run.fx) else []


def _film_of_file(file: Path, count: int, color: str, span: tuple[float, float] | None, dots: int | None) -> Film:
    """The run if the file has its trajectory, else its drive or its ramp."""
    from faultgouge.analysis import PackingFileError, RunFile
    from faultgouge.analysis.files.configuration_file import holds_configuration
    from faultgouge.figures.film import Course, RunMotion, film_of_ramp, film_of_run

    if file.suffix == ".disks" or holds_configuration(file):
        raise PackingFileError(f"{file} is one packing, and nothing moves in it: ask for a mode with --mode")
    driven, course, times = stored_drive(file), None, list[float]()
    with RunFile(file) as run:
        motion = RunMotion.read(run)
        packings = [] if motion is not None else [run.packing(k) for k in range(len(run))]
        times = run.observable("time").tolist() if driven else times
    if driven:
        first, last = span or (-inf, inf)
        shown = [k for k, time in enumerate(times) if first <= time <= last]
        packings = [packings[k] for k in shown]
        if len(shown) < 2:
            raise PackingFileError(
                f"{file} has {len(shown)} of its {len(times)} states between t = {first:g} and {last:g}, and a film "
                "shows two or more: give a longer --span"
            )
        course = Course.of_drive(*driven, [times[k] for k in shown], first, last)
    if motion is not None:
        return film_of_run(motion if span is None else motion.between(*span), count, dots=dots)
    if len(packings) < 2:
        raise PackingFileError(
            f"{file} has one equilibrium and no trajectory: ask for a mode with --mode, or run `faultgouge perturb` "
            "with trajectory = true under [output]"
        )
    return film_of_ramp(packings, count, color, dots=dots, course=course, by_way=driven is not None)


def modes_of(packing: HasConfiguration, which: str) -> tuple[list[ModeShape], str]:
    """The modes that --mode asks for, and what they are."""
    from faultgouge.figures.mode import modes_of as find_modes

    if which != "pair" and not which.isdecimal():
        raise typer.BadParameter(f"--mode {which}: give pair, or the number of a mode, from 0")
    return find_modes(packing, None if which == "pair" else int(which))
