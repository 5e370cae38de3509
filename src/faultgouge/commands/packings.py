"""The commands stability, spectrum, timestep and vibrations: what a packing does."""

from __future__ import annotations

import json
from math import inf, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

from ..analysis.counted import counted
from ..signal_guard import is_root, keeps
from .studies import TRIED, try_cases
from .terminal import (
    RAMPED,
    Frame,
    NewFolder,
    PackingFile,
    Results,
    Time,
    command,
    locked,
    refuse_scene,
    say,
    status,
    stored_packing,
    working,
)

if TYPE_CHECKING:
    from ..analysis import Configuration, ElasticModuli, Packing, Spectrum, Stability, Vibrations
    from ..analysis.has_configuration import HasConfiguration

MOST_PAIRS = 20
"""Lines of complex pairs: a packing of a thousand has hundreds."""

VERDICT_FIRST = 2000
"""Coordinates beyond which the eigenvalues take longer than the verdict, which does not need them."""

Follow = Annotated[
    bool, Option("--follow", help="Where motion grows, let LAMMPS go on until it vibrates, creeps or flows.")
]
OF_RISE = "Also the motion while F_x rises slowly: drift and vibration over its rate."
OF_ANY = "run.h5, NAME.disks, a LAMMPS deck; or, with --material, a table of spheres (CSV, dump, YADE, .data)."
AnyPacking = Annotated[Path, Argument(metavar="FILE", help=OF_ANY, callback=refuse_scene)]
OF_TABLE = "Of a table: young, poisson, density, friction, restitution; or kn, kt and exponent (1.5 or 1) for young."
MaterialOf = Annotated[str | None, Option("--material", metavar="KEY=VALUE,...", help=OF_TABLE)]


@command("faultgouge examples pour && faultgouge stability pour.in --follow", as_json=True)
def stability(
    file: Annotated[
        Path | None, Argument(metavar="FILE|DECK", help="run.h5, NAME.disks, or a LAMMPS deck (.in).")
    ] = None,
    rise: Annotated[str | None, Option(metavar="fx", help=OF_RISE)] = None,
    followed: Annotated[
        float | None,
        Option("--time", metavar="T", help="How long motion is followed; until it has settled by default."),
    ] = None,
    follow: Follow = False,
    relax: Annotated[bool, Option("--relax", help="Bring the last state of a deck to rest first.")] = False,
    frame: Frame = -1,
    output: Annotated[Path, Option("-o", "--output", hidden=True)] = Path("stability"),
    quick: Annotated[bool, Option("--quick", hidden=True)] = False,
) -> Results:
    """Say whether a packing is stable: with its own dashpots and drag, and its contacts at Coulomb's bound as they are.

    The first sentence is the verdict. A deck is run as LAMMPS runs it, and its last
    state is looked at. Without a file this is the old name of `faultgouge extremes`.
    """
    from faultgouge.pywrap.granular.run_deck import run_deck

    if file is None:
        yield from _extremes(output, quick)
        return
    if rise not in (None, "fx"):
        raise typer.BadParameter(f"--rise {rise}: the load rises along fx")
    if followed is not None and not 0 < followed < inf:
        raise typer.BadParameter(f"--time {followed:g}: the time that motion is followed is a positive number")
    found: list[Stability] = []

    def judge(going_on: Any, packing: HasConfiguration) -> None:
        if is_root():
            found.append(verdict_of(packing, rise, followed, follow=going_on))

    if file.suffix == ".in" or file.name.startswith("in."):
        with status(f"{file}: LAMMPS runs") as show:  # motion is followed while LAMMPS is there
            packing = run_deck(file, relaxes=relax, show=show, use=judge if follow else None)
        if not follow:
            judge(False, packing)
    elif relax:
        raise typer.BadParameter(f"--relax: {file} is no deck; a deck's last state may move")
    else:
        judge(follow, _with_layer(file, stored_packing(refuse_scene(file), frame), rise))
    for verdict in found:
        yield str(verdict)
        yield verdict.as_dict()


def _with_layer(file: Path, packing: HasConfiguration, rise: object) -> HasConfiguration:
    """The packing; refused if a load is to rise and there is no layer."""
    if rise and not packing.configuration.top.any():
        raise typer.BadParameter(f"--rise: {file} has no upper layer that a load could push; leave it out")
    return packing


def verdict_of(packing: HasConfiguration, *given: Any, **options: Any) -> Stability:
    """The verdict on a packing, with progress."""
    from faultgouge import stability as stability_of

    with working("stability"):
        return stability_of(packing, *given, **options)


