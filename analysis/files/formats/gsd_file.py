"""GSD, HOOMD's format, in and out, by the library gsd.

GSD keeps positions, diameters, masses and orientations in float32, too coarse for overlaps. An export also has these
numbers in float64, among the logged quantities (``log/particles/faultgouge/...``), which `import` prefers; other
readers see float32. The y axis of a GSD box has its middle at zero; an export gives the height of the floor.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import PackingFileError
from ...packing.packing import Packing
from ..atomic_write import FORMAT, FORMAT_KEY, check_format, replace_whole
from ..plain_file import check_plain
from . import export_quantities
from .disks import Disks, of_columns
from .export_quantities import Frame, ModeVectors
from .optional_library import needed_library
from .text_columns import choose_frame

OWN_QUANTITIES = "particles/faultgouge/"
CONTACTS = "faultgouge/contacts"
GSD_PRECISION = "GSD keeps positions and radii in float32, about 1e-7 of a coordinate: overlaps are lost below that"


def read_gsd(path: Path, frame: int | None = None) -> Disks:
    """A frame of a GSD file; the last one by default, if all are of as many disks."""
    hoomd = needed_library("gsd.hoomd", path)
    try:
        check_plain(path)
        with hoomd.open(str(path), "r") as file:
            counts = [file[k].particles.N for k in (range(len(file)) if frame is None else ())]
            return _disks(path, file[choose_frame(path, counts or [0] * len(file), frame)])
    except (OSError, RuntimeError) as error:
        raise PackingFileError(f"{path} is no readable GSD file: {error}.") from error


def _disks(path: Path, frame: Any) -> Disks:
    log, particles, box = frame.log, frame.particles, frame.configuration.box
    own = {
        key.removeprefix(OWN_QUANTITIES): np.asarray(value)
        for key, value in log.items()
        if key.startswith(OWN_QUANTITIES)
    }
    if "x" in own:
        columns = {name: array.astype(np.float64) for name, array in own.items()}
        values = {key.removeprefix("faultgouge/"): np.ravel(value)[0] for key, value in log.items() if "/" in key}
        period, number = values.get("box_length"), values.get(FORMAT_KEY)
        check_format(None if number is None else int(number), path)
        rows = log.get(CONTACTS)
        return of_columns(
            str(path),
            columns,
            _type_names(particles),
            box_length=None if period is None else float(period),
            given=export_quantities.pick_numbers(values),
            slips=None if rows is None else export_quantities.slips_of(rows[rows[:, 0] > 0], "x_low" in columns),
        )
    if particles.diameter is None or not particles.N:
        raise PackingFileError(f"{path} has no disks with diameters.")
    place = np.asarray(particles.position, dtype=np.float64)
    turn = np.asarray(particles.orientation, dtype=np.float64)
    columns = dict(zip("xyz", place.T, strict=True)) | {
        "diameter": np.asarray(particles.diameter, dtype=np.float64),
        "mass": np.asarray(particles.mass, dtype=np.float64),
        "type": 1.0 + np.asarray(particles.typeid, dtype=np.float64),
        "angle": 2 * np.arctan2(turn[:, 3], turn[:, 0]),
    }
    return of_columns(str(path), columns, _type_names(particles), box_length=float(box[0]), remark=GSD_PRECISION)


def _type_names(particles: Any) -> list[str]:
    """The name of each particle's type; none where types have no names."""
    names = list(particles.types or [])
    known = len(names) > int(np.max(particles.typeid, initial=0))
    return [names[number] for number in particles.typeid] if known else []


def write_gsd(path: Path, frames: Iterable[Frame], modes: list[ModeVectors]) -> str:
    """Write one frame or several as GSD, and return the contents in words."""
    hoomd = needed_library("gsd.hoomd", path)
    with replace_whole(path) as new, hoomd.open(str(new), "w") as file:
        for number, each in enumerate(frames):
            frame = _frame(hoomd, each.packing)
            frame.configuration.step = number
            if each.displacement is not None:
                frame.log["particles/displacement"] = export_quantities.in_space(each.displacement)
                frame.log["particles/normal_force"] = export_quantities.disk_pressure(each.packing)
            frame.log |= {f"faultgouge/{key}": np.array([value]) for key, value in each.number.items()}
            if each.whole:
                frame.log |= _forces(each.packing)
            for mode in modes:
                frame.log[f"particles/{mode.name}"] = np.ascontiguousarray(mode.displacement.real.T)
                frame.log[f"particles/{mode.name}_imag"] = np.ascontiguousarray(mode.displacement.imag.T)
            file.append(frame)
    return f"{GSD_PRECISION}; the logged quantities have all of the packing in float64, and import takes these"


def _forces(packing: Packing) -> dict[str, np.ndarray]:
    """The slips, and the forces that follow from them."""
    # gsd has no empty arrays: a row of zeros stands for no contact
    rows = export_quantities.contact_rows(packing)
    return {
        CONTACTS: rows if len(rows) else np.zeros((1, 4 if packing.compensated else 3)),
        "particles/net_force": export_quantities.in_space(export_quantities.disk_force(packing)[:, :2]),
        "particles/normal_force": export_quantities.disk_pressure(packing),
        "particles/mobilised": export_quantities.disk_mobilised(packing),
    }


def _frame(hoomd: Any, packing: Packing) -> Any:
    """The disks, the box, law and load."""
    frame, n = hoomd.Frame(), len(packing)
    x, y = packing.position.T
    box = packing.box_length
    width = box if box is not None else 2 * (np.abs(x).max() + packing.radius.max())
    height = 2 * (y + packing.radius).max()  # so that y = 0 is in the middle, and the floor stays there
    frame.configuration.box = [width, height, 0, 0, 0, 0]
    frame.configuration.dimensions = 2
    particles = frame.particles
    particles.N, particles.types = n, ["bed", "top"]
    shifted = x - width * np.floor(x / width + 0.5) if box is not None else x
    particles.position = np.column_stack([shifted, y, np.zeros(n)])
    particles.diameter, particles.mass = 2 * packing.radius, packing.mass
    particles.typeid = packing.top.astype(np.uint32)
    half = 0.5 * packing.angle
    particles.orientation = np.column_stack([np.cos(half), np.zeros((n, 2)), np.sin(half)])
    particles.moment_inertia = np.column_stack(
        [np.zeros((n, 2)), packing.inertia_factor * packing.mass * packing.radius**2]
    )
    columns = {"x": x, "y": y, "radius": packing.radius, "mass": packing.mass, "angle": packing.angle}
    columns |= {"top": packing.top.astype(np.float64)}
    if packing.position_low is not None:
        columns |= {"x_low": packing.position_low[:, 0], "y_low": packing.position_low[:, 1]}
    frame.log = {
        OWN_QUANTITIES + name: np.ascontiguousarray(column, dtype=np.float64) for name, column in columns.items()
    }
    numbers = export_quantities.scalars(packing) | ({} if box is None else {"box_length": box}) | {FORMAT_KEY: FORMAT}
    frame.log |= {f"faultgouge/{key}": np.array([value], dtype=np.float64) for key, value in numbers.items()}
    return frame
