"""Whether a run.h5 is what it should be: names, shapes, types, finite numbers, lengths that agree, indices in range.

`runfile` describes the format. A file is checked whole when it is opened, and nothing is appended to one that fails.
"""

from pathlib import Path

import h5py
import numpy as np

from ..errors import PackingFileError

BEST_COMPRESSION = 1100
"""More bytes than this a stored byte cannot stand for: deflate packs up to 1032 times. A shape beyond is damage, and
reading it would take all memory."""

BLOCK = 1 << 20
"""Bytes that are read at a time."""


class _UnsoundError(Exception):
    """What is wrong, in words that follow the name of the file."""


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
        _check_creator(file)
        disks, frames = _check_position(file, size)
        _check_parameters(file, disks)
        _check_observables(file, disks, frames, size)
        _check_series(file, size)
    except _UnsoundError as error:
        raise PackingFileError(f"{path} {error}.") from None
    except Exception as error:  # h5py raises nearly every exception there is, depending on what is damaged
        raise PackingFileError(f"{path} is damaged: {str(error).strip() or type(error).__name__}.") from error


def equilibria(file: h5py.File) -> int:
    """Number of equilibria: the frames that are not of a trajectory."""
    frames = int(file["particles/disks/position/step"].shape[0])
    trajectory = file.get("faultgouge/trajectory", {})
    # version 0.1.0 kept the positions of a trajectory beside its times
    return frames if "position" in trajectory or "time" not in trajectory else frames - len(trajectory["time"])


def _check_creator(file: h5py.File) -> None:
    creator = file.get("h5md/creator")
    if creator is None or creator.attrs.get("name") != "faultgouge":
        raise _UnsoundError("is an HDF5 file, but not a run of faultgouge")


def _dataset(file: h5py.Group, name: str, size: int, rows: int | None = None) -> h5py.Dataset:
    """A dataset of numbers whose bytes can stand for its shape, or for its first rows if no others are read.

    Behind the equilibria a trajectory has rows that nobody wrote, and that have no bytes.
    """
    item = file.get(name)
    if not isinstance(item, h5py.Dataset):
        raise _UnsoundError(f"is damaged: the dataset {name} is missing")
    if item.dtype.kind not in "fib":
        raise _UnsoundError(f"is damaged: {item.name} is of type {item.dtype}, and not of numbers")
    if item.dtype.kind == "f" and item.dtype != np.float64:
        raise _UnsoundError(f"is damaged: {item.name} is of type {item.dtype}, and not float64")
    stored = min(item.id.get_storage_size(), size)
    read = item.nbytes if rows is None or not item.ndim else item.nbytes // max(len(item), 1) * min(rows, len(item))
    if read > BEST_COMPRESSION * stored:
        raise _UnsoundError(f"is damaged: {item.name} has the shape {item.shape}, more than its {stored} bytes hold")
    return item


def _shaped(file: h5py.Group, name: str, shape: tuple[int, ...], size: int, kind: str = "f") -> h5py.Dataset:
    """A dataset of this shape and kind, its numbers finite."""
    item = _dataset(file, name, size)
    if item.shape != shape:
        raise _UnsoundError(f"is damaged: {item.name} has the shape {item.shape}, and should have {shape}")
    if item.dtype.kind not in kind:
        raise _UnsoundError(f"is damaged: {item.name} is of type {item.dtype}")
    _check_finite(item)
    return item


