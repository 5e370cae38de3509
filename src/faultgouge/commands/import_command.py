"""The command import: packings of other codes, and decks of LAMMPS, as run.h5."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..analysis.counted import counted
from ..mpi_rank import is_root
from ..signal_guard import keeps
from .stability import first_sentence
from .terminal import lock_output, print_line, say, status

if TYPE_CHECKING:
    from faultgouge.analysis import Configuration, Packing
    from faultgouge.analysis.files.formats import Disks
    from faultgouge.pywrap import Scene

app = typer.Typer()

SourceFile = Annotated[
    Path,
    typer.Argument(
        metavar="FILE",
        help="A LAMMPS deck (.in), or a restart that was kept with its deck (NAME.restart beside NAME.restart.in); or "
        "LAMMPS data, dump or restart (atom style sphere), NAME.disks, CSV, extended XYZ, GSD, packing.json, or a file "
        "that MDAnalysis reads with radii.",
        show_default=False,
    ),
]

UpperLayer = Annotated[
    str | None,
    typer.Option(
        metavar="LAYER",
        help="The upper layer: a number of highest disks that touch something, type:2 or type:NAME, ids:1,4,7-9, "
        "ids:@FILE, group:NAME of a restart, "
        "or a region such as 'y>10 and x<5'. By default the upper layer of the file.",
    ),
]

LawOfScene = Annotated[
    Path | None, typer.Option(help="Law, load, damping and inertia of this scene.", show_default=False)
]

Period = Annotated[
    str | None, typer.Option(metavar="L|open", help="Period along x, or open sides; by default as in the file.")
]

SlipsFile = Annotated[
    Path | None,
    typer.Option(
        help="A table of contacts: slips (CSV with id1, id2, 0 being the floor, slip; or a LAMMPS dump local); with "
        "--material forces, of YADE, MercuryDPM (.fstat), LIGGGHTS or LAMMPS, or measured ones (RigidLibrary)."
    ),
]


@app.command(
    "import",
    epilog="Example: faultgouge examples pour && faultgouge import pour.in -o packing.h5",
)
def import_(
    context: typer.Context,
    file: SourceFile,
    output: Annotated[Path, typer.Option("-o", "--output", help="The run.h5 to write.")] = Path("packing.h5"),
    top: UpperLayer = None,
    scene: LawOfScene = None,
    kn: Annotated[float | None, typer.Option(help="Normal stiffness, without a scene.", show_default=False)] = None,
    kt: Annotated[str | None, typer.Option(help="Tangential stiffness: a number, or '2/7 kn'.")] = None,
    mu: Annotated[float | None, typer.Option(help="Friction coefficient; 1 by default.", show_default=False)] = None,
    exponent: Annotated[float | None, typer.Option(help="1.5 (Hertz, the default) or 1.", show_default=False)] = None,
    fy: Annotated[float | None, typer.Option(help="Load on each disk of the layer.", show_default=False)] = None,
    fx: Annotated[float | None, typer.Option(help="Shear force on each disk of the layer; 0 by default.")] = None,
    inertia: Annotated[float | None, typer.Option(help="I_0 in I = I_0 m R^2; 1 by default.")] = None,
    floor: Annotated[
        float, typer.Option(help="y of the floor in the file; the packing is shifted so that the floor is at 0.")
    ] = 0.0,
    width: Period = None,
    contacts: SlipsFile = None,
    frame: Annotated[
        int | None, typer.Option(help="Number of the frame; negative numbers count from the last.")
    ] = None,
    relax: Annotated[bool, typer.Option("--relax", help="Bring a packing out of balance to rest.")] = False,
    material: Annotated[
        str | None,
        typer.Option(
            metavar="KEY=VALUE,...",
            help="For spheres of a table: young, poisson, density, friction, restitution; or kn, kt and exponent.",
        ),
    ] = None,
    columns: Annotated[
        str | None, typer.Option(metavar="NAME,...", help="Names of the columns of --contacts, with --material.")
    ] = None,
    slides: Annotated[
        bool, typer.Option("--slides", help="For a deck: contacts at Coulomb's bound slide; by default they stick.")
    ] = False,
    balance: Annotated[
        float | None,
        typer.Option(
            help="For a deck: force on a particle that may be out of balance, as a share of the mean contact force; "
            "1e-4 by default.",
            min=0.0,
            show_default=False,
        ),
    ] = None,
) -> None:
    """Run a LAMMPS deck and give the verdict on its last state, or convert a packing of another code, to a run.h5.

    spectrum, draw and the key packing.file of a scene take the run.h5. A packing in
    balance is imported unchanged, to the bit. With --relax, a packing out
    of balance comes to rest under law and load. It relaxes without friction, and
    friction then starts with zero slips. If the file has slips, it relaxes with
    friction. The command prints how far the disks moved.

    A LAMMPS deck (NAME.in, in.NAME) is run in its own folder, as lmp -in does there, and
    its last state is stored unchanged, with LAMMPS's own granular styles, disks or
    spheres. The command ends with the first sentence of the verdict. With --relax
    LAMMPS first runs on with drag until the packing rests. A state that cannot be
    taken is kept in a restart file, with a deck that goes on from it.
    """
    from faultgouge.analysis import BadInputError, PackingFileError

    if output.exists():
        raise typer.BadParameter(f"{output} exists: give another name with -o, or delete it")
    lock_output(context, output)
    if material is not None:
        _import_spheres(file, output, material, contacts, columns, -1 if frame is None else frame)
        return
    given = [top, scene, kn, kt, mu, exponent, fy, fx, inertia, width, contacts, frame]
    is_bare = not floor and all(each is None for each in given)
    kept = file.with_name(f"{file.name}.in")
    if is_bare and file.suffix == ".restart" and kept.is_file():
        file = kept
    if file.suffix == ".in" or file.name.startswith("in."):
        if not is_bare:
            raise typer.BadParameter(
                f"{file} is a deck, which says all by itself: leave all options but -o, --relax, --slides and --balance"
            )
        _import_deck(file, output, slides, balance, relax)
        return
    if slides or balance is not None:
        raise typer.BadParameter("--slides and --balance are for a LAMMPS deck (.in): leave them out")
    laws = {"kn": kn, "kt": _number_or_text(kt), "mu": mu, "exponent": exponent}
    try:
        disks = _place_disks(file, frame, floor, width, contacts)
        packing = _packing(disks, top, scene, laws | {"fy": fy, "fx": fx, "inertia_factor": inertia})
    except (PackingFileError, BadInputError) as error:
        lines = _deck_around(file) if is_bare else ""
        if not lines:
            raise
        raise type(error)(f"{error}\n{lines}") from error
    _import_disks(file, output, disks, top, packing, relax)


def _import_spheres(
    file: Path, output: Path, material: str, contacts: Path | None, columns: str | None, frame: int
) -> None:
    """Store spheres of a table with the forces of their contacts, and give the verdict that the digits allow."""
    from faultgouge.analysis.files.configuration_file import write_configuration
    from faultgouge.analysis.files.contact_tables import (
        material_of,
        read_contacts,
        read_spheres,
        verdict_within_digits,
    )
    from faultgouge.analysis.files.measured_forces import is_measured, measured_forces
    from faultgouge.analysis.progress import show_progress

    law = material_of(material)
    if contacts is not None and is_measured(contacts):
        with status("draws of the forces") as show, show_progress(show):
            found, counts = measured_forces(file, contacts, law, frame)
        if is_root():
            write_configuration(output, found, {"deck": ""})
            print_line("\n".join([f"written to {output}", *counts]))
        return
    spheres = read_spheres(file, frame)
    if contacts is None:
        found = spheres.of_material(law)
    else:
        found = read_contacts(spheres, contacts, law, None if columns is None else columns.split(","), frame)
    if not is_root():
        return
    write_configuration(output, found, {"deck": ""})
    keeps(f"{output} has been written", output)
    print_line(f"{repr(found).removeprefix('<Configuration: ').removesuffix('>')}; written to {output}")
    if contacts is None:
        print_line("\n".join(found.remarks))
    else:
        with status("stability") as show, show_progress(show):
            verdict, says = verdict_within_digits(found)
        print_line(f"{verdict}\n{says}")


def _import_disks(file: Path, output: Path, disks: Disks, top: str | None, packing: Packing, relax: bool) -> None:
    """Store a packing in balance, and say what it is."""
    from faultgouge.analysis.files.formats.disks import layer_remark

    for remark in (disks.remark, layer_remark(disks, top, packing.top)):
        if remark:
            say(f"{file}: {remark}")
    keeps(f"nothing has been written to {output} yet")
    packing = _in_balance(file, packing, relax)
    if is_root():
        _store(output, packing)
    if not packing.slips_known:
        say(f"{file} gives no tangential forces: they are taken as zero, and nothing can be said of the stability")
    contacts_of = f"{counted(len(packing.contacts), 'contact')}, {counted(len(packing.rattlers), 'rattler')}"
    print_line(
        f"{counted(len(packing), 'disk')}, {int(packing.top.sum())} of them the upper layer, {contacts_of}; residual "
        f"{packing.residual:.2g}; written to {output}"
    )


def _import_deck(file: Path, output: Path, slides: bool, balance: float | None, relaxes: bool) -> None:
    """Run a deck and keep its last state."""
    from faultgouge.analysis.files.configuration_file import write_configuration
    from faultgouge.pywrap.granular.balance import BALANCE
    from faultgouge.pywrap.granular.run_deck import run_deck

    keeps(f"nothing has been written to {output} yet")
    text = file.read_text(errors="replace") if file.is_file() else ""  # a deck may move its own file
    with status(f"{file}: LAMMPS runs") as show:
        allowed = BALANCE if balance is None else balance
        configuration = run_deck(
            file, slides=slides, balance=allowed, relaxes=relaxes, keep=output, notice=say, show=show
        )
    keeps(f"{output} has been written; whether the packing is stable says `faultgouge stability {output}`", output)
    if is_root():
        write_configuration(output, configuration, {"deck": text})
    print_line(f"{repr(configuration).removeprefix('<Configuration: ').removesuffix('>')}; written to {output}")
    print_line(_time_steps(configuration))
    if is_root():
        print_line(first_sentence(configuration))


AROUND = """\
pair_style gran/hertz/history 1e5 NULL 50 NULL 0.5 1   # the contact law: KN KT GAMMA_N GAMMA_T MU
pair_coeff * *
fix floor all wall/gran hertz/history 1e5 NULL 50 NULL 0.5 1 zplane 0 NULL contacts
fix load all gravity 1.0 vector 0 0 -1
fix move all nve/sphere
fix drag all viscous 1.0
timestep 1e-4
run 100000   # until it rests; 0 for a restart at rest"""


