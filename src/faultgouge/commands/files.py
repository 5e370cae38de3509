"""The commands import and export: packings of other codes and decks of LAMMPS as run.h5, and packings for others."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Argument, Option

from ..analysis.counted import counted
from ..signal_guard import is_root, keeps
from .packings import MaterialOf, verdict_of
from .pictures import modes_of
from .terminal import (
    RAMPED,
    Frame,
    PackingFile,
    Results,
    command,
    locked,
    progress,
    say,
    status,
    stored_packing,
    working,
)

OF_SOURCE = "A deck (.in); LAMMPS data, dump or restart; NAME.disks, CSV, XYZ, GSD, JSON; of YADE and MercuryDPM."
OF_LAYER = "The upper layer: a number of highest disks, type:2, ids:1,4,7-9, group:NAME, or a region such as 'y>10'."
OF_CONTACTS = "A table of contacts: slips (id1, id2, slip; 0 is the floor); with --material forces, of many codes."


@command("faultgouge examples pour && faultgouge import pour.in -o packing.h5", writes="new")
def import_(
    file: Annotated[Path, Argument(metavar="FILE", help=OF_SOURCE)],
    output: Annotated[Path, Option("-o", "--output", help="The run.h5 to write.")] = Path("packing.h5"),
    top: Annotated[str | None, Option(metavar="LAYER", help=OF_LAYER)] = None,
    scene: Annotated[Path | None, Option(help="Law, load, damping and inertia of this scene.")] = None,
    kn: Annotated[float | None, Option(help="Normal stiffness, without a scene.")] = None,
    mu: Annotated[float | None, Option(help="Friction coefficient; 1 by default.")] = None,
    fy: Annotated[float | None, Option(help="Load on each disk of the layer.")] = None,
    fx: Annotated[float | None, Option(help="Shear force on each disk of the layer; 0 by default.")] = None,
    floor: Annotated[float | None, Option(help="y of the floor in the file; the packing is shifted to 0.")] = None,
    width: Annotated[str | None, Option(metavar="L|open", help="Period along x; that of the file by default.")] = None,
    contacts: Annotated[Path | None, Option(help=OF_CONTACTS)] = None,
    frame: Annotated[int | None, Option(help="Number of the frame; negative numbers count from the last.")] = None,
    relax: Annotated[bool, Option("--relax", help="Bring a packing out of balance to rest.")] = False,
    material: MaterialOf = None,
    columns: Annotated[str | None, Option(metavar="NAME,...", help="Columns of --contacts, with --material.")] = None,
    balance: Annotated[float | None, Option(min=0.0, help="Of a deck: imbalance over mean contact force.")] = None,
) -> Results:
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
    from faultgouge.door import is_deck

    if material is not None:
        yield from _spheres(file, output, material, contacts, columns, -1 if frame is None else frame)
        return
    options: dict[str, Any] = {"kn": kn, "mu": mu, "fy": fy, "fx": fx, "top": top, "scene": scene, "floor": floor}
    options |= {"width": width, "contacts": contacts, "frame": frame}
    given = {key: value for key, value in options.items() if value is not None}
    kept = file.with_name(f"{file.name}.in")
    if not given and file.suffix == ".restart" and kept.is_file():
        file = kept
    if is_deck(file) and given:
        raise typer.BadParameter(f"{file} is a deck: only -o, --relax and --balance go with it")
    if not is_deck(file) and balance is not None:
        raise typer.BadParameter("--balance is for a LAMMPS deck (.in): leave it out")
    keeps(f"nothing has been written to {output} yet")
    yield from _deck(file, output, relax, balance) if is_deck(file) else _disks(file, output, relax, given)


def _deck(file: Path, output: Path, relax: bool, balance: float | None) -> Results:
    """Store what a deck leaves; its largest stable time step beside Rayleigh's, and whether it is stable."""
    from faultgouge.analysis import rayleigh_timestep, stable_timestep
    from faultgouge.analysis.files.configuration_file import write_configuration
    from faultgouge.pywrap.granular.balance import BALANCE
    from faultgouge.pywrap.granular.run_deck import run_deck

    text = file.read_text(errors="replace") if file.is_file() else ""  # a deck may move its own file
    balance = BALANCE if balance is None else balance
    with status(f"{file}: LAMMPS runs") as show:
        found = run_deck(file, balance=balance, relaxes=relax, keep=output, show=show)
    keeps(f"{output} has been written; whether the packing is stable says `faultgouge stability {output}`")
    if not is_root():
        return
    write_configuration(output, found, {"deck": text})
    yield f"{repr(found).removeprefix('<Configuration: ').removesuffix('>')}; written to {output}"
    step, usual = stable_timestep(found), rayleigh_timestep(found)
    beside = "" if usual is None else f", {step / usual:.3g} of Rayleigh's formula ({usual:.4g})"
    yield f"largest stable time step {step:.4g}{beside}"
    verdict = verdict_of(found)
    yield "\n".join([verdict.sentences[0], *verdict.remarks])


