"""The command onset: the load at which a layer becomes unstable."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..analysis.counted import counted
from ..analysis.table_display import table_of
from ..mpi_rank import is_root
from ..signal_guard import keeps
from .terminal import (
    AsJson,
    ScenePath,
    lock_output,
    print_json,
    print_line,
    read_scene,
    report_fallback,
    say,
    status,
    stored_files,
)

if TYPE_CHECKING:
    from ..analysis import Onset, Packing, Window
    from ..pywrap import Equilibrium, Scene

app = typer.Typer()

Slices = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER",
        help="Folder for the results of a long search, which continues from the results there. Jobs that name the "
        "same folder share the search. By default -o FILE has its own folder until the search is done.",
    ),
]


@app.command(epilog="Example: faultgouge examples scene && faultgouge onset scene.toml --json")
def onset(
    context: typer.Context,
    scene: ScenePath,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Also write the JSON to this file; a long interrupted search continues."),
    ] = None,
    modes: Annotated[
        str | None,
        typer.Option(
            metavar="FIRST:STOP",
            help="Search only these modes, counted by frequency from 0, since all modes of 100,000 disks take hours. "
            "0:600 are the 600 lowest.",
        ),
    ] = None,
    slices: Slices = None,
    every: Annotated[
        bool,
        typer.Option("--all", help="All windows up to ramp.until, of up to 300 disks; takes longer."),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Compute the onset F_x^c for each friction coefficient of the scene. The ramp ends there.

    Two eigenvalues become complex at F_x^c. With a section [damping], F_x^c is the
    load beyond which some motion grows in spite of the dissipation, or because of
    it; the command then also prints the undamped onset. --all gives all windows up
    to the end of the ramp. Of several friction coefficients those without an onset
    are named; the exit code is 1 if none has one.
    """
    from faultgouge.analysis.progress import show_progress
    from faultgouge.pywrap.settling.settle import shared_bed

    wanted = read_scene(scene, "onset", "onset")
    part = None if modes is None else _modes(modes)
    if part is not None and wanted.damping is not None:
        raise typer.BadParameter("--modes goes without [damping]: with it, all modes are searched; leave one out")
    if every:
        _check_all_windows(wanted, part)
    if output:
        lock_output(context, output, scene, *stored_files(wanted))
    folder = _search_folder(slices, output)
    tell = say if as_json else print_line
    with status("settling") as show, show_progress(show, "settling: "):
        bed = shared_bed(wanted)

    def solve(mu: float, before: list[dict[str, Any]]) -> dict[str, Any]:
        if wanted.damping is not None:
            return _damped_onset(wanted, mu, bed, not every, tell, output, folder, before)
        return _undamped_onset(part, folder, wanted, mu, bed, not every, tell)

    found, failed = _each_onset(wanted.law.mus, solve, tell)
    if failed is not None and not any("undamped" in each for each in found):
        raise failed
    tell(f'law of friction: {wanted.law.in_words} (history = "{wanted.law.history}")')
    result = _write_result(output, found)
    if is_root() and folder is not None and not slices:
        from faultgouge.analysis.windows.store import remove_passes

        remove_passes(folder)  # the result is there
    if as_json:
        print_json(result)
    if failed is not None:
        raise failed


def _each_onset(
    mus: Sequence[float], solve: Callable[[float, list[dict[str, Any]]], dict[str, Any]], tell: Tell
) -> tuple[list[dict[str, Any]], Exception | None]:
    """The JSON of each friction coefficient, and the error if none has an onset.

    `solve` gives the JSON of one, beside the JSON of those before.
    """
    from faultgouge.analysis import NoEquilibriumError, OnsetError

    found: list[dict[str, Any]] = []
    failed: Exception | None = None
    for mu in mus:
        try:
            found.append(solve(mu, found))
        except (OnsetError, NoEquilibriumError) as error:
            found.append({"mu": mu, "fx_c": None, "no_onset": str(error)} | _only_undamped(mu, error, tell))
            failed = error
            if len(mus) > 1:
                tell(f"mu = {mu:g}: no onset: {error}")
    if any(each["fx_c"] is not None for each in found):
        return found, None
    if failed is not None and len(mus) > 1:
        failed = OnsetError(f"None of the {len(mus)} friction coefficients has an onset on this ramp.")
    return found, failed


def _only_undamped(mu: float, error: Exception, tell: Tell) -> dict[str, Any]:
    """The JSON of a ramp on which motion grows only without dissipation, told to the user, too; empty for others."""
    from faultgouge.analysis.windows import NoGrowthError

    if not isinstance(error, NoGrowthError) or error.undamped is None:
        return {}
    return {"windows": [], "undamped": _tell_undamped(mu, error.undamped, tell)}