def _deck_around(file: Path) -> str:
    """Lines of a deck for a restart or data file of LAMMPS, to be filled in; empty for other files."""
    from faultgouge.analysis.files.formats import RESTART_BEGINNING

    if not file.is_file():
        return ""
    with file.open("rb") as stream:
        first = stream.readline(500)
    head = first.decode(errors="replace")
    if first.startswith(RESTART_BEGINNING):
        reads = f"comm_modify vel yes\nread_restart {file.name}"
    elif head.startswith("LAMMPS data file"):
        units = (re.findall(r"units = (\w+)", head) or ["lj"])[0]
        reads = f"units {units}\natom_style sphere\nboundary f f f\ncomm_modify vel yes\nread_data {file.name}"
    else:
        return ""
    deck = file.with_suffix(".in").name
    return (
        f"For spheres, or any other law, write a deck beside it, here {deck} with the laws and walls of the run that "
        f"made the file, and give `faultgouge import {deck}`:\n\n{reads}\n{AROUND}"
    )


def _time_steps(configuration: Configuration) -> str:
    """The largest stable time step beside the time step by the speed of Rayleigh's wave."""
    from faultgouge.analysis import rayleigh_timestep, stable_timestep

    found, usual = stable_timestep(configuration), rayleigh_timestep(configuration)
    if usual is None:
        return f"largest stable time step {found:.4g}"
    return f"largest stable time step {found:.4g}, {found / usual:.3g} of Rayleigh's formula ({usual:.4g})"


