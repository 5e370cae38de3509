"""What an export of a packing has: particles, contacts and modes as columns, whatever the format; and frames of films.

A Packing and a Configuration have the same columns, and a Packing some more, with which `import` reads it back. Law,
load and inertia are names with numbers. Contacts of a Packing are rows (first ID, second ID, slip), a second ID of 0 is
the floor, and low parts of compensated packings are a fourth column.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats
from ...configuration import Configuration
from ...contacts import LinearisedContacts
from ...errors import BadInputError
from ...motion.hysteresis import turning_points
from ...packing.contacts import Contacts
from ...packing.geometry import nearest_image, touching
from ...packing.packing import Packing
from ..runfile import RunFile, law_parameters
from .disks import Slips

PARAMETER_NAMES = (
    "kn", "kt", "mu", "exponent", "rescaled", "coulomb", "cn", "ct", "tau", "fx", "fy", "inertia_factor",
    "slips_known",
)  # fmt: skip
"""Names of law, load and inertia in files; and slips_known, 0 where the slips are not known."""

LARGEST_EXPORTED = 0.5
"""Longest displacement in a film of a mode, in units of the smallest radius: particles stay beside their neighbours."""


@dataclass(frozen=True, eq=False)
class ModeVectors:
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


@dataclass(frozen=True, eq=False)
class Frame:
    """A packing for an export, alone or as a frame of a film.

    Attributes
    ----------
    packing : Packing
        The packing. If it is not `whole`, its contacts are all disks that touch, without slips.
    time : float
        F_x of an equilibrium, or the total path of F_x on a ramp with turning points; or the time of an undamped run.
    displacement : ndarray, shape (N, 2), or None
        Displacement from the first frame of a film, length.
    whole : bool
        Whether angles and slips, and so the forces, are known: an undamped run stores only positions.
    """

    packing: Packing
    time: float = 0.0
    displacement: Floats | None = None
    whole: bool = True


@dataclass(frozen=True, eq=False)
class Exported:
    """The columns of an export.

    Attributes
    ----------
    position : ndarray, shape (N, 3)
        Centres, length.
    top : ndarray of bool, shape (N,)
        The upper layer.
    particles, contacts : dict of ndarray
        Columns by name, of numbers or of vectors with three components; whole numbers are integers.
    ends : ndarray, shape (C, 2, 3)
        The centre of the first particle of each contact, and that of the nearest image of the second, or the foot on
        the wall.
    numbers : dict of float
        Law, load, inertia, the time of a frame, eigenvalues of modes.
    box : ndarray, shape (3, 3)
        Edges of the box in rows.
    periodic : tuple of bool
        Along each edge.
    rows : ndarray, shape (C, 3 or 4), or None
        Contacts of a Packing, as it is read back; None where slips are not known.
    """

    position: Floats
    top: NDArray[np.bool_]
    particles: dict[str, NDArray]
    contacts: dict[str, NDArray]
    ends: Floats
    numbers: dict[str, float]
    box: Floats
    periodic: tuple[bool, ...]
    origin: Floats | None = None
    rows: Floats | None = field(default=None)


def exported_packing(frame: Frame, modes: Sequence[ModeVectors] = ()) -> Exported:
    """The columns of a Packing; those of slips and of forces that follow from them where they are known."""
    p, g, c = frame.packing, frame.packing.geometry, frame.packing.contacts
    force, n = p.net_force.reshape(3, -1).T, len(p)
    known: dict[str, NDArray] = {
        "angle": p.angle,
        "net_force": in_space(force[:, :2]),
        "torque_over_radius": force[:, 2],
        "mobilised": at_particles(np.maximum, n, c, p.mobilised),
    }
    low = {} if p.position_low is None else {"x_low": p.position_low[:, 0], "y_low": p.position_low[:, 1]}
    moved = {} if frame.displacement is None else {"displacement": in_space(frame.displacement)}
    particles: dict[str, NDArray] = {
        "id": np.arange(1, n + 1),
        "radius": p.radius,
        "mass": p.mass,
        "top": p.top.astype(np.int64),
        "normal_force": at_particles(np.add, n, c, p.normal_force),
        **(known if frame.whole else {}),
        **moved,
        **low,
    }
    contacts: dict[str, NDArray] = {"contact_i": c.i, "contact_j": c.j}
    contacts |= {"contact_normal_force": p.normal_force, "contact_overlap": g.overlap}
    if frame.whole:
        both = p.normal_force[:, None] * g.normal + p.tangential_force[:, None] * g.tangent
        contacts |= {"contact_force": in_space(both), "contact_tangential_force": p.tangential_force}
        contacts |= {"contact_slip": c.slip, "contact_mobilised": p.mobilised}
    first, height = p.position[c.i], float((p.position[:, 1] + p.radius).max())
    sides = {} if p.box_length is None else {"box_length": p.box_length}
    width = 2 * np.ptp(p.position[:, 0]) + 2 * p.radius.max() if p.box_length is None else p.box_length
    for mode in modes:
        for part, vectors in parts_of(mode):
            particles |= {f"{mode.name}{part}": in_space(vectors[:2].T), f"{mode.name}{part}_rotation": vectors[2]}
    return Exported(
        in_space(p.position),
        p.top,
        particles,
        contacts,
        in_space(np.stack([first, first - g.distance[:, None] * g.normal], axis=1)),
        scalars(p) | sides | ({} if frame.whole else {"time": frame.time}) | _eigenvalues(modes),
        np.diag([width, height, 2 * p.radius.max()]),
        (p.box_length is not None, False, False),
        rows=contact_rows(p) if frame.whole else None,
    )


def exported_configuration(
    configuration: Configuration, modes: Sequence[ModeVectors] = (), displacement: Floats | None = None
) -> Exported:
    """The columns of a Configuration; particles may be displaced, with the contacts that they have at rest.

    Parameters
    ----------
    displacement : ndarray, shape (N, 3), optional
        In space, length.
    """
    c, n = configuration.contacts.touching, len(configuration)
    rest = np.pad(configuration.position, ((0, 0), (0, 3 - configuration.dimension)))
    moved = np.zeros_like(rest) if displacement is None else displacement
    particles: dict[str, NDArray] = {
        "radius": configuration.radius,
        "mass": configuration.mass,
        "id": configuration.ids,
        "type": configuration.kind,
        "free": configuration.free.astype(np.float64),
        "load": configuration.load[:, 0],
        "net_force": configuration.net_force[:, 0],
        "net_torque": configuration.net_force[:, 1],
        "normal_force": at_particles(np.add, n, c, c.normal_force),
        "coordination": at_particles(np.add, n, c, np.ones(len(c))),
    }
    for mode in modes:
        for part, vectors in parts_of(mode):
            names = f"{mode.name}{part}", f"{mode.name}{part}_rotation"
            particles |= dict(zip(names, configuration.vectors(vectors), strict=True))
    second = np.maximum(c.j, 0)
    contacts: dict[str, NDArray] = {
        "contact_i": configuration.ids[c.i],
        "contact_j": np.where(c.wall, 0, configuration.ids[second]),
        "contact_force": c.normal_force[:, None] * c.normal + c.tangential_force,
        "contact_normal_force": c.normal_force,
        "contact_tangential_force": c.tangential_force,
        "contact_overlap": c.overlap,
        "contact_mobilised": configuration.mobilised[~configuration.contacts.couple],
    }
    other = (
        rest[c.i] - configuration.branch[~configuration.contacts.couple] + np.where(c.wall[:, None], 0.0, moved[second])
    )
    return Exported(
        rest + moved,
        configuration.top,
        particles,
        contacts,
        np.stack([rest[c.i] + moved[c.i], other], axis=1),
        _eigenvalues(modes),
        configuration.box,
        tuple(map(bool, configuration.periodic)),
        configuration.origin,
    )


def motion_of_mode(configuration: Configuration, mode: ModeVectors, count: int, periods: int = 1) -> Iterator[Exported]:
    """The motion of a mode, growth left out: frames with displaced particles, their displacement and rotation."""
    reach = LARGEST_EXPORTED * configuration.radius.min() / max(1.0, np.abs(mode.displacement).max())
    for k in range(count):
        moved = np.real(reach * mode.displacement * np.exp(2j * np.pi * periods * k / count))
        there = ModeVectors("displacement", mode.eigenvalue, moved.astype(np.complex128))
        yield exported_configuration(configuration, [there], configuration.vectors(moved)[0])


def parts_of(mode: ModeVectors) -> Iterator[tuple[str, Floats]]:
    """The real part of a mode, and, if it has one, the imaginary part, with what is added to their names."""
    yield "", mode.displacement.real
    if np.any(mode.displacement.imag):
        yield "_imag", mode.displacement.imag


def _eigenvalues(modes: Sequence[ModeVectors]) -> dict[str, float]:
    parts = [("_eigenvalue", np.real), ("_eigenvalue_imag", np.imag)]
    return {f"{mode.name}{name}": float(part(mode.eigenvalue)) for mode in modes for name, part in parts}


def scalars(packing: Packing) -> dict[str, float]:
    """Law, load and inertia by name, without absent values and defaults."""
    values = law_parameters(packing.law)
    if packing.drag_time is not None:
        values["tau"] = packing.drag_time
    if not packing.slips_known:
        values["slips_known"] = 0.0
    return {**values, "fx": packing.fx, "fy": packing.fy, "inertia_factor": packing.inertia_factor}


def pick_numbers(values: Mapping[str, Any]) -> dict[str, float]:
    """The values of `PARAMETER_NAMES` in a mapping, as far as these are numbers."""
    found = {}
    for key in PARAMETER_NAMES:
        try:
            found[key] = float(values[key])
        except (KeyError, TypeError, ValueError):
            continue
    return found


def contact_rows(packing: Packing) -> Floats:
    """Rows (first ID, second ID, slip[, low part]), shape (C, 3 or 4); IDs from 1, 0 is the floor."""
    c = packing.contacts
    low = [] if c.slip_low is None else [c.slip_low]
    return np.column_stack([c.i + 1, c.j + 1, c.slip, *low]).astype(np.float64)


def slips_of(numbers: Sequence[float] | Floats, compensated: bool) -> Slips:
    """The reverse of `contact_rows`, of its numbers in a row."""
    rows = np.reshape(np.asarray(numbers, dtype=np.float64), (-1, 4 if compensated else 3))
    low = rows[:, 3] if compensated else None
    return Slips(rows[:, 0].astype(np.int64), rows[:, 1].astype(np.int64), rows[:, 2], low, complete=True)


def in_space(vectors: Floats) -> Floats:
    """Vectors in the plane with z = 0, shape (..., 3)."""
    return np.pad(vectors, [(0, 0)] * (vectors.ndim - 1) + [(0, 1)])


def at_particles(operation: np.ufunc, count: int, contacts: Contacts | LinearisedContacts, values: Floats) -> Floats:
    """Numbers of contacts put together at their particles, shape (N,)."""
    found, pair = np.zeros(count), contacts.j >= 0
    operation.at(found, contacts.i, values)
    operation.at(found, contacts.j[pair], values[pair])
    return found


def choose_frames(run: RunFile, says: str) -> range:
    """The numbers of frames in a choice: "all", or START:STOP or START:STOP:STEP as in Python.

    Raises BadInputError if the text is neither, or selects no frame.
    """
    total = len(run)
    if "trajectory" in run.names_of_series:
        total = 1 + len(run.series("trajectory")["time"])
    parts = says.split(":")
    try:
        wanted = slice(None) if says == "all" else slice(*(int(part) if part else None for part in parts))
        found = range(total)[wanted]
    except (TypeError, ValueError):
        found = None
    if found is None or (says != "all" and len(parts) < 2):
        raise BadInputError(f"--frames {says}: give all, START:STOP or START:STOP:STEP, counted from 0.")
    if not found:
        raise BadInputError(f"--frames {says}: {run.path} has {total} frames, and none of them is meant.")
    return found


def frames_of(run: RunFile, numbers: range) -> Iterator[Frame]:
    """The frames of a run.h5, one after the other: of its undamped run if it has its trajectory, else of its ramp.

    Parameters
    ----------
    run : RunFile
        The file, which must stay open until the last frame has been read. Frame 0 of an undamped run is its initial
        equilibrium.
    numbers : range
        From :func:`choose_frames`.
    """
    undamped = "trajectory" in run.names_of_series
    start, way = run.packing(-1 if undamped else 0), run.fx
    if not undamped and turning_points(way):  # programs want times that grow
        way = np.append(0.0, np.cumsum(np.abs(np.diff(way))))
    series = run.series("trajectory") if undamped else {}
    for number in numbers:
        if not undamped:
            packing, time = run.packing(number), float(way[number])
        else:
            time = float(series["time"][number - 1]) if number else 0.0
            place = {"position": series["position"][number - 1]} if number else {"position": start.position}
            if number and "position_low" in series:
                place["position_low"] = series["position_low"][number - 1]
            near = touching(place["position"], start.radius, start.box_length)
            packing = replace(start, **place, contacts=near, angle=np.zeros(len(start)))
        moved = nearest_image(packing.position - start.position, packing.box_length)
        if packing.position_low is not None and start.position_low is not None:
            moved = moved + (packing.position_low - start.position_low)
        yield Frame(packing, time, moved, whole=not undamped)
