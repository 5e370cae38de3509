"""Snapshots for ParaView (.vtp) and OVITO (.xyz): particles with forces and modes, contacts as lines.

The motion of a mode, growth left out, is a film of frames: an .xyz of many frames, or a .pvd with a folder of .vtp. A
.vtp is laid out as that of a Packing (:mod:`.vtp`): N centres, then two ends for each contact.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ...analysis import BadInputError, Snapshot
from ...analysis.files.atomic_write import replace_whole
from ...analysis.packing.arrays import Floats
from .vtp import write_frame_list, write_poly_data, write_xml


@dataclass(frozen=True, eq=False)
class SnapshotMode:
    """A mode of a snapshot: its name, its eigenvalue, 1 / time^2, and q, shape (axes N,)."""

    name: str
    eigenvalue: complex
    vector: NDArray[np.complex128]

    def fields(self, snapshot: Snapshot) -> dict[str, Floats]:
        """Translations and rotations R theta, shape (N, 3), by the names that they have in a file."""
        d = snapshot.dimension
        found: dict[str, Floats] = {}
        parts = self.vector.reshape(snapshot.axes, -1)
        for part, moved in (("", parts.real), ("_imag", parts.imag)):
            if not part or np.any(moved):
                translation, rotation = np.zeros((2, len(snapshot), 3))
                translation[:, :d], rotation[:, 3 - len(moved[d:]) :] = moved[:d].T, moved[d:].T
                found |= {f"{self.name}{part}": translation, f"{self.name}{part}_rotation": rotation}
        return found


def modes_of_snapshot(snapshot: Snapshot, which: str) -> list[SnapshotMode]:
    """The fastest growing pair, or the mode of a number, counted by eigenvalue from 0.

    Raises
    ------
    BadInputError
        If there is none.
    """
    from ...analysis import normal_modes, spectrum

    modes = normal_modes(snapshot)
    if which == "pair":
        pairs = spectrum(snapshot).pairs
        if not pairs:
            raise BadInputError("--mode pair: the packing has no complex pair; give the number of a mode, from 0")
        number = int(np.argmin(np.abs(modes.values - pairs[0].eigenvalue)))
    elif which.isdecimal() and int(which) < len(modes.values):
        number = int(which)
    else:
        raise BadInputError(f"--mode {which}: give pair, or a number from 0 to {len(modes.values) - 1}")
    vector = modes.right[:, number] / np.sqrt(snapshot.coordinate_mass)
    return [SnapshotMode(f"mode_{number}", complex(modes.values[number]), vector / np.abs(vector).max())]


def write_snapshot_for_others(path: Path, snapshot: Snapshot, modes: Sequence[SnapshotMode] = ()) -> str:
    """Write a .vtp or an .xyz; what is in it, in words.

    Raises
    ------
    BadInputError
        If the suffix is another one.
    OutputError
        If the file cannot be written.
    """
    writers = {".vtp": _write_vtp, ".xyz": _write_xyz}
    if path.suffix not in writers:
        raise BadInputError(f"-o {path}: a snapshot goes into {', '.join(writers)}; give it one of these suffixes.")
    writers[path.suffix](path, snapshot, modes)
    return f"{len(snapshot)} particles, {len(snapshot.contacts)} contacts, {len(modes)} modes"


FARTHEST = 0.5
"""Longest displacement in a film of a mode, in units of the smallest radius: particles stay beside their neighbours."""


def check_mode_frames(path: Path) -> None:
    """Refuse a film whose name has another suffix than .xyz and .pvd."""
    if path.suffix not in (".xyz", ".pvd"):
        raise BadInputError(
            f"-o {path}: a mode of spheres moves in OVITO (.xyz) or ParaView (.pvd); give one of these."
        )


def write_mode_frames(path: Path, snapshot: Snapshot, mode: SnapshotMode, count: int, periods: int = 1) -> None:
    """Write the motion of a mode, growth left out: frames with displaced particles, their displacement and rotation.

    Parameters
    ----------
    path : Path
        An .xyz of many frames, or a .pvd, beside which a folder of .vtp is made.
    count, periods : int
        Frames, and whole periods of the mode in them.

    Raises
    ------
    BadInputError
        If the suffix is another one.
    OutputError
        If a file cannot be written.
    """
    check_mode_frames(path)
    # the phase at which the two moments a quarter of a period apart are the largest and the smallest displacement
    vector = mode.vector * np.exp(-0.5j * np.angle(np.sum(mode.vector**2)))
    translation = np.abs(vector.reshape(snapshot.axes, -1)[: snapshot.dimension])
    reach = FARTHEST * snapshot.radius.min() / max(np.sqrt(np.sum(translation**2, axis=0)).max(), np.abs(vector).max())
    frames = []
    for k in range(count):
        moved = np.real(reach * vector * np.exp(2j * np.pi * periods * k / count))
        there = SnapshotMode("displacement", mode.eigenvalue, moved.astype(np.complex128))
        frames.append((_in_space(snapshot) + there.fields(snapshot)["displacement"], there))
    if path.suffix == ".xyz":
        with replace_whole(path) as new, new.open("w") as stream:
            for position, there in frames:
                _write_xyz_frame(stream, snapshot, position, [there])
        return
    pages = ((float(k), _poly_data(snapshot, position, [there])) for k, (position, there) in enumerate(frames))
    write_frame_list(path, pages)


def _in_space(snapshot: Snapshot) -> Floats:
    return np.pad(snapshot.position, ((0, 0), (0, 3 - snapshot.dimension)))


def _of_particles(snapshot: Snapshot, modes: Sequence[SnapshotMode]) -> dict[str, Floats]:
    c, pair = snapshot.contacts, ~snapshot.contacts.wall
    count, pressure = (
        np.bincount(c.i, weight, len(snapshot)) + np.bincount(c.j[pair], weight[pair], len(snapshot))
        for weight in (np.ones(len(c)), c.normal_force)
    )
    values: dict[str, Floats] = {
        "radius": snapshot.radius,
        "mass": snapshot.mass,
        "id": snapshot.ids.astype(np.float64),
        "type": snapshot.kind.astype(np.float64),
        "free": snapshot.free.astype(np.float64),
        "load": snapshot.load[:, 0],
        "net_force": snapshot.net_force[:, 0],
        "net_torque": snapshot.net_force[:, 1],
        "normal_force": pressure.astype(np.float64),
        "coordination": count.astype(np.float64),
    }
    for mode in modes:
        values |= mode.fields(snapshot)
    return values


def _write_vtp(path: Path, snapshot: Snapshot, modes: Sequence[SnapshotMode]) -> None:
    write_xml(path, _poly_data(snapshot, _in_space(snapshot), modes))


def _poly_data(snapshot: Snapshot, position: Floats, modes: Sequence[SnapshotMode]) -> ElementTree.Element:
    """Particles where they have been moved to, with the contacts that they have at rest."""
    c = snapshot.contacts
    first, rest = position[c.i], _in_space(snapshot)
    reach = np.where(c.wall, snapshot.radius[c.i] - c.overlap, c.distance)
    numbers = {f"{mode.name}_eigenvalue": mode.eigenvalue.real for mode in modes}
    numbers |= {f"{mode.name}_eigenvalue_imag": mode.eigenvalue.imag for mode in modes}
    on_contacts = {
        "contact_i": snapshot.ids[c.i].astype(np.float64),
        "contact_j": np.where(c.wall, 0, snapshot.ids[np.maximum(c.j, 0)]).astype(np.float64),
        "contact_force": c.normal_force[:, None] * c.normal + c.tangential_force,
        "contact_normal_force": c.normal_force,
        "contact_tangential_force": c.tangential_force,
        "contact_overlap": c.overlap,
        "contact_mobilised": snapshot.mobilised,
    }
    moved = np.where(c.wall[:, None], 0.0, position[np.maximum(c.j, 0)] - rest[np.maximum(c.j, 0)])
    second = rest[c.i] - reach[:, None] * c.normal + moved
    ends = np.stack([first, second], axis=1).reshape(-1, 3)
    return write_poly_data(position, ends, numbers, _of_particles(snapshot, modes), on_contacts)


def _write_xyz(path: Path, snapshot: Snapshot, modes: Sequence[SnapshotMode]) -> None:
    with replace_whole(path) as new, new.open("w") as stream:
        _write_xyz_frame(stream, snapshot, _in_space(snapshot), modes)


def _write_xyz_frame(stream: TextIO, snapshot: Snapshot, position: Floats, modes: Sequence[SnapshotMode]) -> None:
    columns = {"pos": position} | _of_particles(snapshot, modes)
    columns = {("forces" if name == "net_force" else name): value for name, value in columns.items()}
    properties = ":".join(f"{name}:R:{1 if value.ndim == 1 else value.shape[1]}" for name, value in columns.items())
    lattice = " ".join(repr(float(value)) for value in snapshot.box.ravel())
    sides = " ".join("T" if each else "F" for each in snapshot.periodic)
    origin = " ".join(repr(float(value)) for value in snapshot.origin)
    rows = np.column_stack([value if value.ndim == 2 else value[:, None] for value in columns.values()])
    stream.write(f'{len(snapshot)}\nLattice="{lattice}" Origin="{origin}" pbc="{sides}" Properties={properties}\n')
    stream.writelines(" ".join(map(repr, row)) + "\n" for row in rows.tolist())
