"""Configurations for ParaView (.vtp) and OVITO (.xyz): particles with forces and modes, contacts as lines.

The motion of a mode, growth left out, is a film of frames: an .xyz of many frames, or a .pvd with a folder of .vtp. A
.vtp is laid out as that of a Packing (:mod:`.vtp`): N centres, then two ends for each contact.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ...arrays import Floats
from ...configuration import Configuration
from ...counted import counted
from ...errors import BadInputError
from ..atomic_write import FORMAT, FORMAT_KEY, replace_whole
from .export_quantities import ModeVectors, sum_at_particles
from .vtp import write_frame_list, write_poly_data, write_xml
from .xyz import species_of


def check_configuration_writer(path: Path) -> None:
    """Refuse a suffix that is neither .vtp nor .xyz, before work begins."""
    if path.suffix not in (".vtp", ".xyz"):
        raise BadInputError(f"-o {path}: a configuration goes into .vtp, .xyz; give it one of these suffixes.")


def export_configuration(
    path: Path,
    configuration: Configuration,
    modes: Sequence[ModeVectors] = (),
    values: Mapping[str, Floats] | None = None,
) -> str:
    """Write a configuration as .vtp or .xyz, and return the contents in words; `values` are further numbers of the
    particles, shape (N,) each.

    Raises
    ------
    BadInputError
        If the suffix is another one.
    OutputError
        If the file cannot be written.
    """
    check_configuration_writer(path)
    if path.suffix == ".vtp":
        write_xml(path, _poly_data(configuration, _in_space(configuration), modes, values))
    else:
        _write_xyz(path, configuration, [(_in_space(configuration), modes)], values)
    what = {"particle": len(configuration), "contact": len(configuration.contacts), "mode": len(modes)}
    return ", ".join(counted(number, noun) for noun, number in what.items())


LARGEST_EXPORTED = 0.5
"""Longest displacement in a film of a mode, in units of the smallest radius: particles stay beside their neighbours."""


def write_mode_frames(
    path: Path, configuration: Configuration, mode: ModeVectors, count: int, periods: int = 1
) -> None:
    """Write the motion of a mode, growth left out: frames with displaced particles, their displacement and rotation.

    Parameters
    ----------
    path : Path
        An .xyz of many frames, or a .pvd, beside which a folder of .vtp is made.
    count, periods : int
        Frames, and whole periods of the mode in them.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    reach = LARGEST_EXPORTED * configuration.radius.min() / max(1.0, np.abs(mode.displacement).max())
    frames = []
    for k in range(count):
        moved = np.real(reach * mode.displacement * np.exp(2j * np.pi * periods * k / count))
        there = ModeVectors("displacement", mode.eigenvalue, moved.astype(np.complex128))
        frames.append((_in_space(configuration) + configuration.vectors(moved)[0], [there]))
    if path.suffix == ".xyz":
        _write_xyz(path, configuration, frames)
    else:
        write_frame_list(path, ((float(k), _poly_data(configuration, *frame)) for k, frame in enumerate(frames)))


def _in_space(configuration: Configuration) -> Floats:
    return np.pad(configuration.position, ((0, 0), (0, 3 - configuration.dimension)))


def _of_particles(configuration: Configuration, modes: Sequence[ModeVectors]) -> dict[str, Floats]:
    c = configuration.contacts
    count, pressure = (
        sum_at_particles(np.add, len(configuration), c, each) for each in (np.ones(len(c)), c.normal_force)
    )
    values: dict[str, Floats] = {
        "radius": configuration.radius,
        "mass": configuration.mass,
        "id": configuration.ids.astype(np.float64),
        "type": configuration.kind.astype(np.float64),
        "free": configuration.free.astype(np.float64),
        "load": configuration.load[:, 0],
        "net_force": configuration.net_force[:, 0],
        "net_torque": configuration.net_force[:, 1],
        "normal_force": pressure,
        "coordination": count,
    }
    for mode in modes:
        values |= mode.fields(configuration.vectors)
    return values


def _poly_data(
    configuration: Configuration,
    position: Floats,
    modes: Sequence[ModeVectors],
    values: Mapping[str, Floats] | None = None,
) -> ElementTree.Element:
    """Particles where they have been moved to, with the contacts that they have at rest."""
    c = configuration.contacts
    first, rest = position[c.i], _in_space(configuration)
    numbers: dict[str, float] = {}
    for mode in modes:
        numbers |= mode.numbers
    on_contacts = {
        "contact_i": configuration.ids[c.i].astype(np.float64),
        "contact_j": np.where(c.wall, 0, configuration.ids[np.maximum(c.j, 0)]).astype(np.float64),
        "contact_force": c.normal_force[:, None] * c.normal + c.tangential_force,
        "contact_normal_force": c.normal_force,
        "contact_tangential_force": c.tangential_force,
        "contact_overlap": c.overlap,
        "contact_mobilised": configuration.mobilised,
    }
    moved = np.where(c.wall[:, None], 0.0, position[np.maximum(c.j, 0)] - rest[np.maximum(c.j, 0)])
    second = rest[c.i] - configuration.branch + moved
    ends = np.stack([first, second], axis=1).reshape(-1, 3)
    return write_poly_data(
        position, ends, numbers, _of_particles(configuration, modes) | dict(values or {}), on_contacts
    )


def _write_xyz(
    path: Path,
    configuration: Configuration,
    frames: Sequence[tuple[Floats, Sequence[ModeVectors]]],
    values: Mapping[str, Floats] | None = None,
) -> None:
    """Frames, each of positions and modes."""
    lattice, origin = (" ".join(map(repr, each.ravel().tolist())) for each in (configuration.box, configuration.origin))
    sides = " ".join("T" if each else "F" for each in configuration.periodic)
    with replace_whole(path) as new, new.open("w") as stream:
        for position, modes in frames:
            columns = {"pos": position} | _of_particles(configuration, modes) | dict(values or {})
            columns = {("forces" if name == "net_force" else name): value for name, value in columns.items()}
            sizes = [f"{name}:R:{1 if value.ndim == 1 else value.shape[1]}" for name, value in columns.items()]
            rows = np.column_stack([value if value.ndim == 2 else value[:, None] for value in columns.values()])
            box = f'Lattice="{lattice}" Origin="{origin}" pbc="{sides}"'
            head = f"{box} Properties=species:S:1:{':'.join(sizes)} {FORMAT_KEY}={FORMAT}"
            stream.write(f"{len(configuration)}\n{head}\n")
            lines = zip(species_of(configuration.top), rows.tolist(), strict=True)
            stream.writelines(f"{name} {' '.join(map(repr, row))}\n" for name, row in lines)
