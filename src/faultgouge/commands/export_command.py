"""The command export: packings for other codes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..analysis.counted import counted
from ..mpi_rank import is_root
from .pictures import modes_of
from .terminal import (
    Frame,
    PackingFile,
    lock_output,
    print_line,
    progress,
    stored_packing,
)

app = typer.Typer()


@app.command(epilog="Example: faultgouge export run.h5 --mode pair -o packing.vtp")
def export(
    context: typer.Context,
    file: PackingFile,
    frame: Frame = -1,
    mode: Annotated[
        str | None,
        typer.Option("--mode", metavar="pair|N", help="Also a mode as vectors, as in `faultgouge draw`."),
    ] = None,
    frames: Annotated[
        str | None,
        typer.Option(
            "--frames",
            metavar="all|START:STOP[:STEP]",
            help="Frames of the undamped run if the file has its trajectory, else of the ramp; .xyz, .gsd or .pvd.",
        ),
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="A .vtp, .pvd, .xyz, .data, .gsd or .csv.")] = Path(
        "packing.vtp"
    ),
) -> None:
    """Write a stored packing for ParaView (.vtp), OVITO and ASE (.xyz), LAMMPS (.data) or HOOMD (.gsd).

    The file contains disks with radii, net forces and mobilised friction; contacts
    with forces and slips (in .vtp as lines); modes as vectors (not in .data). A .csv
    has a row for each contact.
    `faultgouge import` reads .xyz, .data and .gsd back unchanged, to the bit. A .gsd
    needs pip install 'faultgouge[export]'. With --frames the file is a film of
    displacements; a .pvd for ParaView comes with a folder of .vtp.
    """
    from faultgouge.analysis import Configuration
    from faultgouge.analysis.files.formats import ModeVectors, check_writer, write_packing
    from faultgouge.analysis.files.formats.tables import HEAD_OF_CONTACTS

    lock_output(context, output, file, head=HEAD_OF_CONTACTS if output.suffix == ".csv" else "")
    if frames is not None:
        if mode is not None or frame != -1:
            raise typer.BadParameter("--frames stands without --frame and --mode: leave these out")
        _export_frames(file, frames, output)
        return
    packing = stored_packing(file, frame)
    check_writer(output, mode is not None)
    if not is_root():
        return
    modes = [] if mode is None else modes_of(packing, mode)[0]
    vectors = [ModeVectors(f"mode_{each.number}", each.eigenvalue, each.displacement) for each in modes]
    load = "" if isinstance(packing, Configuration) else f"F_x = {packing.fx:g}: "
    print_line(f"{load}{write_packing(output, packing, vectors)}; written to {output}")


def _export_frames(file: Path, says: str, output: Path) -> None:
    """The frames of a ramp or of an undamped run."""
    from faultgouge.analysis import PackingFileError, RunFile
    from faultgouge.analysis.files.formats import check_writer, choose_frames, frames_of, write_frames

    check_writer(output, frames=True)
    if file.suffix == ".disks":
        raise PackingFileError(f"{file} is one packing: leave --frames out, or give a run.h5.")
    if not is_root():
        return
    with RunFile(file) as run:
        numbers = choose_frames(run, says)
        write_frames(output, progress(frames_of(run, numbers), "frames", len(numbers)))
        what = "an undamped run" if "trajectory" in run.names_of_series else "equilibria"
    print_line(f"{counted(len(numbers), 'frame')} of {what}; written to {output}")
