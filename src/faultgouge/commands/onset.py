"""The command onset: the load at which a layer becomes unstable."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from ..analysis.counted import counted
from ..analysis.table_display import table_of
from ..signal_guard import is_root, keeps
from .terminal import LAYER, Results, SceneFile, command, report_fallback, say, status, working

if TYPE_CHECKING:
    from ..analysis import Onset
    from ..pywrap import Scene


@command(f"{LAYER} && faultgouge onset scene.toml --json", reads="onset", writes="file", as_json=True)
def onset(
    scene: SceneFile,
    output: Annotated[Path | None, Option("-o", "--output", help="Also write the JSON; continues a search.")] = None,
    every: Annotated[bool, Option("--all", help="All windows up to ramp.until, of up to 300 disks.")] = False,
) -> Results:
    """Compute the onset F_x^c for each friction coefficient of the scene. The ramp ends there.

    Two eigenvalues become complex at F_x^c. With a section [damping], F_x^c is the
    load beyond which some motion grows in spite of the dissipation, or because of
    it; the command then also prints the undamped onset. --all gives all windows up
    to the end of the ramp. Of several friction coefficients those without an onset
    are named; the exit code is 1 if none has one.
    """
    from faultgouge.analysis import BadInputError, NoEquilibriumError, OnsetError
    from faultgouge.analysis.files.atomic_write import write_json
    from faultgouge.analysis.windows import LIMITS
    from faultgouge.analysis.windows.slices import remove_results
    from faultgouge.pywrap.scenes.units import real_units
    from faultgouge.pywrap.settling.settle import shared_bed

    if every and (disks := scene.packing.disks) > LIMITS.all_windows:
        takes = f"--all finds all windows of up to {LIMITS.all_windows} disks"
        raise BadInputError(f"{takes}, and the packing has {disks}: leave --all out for the first window")
    # a long search leaves what it finds beside its file, unless that is a device
    folder = Path(f"{output}.slices") if output and (output.is_file() or not output.exists()) else None
    with working("settling"):
        bed = shared_bed(scene)
    found: list[dict[str, Any]] = []
    failed: Exception | None = None
    for mu in scene.law.mus:
        try:
            each = _search(scene, mu, not every, bed, folder)
            yield from _in_words(each)
            si = {}
            if (real := real_units(scene)) is not None:
                si = {"si": [real.onset(window.fx_onset, window.frequency) for window in each.windows]}
                stress, ratio, frequency = (f"{number:.4g}" for number in si["si"][0].values())
                yield f"mu = {mu:g}: in SI a shear stress of {stress} Pa, {ratio} of the overburden, at {frequency} Hz"
            found.append({"mu": mu} | each.as_dict() | {"flows_beyond": each.flows_beyond} | si)
        except (OnsetError, NoEquilibriumError) as error:
            failed = error
            found.append({"mu": mu, "fx_c": None, "no_onset": str(error)})
            if undamped := getattr(error, "undamped", None):
                found[-1] |= {"windows": [], "undamped": {"fx_c": undamped.fx_c, "error": undamped.error}}
                yield f"mu = {mu:g}: without dissipation {undamped.describe()}"
            if len(scene.law.mus) > 1:
                yield f"mu = {mu:g}: no onset: {error}"
                count = len(scene.law.mus)
                failed = OnsetError(f"None of the {count} friction coefficients has an onset on this ramp.")
    first = next((each for each in found if each["fx_c"] is not None), None)
    if first is not None or any("undamped" in each for each in found):
        yield f'law of friction: {scene.law.in_words} (history = "{scene.law.history}")'
        result = (first or found[0]) | ({"each_mu": found} if len(found) > 1 else {})
        if output and is_root():
            write_json(output, result)
        yield result
        if is_root() and folder is not None:
            remove_results(folder)  # the result is there
    if first is None and failed is not None:
        raise failed


def _search(scene: Scene, mu: float, first: bool, bed: Any, folder: Path | None) -> Onset:
    """Search for one friction coefficient, and say what is doubtful."""
    from faultgouge.pywrap.onset import onset_run

    dissipation = scene.damping is not None
    with status(f"mu = {mu:g}") as show:

        def watch(now: str) -> None:
            show(f"mu = {mu:g}: {now}")
            if folder is not None and folder.is_dir():
                keeps(f"{folder} has what was found so far; the same command continues from there")

        found = onset_run(scene, mu, dissipation=dissipation, first=first, bed=bed, watch=watch, folder=folder)
    for equilibrium in found.equilibria:
        report_fallback(equilibrium)
    expected = "a motion was expected to grow" if dissipation else "a pair was expected to become complex"
    for below, above in found.doubtful:
        hides = "was not found: an earlier onset may hide there; take smaller increments to be sure"
        say(f"{expected} between F_x = {below:.6g} and {above:.6g}, and {hides}")
    if alone := [each for each in found.windows if each.path_error is None and each.kind != "start"]:
        which = f"{len(alone)} of {counted(len(found.windows), 'onset')}, the first at F_x = {alone[0].fx_onset:.6g}"
        say(f"the error of {which}, is that of rounding alone: other increments may find that of the path, too")
    return found


def _in_words(found: Onset) -> Results:
    """The onset of a friction coefficient: F_x^c, how it begins, and all windows as a table."""
    from faultgouge.analysis.uncertain_digits import with_uncertainty

    mu, opening = f"mu = {found.mu:g}", found.windows[0]
    if opening.dissipative and opening.kind == "start":
        spite = f"unstable at F_x = {opening.fx_onset:g} in spite of the dissipation, before any shear is added"
        yield f"{mu}: {spite}: a motion of omega = {opening.frequency:.6g} grows"
    elif opening.dissipative:
        yield f"{mu}: with dissipation {found.describe()} ({opening.kind}, omega = {opening.frequency:.6g})"
    else:
        yield f"{mu}: {found.describe()}"
    if opening.dissipative:
        yield f"{mu}: without dissipation {found.undamped.describe() if found.undamped else 'none on this ramp'}"
    elif found.complete:
        within = [with_uncertainty(each.fx_onset, each.error) for each in found.windows]
        to = ["the end of the ramp" if each.fx_end is None else f"{each.fx_end:.8g}" for each in found.windows]
        begins = [(f"{each.eigenvalue:.6g}", each.kind) for each in found.windows]
        rows = ((*ends, *how) for *ends, how in zip(within, to, begins, strict=True))
        yield table_of(("from F_x", "to F_x", "eigenvalue", "begins with"), rows)
        if found.ends is not None:
            yield f"{mu}: the branch of equilibria ends before F_x = {found.ends:g}, where an eigenvalue is negative"
    elif opening.kind != "start":
        how = "two eigenvalues merge" if opening.kind == "coalescence" else "contacts change"
        yield f"{mu}: {how} there, and become complex about {opening.eigenvalue:.6g} ({opening.kind})"
