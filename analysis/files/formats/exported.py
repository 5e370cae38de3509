"""What an export of a packing has: particles, contacts and modes as columns, whatever the format; and frames of films.

A Packing and a Configuration have the same columns, and a Packing some more, with which `import` reads it back. Law,
load and inertia are names with numbers. Contacts of a Packing are rows (first ID, second ID, slip), a second ID of 0 is
the floor, and low parts of compensated packings are a fourth column.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats
from ...configuration import Configuration
from ...contacts import LinearisedContacts
from ...errors import BadInputError
from ...packing.contacts import Contacts
from ...packing.geometry import nearest_image, touching
from ...packing.law import MindlinLaw
from ...packing.packing import Packing
from ...responses.hysteresis import turning_points
from ..atomic_write import FORMAT_KEY, check_format
from ..runfile import RunFile, law_parameters
from .disks import Slips

PARAMETER_NAMES = {*MindlinLaw.__dataclass_fields__, "tau", "fx", "fy", "inertia_factor", "slips_known"}
"""Names of law, load and inertia in files; and slips_known, 0 where the slips are not known."""


class ModeVectors(NamedTuple):
    """A mode of a packing for an export.

    Attributes
    ----------
    name : str
        Name of its fields.
    eigenvalue : complex
        lambda, 1 / time^2.
    displacement : ndarray of complex, shape (3, N)
        x, y and R theta; of a Configuration all its coordinates, shape (axes, N).
    """

    name: str
    eigenvalue: complex
    displacement: NDArray[np.complex128]


class Exported(NamedTuple):
    """The columns of an export, of a Packing or a Configuration, the `source`.

    `position`, shape (N, 3), are centres; `particles` and `contacts` columns by name, of numbers or of vectors with
    three components, whole numbers as integers. `ends`, shape (C, 2, 3), are the centre of the first particle of each
    contact, and that of the nearest image of the second, or the foot on the wall. `numbers` are law, load, inertia, the
    time of a frame, eigenvalues of modes. `box`, shape (3, 3), has the edges of the box in rows, `periodic` says along
    which it is, `origin` is its lower corner; None of a Packing. `rows`, shape (C, 3 or 4), are contacts of a Packing
    as they are read back; None where slips are not known.
    """

    source: Packing | Configuration
    position: Floats
    particles: dict[str, NDArray]
    contacts: dict[str, NDArray]
    ends: Floats
    numbers: dict[str, float]
    box: Floats
    periodic: tuple[bool, ...]
    origin: Floats | None = None
    rows: Floats | None = None


def exported(
    source: Packing | Configuration,
    modes: Sequence[ModeVectors] = (),
    displacement: Floats | None = None,
    time: float | None = None,
) -> Exported:
    """The columns of a packing; of a Packing also its `displacement` since the first frame of a film, shape (N, 2).

    With `time`, that of a frame of an undamped run, positions alone are known: the contacts of the Packing are then all
    disks that touch, and there are neither slips nor forces that follow from them.
    """
    if isinstance(source, Configuration):
        return _of_configuration(source, modes)
    p, c, g, n, rows = source, source.contacts, source.geometry, len(source), None
    particles: dict[str, NDArray] = {"id": np.arange(1, n + 1), "radius": p.radius, "mass": p.mass}
    particles |= {"top": p.top.astype(np.int64), "normal_force": _at_particles(np.add, n, c, p.normal_force)}
    contacts: dict[str, NDArray] = {"contact_i": c.i, "contact_j": c.j}
    contacts |= {"contact_normal_force": p.normal_force, "contact_overlap": g.overlap}
    if time is None:
        force = p.net_force.reshape(3, -1).T
        particles |= {"angle": p.angle, "net_force": _in_space(force[:, :2]), "torque_over_radius": force[:, 2]}
        particles["mobilised"] = _at_particles(np.maximum, n, c, p.mobilised)
        both = p.normal_force[:, None] * g.normal + p.tangential_force[:, None] * g.tangent
        contacts |= {"contact_force": _in_space(both), "contact_tangential_force": p.tangential_force}
        contacts |= {"contact_slip": c.slip, "contact_mobilised": p.mobilised}
        rows = np.column_stack([c.i + 1.0, c.j + 1.0, c.slip, *([] if c.slip_low is None else [c.slip_low])])
    if displacement is not None:
        particles["displacement"] = _in_space(displacement)
    if p.position_low is not None:
        particles |= {"x_low": p.position_low[:, 0], "y_low": p.position_low[:, 1]}
    vectors, eigenvalues = _of_modes(modes, lambda moved: (_in_space(moved[:2].T), moved[2]))
    more = {"tau": p.drag_time, "slips_known": None if p.slips_known else 0.0, "fx": p.fx, "fy": p.fy}
    more |= {"inertia_factor": p.inertia_factor, "box_length": p.box_length, "time": time}
    numbers = law_parameters(p.law) | {name: value for name, value in more.items() if value is not None}
    width = 2 * (np.ptp(p.position[:, 0]) + p.radius.max()) if p.box_length is None else p.box_length
    box = np.diag([width, (p.position[:, 1] + p.radius).max(), 2 * p.radius.max()])
    first, sides = p.position[c.i], (p.box_length is not None, False, False)
    ends = _in_space(np.stack([first, first - g.distance[:, None] * g.normal], axis=1))
    place, numbers = _in_space(p.position), numbers | eigenvalues
    return Exported(p, place, particles | vectors, contacts, ends, numbers, box, sides, rows=rows)


def _of_configuration(own: Configuration, modes: Sequence[ModeVectors]) -> Exported:
    c, n, touches = own.contacts.touching, len(own), ~own.contacts.couple
    place = np.pad(own.position, ((0, 0), (0, 3 - own.dimension)))
    particles: dict[str, NDArray] = {"radius": own.radius, "mass": own.mass, "id": own.ids, "type": own.kind}
    particles |= {"free": own.free.astype(np.float64), "load": own.load[:, 0]}
    particles |= {"net_force": own.net_force[:, 0], "net_torque": own.net_force[:, 1]}
    particles["normal_force"] = _at_particles(np.add, n, c, c.normal_force)
    particles["coordination"] = _at_particles(np.add, n, c, np.ones(len(c)))
    vectors, eigenvalues = _of_modes(modes, own.vectors)
    contacts: dict[str, NDArray] = {"contact_i": own.ids[c.i]}
    contacts["contact_j"] = np.where(c.wall, 0, own.ids[np.maximum(c.j, 0)])
    contacts["contact_force"] = c.normal_force[:, None] * c.normal + c.tangential_force
    contacts |= {f"contact_{name}": getattr(c, name) for name in ("normal_force", "tangential_force", "overlap")}
    contacts["contact_mobilised"] = own.mobilised[touches]
    ends = np.stack([place[c.i], place[c.i] - own.branch[touches]], axis=1)
    sides = tuple(map(bool, own.periodic))
    return Exported(own, place, particles | vectors, contacts, ends, eigenvalues, own.box, sides, own.origin)


def _of_modes(
    modes: Sequence[ModeVectors], apart: Callable[[Floats], tuple[NDArray, NDArray]]
) -> tuple[dict[str, NDArray], dict[str, float]]:
    """Columns of vectors and rotations, into which `apart` takes coordinates; imaginary parts where there are any."""
    vectors, eigenvalues = dict[str, NDArray](), dict[str, float]()
    for name, value, moved in modes:
        for part, coordinates in {"": moved.real, "_imag": moved.imag}.items():
            if not part or coordinates.any():
                vectors[f"{name}{part}"], vectors[f"{name}{part}_rotation"] = apart(coordinates)
        eigenvalues |= {f"{name}_eigenvalue": float(value.real), f"{name}_eigenvalue_imag": float(value.imag)}
    return vectors, eigenvalues


def read_back(
    path: Path, values: Mapping[str, Any], rows: Sequence[float] | Floats | None, low: bool
) -> dict[str, Any]:
    """Fields `given` and `slips` of Disks, of what a file, which may be another's, has by name, and of `Exported.rows`
    in it, if there are any; `low` tells whether these have low parts of slips."""
    check_format(values.get(FORMAT_KEY), path)
    given = dict[str, float]()
    for key in PARAMETER_NAMES & values.keys():
        with suppress(TypeError, ValueError):  # another program's, by the same name
            given[key] = float(values[key])
    if rows is None:
        return {"given": given}
    columns = np.reshape(np.asarray(rows, dtype=np.float64), (-1, 4 if low else 3)).T
    first, second = columns[:2].astype(np.int64)
    return {"given": given, "slips": Slips(first, second, columns[2], columns[3] if low else None, complete=True)}


def _in_space(vectors: Floats) -> Floats:
    """Vectors in the plane with z = 0, shape (..., 3)."""
    return np.pad(vectors, [(0, 0)] * (vectors.ndim - 1) + [(0, 1)])


def _at_particles(operation: np.ufunc, count: int, contacts: Contacts | LinearisedContacts, values: Floats) -> Floats:
    """Numbers of contacts put together at their particles, shape (N,)."""
    found, pair = np.zeros(count), contacts.j >= 0
    operation.at(found, contacts.i, values)
    operation.at(found, contacts.j[pair], values[pair])
    return found


def choose_frames(run: RunFile, says: str) -> range:
    """The numbers of frames in a choice: "all", or START:STOP or START:STOP:STEP as in Python.

    Raises BadInputError if the text is neither, or selects no frame.
    """
    total = 1 + len(run.series("trajectory")["time"]) if "trajectory" in run.names_of_series else len(run)
    found = range(0)
    with suppress(ValueError, TypeError):
        start, stop, *step = (int(part) if part else None for part in says.replace("all", ":").split(":"))
        found = range(total)[slice(start, stop, *step)]
    if not found:
        ways = "give all, START:STOP or START:STOP:STEP, counted from 0"
        raise BadInputError(f"--frames {says} means none of the {total} frames of {run.path}: {ways}.")
    return found


def frames_of(run: RunFile, numbers: range) -> Iterator[tuple[float, Exported]]:
    """Times and frames of a run.h5, which must stay open, one after the other, by numbers from `choose_frames`.

    Of an undamped run with a trajectory these are its samples; frame 0 is its initial equilibrium. Else they are the
    equilibria of the ramp, whose time is F_x, or the total path of F_x where there are turning points.
    """
    undamped = "trajectory" in run.names_of_series
    start, times = run.packing(-1 if undamped else 0), run.fx
    if undamped:
        series = run.series("trajectory")
        times = np.append(0.0, series.pop("time"))
    elif turning_points(times):  # programs want times that grow
        times = np.append(0.0, np.cumsum(np.abs(np.diff(times))))
    for number in numbers:
        packing, time = start if undamped else run.packing(number), float(times[number])
        if undamped:
            place = {name: column[number - 1] for name, column in series.items()} if number else {}
            near = touching(place.get("position", start.position), start.radius, start.box_length)
            packing = replace(start, **place, contacts=near, angle=np.zeros(len(start)))
        moved = nearest_image(packing.position - start.position, packing.box_length)
        if packing.position_low is not None and start.position_low is not None:
            moved = moved + (packing.position_low - start.position_low)
        yield time, exported(packing, displacement=moved, time=time if undamped else None)