def _place_disks(file: Path, frame: int | None, floor: float, width: str | None, contacts: Path | None) -> Disks:
    """The disks of the file; options replace numbers of the file."""
    from dataclasses import replace

    from faultgouge.analysis.files.formats.tables import read_slips
    from faultgouge.pywrap.lammps.restart_file import read_disks

    disks = read_disks(file, frame).above(floor)
    if width is not None:
        disks = replace(disks, box_length=_width(width))
    if contacts is None:
        return disks
    given = {key: value for key, value in disks.given.items() if key != "slips_known"}
    return replace(disks, slips=read_slips(contacts, disks.length_unit), given=given)


def _width(text: str) -> float | None:
    if text == "open":
        return None
    value = _number_or_text(text)
    if not (isinstance(value, float) and value > 0):
        raise typer.BadParameter(f"--width {text}: give the period along x, above 0, or open")
    return value


def _number_or_text(text: str | None) -> float | str | None:
    try:
        return None if text is None else float(text)
    except ValueError:
        return text


def _packing(disks: Disks, top: str | None, scene: Path | None, options: dict[str, Any]) -> Packing:
    """The packing under the law and the load of the scene, of the options, or of the file."""
    from faultgouge.analysis.files.formats import packing_of, upper_layer
    from faultgouge.pywrap.settling.settle import law_of, load_of

    options = {key: value for key, value in options.items() if value is not None}
    decided = [f"--{key.removesuffix('_factor')}" for key in options if key != "fx"]
    if scene is not None and decided:
        raise typer.BadParameter(f"{decided[0]} cannot stand beside --scene, which decides it: leave one out")
    values = options if scene else {**disks.given, **options}
    _refuse_gaps(disks, top, scene, values)
    layer = upper_layer(disks, top)
    wanted = _scene(scene, values, float(disks.radius.min()))
    load = load_of(wanted) | {"fx": 0.0} | {key: values[key] for key in ("fx", "inertia_factor") if key in values}
    return packing_of(disks, law_of(wanted, wanted.law.mus[0]), layer, **load)