def _spheres(
    file: Path, output: Path, material: str, contacts: Path | None, columns: str | None, frame: int
) -> Results:
    """Store spheres of a table with the forces of their contacts, and give the verdict that the digits allow."""
    from faultgouge.analysis.files.configuration_file import write_configuration
    from faultgouge.analysis.files.contact_tables import material_of, of_material, read_contacts, verdict_within_digits
    from faultgouge.analysis.files.formats import read_particles
    from faultgouge.analysis.files.measured_forces import is_measured, measured_forces

    if not is_root():
        return
    law, names = material_of(material), None if columns is None else columns.split(",")
    says: list[str] = []
    if contacts is None:
        found = of_material(read_particles(file, frame), law)
        says = [*found.remarks]
    elif is_measured(contacts):
        with working("draws of the forces"):
            found, says = measured_forces(file, contacts, law, frame)
    else:
        found = read_contacts(read_particles(file, frame), contacts, law, names, frame)
    write_configuration(output, found, {"deck": ""})
    keeps(f"{output} has been written")
    yield f"{repr(found).removeprefix('<Configuration: ').removesuffix('>')}; written to {output}"
    if contacts is not None and not says:
        with working("stability"):
            says = [*map(str, verdict_within_digits(found))]
    yield "\n".join(says)


def _disks(file: Path, output: Path, relax: bool, given: dict[str, Any]) -> Results:
    """Store disks of another code in balance, or brought to rest if that is wanted, and say what they are."""
    from faultgouge.analysis import BadInputError, PackingFileError, RunFile
    from faultgouge.analysis.files.formats import DATA, RESTART, format_of
    from faultgouge.analysis.files.formats.tables import read_slips
    from faultgouge.door import packing_under
    from faultgouge.pywrap.equilibria.quasistatic import rounding_floor
    from faultgouge.pywrap.lammps.restart_file import read_disks
    from faultgouge.pywrap.scenes.scene import Scene
    from faultgouge.pywrap.settling.relax import bring_to_rest
    from faultgouge.pywrap.settling.settle import LARGEST_IMBALANCE, law_of, load_of

    load: dict[str, Any] = {key: given[key] for key in ("kn", "mu", "fy", "fx") if key in given}
    if "scene" in given and (decided := [f"--{key}" for key in load if key != "fx"]):
        raise typer.BadParameter(f"{decided[0]} cannot stand beside --scene, which decides it: leave one out")
    width, law = given.get("width", "open"), None
    if not re.fullmatch(r"open|[\d.]*[1-9][\d.]*(e[-+]?\d+)?", width):
        raise typer.BadParameter(f"--width {width}: give the period along x, above 0, or open")
    try:
        disks = read_disks(file, given.get("frame")).above(given.get("floor", 0.0))
        if "width" in given:
            disks = replace(disks, box_length=None if width == "open" else float(width))
        if "contacts" in given:
            known = {key: value for key, value in disks.given.items() if key != "slips_known"}
            disks = replace(disks, slips=read_slips(given["contacts"]), given=known)
        if "scene" in given:
            any_of_size = {"radii": [smallest := float(disks.radius.min())], "width": 20 * smallest}
            scene = Scene.from_toml(given["scene"], packing=any_of_size, command="settle")
            law, load = law_of(scene), {"fx": 0.0} | load_of(scene) | load
        packing = packing_under(disks, law, load, given.get("top"))
    except (PackingFileError, BadInputError) as error:
        if given or not file.is_file() or format_of(file) not in (DATA, RESTART):
            raise
        reads = "read_restart" if format_of(file) is RESTART else "units lj, atom_style sphere and read_data"
        says = f"For spheres, or another law, write a deck with {reads} {file.name}, its laws, its walls and a run,"
        raise type(error)(f"{error} {says} and give it to faultgouge import.") from error
    if not len(packing.contacts) or packing.residual > LARGEST_IMBALANCE * packing.fy:
        if not relax:
            feels = f"a disk feels {packing.residual:.3g}" if len(packing.contacts) else "no disk touches another"
            raise PackingFileError(f"{file} is not in balance under fy = {packing.fy:g}: {feels}; --relax mends it.")
        with status("coming to rest") as show:
            resting, words = bring_to_rest(packing, watch=lambda what: show(f"coming to rest: {what}"))
        yield words
        packing = resting.packing
    if is_root():
        with RunFile.create(output, packing, {"task": "import"}) as run:
            run.append(packing, floor=rounding_floor(packing), evaluations=0)
            with run.change():
                run.complete = True
    if not packing.slips_known:
        say(f"{file} gives no tangential forces: they are taken as zero, and nothing can be said of the stability")
    disks_of = f"{counted(len(packing), 'disk')}, {int(packing.top.sum())} of them the upper layer"
    contacts_of = f"{counted(len(packing.contacts), 'contact')}, {counted(len(packing.rattlers), 'rattler')}"
    yield f"{disks_of}, {contacts_of}; residual {packing.residual:.2g}; written to {output}"


