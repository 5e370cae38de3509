"""Check a run.h5: names, shapes, types, finite numbers, lengths that agree, indices in range.

`runfile` describes the format. The whole file is checked when it is opened, and nothing is appended to a file that
fails.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import PackingFileError

if TYPE_CHECKING:
    import h5py

BEST_COMPRESSION = 1100
"""More bytes than this a stored byte cannot stand for: deflate packs up to 1032 times. A shape beyond is damage, and
reading it would take all memory."""

BYTES_OF_A_CHUNK = 1 << 20
"""Bytes that are read at a time, or one chunk, where that is larger: a chunk is unpacked as a whole."""

LARGEST_CHUNK = 1 << 30
"""Bytes of a chunk, unpacked: a frame of ten million disks has a quarter of these."""


class _UnsoundError(Exception):
    """A file is damaged; the message says which part."""


def _require(sound: object, says: str) -> None:
    """Refuse a damaged file, with the reason."""
    if not sound:
        raise _UnsoundError(says)


def check(file: h5py.File, path: Path, size: int) -> None:
    """Check an open file.

    Parameters
    ----------
    file : h5py.File
        The file.
    path : Path
        Its name, for the message.
    size : int
        Its bytes.

    Raises
    ------
    PackingFileError
        If something in the file is not what it should be.
    """
    try:
        creator = file.get("h5md/creator")
        if creator is None or creator.attrs.get("name") != "faultgouge":
            raise PackingFileError(f"{path} is an HDF5 file, but not a run of faultgouge.")
        if "snapshot" in file:
            raise PackingFileError(
                f"{path} holds a packing as LAMMPS left it, and no run of this program's own: the commands spectrum, "
                "draw, movie, view and export take it."
            )
        check_places(file)
        disks, frames = _check_position(file, size)
        _check_parameters(file, disks)
        _check_observables(file, disks, frames, size)
        for name, group in file.get("faultgouge", {}).items():
            for column in [dataset(group, each, size) for each in group]:
                _require(column.ndim, f"the series {name} has columns without rows")
                _check_finite(column)
    except _UnsoundError as error:
        raise PackingFileError(f"{path} is damaged: {error}.") from None
    except PackingFileError:
        raise
    except Exception as error:  # h5py raises nearly every exception there is, depending on what is damaged
        raise PackingFileError(f"{path} is damaged: {str(error).strip() or type(error).__name__}.") from error


def equilibria(file: h5py.File) -> int:
    """Number of equilibria: the frames that are not of a trajectory."""
    frames = int(file["particles/disks/position/step"].shape[0])
    trajectory = file.get("faultgouge/trajectory", {})
    # version 0.1.0 kept the positions of a trajectory beside its times
    return frames if "position" in trajectory or "time" not in trajectory else frames - len(trajectory["time"])


def dataset(file: h5py.Group, name: str, size: int, rows: int | None = None) -> h5py.Dataset:
    """A dataset of numbers whose bytes can stand for its shape, or for its first rows if no others are read.

    Behind the equilibria a trajectory has rows that nobody wrote, and that have no bytes.
    """
    import h5py

    item = file.get(name)
    _require(isinstance(item, h5py.Dataset), f"the dataset {name} is missing")
    _require(item.dtype.kind in "fib", f"{item.name} is of type {item.dtype}, and not of numbers")
    _require(
        item.dtype.kind != "f" or item.dtype == np.float64, f"{item.name} is of type {item.dtype}, and not float64"
    )
    stored = min(item.id.get_storage_size(), size)
    read = item.nbytes if rows is None or not item.ndim else item.nbytes // max(len(item), 1) * min(rows, len(item))
    says = f"{item.name} has the shape {item.shape}, more than its {stored} bytes hold"
    _require(read <= BEST_COMPRESSION * stored, says)
    return item


def _check_shape(file: h5py.Group, name: str, shape: tuple[int, ...], size: int, kind: str = "f") -> h5py.Dataset:
    """A dataset of this shape and kind, its numbers finite."""
    item = dataset(file, name, size)
    _require(item.shape == shape, f"{item.name} has the shape {item.shape}, and should have {shape}")
    _require(item.dtype.kind in kind, f"{item.name} is of type {item.dtype}")
    _check_finite(item)
    return item


def _check_finite(item: h5py.Dataset, rows: int | None = None) -> None:
    """All numbers of a dataset, or those of its first rows, are finite."""
    if item.dtype.kind != "f":
        return
    finite = True
    if item.ndim == 0:
        finite = bool(np.isfinite(item[()]))
    else:
        end = len(item) if rows is None else rows
        block = max(1, BYTES_OF_A_CHUNK * len(item) // max(item.nbytes, 1))
        if item.chunks:
            block = -(-block // item.chunks[0]) * item.chunks[0]
        finite = all(np.isfinite(item[k : min(k + block, end)]).all() for k in range(0, end, block))
    _require(finite, f"{item.name} has numbers that are not finite")


def check_places(file: h5py.File) -> None:
    """Every number lies in the file itself, whose checksum covers it, and unpacks into the memory that there is."""
    import h5py

    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    unpacked, seen, groups = 0, set[int](), [file]
    while groups:
        here = groups.pop()
        for name in here:
            link = here.get(name, getlink=True)
            _require(not isinstance(link, h5py.ExternalLink), f"{here.name}/{name} is a link to another file")
            item = here[name]
            address = h5py.h5o.get_info(item.id).addr
            if address in seen:
                continue
            seen.add(address)
            if isinstance(item, h5py.Group):
                groups.append(item)
            elif isinstance(item, h5py.Dataset):
                _require(not item.external and not item.is_virtual, f"{item.name} has its numbers in another file")
                chunk = math.prod(item.chunks or ()) * item.dtype.itemsize
                _require(chunk <= LARGEST_CHUNK, f"{item.name} has chunks of {chunk} bytes")
                unpacked += item.id.get_num_chunks() * chunk if item.chunks else 0
    _require(unpacked <= memory, f"its datasets unpack to {unpacked} bytes, more than this machine has memory")


def _check_position(file: h5py.File, size: int) -> tuple[int, int]:
    """Numbers of disks and of frames."""
    value = dataset(file, "particles/disks/position/value", size)
    step = dataset(file, "particles/disks/position/step", size)
    shaped = value.ndim == 3 and value.shape[1] >= 1 and value.shape[2] == 3 and step.ndim == 1
    _require(shaped, f"{value.name} has the shape {value.shape}, and should have (T, N, 3)")
    disks, frames = value.shape[1], len(step)
    _require(value.shape[0] >= frames, f"{frames} frames are counted, and {value.shape[0]} are there")
    count, first = np.arange(frames), equilibria(file)
    time = _check_shape(file, "particles/disks/position/time", (frames,), size)
    counted = first >= 0 and np.array_equal(step[...], count) and np.array_equal(time[:first], count[:first])
    _require(counted, f"{step.name} does not count the equilibria")
    if first < frames:
        same = np.array_equal(time[first:], file["faultgouge/trajectory/time"][...])
        _require(same, f"{time.name} has other times than the trajectory")
    _check_shape(file, "particles/disks/position/value", value.shape, size)
    _require(not np.any(value[:frames, :, 2]), f"{value.name} has disks outside of the plane")
    return disks, first


def _check_parameters(file: h5py.File, disks: int) -> None:
    group, size = file["parameters"], file.id.get_filesize()
    for name in ("radius", "mass"):
        positive = np.all(_check_shape(group, name, (disks,), size)[...] > 0)
        _require(positive, f"/parameters/{name} has numbers that are not above 0")
    _check_shape(group, "top", (disks,), size, "bi")
    for name in {"kn", "kt", "mu", "inertia_factor"} | set(group) - {"radius", "mass", "top"}:
        _require(_check_shape(group, name, (), size, "fi")[()] >= 0, f"/parameters/{name} is below 0")
    periodic = file["particles/disks/box"].attrs["boundary"][0] == b"periodic"
    has_length = "box_length" in group and group["box_length"][()] != 0
    says = "its box is said to be periodic, and has no length, or the other way round"
    _require(periodic == has_length == ("box_length" in group), says)


def _check_observables(file: h5py.File, disks: int, frames: int, size: int) -> None:
    group = file["observables"]
    linked = "position" not in group or group["position"] == file["particles/disks/position"]
    _require(linked, "/observables/position is no link to /particles/disks/position")
    shapes = {"angle": (disks,), "fx": (), "fy": (), "residual": (), "position_low": (disks, 2)}
    needed = {"contacts", *shapes} - {"position_low"} if frames else set()
    for name in needed | set(group):
        item = dataset(group, f"{name}/value", size, frames)
        enough = item.ndim and item.shape[0] >= frames
        _require(enough, f"{item.name} has the shape {item.shape} for {frames} equilibria")
        fits = not frames or item.shape[1:] == shapes.get(name, item.shape[1:])
        _require(fits, f"{item.name} has the shape {item.shape}")
        if name != "contacts":
            _check_finite(item, frames)
    if not frames:
        return
    if "box_length" in file["parameters"]:
        dataset(file, "particles/disks/box/edges/value", size, frames)
    contacts = group["contacts/value"]
    width = 4 if "position_low" in group else 3
    _require(contacts.shape[2:] == (width,), f"{contacts.name} has the shape {contacts.shape}")
    for k in range(frames):
        _check_contacts(contacts[k], disks, contacts.name)


def _check_contacts(rows: np.ndarray, disks: int, name: str) -> None:
    used = ~np.isnan(rows[:, 0])
    finite = np.isnan(rows[~used]).all() and np.isfinite(rows[used]).all()
    _require(finite, f"{name} has numbers that are not finite")
    i, j = rows[used, 0], rows[used, 1]
    there = (i >= 0) & (i < disks) & (j >= -1) & (j < disks) & (i == np.rint(i)) & (j == np.rint(j)) & (i != j)
    _require(there.all(), f"{name} names disks that are not there")