def _refuse_gaps(disks: Disks, top: str | None, scene: Path | None, values: dict[str, Any]) -> None:
    """Say in one sentence all that neither file nor options say, with the command that would do."""
    from faultgouge.analysis import BadInputError
    from faultgouge.analysis.files.formats.disks import LAYER_WAYS

    gaps = {"--top 10": "which disks are the upper layer"} if top is None and disks.top is None else {}
    if scene is None and "kn" not in values:
        gaps["--kn 2e5"] = "the normal stiffness"
    if scene is None and "fy" not in values:
        gaps["--fy 3"] = "the load on each disk of the upper layer"
    if not gaps:
        return
    *others, last = gaps.values()
    missing = f"{', '.join(others)} and {last}" if others else last
    ways = f"; --top takes {LAYER_WAYS}" if "--top 10" in gaps else ""
    example = f"faultgouge import ... {' '.join(gaps)}"
    options = " ".join(each.split()[0] for each in gaps)
    raise BadInputError(f"{disks.source} does not say {missing}: add {options}, as in `{example}`{ways}")


def _scene(scene: Path | None, values: dict[str, Any], smallest: float) -> Scene:
    """The scene, or a scene made of options and file; its disks have the smallest radius of the packing."""
    from faultgouge.pywrap.scenes.scene import Scene

    packing = {"radii": [smallest], "width": 20 * smallest}
    if scene is not None:
        return Scene.from_toml(scene, packing=packing, command="settle")
    damping = {key: values[key] for key in ("cn", "ct", "tau") if key in values}
    law: dict[str, Any] = {key: values[key] for key in ("kn", "kt", "mu", "exponent") if key in values}
    law["history"] = next((name for name in ("rescaled", "coulomb") if values.get(name)), "total")
    sections = {"packing": packing, "law": law, "load": {"fy": values["fy"]}}
    return Scene.from_mapping(sections | ({"damping": damping} if damping else {}))


def _in_balance(file: Path, packing: Packing, relax: bool) -> Packing:
    """The packing if it is in balance, else brought to rest if that is wanted."""
    from faultgouge.analysis import PackingFileError
    from faultgouge.pywrap.settling.relax import bring_to_rest
    from faultgouge.pywrap.settling.settle import LARGEST_IMBALANCE

    if len(packing.contacts) and packing.residual <= LARGEST_IMBALANCE * packing.fy:
        return packing
    if not relax:
        feels = f"a disk feels {packing.residual:.3g}" if len(packing.contacts) else "no disk touches another"
        raise PackingFileError(
            f"{file} is not in balance under fy = {packing.fy:g}: {feels}; check law and load, or let it come to rest "
            "with --relax."
        )
    with status("coming to rest") as show:
        found, words = bring_to_rest(packing, watch=lambda what: show(f"coming to rest: {what}"))
    print_line(words)
    return found.packing


def _store(output: Path, packing: Packing) -> None:
    from faultgouge.analysis import RunFile
    from faultgouge.pywrap.equilibria.quasistatic import rounding_floor

    with RunFile.create(output, packing, {"task": "import"}) as file:
        file.append(packing, floor=rounding_floor(packing), evaluations=0)
        with file.change():
            file.complete = True
