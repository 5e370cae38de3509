"""GSD, HOOMD's format, in and out.

GSD keeps positions, diameters, masses and orientations in float32, too coarse for overlaps. An export also has these
numbers in float64, among the logged quantities (``log/particles/faultgouge/...``), which `import` prefers; other
readers see float32. The y axis of a GSD box has its middle at zero; an export gives the height of the floor.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import PackingFileError
from ..atomic_write import FORMAT, FORMAT_KEY, replace_whole, telling
from .disks import Disks, choose_frame, particles_of
from .exported import Exported, read_back

OWN_COLUMNS = "angle", "radius", "mass", "top", "x_low", "y_low"
OWN_QUANTITIES = "particles/faultgouge/"
CONTACTS = "faultgouge/contacts"
GSD_PRECISION = "GSD keeps positions and radii in float32, about 1e-7 of a coordinate: overlaps are lost below that"


def _hoomd(path: Path) -> Any:
    with telling(path, "needs the library gsd, of pip install 'faultgouge[export]'", ImportError):
        return import_module("gsd.hoomd")


def read_gsd(path: Path, frame: int) -> Disks:
    """A frame of a GSD file."""
    with _hoomd(path).open(str(path), "r") as file:
        shown = file[choose_frame(path, len(file), frame)]
    log, particles = shown.log, shown.particles
    type_names = [particles.types[number] for number in particles.typeid] if particles.types else []
    columns = {key.removeprefix(OWN_QUANTITIES): log[key] for key in log if key.startswith(OWN_QUANTITIES)}
    if "x" in columns:
        values = {key.removeprefix("faultgouge/"): np.ravel(value)[0] for key, value in log.items() if "/" in key}
        rows = log.get(CONTACTS)
        box = np.diag([float(values["box_length"]), 1.0, 1.0]) if "box_length" in values else None
        more = read_back(path, values, None if rows is None else rows[rows[:, 0] > 0], "x_low" in columns)
    elif particles.diameter is None or not particles.N:
        raise PackingFileError(f"{path} has no disks with diameters.")
    else:
        columns = {"diameter": particles.diameter, "mass": particles.mass, "type": 1.0 + particles.typeid}
        columns |= dict(zip("xyz", particles.position.T, strict=True))
        x, y, z, xy, xz, yz = (float(each) for each in shown.configuration.box)
        box = np.array([[x, 0, 0], [xy * y, y, 0], [xz * z, yz * z, z]])
        more = {"origin": -0.5 * box.sum(axis=0)}
    numbers = {name: np.asarray(column, dtype=np.float64) for name, column in columns.items()}
    return particles_of(path, numbers, box, type_names=type_names, **more)


def write_gsd(path: Path, frames: Iterable[tuple[float, Exported]]) -> str:
    """Write one frame or several, and return the contents in words."""
    hoomd = _hoomd(path)
    with replace_whole(path) as new, hoomd.open(str(new), "w") as file:
        for number, (_, exported) in enumerate(frames):
            frame = hoomd.Frame()
            frame.configuration.step = number
            _fill(frame, exported)
            file.append(frame)
    return f"{GSD_PRECISION}; the logged quantities are in float64, and import takes those of a packing of disks"


def _fill(frame: Any, e: Exported) -> None:
    """The columns as particles of GSD, within a box whose middle is at 0.

    Of a Packing y = 0 is in the middle, so that the floor stays there.
    """
    radius, mass, flat = e.particles["radius"], e.particles["mass"], "fy" in e.numbers
    angle, zeros = e.particles.get("angle", np.zeros(len(radius))), np.zeros((len(radius), 2))
    box, middle = e.box.copy(), np.zeros(3) if e.origin is None else e.origin + 0.5 * e.box.sum(axis=0)
    if flat:
        box[1, 1] = 2 * (e.position[:, 1] + radius).max()
        box[0, 0] = box[0, 0] if e.periodic[0] else 2 * (np.abs(e.position[:, 0]).max() + radius.max())
    none = np.flatnonzero(np.diag(box) == 0)
    box[none, none] = np.ptp(e.position, axis=0)[none] + 2 * radius.max()
    images = np.floor((e.position - middle) @ np.linalg.inv(box) + 0.5) * e.periodic
    (xx, yy, zz), particles = np.diag(box), frame.particles
    frame.configuration.box = [xx, yy, 0 if flat else zz, box[1, 0] / yy, box[2, 0] / zz, box[2, 1] / zz]
    frame.configuration.dimensions = 2 if flat else 3
    particles.N, particles.types, particles.typeid = len(radius), ["bed", "top"], e.source.top.astype(np.uint32)
    particles.position, particles.diameter, particles.mass = e.position - middle - images @ box, 2 * radius, mass
    particles.orientation = np.column_stack([np.cos(0.5 * angle), zeros, np.sin(0.5 * angle)])
    inertia = e.numbers.get("inertia_factor", 0.4) * mass * radius**2
    particles.moment_inertia = np.column_stack([zeros if flat else np.tile(inertia, (2, 1)).T, inertia])
    own = {"x": e.position[:, 0], "y": e.position[:, 1], "angle": angle} | e.particles
    logged = {OWN_QUANTITIES + name: own[name] for name in ("x", "y", *OWN_COLUMNS) if flat and name in own}
    logged |= {f"particles/{name}": values for name, values in e.particles.items() if name not in (*OWN_COLUMNS, "id")}
    logged |= {f"faultgouge/{key}": np.array([value]) for key, value in ({FORMAT_KEY: FORMAT} | e.numbers).items()}
    if e.rows is not None:  # gsd has no empty arrays: a row of zeros stands for no contact
        logged[CONTACTS] = e.rows if len(e.rows) else np.zeros((1, e.rows.shape[1]))
    frame.log = {name: np.ascontiguousarray(values, dtype=np.float64) for name, values in logged.items()}