@command(f"{RAMPED} && faultgouge export run.h5 --mode pair", alone=True)
def export(
    file: PackingFile,
    frame: Frame = -1,
    mode: Annotated[str | None, Option("--mode", metavar="pair|N", help="Also a mode, as of `draw`.")] = None,
    frames: Annotated[str | None, Option(metavar="all|START:STOP[:STEP]", help="A film; .xyz, .gsd, .pvd.")] = None,
    output: Annotated[Path, Option("-o", "--output", help=".vtp, .pvd, .xyz, .data, .gsd, .csv")] = Path("packing.vtp"),
) -> Results:
    """Write a stored packing for ParaView (.vtp), OVITO and ASE (.xyz), LAMMPS (.data) or HOOMD (.gsd).

    The file contains disks with radii, net forces and mobilised friction; contacts
    with forces and slips (in .vtp as lines); modes as vectors (not in .data). A .csv
    has a row for each contact.
    `faultgouge import` reads .xyz, .data and .gsd back unchanged, to the bit. A .gsd
    needs pip install 'faultgouge[export]'. With --frames the file is a film of
    displacements; a .pvd for ParaView comes with a folder of .vtp.
    """
    from faultgouge.analysis import RunFile
    from faultgouge.analysis.files.formats import (
        ModeVectors,
        check_writer,
        choose_frames,
        frames_of,
        write_frames,
        write_packing,
    )
    from faultgouge.analysis.files.formats.tables import HEAD_OF_CONTACTS

    with locked(output, file, head=HEAD_OF_CONTACTS if output.suffix == ".csv" else ""):
        if frames is not None:
            if mode is not None or frame != -1:
                raise typer.BadParameter("--frames stands without --frame and --mode: leave these out")
            check_writer(output, frames=True)
            with RunFile(file) as run:
                numbers = choose_frames(run, frames)
                write_frames(output, progress(frames_of(run, numbers), "frames", len(numbers)))
                what = "an undamped run" if "trajectory" in run.names_of_series else "equilibria"
            yield f"{counted(len(numbers), 'frame')} of {what}; written to {output}"
            return
        packing = stored_packing(file, frame)
        check_writer(output, mode is not None)
        modes = [] if mode is None else modes_of(packing, mode)[0]
        vectors = [ModeVectors(f"mode_{each.number}", each.eigenvalue, each.displacement) for each in modes]
        load = f"F_x = {packing.fx:g}: " if packing.top.any() else ""
        yield f"{load}{write_packing(output, packing, vectors)}; written to {output}"