def _extremes(output: Path, quick: bool) -> Results:
    """The stiff and extreme cases under their name until version 1, with the JSON under its old name, too."""
    from faultgouge.analysis.files.atomic_write import write_whole

    say("faultgouge stability without a file is called faultgouge extremes now")
    with locked(output, kind="folder"):
        keeps(TRIED.format(output=output), output)
        try:
            yield from try_cases(output, quick)
        finally:
            if is_root() and (output / "extremes.json").exists():
                write_whole(output / "stability.json", (output / "extremes.json").read_bytes())


@command(f"{RAMPED} && faultgouge spectrum run.h5 --json", alone=True, as_json=True)
def spectrum(
    file: PackingFile,
    frame: Frame = -1,
    time: Time = None,
    values: Annotated[
        bool, Option("--values", help="Only the eigenvalues: for a thousand disks in a third of the time.")
    ] = False,
    gain: Annotated[
        bool,
        Option(
            "--gain", help="Also how much a stable packing amplifies its worst push; up to 300 disks or 150 spheres."
        ),
    ] = False,
    rise: Annotated[bool, Option("--rise", help=OF_RISE)] = False,
    follow: Follow = False,
    verbose: Annotated[
        bool, Option("--verbose", help="Also conditions of pairs, quality factors, what makes K asymmetric.")
    ] = False,
) -> Results:
    """Say whether a stored packing is stable; compute its eigenvalues, complex pairs and rattlers.

    The verdict comes first: with the packing's own dashpots and drag, and with
    contacts at Coulomb's bound as they are, which slide on ahead and stick on the
    way back. The eigenvalues are those of K alone, without dissipation.
    """
    from faultgouge.analysis import Packing, eigenvalues, solid_fraction
    from faultgouge.analysis import spectrum as spectrum_of

    if values and (gain or rise or verbose or follow):
        raise typer.BadParameter(
            "--values computes nothing but eigenvalues: leave --gain, --rise, --follow and --verbose out"
        )
    packing = _with_layer(file, stored_packing(file, frame, time), rise)
    size = packing.configuration.coordinates
    large = size > VERDICT_FIRST
    if values:
        if large:  # four matrices of doubles; 18000 coordinates took 10.2 GB
            say(f"{size} coordinates: LAPACK needs {32e-9 * size**2:.2g} GB, and a time that grows as their cube")
        found = [[value.real, value.imag] for value in eigenvalues(packing).tolist()]
        yield from (f"{real:.17g} {imaginary:.17g}" for real, imaginary in found)
        yield {"eigenvalues": found, "rattlers": packing.rattlers.tolist(), "fx": packing.fx}
        return
    result = None if large else spectrum_of(packing)
    verdict = verdict_of(packing, "fx" if rise else None, spectrum_of_stiffness=result, follow=follow)
    yield str(verdict)
    if result is None:
        with working("eigenvalues of K"):
            result = spectrum_of(packing)
    gains, configuration = _gain_of(packing) if gain else None, packing.configuration
    fraction = solid_fraction(packing) if isinstance(packing, Packing) else None
    yield from _spectrum_in_words(packing, result, verdict.dissipative, verbose, fraction)
    if gains is not None:
        yield (
            f"a displacement from rest grows by up to {gains['displacement']:.6g} times in its square, within t = "
            f"{gains['time']:.6g} (by up to {gains['energy']:.6g} in energy); disk {gains['disk']} is the worst to push"
            if gains["displacement"] > 1
            else "no displacement from rest grows"
        )
        if not gains["linear"]:
            yield "this is the gain of K alone, in which each contact has one derivative; these contacts have two"
    if verbose:
        shares = ", ".join(f"{name.replace('_', ' ')} {share:.3g}" for name, share in verdict.asymmetry.items())
        yield f"what makes K asymmetric, as shares: {shares}"
        if result.noise_pairs:
            pairs = counted(result.noise_pairs, "pair")
            yield f"{pairs} of eigenvalues with imaginary parts within the rounding error: they count as real"
    if spring := configuration.spring:
        yield f"K has the stiffness of the spring that draws the layer, {spring:g} on each of its disks"
    of_pair = ("condition", "overlap", "growth_rate", "frequency", "quality", "participation", "rotation")
    yield {
        "stability": verdict.as_dict(),
        "eigenvalues": [[value.real, value.imag] for value in result.eigenvalues.tolist()],
        "pairs": [
            {"eigenvalue": [each.eigenvalue.real, each.eigenvalue.imag]} | {key: getattr(each, key) for key in of_pair}
            for each in result.pairs
        ],
        "pair_count": len(result.pairs),
        "least_q": result.least_q if result.pairs else None,
        "negative": result.negative.tolist(),
        "stable": verdict.stable,
        "largest_growth_rate": result.growth_rate(),
        "rattlers": result.rattlers.tolist(),
        "fx": configuration.fx,
        "spring": configuration.spring,
        "residual": packing.residual,
        "solid_fraction": fraction,
        "noise_pairs": result.noise_pairs,
        "transient_gain": gains,
    }


