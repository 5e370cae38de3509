"""The commands vibrations and timestep: a packing as a material, for any code."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..mpi_rank import is_root
from .terminal import Answer, Frame, NewFolder, command, lock_folder, print_line, refuse_scene, say, status

if TYPE_CHECKING:
    from ..analysis import Configuration, ElasticModuli, Packing, PlaneWave, Vibrations

app = typer.Typer()

AnyPacking = Annotated[
    Path,
    typer.Argument(
        metavar="FILE",
        help="run.h5, NAME.disks, a LAMMPS deck; or, with --material, a table of spheres (CSV, dump, YADE, .data).",
        show_default=False,
        callback=refuse_scene,
    ),
]
MaterialOf = Annotated[
    str | None,
    typer.Option(
        "--material",
        metavar="KEY=VALUE,...",
        help="Of a table: young, poisson, density, friction, restitution; or kn, kt and exponent (1.5 or 1) for young.",
    ),
]


@command(app, "faultgouge settle scene.toml -o run.h5 && faultgouge timestep run.h5")
def timestep(file: AnyPacking, material: MaterialOf = None, frame: Frame = -1) -> Answer:
    """Compute the largest stable time step of a packing, beside the rules that users have.

    It is the step of velocity Verlet with the packing's own contacts and dashpots, and
    so a limit for any code with that integrator. A step of a fifth of it is usual.
    """
    from faultgouge.analysis import timestep_rules

    configuration = _packing(file, frame, material).configuration
    with status(f"{file}: time step"):
        step, rules = timestep_rules(configuration)
    error = f" (at most {step.error:.2g} shorter)" if step.error else ""
    says = [
        f"{configuration!r}".removeprefix("<Configuration: ").removesuffix(">"),
        f"largest stable time step {step:.6g}{error}; all steps up to {step.certain:.6g} are stable for certain",
    ]
    names = {
        "rayleigh": "Rayleigh's formula (Li, Xu and Thornton), of which 0.1 to 0.3 is usual",
        "o_sullivan_bray": "0.17 sqrt(m/k) (O'Sullivan and Bray)",
        "oscillator": "2 sqrt(m/k), one sphere on one spring",
        "p_wave": "R sqrt(rho/E) with k = E R, a sound wave through a sphere (YADE)",
    }
    for name, value in rules.items():
        what = (
            "does not apply to these contacts" if value is None else f"{value:.6g}, {value / step:.3g} of the largest"
        )
        says.append(f"  {names[name]}: {what}")
    document = {"largest": float(step), "error": step.error, "certain": step.certain, "rules": rules}
    # infinite where nothing touches: JSON has no such number
    return Answer(says, {key: None if value == float("inf") else value for key, value in document.items()})


@app.command(epilog="Example: faultgouge vibrations packing.h5 -o vibrations")
def vibrations(
    file: AnyPacking,
    output: NewFolder = Path("vibrations"),
    material: MaterialOf = None,
    frame: Frame = -1,
    along: Annotated[str, typer.Option(metavar="x|y|z", help="Edge of the box along which plane waves run.")] = "x",
    waves: Annotated[int, typer.Option(min=0, help="Plane waves, from the one as long as the box.")] = 4,
) -> None:
    """Compute how a packing vibrates: density of states, modes, softness, plane waves, elastic moduli.

    The folder gets vibrations.json, density.csv, modes.csv (of few coordinates),
    waves.csv, softness.xyz and .vtp, and pictures. Contacts stick.
    """
    from faultgouge.analysis import BadInputError, dispersion, elastic_moduli, softness
    from faultgouge.analysis import vibrations as vibrations_of
    from faultgouge.analysis.progress import show_progress

    if along not in ("x", "y", "z"):
        raise typer.BadParameter(f"--along {along}: give x, y or z")
    packing = _packing(file, frame, material)
    if not is_root():
        return
    with lock_folder(output), status(f"{file}: vibrations") as show, show_progress(show):
        found = vibrations_of(packing)
        soft, error = softness(packing)
        plane: list[PlaneWave] = []
        moduli: ElasticModuli | None = None
        try:
            plane = dispersion(packing, "xyz".index(along), waves)
            moduli = elastic_moduli(packing)
        except BadInputError as reason:
            say(f"{reason}")
        _write(output, packing, found, soft, error, plane, moduli)
        _draw(output, found, plane, moduli)
    few = "all modes" if found.modes is not None else f"window {found.resolution[0] / found.largest:.2g} of the largest"
    print_line(
        f"{found.counted} motions with a frequency up to {found.largest / 1.01:.6g} ({few}), {found.zero} without "
        f"stiffness, {found.negative} with a negative eigenvalue; written to {output}"
    )
    if moduli is not None:
        print_line(repr(moduli).strip("<>"))


def _packing(file: Path, frame: int, material: str | None) -> Packing | Configuration:
    """A stored packing, or the spheres of a table."""
    from faultgouge.analysis.files.contact_tables import material_of, read_spheres
    from faultgouge.stored_files import load

    if material is None and file.suffix in (".csv", ".txt", ".dump", ".data"):
        raise typer.BadParameter(f"{file} is a table: give its --material, as in young=7e10,poisson=0.25,density=2500")
    return load(file, frame) if material is None else read_spheres(file, frame).of_material(material_of(material))


def _columns(found: Vibrations) -> dict[str, Any]:
    names = ("frequency", "resolution", "density", "density_error", "rotation", "damping")
    return {name: getattr(found, name) for name in names}


def _write(
    folder: Path, packing: Packing | Configuration, found: Vibrations, soft: Any, error: Any, plane: list[PlaneWave],
    moduli: ElasticModuli | None,
) -> None:  # fmt: skip
    import json
    from math import isfinite

    from faultgouge.analysis.files.atomic_write import write_whole
    from faultgouge.analysis.files.formats import write_packing

    def plain(values: Any) -> list[float | None]:
        return [each if isfinite(each) else None for each in values.tolist()]

    tables: dict[str, dict[str, Any]] = {"density": _columns(found)}
    if found.modes is not None:
        tables["modes"] = found.modes
    document: dict[str, Any] = {
        name: {key: plain(value) for key, value in columns.items()} for name, columns in tables.items()
    }
    document.setdefault("modes", None)
    document |= {"waves": [wave._asdict() for wave in plane], "softness": plain(soft), "softness_error": plain(error)}
    document |= {name: getattr(found, name) for name in ("largest", "counted", "zero", "negative")}
    names = ("young", "poisson", "shear", "bulk", "anisotropy", "density", "at_bound", "box")
    document["moduli"] = moduli and {name: getattr(moduli, name) for name in names} | {
        name: getattr(moduli, name).tolist() for name in ("tensor", "antisymmetric", "wave_speeds")
    }
    write_whole(folder / "vibrations.json", (json.dumps(document, indent=1) + "\n").encode())
    if plane:
        tables["waves"] = {name: [getattr(wave, name) for wave in plane] for name in plane[0]._fields}
    for name, columns in tables.items():
        rows = [",".join(map(repr, map(float, row))) for row in zip(*columns.values(), strict=True)]
        write_whole(folder / f"{name}.csv", "\n".join([",".join(columns), *rows, ""]).encode())
    for suffix in (".xyz", ".vtp"):
        write_packing(folder / f"softness{suffix}", packing, values={"softness": soft})


def _draw(folder: Path, found: Vibrations, plane: list[PlaneWave], moduli: ElasticModuli | None) -> None:
    from faultgouge.figures import save
    from faultgouge.figures.series import draw_vibrations, draw_waves
    from faultgouge.figures.style import report_failure

    with report_failure("density", say):
        save(draw_vibrations(found), folder / "density")
    if plane:
        with report_failure("waves", say):
            save(draw_waves(plane, moduli), folder / "waves")
