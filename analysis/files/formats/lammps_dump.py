"""LAMMPS text dumps of disks: those of the decks (NAME.disks) and those of any other run (dump custom).

Columns are found by name: x or xu or xs, radius or diameter, and, if present, id, type, mass, theta. Several snapshots
in a file must have the same disks; otherwise a snapshot must be chosen.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import PackingFileError
from ..dumps import DumpFrame, dump_frames, read_dump
from . import export_quantities
from .disks import Disks, of_columns
from .text_columns import choose_frame


def read_deck_dump(path: Path, frame: int | None = None) -> Disks:
    """Read a dump of write.in, with its .contacts and .params."""
    packing = read_dump(path, frame=-1 if frame is None else frame)
    return Disks(
        str(path),
        packing.position,
        packing.radius,
        np.arange(1, len(packing) + 1),
        packing.mass,
        packing.angle,
        1 + packing.top.astype(np.int64),
        packing.top,
        packing.position_low,
        packing.box_length,
        export_quantities.slips_of(export_quantities.contact_rows(packing), packing.compensated),
        export_quantities.scalars(packing),
    )


def read_custom_dump(path: Path, frame: int | None = None) -> Disks:
    """A snapshot of `dump custom`; the last one by default, if all are of the same disks."""
    shown = _snapshot(path, frame)
    source = f"{path} (step {shown.step})"
    if shown.bounds.shape[1] > 2 and np.any(shown.bounds[:, 2]):
        raise PackingFileError(f"{source} has a tilted box: give one with right angles.")
    columns = dict(zip(shown.columns, shown.rows.T, strict=True))
    for axis, (low, high) in zip("xyz", shown.bounds[:, :2], strict=True):
        for scaled in (f"{axis}s", f"{axis}su"):
            if scaled in columns and axis not in columns and f"{axis}u" not in columns:
                columns[axis] = low + (high - low) * columns[scaled]
    if not len(shown.rows):
        raise PackingFileError(f"{source} has no disks.")
    periodic = shown.boundary[:1] == ("pp",)
    return of_columns(source, columns, box_length=float(np.ptp(shown.bounds[0, :2])) if periodic else None)


def _snapshot(path: Path, frame: int | None) -> DumpFrame:
    """The snapshot that is meant; by default the last one, if all are of the same disks."""
    frames: list[DumpFrame] = []
    first: tuple[int, tuple[float, ...]] | None = None
    for shown in dump_frames(path):
        disks = _ids(shown)
        first = first or (shown.step, disks)
        if frame is None and disks != first[1]:
            raise PackingFileError(
                f"{path} has other disks at step {shown.step} ({len(shown.rows)}) than at step {first[0]} "
                f"({len(first[1])}): choose a snapshot with --frame; -1 is the last."
            )
        # of a long file the last one alone is kept, unless another is wanted
        frames = [shown] if frame is None else [*frames, shown]
    if not frames:
        raise PackingFileError(f"{path} is not a complete LAMMPS text dump: it is empty.")
    return frames[choose_frame(path, [len(shown.rows) for shown in frames], frame)]


def _ids(shown: DumpFrame) -> tuple[float, ...]:
    if "id" not in shown.columns:
        return tuple(range(len(shown.rows)))
    return tuple(sorted(shown.rows[:, shown.columns.index("id")].tolist()))
