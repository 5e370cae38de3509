"""VTK PolyData (.vtp), for ParaView: disks as vertices, contacts as lines, modes as vectors; full precision.

The points are the N centres, followed by two ends for each contact: the centre of the first disk, and the centre of the
nearest image of the second disk, or the foot on the floor. A contact across the periodic boundary is therefore a short
line, not a line across the box. Cells are N vertices, then the lines. Quantities that are not defined for a point or a
cell are nan, and the radius of an end is 0. The file is XML with arrays in base64 (VTK file formats, "XML file
formats", header type UInt64).
"""

from __future__ import annotations

import base64
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ...counted import counted
from ...packing.packing import Packing
from ..atomic_write import make_folder, write_whole
from . import export_quantities
from .export_quantities import Frame, ModeVectors

Element = ElementTree.Element

VTK_TYPES = {"f": "Float64", "i": "Int64"}

FORCES = ("angle", "net_force", "torque_over_radius", "mobilised", "contact_force", "contact_tangential_force")
SLIPS = ("contact_slip", "contact_mobilised")


def write_vtp(path: Path, frames: Iterable[Frame], modes: list[ModeVectors]) -> str:
    """Write a .vtp file, and return the contents in words."""
    (frame,) = frames
    packing = frame.packing
    write_xml(path, _tree(frame, modes))
    return f"{counted(len(packing), 'disk')} and {counted(len(packing.contacts), 'contact')}, in float64"


def write_pvd(path: Path, frames: Iterable[Frame], modes: list[ModeVectors]) -> str:
    """A .pvd file, ParaView's list of frames, and a folder of its name with a .vtp for each."""
    write_frame_list(path, ((float(frame.time), _tree(frame, modes)) for frame in frames))
    return "displacements and what is known of forces"


def write_frame_list(path: Path, frames: Iterable[tuple[float, Element]]) -> None:
    """A .pvd file and its folder, of times and pages of VTK."""
    folder = path.with_suffix("")
    make_folder(folder)
    root = Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    collection = ElementTree.SubElement(root, "Collection")
    for number, (time, page) in enumerate(frames):
        name = f"{folder.name}/{number:05d}.vtp"
        write_xml(path.parent / name, page)
        ElementTree.SubElement(collection, "DataSet", timestep=repr(time), part="0", file=name)
    write_xml(path, root)


def write_xml(path: Path, page: Element) -> None:
    """Replace a file by a page of XML."""
    write_whole(path, ElementTree.tostring(page, encoding="utf-8", xml_declaration=True))


def _tree(frame: Frame, modes: list[ModeVectors]) -> Element:
    packing = frame.packing
    numbers = export_quantities.scalars(packing) | (
        {} if packing.box_length is None else {"box_length": packing.box_length}
    )
    numbers |= frame.number
    for mode in modes:
        numbers |= mode.numbers
    on_disks, unknown = _of_disks(packing, modes), () if frame.whole else FORCES + SLIPS
    if frame.displacement is not None:
        on_disks["displacement"] = export_quantities.in_space(frame.displacement)
    on_disks, on_contacts = (
        {name: values for name, values in each.items() if name not in unknown}
        for each in (on_disks, _of_contacts(packing))
    )
    centres = export_quantities.in_space(packing.position)
    return write_poly_data(centres, _ends(packing), numbers, on_disks, on_contacts)


def write_poly_data(
    centres: NDArray, ends: NDArray, numbers: dict[str, float], on_particles: dict[str, NDArray],
    on_contacts: dict[str, NDArray],
) -> Element:  # fmt: skip
    """PolyData of particles, shape (N, 3), and of both ends of each contact, shape (2C, 3), with their fields."""
    n, count = len(centres), len(ends) // 2
    root = Element("VTKFile", type="PolyData", version="1.0", byte_order="LittleEndian", header_type="UInt64")
    data = ElementTree.SubElement(root, "PolyData")
    fields = ElementTree.SubElement(data, "FieldData")
    for name, value in numbers.items():
        _array(fields, name, np.array([value]))
    sizes = {"NumberOfPoints": n + 2 * count, "NumberOfVerts": n, "NumberOfLines": count}
    none = {"NumberOfStrips": 0, "NumberOfPolys": 0}
    piece = ElementTree.SubElement(data, "Piece", {key: str(value) for key, value in (sizes | none).items()})
    on_points = ElementTree.SubElement(piece, "PointData")
    for name, values in on_particles.items():
        _array(on_points, name, _pad(values, 2 * count, 0.0 if name == "radius" else np.nan, behind=True))
    on_cells = ElementTree.SubElement(piece, "CellData")
    for name, values in on_contacts.items():
        _array(on_cells, name, _pad(values, n, np.nan, behind=False))
    _array(ElementTree.SubElement(piece, "Points"), "Points", np.concatenate([centres, ends]))
    _cells(piece, "Verts", np.arange(n), 1)
    _cells(piece, "Lines", n + np.arange(2 * count), 2)
    return root


def _of_disks(packing: Packing, modes: list[ModeVectors]) -> dict[str, NDArray]:
    force = export_quantities.disk_force(packing)
    values = {
        "radius": packing.radius,
        "mass": packing.mass,
        "angle": packing.angle,
        "top": packing.top.astype(np.float64),
        "net_force": export_quantities.in_space(force[:, :2]),
        "torque_over_radius": force[:, 2],
        "normal_force": export_quantities.disk_pressure(packing),
        "mobilised": export_quantities.disk_mobilised(packing),
    }
    for mode in modes:
        values |= mode.fields()
    return values


def _of_contacts(packing: Packing) -> dict[str, NDArray]:
    contacts = packing.contacts
    return {
        "contact_i": contacts.i.astype(np.float64),
        "contact_j": contacts.j.astype(np.float64),
        "contact_force": export_quantities.in_space(export_quantities.contact_force(packing)),
        "contact_normal_force": packing.normal_force,
        "contact_tangential_force": packing.tangential_force,
        "contact_slip": contacts.slip,
        "contact_overlap": packing.geometry.overlap,
        "contact_mobilised": packing.mobilised,
    }


def _ends(packing: Packing) -> NDArray:
    geometry, i = packing.geometry, packing.contacts.i
    first = packing.position[i]
    second = first - geometry.distance[:, None] * geometry.normal
    return export_quantities.in_space(np.stack([first, second], axis=1).reshape(-1, 2))


def _pad(values: NDArray, missing: int, fill: float, *, behind: bool) -> NDArray:
    rows = np.full((missing, *values.shape[1:]), fill)
    return np.concatenate([values, rows] if behind else [rows, values])


def _cells(piece: Element, name: str, points: NDArray, size: int) -> None:
    cells = ElementTree.SubElement(piece, name)
    _array(cells, "connectivity", points.astype(np.int64))
    _array(cells, "offsets", size * np.arange(1, len(points) // size + 1, dtype=np.int64))


def _array(parent: Element, name: str, values: NDArray) -> None:
    kind = {"type": VTK_TYPES[values.dtype.kind], "Name": name, "format": "binary"}
    if values.ndim > 1:
        kind["NumberOfComponents"] = str(values.shape[1])
    if parent.tag == "FieldData":
        kind["NumberOfTuples"] = str(len(values))
    content = np.ascontiguousarray(values, dtype="<f8" if values.dtype.kind == "f" else "<i8").tobytes()
    size = np.array([len(content)], dtype="<u8").tobytes()
    # one base64 text of size and content
    ElementTree.SubElement(parent, "DataArray", kind).text = base64.b64encode(size + content).decode()