def _tell_undamped(mu: float, undamped: Onset | None, tell: Tell) -> dict[str, float] | None:
    """The onset without dissipation, in words and for JSON."""
    from faultgouge.analysis.uncertain_digits import with_uncertainty

    if undamped is None:
        tell(f"mu = {mu:g}: without dissipation none on this ramp")
        return None
    tell(f"mu = {mu:g}: without dissipation F_x^c = {with_uncertainty(undamped.fx_c, undamped.error)}")
    return {"fx_c": undamped.fx_c, "error": undamped.error}


def _check_all_windows(scene: Scene, modes: tuple[int, int] | None) -> None:
    """Refuse --all where the first window alone is sought."""
    from faultgouge.analysis import BadInputError
    from faultgouge.analysis.windows import LIMITS

    if modes is not None:
        raise BadInputError("--all goes without --modes: among some modes the first window is sought; leave one out")
    disks = scene.packing.disks
    if disks > LIMITS.all_windows:
        raise BadInputError(
            f"--all finds all windows of up to {LIMITS.all_windows} disks, and the packing has {disks}: leave --all "
            "out for the first window, or take a smaller packing"
        )


def _write_result(output: Path | None, found: list[dict[str, Any]]) -> dict[str, Any]:
    """The JSON of the first friction coefficient with an onset, and of all, written if there is a file."""
    from faultgouge.analysis.files.atomic_write import write_json

    first = next((each for each in found if each["fx_c"] is not None), found[0])
    result = first | ({"each_mu": found} if len(found) > 1 else {})
    if output and is_root():
        write_json(output, result)
    return result


def _search_folder(slices: Path | None, output: Path | None) -> Path | None:
    """Where a long search leaves what it finds; nowhere if its result goes to no file, or to a device."""
    from faultgouge.analysis.files.atomic_write import make_folder

    if slices:
        make_folder(slices)
        return slices
    return None if output is None or (output.exists() and not output.is_file()) else Path(f"{output}.slices")


Tell = Callable[[str], None]
"""A function that prints results to standard output, or to standard error beside the JSON."""


def _undamped_onset(
    modes: tuple[int, int] | None,
    folder: Path | None,
    scene: Scene,
    mu: float,
    bed: Packing | None,
    first: bool,
    tell: Tell,
) -> dict[str, Any]:
    """The onset of a scene as JSON, told to the user in words."""
    from faultgouge.pywrap.onset import onset_run

    with status(f"mu = {mu:g}") as show:
        watch = partial(_under_way, show, f"mu = {mu:g}", folder=folder)
        onset = onset_run(scene, mu, modes=modes, first=first, bed=bed, watch=watch, folder=folder)
    real = _in_si(scene, [(each.fx_onset, abs(each.eigenvalue) ** 0.5) for each in onset.windows])
    si, opening = real.get("si", []), onset.windows[0]
    among = "" if modes is None else f" among the modes {modes[0]}:{modes[1]}"
    tell(f"mu = {mu:g}: {onset.describe()}{among}")
    if onset.complete:
        _show_windows(onset.windows, si, tell)
    elif opening.kind != "start":
        how = "two eigenvalues merge" if opening.kind == "coalescence" else "contacts change"
        tell(f"mu = {mu:g}: {how} there, and become complex about {opening.eigenvalue:.6g} ({opening.kind})")
        _tell_in_si(mu, si, tell)
    if onset.ends is not None and onset.complete:
        tell(f"mu = {mu:g}: the branch of equilibria ends before F_x = {onset.ends:g}, where an eigenvalue is negative")
    _say_what_is_uncertain(onset.equilibria, onset.doubtful, "a pair was expected to become complex", onset.windows)
    return {"mu": mu} | onset.as_dict() | {"flows_beyond": onset.flows_beyond} | real


