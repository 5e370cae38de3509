"""The commands stability, spectrum, timestep and vibrations: what a packing does."""

from __future__ import annotations

from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from typer import Argument, Option

from ..analysis.counted import counted
from ..signal_guard import is_root, keeps
from .studies import TRIED, extremes
from .terminal import (
    RAMPED,
    Frame,
    NewFolder,
    PackingFile,
    Results,
    Time,
    command,
    locked,
    plain,
    refuse_scene,
    say,
    status,
    stored_packing,
    working,
)

if TYPE_CHECKING:
    from ..analysis import Configuration, Packing, Spectrum, Stability
    from ..analysis.has_configuration import HasConfiguration

MOST_PAIRS = 20
"""Lines of complex pairs: a packing of a thousand has hundreds."""

VERDICT_FIRST = 2000
"""Coordinates beyond which the eigenvalues take longer than the verdict, which does not need them."""

RULES = {
    "rayleigh": "Rayleigh's formula (Li, Xu and Thornton), of which 0.1 to 0.3 is usual",
    "o_sullivan_bray": "0.17 sqrt(m/k) (O'Sullivan and Bray)",
    "oscillator": "2 sqrt(m/k), one sphere on one spring",
    "p_wave": "R sqrt(rho/E) with k = E R, a sound wave through a sphere (YADE)",
}
"""Rules for time steps by their keys in JSON."""

Follow = Annotated[bool, Option("--follow", help="Let LAMMPS go on where motion grows, until it ends.")]
OF_RISE = "Also the motion while F_x rises slowly: drift and vibration over its rate."
OF_ANY = "run.h5, NAME.disks, a LAMMPS deck; or, with --material, a table of spheres (CSV, dump, YADE, .data)."
AnyPacking = Annotated[Path, Argument(metavar="FILE", help=OF_ANY, callback=refuse_scene)]
OF_TABLE = "Of a table: young, poisson, density, friction, restitution; or kn, kt and exponent (1.5 or 1) for young."
MaterialOf = Annotated[str | None, Option("--material", metavar="KEY=VALUE,...", help=OF_TABLE)]


