"""VTK PolyData (.vtp), for ParaView: particles as vertices, contacts as lines, modes as vectors; full precision.

The points are the N centres, followed by two ends for each contact. A contact across the periodic boundary is therefore
a short line, not a line across the box. Cells are N vertices, then the lines. Quantities that are not defined for a
point or a cell are nan, and the radius of an end is 0. The file is XML with arrays in base64 (VTK file formats, "XML
file formats", header type UInt64). A film is a .pvd, ParaView's list of frames, and a folder of its name with a .vtp
for each.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ..atomic_write import make_folder, write_whole
from .exported import Exported

Element = ElementTree.Element


def write_vtp(path: Path, frames: Iterable[tuple[float, Exported]]) -> str:
    """Write a .vtp file of one frame, of which nothing is left to say."""
    [(_, exported)] = frames
    write_whole(path, ElementTree.tostring(_page(exported), encoding="utf-8", xml_declaration=True))
    return ""


def write_pvd(path: Path, frames: Iterable[tuple[float, Exported]]) -> str:
    """Write a .pvd file, of times and frames, and its folder; return the contents in words."""
    folder = path.with_suffix("")
    make_folder(folder)
    root = Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    collection = ElementTree.SubElement(root, "Collection")
    for number, (time, exported) in enumerate(frames):
        name = f"{folder.name}/{number:05d}.vtp"
        write_vtp(path.parent / name, [(time, exported)])
        ElementTree.SubElement(collection, "DataSet", timestep=repr(time), part="0", file=name)
    write_whole(path, ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))
    return "displacements and what is known of forces"


def _page(e: Exported) -> Element:
    n, count = len(e.position), len(e.ends)
    root = Element("VTKFile", type="PolyData", version="1.0", byte_order="LittleEndian", header_type="UInt64")
    data = ElementTree.SubElement(root, "PolyData")
    fields = ElementTree.SubElement(data, "FieldData")
    for name, value in e.numbers.items():
        _array(fields, name, np.array([value]), NumberOfTuples="1")
    sizes = {"Points": n + 2 * count, "Verts": n, "Lines": count, "Strips": 0, "Polys": 0}
    piece = ElementTree.SubElement(data, "Piece", {f"NumberOf{key}": str(value) for key, value in sizes.items()})
    points, cells, places = (ElementTree.SubElement(piece, name) for name in ("PointData", "CellData", "Points"))
    for name, values in e.particles.items():
        ends = np.full((2 * count, *values.shape[1:]), 0.0 if name == "radius" else np.nan)
        _array(points, name, np.concatenate([values, ends]))
    for name, values in e.contacts.items():
        _array(cells, name, np.concatenate([np.full((n, *values.shape[1:]), np.nan), values]))
    _array(places, "Points", np.concatenate([e.position, e.ends.reshape(-1, 3)]))
    for name, size, these in (("Verts", 1, np.arange(n)), ("Lines", 2, n + np.arange(2 * count))):
        part = ElementTree.SubElement(piece, name)
        _array(part, "connectivity", these)
        _array(part, "offsets", size * np.arange(1, len(these) // size + 1))
    return root


def _array(parent: Element, name: str, values: NDArray, **more: str) -> None:
    """An array in one base64 text of its size and its content."""
    kind, stored = ("Int64", "<i8") if values.dtype.kind == "i" else ("Float64", "<f8")
    more |= {"NumberOfComponents": str(values.shape[1])} if values.ndim > 1 else {}
    content = np.ascontiguousarray(values, dtype=stored).tobytes()
    text = base64.b64encode(np.array([len(content)], dtype="<u8").tobytes() + content).decode()
    ElementTree.SubElement(parent, "DataArray", {"type": kind, "Name": name, "format": "binary"} | more).text = text