def _spectrum_in_words(
    packing: HasConfiguration, result: Spectrum, dissipative: bool, verbose: bool, fraction: float | None
) -> Results:
    """The packing, the range of its eigenvalues, and those with which motions grow."""
    from faultgouge.analysis import growth_rate

    real = result.eigenvalues.real
    what = f"F_x = {packing.configuration.fx:g}"
    if fraction is None:
        noun = "sphere" if packing.configuration.dimension == 3 else "disk"
        count = len(packing.configuration)
        what = f"{counted(count, noun)} as LAMMPS left {'it' if count == 1 else 'them'}"
    span = f" from {real.min():.6g} to {real.max():.6g}" if len(real) else ", as no particle touches another"
    left_out = f"{counted(len(result.rattlers), 'rattler')} left out"
    volume = "" if fraction is None else f"; volume fraction {fraction:.4f}"
    yield f"{what}: {counted(len(real), 'eigenvalue')} of K{span}, {left_out}{volume}"
    alone = " without dissipation" if dissipative else ""
    for value in result.negative:
        yield f"negative eigenvalue {value:.10g}: D grows as exp({growth_rate(value):.6g} t){alone}, no oscillation"
    for pair in result.pairs[:MOST_PAIRS]:
        condition = f", |y^H x| = {pair.overlap:.2g}" if verbose else ""
        numbers = f"{pair.eigenvalue.real:.10g} +- {pair.eigenvalue.imag:.10g} i"
        yield f"complex pair {numbers}: D grows as exp({pair.growth_rate:.6g} t){alone}{condition}"
    if len(result.pairs) > MOST_PAIRS:
        yield f"and {len(result.pairs) - MOST_PAIRS} more: --json has all {len(result.pairs)}"
    if result.pairs and verbose:
        yield f"least Q of a pair, |Re omega| / (2 |Im omega|): {result.least_q:.4g}"


def _gain_of(packing: HasConfiguration) -> dict[str, Any] | None:
    """The transient gains of a stable packing; None, with the reason, if unstable, too large, or where it fails."""
    from faultgouge.analysis.responses.transient import GAIN_DISKS, NoGainError, transient_gains

    most, size = 3 * GAIN_DISKS, packing.configuration.coordinates
    if size > most:
        say(f"no gain: it is computed of up to {most} coordinates, and this packing has {size}")
        return None
    try:
        displacement, energy = transient_gains(packing)
    except NoGainError as error:
        say(f"no gain: {error}")
        return None
    except Exception as error:  # whatever it is: the eigenvalues are worth more
        reason = (str(error).splitlines() or ["no reason given"])[0]
        say(f"the transient gain was not found ({type(error).__name__}: {reason}); the eigenvalues are complete")
        return None
    names = ("time", "window", "bound", "disk", "linear")
    gains = {"displacement": displacement.gain, "energy": energy.gain} | {
        key: getattr(displacement, key) for key in names
    }
    return gains | {"direction": displacement.direction.tolist()}


@command("faultgouge examples disks && faultgouge timestep disks.csv --material young=1e9,density=1100", as_json=True)
def timestep(file: AnyPacking, material: MaterialOf = None, frame: Frame = -1) -> Results:
    """Compute the largest stable time step of a packing, beside the rules that users have.

    It is the step of velocity Verlet with the packing's own contacts and dashpots, and
    so a limit for any code with that integrator. A step of a fifth of it is usual.
    """
    from faultgouge.analysis import timestep_rules

    configuration = _any_packing(file, frame, material).configuration
    with status(f"{file}: time step"):
        step, rules = timestep_rules(configuration)
    error = f" (at most {step.error:.2g} shorter)" if step.error else ""
    yield f"{configuration!r}".removeprefix("<Configuration: ").removesuffix(">")
    yield f"largest stable time step {step:.6g}{error}; all steps up to {step.certain:.6g} are stable for certain"
    names = {
        "rayleigh": "Rayleigh's formula (Li, Xu and Thornton), of which 0.1 to 0.3 is usual",
        "o_sullivan_bray": "0.17 sqrt(m/k) (O'Sullivan and Bray)",
        "oscillator": "2 sqrt(m/k), one sphere on one spring",
        "p_wave": "R sqrt(rho/E) with k = E R, a sound wave through a sphere (YADE)",
    }
    for name, value in rules.items():
        share = (
            "does not apply to these contacts" if value is None else f"{value:.6g}, {value / step:.3g} of the largest"
        )
        yield f"  {names[name]}: {share}"
    document = {"largest": float(step), "error": step.error, "certain": step.certain, "rules": rules}
    # infinite where nothing touches: JSON has no such number
    yield {key: None if value == inf else value for key, value in document.items()}