def _check_finite(item: h5py.Dataset, rows: int | None = None) -> None:
    """All numbers of a dataset, or those of its first rows, are finite."""
    if item.dtype.kind != "f":
        return
    if item.ndim == 0:
        finite = bool(np.isfinite(item[()]))
    else:
        end = len(item) if rows is None else rows
        block = max(1, BLOCK * len(item) // max(item.nbytes, 1))
        finite = all(np.isfinite(item[k : min(k + block, end)]).all() for k in range(0, end, block))
    if not finite:
        raise _UnsoundError(f"is damaged: {item.name} has numbers that are not finite")


def _check_position(file: h5py.File, size: int) -> tuple[int, int]:
    """Numbers of disks and of frames."""
    value = _dataset(file, "particles/disks/position/value", size)
    step = _dataset(file, "particles/disks/position/step", size)
    if value.ndim != 3 or value.shape[1] < 1 or value.shape[2] != 3 or step.ndim != 1:
        raise _UnsoundError(f"is damaged: {value.name} has the shape {value.shape}, and should have (T, N, 3)")
    disks, frames = value.shape[1], len(step)
    if value.shape[0] < frames:
        raise _UnsoundError(f"is damaged: {frames} frames are counted, and {value.shape[0]} are there")
    count, first = np.arange(frames), equilibria(file)
    time = _shaped(file, "particles/disks/position/time", (frames,), size)
    if first < 0 or not (np.array_equal(step[...], count) and np.array_equal(time[:first], count[:first])):
        raise _UnsoundError(f"is damaged: {step.name} does not count the equilibria")
    if first < frames and not np.array_equal(time[first:], file["faultgouge/trajectory/time"][...]):
        raise _UnsoundError(f"is damaged: {time.name} has other times than the trajectory")
    _shaped(file, "particles/disks/position/value", (value.shape[0], disks, 3), size)
    if np.any(value[:frames, :, 2]):
        raise _UnsoundError(f"is damaged: {value.name} has disks outside of the plane")
    return disks, first


def _check_parameters(file: h5py.File, disks: int) -> None:
    group = file["parameters"]
    size = file.id.get_filesize()
    for name in ("radius", "mass"):
        if not np.all(_shaped(group, name, (disks,), size)[...] > 0):
            raise _UnsoundError(f"is damaged: /parameters/{name} has numbers that are not above 0")
    _shaped(group, "top", (disks,), size, "bi")
    for name in {"kn", "kt", "mu", "inertia_factor"} | set(group):
        if name not in ("radius", "mass", "top") and _shaped(group, name, (), size, "fi")[()] < 0:
            raise _UnsoundError(f"is damaged: /parameters/{name} is below 0")
    periodic = file["particles/disks/box"].attrs["boundary"][0] == b"periodic"
    if periodic != ("box_length" in group) or (periodic and group["box_length"][()] == 0):
        raise _UnsoundError("is damaged: its box is said to be periodic, and has no length, or the other way round")


def _check_observables(file: h5py.File, disks: int, frames: int, size: int) -> None:
    group = file["observables"]
    if "position" in group and group["position"] != file["particles/disks/position"]:
        raise _UnsoundError("is damaged: /observables/position is no link to /particles/disks/position")
    for name in group:
        item = _dataset(group, f"{name}/value", size, frames)
        if item.ndim < 1 or item.shape[0] < frames:
            raise _UnsoundError(f"is damaged: {item.name} has the shape {item.shape} for {frames} equilibria")
        if name != "contacts":
            _check_finite(item, frames)
    if not frames:
        return
    rows = {"angle": (disks,), "fx": (), "fy": (), "residual": (), "position_low": (disks, 2)}
    for name, shape in rows.items():
        if name != "position_low" or name in group:
            item = _dataset(group, f"{name}/value", size, frames)
            if item.shape[1:] != shape:
                raise _UnsoundError(f"is damaged: {item.name} has the shape {item.shape}")
    if "box_length" in file["parameters"]:
        _dataset(file, "particles/disks/box/edges/value", size, frames)
    contacts = _dataset(group, "contacts/value", size, frames)
    if contacts.ndim != 3 or contacts.shape[2] != (4 if "position_low" in group else 3):
        raise _UnsoundError(f"is damaged: {contacts.name} has the shape {contacts.shape}")
    for k in range(frames):
        _check_contacts(contacts[k], disks, contacts.name)


def _check_contacts(rows: np.ndarray, disks: int, name: str) -> None:
    used = ~np.isnan(rows[:, 0])
    if not np.isnan(rows[~used]).all() or not np.isfinite(rows[used]).all():
        raise _UnsoundError(f"is damaged: {name} has numbers that are not finite")
    i, j = rows[used, 0], rows[used, 1]
    if np.any((i < 0) | (i >= disks) | (j < -1) | (j >= disks) | (i != np.rint(i)) | (j != np.rint(j)) | (i == j)):
        raise _UnsoundError(f"is damaged: {name} names disks that are not there")


def _check_series(file: h5py.File, size: int) -> None:
    for name, group in file.get("faultgouge", {}).items():
        columns = [_dataset(group, column, size) for column in group]
        if any(column.ndim < 1 for column in columns):
            raise _UnsoundError(f"is damaged: the series {name} has columns without rows")
        for column in columns:
            _check_finite(column)
