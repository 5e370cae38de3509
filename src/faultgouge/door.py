"""What `import faultgouge` offers beside its rooms: packings of files of any kind, pictures and pages of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Concatenate, Literal, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from .analysis import BadInputError, Configuration, MindlinLaw, Packing, RunFile, Stability, read_dump
from .analysis import elastic_moduli as moduli_of_packing
from .analysis import spectrum as spectrum_of_packing
from .analysis import stability as stability_of_packing
from .analysis import stress as stress_of_packing
from .analysis import vibrations as vibrations_of_packing
from .analysis.files.atomic_write import telling
from .analysis.files.configuration_file import holds_configuration, read_configuration
from .analysis.files.formats import Disks, is_hdf5, packing_of, upper_layer
from .analysis.files.formats.disks import LAYER_WAYS
from .analysis.files.formats.lammps_dump import dump_frames
from .analysis.files.runfile import law_of_parameters
from .analysis.has_configuration import HasConfiguration

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .figures import PairCurve
    from .pywrap import Scene


def load(
    file: str | Path,
    frame: int = -1,
    *,
    law: MindlinLaw | None = None,
    fy: float | None = None,
    fx: float | None = None,
    top: str | int | None = None,
    width: float | None = None,
) -> Packing | Configuration:
    """Read a packing of any file.

    Parameters
    ----------
    file : str or Path
        A run.h5 or a drive.h5; the dumps that decks write (NAME.disks); a LAMMPS deck (NAME.in, in.NAME), which is
        run; or disks of another code (docs/howto_own_packing.md), as they stand, for which law and load are given.
    frame : int
        Number of the equilibrium, or of the dump; negative numbers count from the last.
    law, fy, fx : MindlinLaw, float, float, optional
        Of disks of another code the contact law and the load on each disk of the upper layer; by default those of the
        file, where `faultgouge export` wrote it, and fx = 0.
    top, width : str or int, float, optional
        Where the file does not say them, their upper layer (the number of its disks, 0 for none, or as `faultgouge
        import --top` has it), and their period along x; open sides by default.

    Returns
    -------
    Packing or Configuration
        A Configuration of what LAMMPS moved by its own laws.

    Raises
    ------
    BadInputError, PackingFileError
        If the file does not say law, load or upper layer; if it is missing, damaged, or of no known format.

    Examples
    --------
    >>> from faultgouge.analysis import MindlinLaw
    >>> faultgouge.load("disks.csv", law=MindlinLaw(kn=2e5, kt=6e4, mu=0.5), fy=1.0, top=6, width=6.0)
    <Packing: 18 disks, 22 contacts, 6 in the upper layer, period 6, mu = 0.5, fx = 0, fy = 1>
    """
    path = path_of(file, "load")
    if path.suffix == ".disks":
        return read_dump(path, frame=frame)
    if is_deck(path):
        from .pywrap.granular.run_deck import run_deck

        return run_deck(path)
    if holds_configuration(path):
        if frame not in (-1, 0):
            raise BadInputError(f"{path} has one packing, and no frame {frame}: leave the frame out.")
        return read_configuration(path)
    if path.suffix == ".h5" or (path.is_file() and is_hdf5(path)):
        with RunFile(path) as run:
            return packing_in(run, frame)
    from .pywrap.lammps.restart_file import read_disks

    disks = read_disks(path, None if frame == -1 else frame)
    given = {key: value for key, value in (("fy", fy), ("fx", fx)) if value is not None}
    if top is None and disks.top is not None and not disks.top.any():
        top = 0
    return packing_under(disks if width is None else replace(disks, box_length=width), law, given, top)


def packing_under(disks: Disks, law: MindlinLaw | None, load: Mapping[str, Any], top: str | int | None) -> Packing:
    """Disks with a law, a load (fx, fy, inertia_factor, drag_time, kn, mu) and an upper layer, or those of the file."""
    given = {"drag_time": disks.given.get("tau"), **disks.given, **load}
    ways = {} if top is not None or disks.top is not None else {"--top 10": "which disks are the upper layer"}
    if law is None and "kn" not in given:
        ways["--kn 2e5"] = "the normal stiffness"
    if "fy" not in given:
        ways["--fy 3"] = "the load on each disk of the layer"
    if ways:
        names, example = " ".join(each.split()[0] for each in ways), f"`faultgouge import ... {' '.join(ways)}`"
        python = f"load({Path(disks.source).name!r}, law=MindlinLaw(kn, kt, mu), fy=3.0, top=10)"
        says = f"{disks.source} does not say {' and '.join(ways.values())}: add {names}, as in {example}"
        raise BadInputError(f"{says}; --top takes {LAYER_WAYS}; in Python {python} takes the disks as they stand.")
    with telling(disks.source, "describes no possible packing", ValueError):
        law = law or law_of_parameters({"kt": 2 * given["kn"] / 7, "mu": 1.0} | given)
    layer = np.zeros(len(disks), dtype=np.bool_) if top == 0 else upper_layer(disks, top)
    values = {key: given[key] for key in ("fx", "fy", "inertia_factor", "drag_time") if key in given}
    return packing_of(disks, law, layer, **values)


def is_deck(file: Path) -> bool:
    """Whether a file has the name of a LAMMPS deck."""
    return file.suffix == ".in" or file.name.startswith("in.")


class frames(Sequence["Packing | Configuration"]):  # noqa: N801  # a function to its users, as `range` is
    """The packings of a file, each read when it is asked for.

    Parameters
    ----------
    file : str or Path
        As for `load`.

    Examples
    --------
    >>> found = faultgouge.frames("run.h5")
    >>> len(found), round(found[-1].fx, 3)
    (17, 2.4)
    >>> [round(packing.fx, 3) for packing in found[:3]]
    [0.0, 0.15, 0.3]
    """

    def __init__(self, file: str | Path) -> None:
        self.path, self._count = path_of(file, "frames"), 1
        if self.path.suffix == ".disks":
            self._count = sum(1 for _ in dump_frames(self.path))
        elif self.path.suffix == ".h5" and not holds_configuration(self.path):
            with RunFile(self.path) as run:
                self._count = len(run)

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, number: Any) -> Any:
        chosen = range(self._count)[number]
        return [load(self.path, each) for each in chosen] if isinstance(number, slice) else load(self.path, chosen)


def path_of(file: object, caller: str) -> Path:
    """The path that a function is given; a BadInputError if it is none."""
    if isinstance(file, (str, Path)):
        return Path(file)
    raise BadInputError(f"{caller} takes the path of a file, and no {type(file).__name__}.")


Options = ParamSpec("Options")
Result = TypeVar("Result")


def takes_file(
    function: Callable[Concatenate[HasConfiguration, Options], Result],
) -> Callable[Concatenate[HasConfiguration | str | Path, Options], Result]:
    """A function of a packing that also takes the path of a stored one, of which it takes the last."""
    name = function.__name__.removesuffix("_packing")

    @wraps(function)
    def opens(packing: Any, *args: Options.args, **options: Options.kwargs) -> Result:
        if isinstance(packing, (str, Path)):
            packing = load(packing)
        elif not hasattr(packing, "configuration"):
            advice = ": give its .packing" if hasattr(packing, "packing") else ""
            takes = f"{name} takes a Packing, a Configuration, or the path of a stored one"
            raise BadInputError(f"{takes}, and no {type(packing).__name__}{advice}.")
        return function(packing, *args, **options)

    return opens


@takes_file
def stability(
    packing: HasConfiguration,
    rise: str | ArrayLike | None = None,
    time: float | None = None,
    *,
    follow: Any = None,
    **known: Any,
) -> Stability:
    """Whether a packing moves; see :func:`faultgouge.analysis.stability`.

    Parameters
    ----------
    packing, rise, time, **known
        As there, or a file with the packing.
    follow : bool or lammps.lammps, optional
        Whether LAMMPS goes on where motion grows, until it vibrates, creeps or flows (`Stability.follow`): True of a
        Packing, which the plugin moves, or the instance of which a Configuration was taken.

    Examples
    --------
    >>> *_, last = faultgouge.ramp("three_disks.toml")
    >>> found = faultgouge.stability(last.packing)
    >>> found.stable, round(found.growth_rate, 3), found.at_bound
    (False, 7.07, 1)
    >>> print(str(found).splitlines()[0])
    unstable: small motion grows, D as exp(7.07002 t)
    """
    if follow is None or follow is False:
        return stability_of_packing(packing, rise, time, **known)
    from .pywrap.granular.growth_followed import follow_by

    followed = follow_by(packing, None if follow is True else follow)
    return stability_of_packing(packing, rise, time, follow=followed, **known)


spectrum = takes_file(spectrum_of_packing)
stress = takes_file(stress_of_packing)
elastic_moduli = takes_file(moduli_of_packing)
vibrations = takes_file(vibrations_of_packing)


def packing_in(run: RunFile, frame: int = -1) -> Packing:
    """The packing of a frame; of a drive.h5 with the spring that draws its layer."""
    packing = run.packing(frame)
    if run.attributes.get("task") != "drive":
        return packing
    from .pywrap.runs.drive import drive_of

    settings = drive_of(run)
    return packing if settings is None or settings.spring == "rigid" else replace(packing, spring=settings.spring)


@takes_file
def draw(
    packing: HasConfiguration,
    ax: Axes | None = None,
    mode: int | Literal["pair"] | None = None,
    color: str = "mobilised",
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
        return draw_packing(packing, ax, color)
    if mode != "pair" and not isinstance(mode, int):
        raise BadInputError(f"draw takes the number of a mode, or 'pair', and not mode = {mode!r}.")
    return draw_mode(packing, None if mode == "pair" else mode, ax)


def pair(scene: Scene | str | Path, mu: float | None = None) -> PairCurve:
    """Follow the pair of eigenvalues that merges at the first onset of a scene, without dissipation.

    Parameters
    ----------
    scene : Scene, str or Path
        With a section [ramp], or its file.
    mu : float, optional
        One of its friction coefficients; the first by default.

    Returns
    -------
    PairCurve
        The pair at the loads of the ramp, and at loads that crowd at the onset, up to the end of its window, or to
        twice the onset. ``faultgouge.figures.draw_pair([curve])`` draws the curve.

    Raises
    ------
    OnsetError, NoEquilibriumError
        As of :func:`faultgouge.onset`.

    Examples
    --------
    >>> curve = faultgouge.pair("three_disks.toml")
    >>> curve.eigenvalues[0].round(3)
    array([1188.882+0.j, 1484.786+0.j])
    >>> curve.eigenvalues[-1].round(3)
    array([1523.763-277.111j, 1523.763+277.111j])
    """
    from .figures import PairCurve
    from .pywrap.onset import ONSET_DISTANCES, onset_run
    from .pywrap.scenes.scene import scene_of
    from .pywrap.scenes.validation import require_section

    scene = scene_of(scene, "pair")
    near = ONSET_DISTANCES * require_section(scene.ramp, "ramp").first
    friction = scene.law.mus[0] if mu is None else mu
    return PairCurve.of_onset(onset_run(scene, friction, reached=lambda _: None, near_onset=near, first=True))


class ViewedPage(type(Path())):  # type: ignore[misc]  # the class of paths of this system
    """The path of a page of some packings, which a notebook shows."""

    packings: int = 0

    def _repr_html_(self) -> str:
        return f'<iframe srcdoc="{escape(self.read_text())}" width="100%" height="640" style="border: 0"></iframe>'


def view(
    file: str | Path,
    output: str | Path = "page.html",
    loads: int | None = None,
    say: Callable[[str], Any] = print,
    progress: Callable[[Sequence[HasConfiguration]], Iterable[HasConfiguration]] = iter,
) -> ViewedPage:
    """Write a page of a stored packing, ramp, undamped run or driven run.

    Parameters
    ----------
    file : str or Path
        A run.h5, drive.h5 or perturb.h5, the dumps of a deck, or what `import` has made of a LAMMPS deck.
    output : str or Path
        The page, .html.
    loads : int, optional
        Number of equilibria on the page, equally spaced; by default as many as take a minute, and 60 at the most.
    say, progress : callable
        Takes a line about long work; wraps the packings while their eigenvalues are computed.

    Returns
    -------
    ViewedPage
        The path of the page; in a notebook the page itself is seen.

    Raises
    ------
    BadInputError, PackingFileError
        If the page is no .html; if the file is missing or damaged.

    Examples
    --------
    >>> page = faultgouge.view("run.h5", "page.html", say=lambda line: None)
    >>> page.read_text()[:15]
    '<!doctype html>'
    """
    from .analysis.responses.hysteresis import turning_points
    from .figures.browser_page import Axis, loads_shown, write_view
    from .figures.followed_pairs import seconds
    from .figures.packing import in_words

    path, output = path_of(file, "view"), Path(output)
    if output.suffix.lower() != ".html":
        raise BadInputError(f"-o {output}: a page is an .html")
    last = load(path)
    packings, series, axis, title = [last], None, None, f"{path.name}: {in_words(last)}"
    if path.suffix != ".disks" and not holds_configuration(path):
        with RunFile(path) as run:
            driven = "time" in run.observables
            turns = [] if driven else turning_points(run.fx)
            chosen = sorted({*loads_shown(len(run), len(last), loads), *turns})
            packings = [packing_in(run, k) for k in chosen]
            series = run.series("undamped") if "undamped" in run.names_of_series else None
            span = " to ".join(f"{run.fx[k]:g}" for k in sorted({0, *turns, len(run) - 1}))
            what = "undamped run" if series is not None else "equilibria"
            title = f"{path.name}: {what} of {len(last)} disks, Fₓ = {span}"
            if driven:
                axis = Axis("t", "time of the run", run.observable("time")[chosen])
                title = f"{path.name}: states of a driven run of {len(last)} disks"
    if (needed := seconds(packings)) > 5:
        say(f"eigenvalues of {len(packings)} loads of {len(packings[0])} disks: about {needed:.0f} s")
    write_view(packings, output, title, series, progress, axis)
    page = ViewedPage(output)
    page.packings = len(packings)
    return page