@command("faultgouge examples fcc && faultgouge vibrations fcc.in -o vibrations", writes="folder", alone=True)
def vibrations(
    file: AnyPacking,
    output: NewFolder = Path("vibrations"),
    material: MaterialOf = None,
    frame: Frame = -1,
    along: Annotated[str, Option(metavar="x|y|z", help="Edge of the box along which plane waves run.")] = "x",
    waves: Annotated[int, Option(min=0, help="Plane waves, from the one as long as the box.")] = 4,
) -> Results:
    """Compute how a packing vibrates: density of states, modes, softness, plane waves, elastic moduli.

    The folder gets vibrations.json, density.csv, modes.csv (of few coordinates),
    waves.csv, softness.xyz and .vtp, and pictures. Contacts stick.
    """
    from faultgouge.analysis import BadInputError, dispersion, elastic_moduli, softness
    from faultgouge.analysis import vibrations as vibrations_of
    from faultgouge.analysis.files.atomic_write import write_whole
    from faultgouge.analysis.files.formats import write_packing
    from faultgouge.figures import save
    from faultgouge.figures.series import draw_vibrations, draw_waves
    from faultgouge.figures.style import report_failure

    if along not in ("x", "y", "z"):
        raise typer.BadParameter(f"--along {along}: give x, y or z")
    packing = _any_packing(file, frame, material)
    with working(f"{file}: vibrations"):
        found = vibrations_of(packing)
        soft, error = softness(packing)
        plane, moduli = [], None
        try:
            plane = dispersion(packing, "xyz".index(along), waves)
            moduli = elastic_moduli(packing)
        except BadInputError as reason:
            say(f"{reason}")
        tables, document = _tables(found, plane, moduli)
        document |= {"softness": _plain(soft), "softness_error": _plain(error)}
        write_whole(output / "vibrations.json", (json.dumps(document, indent=1) + "\n").encode())
        for name, columns in tables.items():
            rows = [",".join(map(repr, map(float, row))) for row in zip(*columns.values(), strict=True)]
            write_whole(output / f"{name}.csv", "\n".join([",".join(columns), *rows, ""]).encode())
        for suffix in (".xyz", ".vtp"):
            write_packing(output / f"softness{suffix}", packing, values={"softness": soft})
        with report_failure("density", say):
            save(draw_vibrations(found), output / "density")
        if plane:
            with report_failure("waves", say):
                save(draw_waves(plane, moduli), output / "waves")
    few = "all modes" if found.modes is not None else f"window {found.resolution[0] / found.largest:.2g} of the largest"
    yield (
        f"{found.counted} motions with a frequency up to {found.largest / 1.01:.6g} ({few}), {found.zero} without "
        f"stiffness, {found.negative} with a negative eigenvalue; written to {output}"
    )
    if moduli is not None:
        yield repr(moduli).strip("<>")


def _tables(
    found: Vibrations, plane: list[Any], moduli: ElasticModuli | None
) -> tuple[dict[str, dict[str, Any]], dict[str, Any]]:
    """The tables of numbers by name, with their columns; and what vibrations.json has of them and beside them."""
    names = ("frequency", "resolution", "density", "density_error", "rotation", "damping")
    tables: dict[str, dict[str, Any]] = {"density": {name: getattr(found, name) for name in names}}
    if found.modes is not None:
        tables["modes"] = found.modes
    document: dict[str, Any] = {
        name: {key: _plain(each) for key, each in table.items()} for name, table in tables.items()
    }
    document.setdefault("modes", None)
    document |= {name: getattr(found, name) for name in ("largest", "counted", "zero", "negative")}
    document["waves"] = [wave._asdict() for wave in plane]
    if plane:
        tables["waves"] = {name: [getattr(wave, name) for wave in plane] for name in plane[0]._fields}
    numbers = ("young", "poisson", "shear", "bulk", "anisotropy", "density", "at_bound", "box")
    arrays = ("tensor", "antisymmetric", "wave_speeds")
    document["moduli"] = moduli and {name: getattr(moduli, name) for name in numbers} | {
        name: getattr(moduli, name).tolist() for name in arrays
    }
    return tables, document


def _plain(values: Any) -> list[float | None]:
    return [each if isfinite(each) else None for each in values.tolist()]


def _any_packing(file: Path, frame: int, material: str | None) -> Packing | Configuration:
    """A stored packing, or the spheres of a table."""
    from faultgouge.analysis.files.contact_tables import material_of, of_material, read_spheres
    from faultgouge.door import load

    if material is None and file.suffix in (".csv", ".txt", ".dump", ".data"):
        raise typer.BadParameter(f"{file} is a table: give its --material, as in young=7e10,poisson=0.25,density=2500")
    return load(file, frame) if material is None else of_material(read_spheres(file, frame), material_of(material))