def _damped_onset(
    scene: Scene,
    mu: float,
    bed: Packing | None,
    first: bool,
    tell: Tell,
    output: Path | None,
    folder: Path | None,
    before: list[dict[str, Any]],
) -> dict[str, Any]:
    """The onset of a scene with dissipation as JSON, told to the user in words.

    What is known is written as it comes, beside what is known `before` of other friction coefficients, with the load
    up to which that is all as the key `searched_to`.
    """
    from faultgouge.analysis.uncertain_digits import with_uncertainty
    from faultgouge.pywrap.onset import onset_run

    def report_windows(so_far: Onset, fx: float) -> None:
        if output is not None:
            _write_result(output, [*before, {"mu": mu, "searched_to": fx} | so_far.as_dict()])
            keeps(
                f"{output} has the windows with dissipation up to F_x = {fx:.6g}, without the errors of the path",
                output,
            )

    with status(f"mu = {mu:g}") as show:
        watch = partial(_under_way, show, f"mu = {mu:g}", folder=folder, tells=output is None)
        run = onset_run(
            scene, mu, dissipation=True, first=first, known=report_windows, bed=bed, watch=watch, folder=folder
        )
    opening = run.windows[0]
    if opening.kind == "start":
        tell(
            f"mu = {mu:g}: unstable at F_x = {opening.fx_onset:g} in spite of the dissipation, before any shear is "
            f"added: a motion of omega = {opening.frequency:.6g} grows"
        )
    else:
        tell(
            f"mu = {mu:g}: with dissipation F_x^c = {with_uncertainty(run.fx_c, run.error)} ({opening.kind}, "
            f"omega = {opening.frequency:.6g})"
        )
    _tell_undamped(mu, run.undamped, tell)
    real = _in_si(scene, [(each.fx_onset, each.frequency) for each in run.windows])
    _tell_in_si(mu, real.get("si", []), tell)
    _say_what_is_uncertain(run.equilibria, run.doubtful, "a motion was expected to grow", run.windows)
    return {"mu": mu} | run.as_dict() | real


def _tell_in_si(mu: float, si: Sequence[dict[str, float]], tell: Tell) -> None:
    """The first window in real units, where the scene has some."""
    for each in si[:1]:
        stress, ratio, frequency = _columns(each)
        tell(f"mu = {mu:g}: in SI a shear stress of {stress} Pa, {ratio} of the overburden, at {frequency} Hz")


def _in_si(scene: Scene, windows: Sequence[tuple[float, float]]) -> dict[str, list[dict[str, float]]]:
    """Loads at which windows begin, with frequencies, as the key si of a scene that has [units]; else nothing."""
    from faultgouge.pywrap.scenes.units import real_units

    real = real_units(scene)
    return {} if real is None else {"si": [real.onset(fx, omega) for fx, omega in windows]}


def _columns(si: dict[str, float]) -> list[str]:
    """Stress, its share of the overburden, and frequency."""
    return [f"{number:.4g}" for number in si.values()]


def _say_what_is_uncertain(
    equilibria: Iterable[Equilibrium],
    doubtful: Iterable[tuple[float, float]],
    expected: str,
    windows: Sequence[Window],
) -> None:
    """How equilibria were reached, where an onset may hide, and where the error of the path is not known."""
    for equilibrium in equilibria:
        report_fallback(equilibrium)
    for below, above in doubtful:
        say(
            f"{expected} between F_x = {below:.6g} and {above:.6g}, and was not found: an earlier onset may hide "
            "there; take smaller increments to be sure"
        )
    alone = [each for each in windows if each.path_error is None and each.kind != "start"]
    if alone:
        say(
            f"the error of {len(alone)} of {counted(len(windows), 'onset')}, the first at F_x = "
            f"{alone[0].fx_onset:.6g}, is that of rounding alone: no equilibrium was found there a second time, so "
            "that the error of the path is not known; other increments may find one"
        )


def _show_windows(windows: Sequence[Window], si: Sequence[dict[str, float]], tell: Tell) -> None:
    """The windows of complex eigenvalues as a table; in SI where the scene has units."""
    from faultgouge.analysis.uncertain_digits import with_uncertainty

    rows = []
    for k, each in enumerate(windows):
        until = "the end of the ramp" if each.fx_end is None else f"{each.fx_end:.8g}"
        numbers = _columns(si[k]) if si else [f"{each.eigenvalue:.6g}"]
        rows.append([with_uncertainty(each.fx_onset, each.error), until, *numbers, each.kind])
    more = ("in Pa", "F_x/F_y", "in Hz") if si else ("eigenvalue",)
    tell(table_of(("from F_x", "to F_x", *more, "begins with"), rows))


def _under_way(
    show: Callable[[str], None], what: str, now: str, folder: Path | None = None, tells: bool = False
) -> None:
    """Say what is under way; at an interrupt, what a folder has, or how far the search had come if it `tells`."""
    show(f"{what}: {now}")
    if folder is not None and folder.is_dir():
        keeps(f"{folder} has what was found so far; the same command continues from there", folder)
    if tells:
        keeps(f"no file was written. {what}: {now}")


def _modes(text: str) -> tuple[int, int]:
    """FIRST:STOP as numbers."""
    first, _, stop = text.partition(":")
    if not (first.isdecimal() and stop.isdecimal() and int(first) < int(stop)):
        raise typer.BadParameter(
            f"--modes {text}: give the first mode and the first one beyond, as in --modes 0:600 for the 600 lowest"
        )
    return int(first), int(stop)