@command("faultgouge examples pour && faultgouge stability pour.in --follow", as_json=True)
def stability(
    file: Annotated[Path | None, Argument(metavar="FILE|DECK", help="run.h5, NAME.disks, or a deck (.in).")] = None,
    rise: Annotated[Literal["fx"] | None, Option(help=OF_RISE)] = None,
    followed: Annotated[float | None, Option("--time", metavar="T", help="How long motion is followed.")] = None,
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
    from faultgouge.door import is_deck

    if file is None:
        say("faultgouge stability without a file is called faultgouge extremes now")
        with locked(output, kind="folder"):
            keeps(TRIED.format(output=output))
            yield from extremes(output, quick)
        return
    if followed is not None and not 0 < followed < inf:
        raise typer.BadParameter(f"--time {followed:g}: the time that motion is followed is a positive number")
    found: list[Stability] = []

    def judge(going_on: Any, packing: HasConfiguration) -> None:
        if is_root():
            found.append(verdict_of(packing, rise, followed, follow=going_on))

    if relax and not is_deck(file):
        raise typer.BadParameter(f"--relax: {file} is no deck; a deck's last state may move")
    if not is_deck(file):
        judge(follow, stored_packing(refuse_scene(file), frame))
    else:
        from faultgouge.pywrap.granular.run_deck import run_deck

        with status(f"{file}: LAMMPS runs") as show:  # motion is followed while LAMMPS is there
            packing = run_deck(file, relaxes=relax, show=show, use=judge if follow else None)
        if not follow:
            judge(False, packing)
    for verdict in found:
        yield str(verdict)
        yield verdict.as_dict()


def verdict_of(packing: HasConfiguration, rise: str | None = None, *given: Any, **options: Any) -> Stability:
    """The verdict on a packing, with progress."""
    from faultgouge import stability as stability_of

    if rise and not packing.configuration.top.any():
        raise typer.BadParameter("--rise: this packing has no upper layer that a load could push; leave it out")
    with working("stability"):
        return stability_of(packing, rise, *given, **options)


@command(f"{RAMPED} && faultgouge spectrum run.h5 --json", alone=True, as_json=True)
def spectrum(
    file: PackingFile,
    frame: Frame = -1,
    time: Time = None,
    values: Annotated[bool, Option("--values", help="The eigenvalues alone, in a third of the time.")] = False,
    gain: Annotated[bool, Option("--gain", help="Also the largest gain of a push; up to 300 disks.")] = False,
    rise: Annotated[bool, Option("--rise", help=OF_RISE)] = False,
    follow: Follow = False,
) -> Results:
    """Say whether a stored packing is stable; compute its eigenvalues, complex pairs and rattlers.

    The verdict comes first: with the packing's own dashpots and drag, and with
    contacts at Coulomb's bound as they are, which slide on ahead and stick on the
    way back. The eigenvalues are those of K alone, without dissipation.
    """
    from faultgouge.analysis import eigenvalues, solid_fraction
    from faultgouge.analysis import spectrum as spectrum_of
    from faultgouge.analysis.files.configuration_file import holds_configuration

    if values and (gain or rise or follow):
        raise typer.BadParameter("--values computes nothing but eigenvalues: leave --gain, --rise and --follow out")
    packing = stored_packing(file, frame, time)
    configuration = packing.configuration
    if values:
        found = plain(eigenvalues(packing))
        yield from (f"{real:.17g} {imaginary:.17g}" for real, imaginary in found)
        yield {"eigenvalues": found, "rattlers": packing.rattlers.tolist(), "fx": packing.fx}
        return
    result = None if configuration.coordinates > VERDICT_FIRST else spectrum_of(packing)
    verdict = verdict_of(packing, "fx" if rise else None, spectrum_of_stiffness=result, follow=follow)
    yield str(verdict)
    if result is None:
        with working("eigenvalues of K"):
            result = spectrum_of(packing)
    gains = _gain_of(packing) if gain else None
    fraction = None if holds_configuration(file) else solid_fraction(packing)
    yield from _spectrum_in_words(packing, result, verdict.dissipative, fraction)
    if gains is not None:
        size = "{displacement:.6g} times in its square, within t = {time:.6g} (by up to {energy:.6g} in energy)"
        grows = f"a displacement from rest grows by up to {size}; disk {{disk}} is the worst to push".format(**gains)
        yield grows if gains["displacement"] > 1 else "no displacement from rest grows"
        if not gains["linear"]:
            yield "this is the gain of K alone, in which each contact has one derivative; these contacts have two"
    if spring := configuration.spring:
        yield f"K has the stiffness of the spring that draws the layer, {spring:g} on each of its disks"
    of_pair = ("eigenvalue", "condition", "overlap", "growth_rate", "frequency", "quality", "participation", "rotation")
    pairs = [{key: plain(getattr(each, key)) for key in of_pair} for each in result.pairs]
    of_result = ("eigenvalues", "negative", "rattlers", "noise_pairs")
    document: dict[str, Any] = {"stability": verdict.as_dict(), "stable": verdict.stable}
    document |= {key: plain(getattr(result, key)) for key in of_result} | {"largest_growth_rate": result.growth_rate()}
    document |= {"pairs": pairs, "pair_count": len(pairs), "least_q": result.least_q if pairs else None}
    document |= {"fx": packing.fx, "spring": spring, "residual": packing.residual, "solid_fraction": fraction}
    yield document | {"transient_gain": gains}


def _spectrum_in_words(
    packing: HasConfiguration, result: Spectrum, dissipative: bool, fraction: float | None
) -> Results:
    """The packing, the range of its eigenvalues, and those with which motions grow."""
    from faultgouge.analysis import growth_rate

    real, what, volume = result.eigenvalues.real, f"F_x = {packing.fx:g}", f"; volume fraction {fraction or 0.0:.4f}"
    if fraction is None:
        what, volume = packing.configuration.in_words, ""
    span = f" from {real.min():.6g} to {real.max():.6g}" if len(real) else ", as no particle touches another"
    counts = f"{counted(len(real), 'eigenvalue')} of K{span}, {counted(len(result.rattlers), 'rattler')} left out"
    yield f"{what}: {counts}{volume}"
    alone = " without dissipation" if dissipative else ""
    for value in result.negative:
        yield f"negative eigenvalue {value:.10g}: D grows as exp({growth_rate(value):.6g} t){alone}, no oscillation"
    for pair in result.pairs[:MOST_PAIRS]:
        numbers = f"{pair.eigenvalue.real:.10g} +- {pair.eigenvalue.imag:.10g} i"
        yield f"complex pair {numbers}: D grows as exp({pair.growth_rate:.6g} t){alone}"
    if len(result.pairs) > MOST_PAIRS:
        yield f"and {len(result.pairs) - MOST_PAIRS} more: --json has all {len(result.pairs)}"


def _gain_of(packing: HasConfiguration) -> dict[str, Any] | None:
    """The transient gains of a stable packing; None, with the reason, if it is unstable or too large."""
    from faultgouge.analysis.responses.transient import GAIN_DISKS, NoGainError, transient_gains

    try:
        if (size := packing.configuration.coordinates) > (most := 3 * GAIN_DISKS):
            raise NoGainError(f"it is computed of up to {most} coordinates, and this packing has {size}")
        displacement, energy = transient_gains(packing)
    except NoGainError as error:
        say(f"no gain: {error}")
        return None
    names = ("time", "window", "bound", "disk", "linear", "direction")
    gains = {"displacement": displacement.gain, "energy": energy.gain}
    return gains | {key: plain(getattr(displacement, key)) for key in names}


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
    for name, value in rules.items():
        share = "does not apply to these contacts"
        share = share if value is None else f"{value:.6g}, {value / step:.3g} of the largest"
        yield f"  {RULES[name]}: {share}"
    # infinite where nothing touches: JSON has no such number
    yield plain({"largest": float(step), "error": step.error, "certain": step.certain, "rules": rules})


@command("faultgouge examples fcc && faultgouge vibrations fcc.in -o vibrations", writes="folder", alone=True)
def vibrations(
    file: AnyPacking,
    output: NewFolder = Path("vibrations"),
    material: MaterialOf = None,
    frame: Frame = -1,
    along: Annotated[Literal["x", "y", "z"], Option(help="Where plane waves run.")] = "x",
    waves: Annotated[int, Option(min=0, help="Plane waves, from the one as long as the box.")] = 4,
) -> Results:
    """Compute how a packing vibrates: density of states, modes, softness, plane waves, elastic moduli.

    The folder gets vibrations.json, density.csv, modes.csv (of few coordinates),
    waves.csv, softness.xyz and .vtp, and pictures. Contacts stick.
    """
    from faultgouge.analysis import BadInputError, dispersion, elastic_moduli, softness
    from faultgouge.analysis import vibrations as vibrations_of
    from faultgouge.analysis.files.atomic_write import write_json, write_text
    from faultgouge.analysis.files.formats import write_packing
    from faultgouge.figures.series import draw_vibrations, draw_waves
    from faultgouge.studies.study import draw_all

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
        of_spectrum = ("frequency", "resolution", "density", "density_error", "rotation", "damping")
        of_moduli: tuple[str, ...] = ("young", "poisson", "shear", "bulk", "anisotropy", "density", "at_bound", "box")
        of_moduli += ("tensor", "antisymmetric", "wave_speeds")
        document: dict[str, Any] = {key: getattr(found, key) for key in ("largest", "counted", "zero", "negative")}
        document |= {"density": {key: getattr(found, key) for key in of_spectrum}, "modes": found.modes}
        document |= {"waves": [wave._asdict() for wave in plane], "softness": soft, "softness_error": error}
        document["moduli"] = moduli and {key: getattr(moduli, key) for key in of_moduli}
        write_json(output / "vibrations.json", plain(document))
        of_waves = {key: [getattr(wave, key) for wave in plane] for key in plane[0]._fields} if plane else {}
        for name, columns in {**document, "waves": of_waves}.items():
            if name in ("density", "modes", "waves") and columns:
                head, rows = ",".join(columns), zip(*columns.values(), strict=True)
                lines = [",".join(map(repr, map(float, row))) for row in rows]
                write_text(output / f"{name}.csv", "\n".join([head, *lines, ""]), head)
        for suffix in (".xyz", ".vtp"):
            write_packing(output / f"softness{suffix}", packing, values={"softness": soft})
    pictures = {"density": partial(draw_vibrations, found)}
    draw_all(pictures | ({"waves": partial(draw_waves, plane, moduli)} if plane else {}), output, say)
    few = "all modes" if found.modes is not None else f"window {found.resolution[0] / found.largest:.2g} of the largest"
    motions = f"{found.counted} motions with a frequency up to {found.largest / 1.01:.6g} ({few}), {found.zero} without"
    yield f"{motions} stiffness, {found.negative} with a negative eigenvalue; written to {output}"
    if moduli is not None:
        yield repr(moduli).strip("<>")


def _any_packing(file: Path, frame: int, material: str | None) -> Packing | Configuration:
    """A stored packing, or the spheres of a table."""
    from faultgouge.analysis.files.contact_tables import material_of, of_material
    from faultgouge.analysis.files.formats import read_particles
    from faultgouge.door import load

    if material is None and file.suffix in (".csv", ".txt", ".dump", ".data"):
        raise typer.BadParameter(f"{file} is a table: give its --material, as in young=7e10,poisson=0.25,density=2500")
    return load(file, frame) if material is None else of_material(read_particles(file, frame), material_of(material))
