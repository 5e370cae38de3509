"""run.h5: the equilibria of a run, bitwise, written one after the other.

The file is H5MD 1.1, which MDAnalysis opens after ``import faultgouge.analysis.files.mdanalysis``::

    /h5md                          version, author, creator (the program's name and version)
    /particles/disks/position      (T, N, 3)  centres, z = 0; a link /observables/position leads to them
    /particles/disks/mass          (N,)       a link to the masses among the parameters
    /particles/disks/box           dimension 3, periodic along x or not
    /particles/disks/box/edges     (T, 3)     period, twice the height, largest diameter; only if periodic
    /observables/angle             (T, N)     orientations
    /observables/fx, fy            (T,)       force per top disk
    /observables/residual          (T,)       the largest net force on a disk that has a contact
    /observables/contacts          (T, C, 3)  rows (i, j, slip), j = -1 for the floor; unused rows are nan
    /observables/<name>            (T,)       further scalars of an equilibrium
    /parameters/<name>             constants: radii, masses, top, law, inertia, box
    /faultgouge/<name>/<column>    time series, such as D(t)

Every element with a T is a group of ``value`` and of links to one common ``step`` (the number of the equilibrium) and
``time`` (the same number: equilibria have no time). ``step`` is written last: a frame exists only if ``step`` counts
it.

The trajectory of an undamped run follows after its initial equilibrium, as further frames of position with the time of
the run, and with fx and fy of the equilibrium; all other observables are nan there, or 0. ``/faultgouge/trajectory``
has its times, so that it counts these frames, and low parts of its positions.

The stored file is complete at any moment and has a checksum over all its bytes (:mod:`.atomic_write`). The attribute
``complete`` of the root is false until the run has ended; until then, it continues from the state in ``/checkpoint``.
Datasets depend on the scene alone; scene, versions, seed and ranks are attributes of the root.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import MISSING, fields
from os import PathLike
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats
from ..errors import PackingFileError
from ..packing.contacts import Contacts
from ..packing.law import MindlinLaw
from ..packing.packing import Packing
from .atomic_write import new_sealed, open_sealed, telling, write_sealed
from .configuration_file import write_h5md

if TYPE_CHECKING:
    import h5py

NONE_GIVEN = "none were given"
"""The attribute tangential_forces of older files, where slips are not known."""

SHARE_OF_SAVING = 0.05
"""Share of the time that saving takes, at the most: a frame or a part of a series waits that long to be saved."""

CHECKSUM: dict[str, Any] = {"fletcher32": True}
"""A checksum for every chunk, for readers other than this one."""

COMPACT: dict[str, Any] = {"shuffle": True, "compression": "gzip", "compression_opts": 1, **CHECKSUM}
"""Filters of what is stored for every disk or contact: half the size, mostly from indices and equal leading bytes, at a
few milliseconds for a thousand disks. Slower ones gain 3 % more."""

POSITION, EDGES = "particles/disks/position", "particles/disks/box/edges"


class RunFile(AbstractContextManager["RunFile"]):
    """A run.h5, checked whole, open for reading or for appending; a context manager.

    A file that is open for appending is kept in memory. When it is saved, all of it replaces the stored file; saving
    takes at most a fixed share of the time, so that a file that grows for a long time is not written too often.

    Raises PackingFileError if the file is missing, broken, or not written by this class.
    """

    def __init__(self, path: str | PathLike[str], mode: Literal["r", "a"] = "r") -> None:
        self.path, self._writable = Path(path), mode == "a"
        self.saved, self._sound, self._next_save = True, True, 0.0
        self._file = open_sealed(self.path, self._writable)
        if "parameters" not in self._file:
            says = "holds no run of ours: of a packing as LAMMPS left it, spectrum and draw tell"
            raise PackingFileError(f"{self.path} {says}.")
        self._parameters = {name: item[()] for name, item in self._file["parameters"].items()}

    @classmethod
    def create(
        cls, path: str | PathLike[str], packing: Packing, attributes: Mapping[str, str | int | float] | None = None
    ) -> RunFile:
        """Start a new file for runs of the disks of a packing; an existing file is replaced.

        Radii, masses, upper layer, law, inertia factor and box of the packing are those of every frame; it is not
        appended. `attributes` are those of the root: the resolved scene as JSON, versions, seed, ranks. The file is
        open for appending, without frames, and not `complete`. Raises OutputError if it cannot be written.
        """
        with new_sealed() as file:
            write_h5md(file)
            disks = file.create_group("particles/disks")
            sides = ["none" if packing.box_length is None else "periodic", "none", "none"]
            disks.create_group("box").attrs.update({"dimension": 3, "boundary": np.array(sides, "S8")})
            position, clocks = disks.create_group("position"), {"step": np.zeros(0, np.int64), "time": np.zeros(0)}
            for name, rows in {**clocks, "value": np.zeros((0, len(packing), 3))}.items():
                _write_rows(position, name, rows, 0)
            # readers of H5MD take positions as float32, and observables as they are: a link, which takes no room
            file["observables/position"] = position
            for name, value in parameters_of(packing).items():
                file[f"parameters/{name}"] = value
            disks["mass"] = file["parameters/mass"]
            file.attrs.update({"complete": False, **(attributes or {})})
            write_sealed(Path(path), file)
        return cls(path, "a")

    def __len__(self) -> int:
        """Number of equilibria; frames of a trajectory do not count."""
        return len(self._file[f"{POSITION}/step"]) - len(self._file.get("faultgouge/trajectory/time", ()))

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Save and close the file."""
        if self._file:
            self.save()
            self._file.close()

    def save(self) -> None:
        """Write all changes to the file on the disk."""
        if not self.saved and self._sound:
            begin = monotonic()
            write_sealed(self.path, self._file)
            self.saved, self._next_save = True, monotonic() + (monotonic() - begin) / SHARE_OF_SAVING

    @contextmanager
    def change(self) -> Iterator[None]:
        """Changes that belong together: all of them are saved, or none.

        What an error leaves is not saved any more.
        """
        if not self._writable:
            raise ValueError(f"{self.path} is open for reading alone.")
        outer, self._sound, self.saved = self._sound, False, False
        yield
        self._sound = outer
        if outer and monotonic() >= self._next_save:
            self.save()

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the root: scene, versions, seed, ranks."""
        return {name: value.tolist() if hasattr(value, "tolist") else value for name, value in self._file.attrs.items()}

    def put_attribute(self, name: str, value: str) -> None:
        """Set an attribute of the root."""
        with self.change():
            self._file.attrs[name] = value

    @property
    def complete(self) -> bool:
        """Whether the run has come to its end."""
        return bool(self._file.attrs["complete"])

    @complete.setter
    def complete(self, value: bool) -> None:
        if self.complete != value or not self.saved:
            self._file.attrs["complete"], self.saved = value, False

    def put_checkpoint(self, **arrays: NDArray | int) -> None:
        """Keep the state of a run that is under way, in place of the last one; none for a run that is over."""
        with self.change():
            if "checkpoint" in self._file:
                del self._file["checkpoint"]
            for name, value in arrays.items():
                self._file[f"checkpoint/{name}"] = value

    @property
    def checkpoint(self) -> dict[str, NDArray]:
        """The state of a run that is under way, by name; empty if there is none."""
        return {name: item[()] for name, item in self._file.get("checkpoint", {}).items()}

    @property
    def fx(self) -> Floats:
        """Force along +x on each top disk in every frame, shape (T,)."""
        return self.observable("fx")

    @property
    def observables(self) -> tuple[str, ...]:
        """Names of the observables stored with a frame, besides positions."""
        return tuple(name for name in self._file["observables"] if name != "position")

    def observable(self, name: str) -> NDArray:
        """An observable in every frame, shape (T, ...); a KeyError if it is not stored."""
        return self._file["observables"][name]["value"][: len(self)]

    def append(self, packing: Packing, **scalars: float) -> None:
        """Add an equilibrium; it is stored with the next saving, which takes at most `SHARE_OF_SAVING` of the time.

        `scalars` are further observables, such as the number of evaluations. Raises ValueError if disks, law or box are
        not those of the file, or names of observables are not those of earlier frames.
        """
        known, own, count, c = self._parameters, parameters_of(packing), len(self), packing.contacts
        for name in known | own:
            if not np.array_equal(known.get(name, np.nan), own.get(name, np.nan)):
                raise ValueError(f"{self.path} was begun for a packing with another {name}.")
        if "trajectory" in self.names_of_series:
            raise ValueError(f"{self.path} has a trajectory, behind which no equilibrium can follow.")
        frame = scalars | {name: getattr(packing, name) for name in ("angle", "fx", "fy", "residual")}
        frame["contacts"] = np.column_stack([each for each in (c.i, c.j, c.slip, c.slip_low) if each is not None])
        if packing.position_low is not None:
            frame["position_low"] = packing.position_low
        if count and set(frame) != set(self.observables):
            raise ValueError(f"Frames of {self.path} have the observables {', '.join(self.observables)}, not others.")
        parts = {f"observables/{name}": np.asarray(value) for name, value in frame.items()}
        parts[POSITION] = np.pad(packing.position, ((0, 0), (0, 1)))
        if packing.box_length is not None:
            # twice the height: readers that take every axis as periodic see no neighbours across it
            height = 2 * (packing.position[:, 1] + packing.radius).max()
            parts[EDGES] = np.array([packing.box_length, height, 2 * packing.radius.max()])
        with self.change():
            for name, value in parts.items():
                if name not in self._file:
                    clocks = {clock: self._file[f"{POSITION}/{clock}"] for clock in ("step", "time")}
                    self._file.create_group(name).update(clocks)
                _write_rows(self._file[name], "value", value[None], count)
            for clock in ("time", "step"):
                _write_rows(self._file[POSITION], clock, np.array([count]), count)

    @property
    def _rows_of_frames(self) -> dict[str, h5py.Dataset]:
        """What has a row for each frame."""
        names = [f"observables/{name}/value" for name in self.observables]
        names += [f"{POSITION}/{name}" for name in ("value", "time", "step")] + [f"{EDGES}/value"]
        return {name: self._file[name] for name in names if name in self._file}

    def cut(self, count: int) -> None:
        """Remove the frames from a number on; of a file without a trajectory."""
        with self.change():
            for data in self._rows_of_frames.values():
                data.resize(count, axis=0)

    def packing(self, frame: int = -1) -> Packing:
        """The packing of a frame, bitwise as it was stored; negative numbers count from the end.

        Raises PackingFileError if there is no such frame.
        """
        count, given = len(self), self._parameters
        if not -count <= frame < count:
            raise PackingFileError(f"{self.path} has {count} frames; there is no frame {frame}.")
        stored = [name for name in ("angle", "fx", "fy", "position_low") if name in self.observables]
        seen = {name: self.observable(name)[frame % count] for name in stored}
        rows = self.observable("contacts")[frame % count]
        known = "slips_known" not in given and self.attributes.get("tangential_forces") != NONE_GIVEN
        names = ("radius", "mass", "inertia_factor", "box_length", "drag_time", "spring")
        with telling(self.path, "is damaged", ValueError):  # numbers that no packing has
            i, j, *slip = rows[~np.isnan(rows[:, 0])].T
            return Packing(
                position=self._file[f"{POSITION}/value"][frame % count, :, :2], slips_known=known,
                contacts=Contacts(i.astype(np.int64), j.astype(np.int64), *slip),
                law=law_of_parameters(given), top=given["top"].astype(bool),
                **seen, **{name: given[name] for name in names if name in given},
            )  # fmt: skip

    def append_trajectory(self, time: ArrayLike, position: ArrayLike, position_low: ArrayLike | None = None) -> None:
        """Add frames of the undamped run that began at the last equilibrium.

        `time`, shape (S,), counts from the beginning of the run; `position` and `position_low`, shape (S, N, 2), are
        centres, length, and their low parts if there are any.
        """
        begin, low = len(self._file[f"{POSITION}/step"]), {} if position_low is None else {"position_low": position_low}
        place = np.pad(position, ((0, 0), (0, 0), (0, 1)))
        new = {"value": place, "time": time, "step": np.arange(begin, begin + len(place))}
        with self.change():
            self.append_series("trajectory", time=time, **low)
            for name, data in self._rows_of_frames.items():
                data.resize(begin + len(place), axis=0)
                if name.startswith(POSITION):
                    data[begin:] = new[name.rpartition("/")[2]]
                elif name in ("observables/fx/value", "observables/fy/value", f"{EDGES}/value"):
                    data[begin:] = data[begin - 1]

    def append_series(self, name: str, **columns: ArrayLike) -> None:
        """Add rows to a time series, which begins with the first call.

        `columns`, each of shape (R, ...), have the same length, and the same names in each call, or a ValueError says
        so.
        """
        group = self._file.require_group(f"faultgouge/{name}")
        arrays = {column: np.atleast_1d(value) for column, value in columns.items()}
        if len({len(array) for array in arrays.values()}) != 1 or (len(group) and set(group) != set(arrays)):
            raise ValueError(f"The series {name} has columns of one length, and each time the same: {[*group]}.")
        start = _rows(group)
        with self.change():
            for column, array in arrays.items():
                _write_rows(group, column, array, start, series=True)

    @property
    def names_of_series(self) -> tuple[str, ...]:
        """Names of the time series."""
        return tuple(self._file.get("faultgouge", ()))

    def series(self, name: str) -> dict[str, NDArray]:
        """The columns of a time series by name; a PackingFileError if there is no such series."""
        group = self._file.get(f"faultgouge/{name}")
        if group is None:
            raise PackingFileError(f"{self.path} has no series {name}.")
        columns = {column: group[column][: _rows(group)] for column in group}
        if name == "trajectory":
            columns["position"] = self._file[f"{POSITION}/value"][len(self) :, :, :2]
        return columns


def _write_rows(group: h5py.Group, name: str, rows: NDArray, start: int, series: bool = False) -> None:
    """Write rows of frames, or of a time series, from a number on, in place of what is there; the dataset is made with
    the first. Further axes grow as they must, as contacts may become more."""
    shape, empty = rows.shape[1:], np.nan if rows.dtype.kind == "f" else 0
    if name not in group:
        chunks = True if series or math.prod(shape) <= 1 else (1, *shape)
        layout = {"maxshape": (None,) * rows.ndim, "chunks": chunks, "fillvalue": empty}
        group.create_dataset(name, (0, *shape), rows.dtype, **layout, **(CHECKSUM if series or not shape else COMPACT))
    data = group[name]
    size = [max(have, need) for have, need in zip(data.shape[1:], shape, strict=True)]
    data.resize((start + len(rows), *size))
    filled = np.full((len(rows), *size), empty, data.dtype)
    filled[tuple(map(slice, rows.shape))] = rows
    data[start:] = filled


def _rows(group: h5py.Group) -> int:
    """Rows that every column of a series has: a killed run may have left them uneven."""
    return min((len(column) for column in group.values()), default=0)


def law_parameters(law: MindlinLaw) -> dict[str, float]:
    """kn, kt, mu, and the parameters of the law that differ from their defaults."""
    given = {each.name: (getattr(law, each.name), each.default) for each in fields(law)}
    return {name: float(value) for name, (value, default) in given.items() if value != default}


def law_of_parameters(given: Mapping[str, Any]) -> MindlinLaw:
    """The reverse of `law_parameters`; a KeyError if kn, kt or mu is missing."""
    needed = (each.name for each in fields(MindlinLaw) if each.default is MISSING or each.name in given)
    return MindlinLaw(**{name: given[name] for name in needed})


def parameters_of(packing: Packing) -> dict[str, Any]:
    """The constants of a run, by their names below /parameters; what is absent or zero is left out."""
    values: dict[str, Any] = {name: getattr(packing, name) for name in ("radius", "mass", "top", "inertia_factor")}
    values |= law_parameters(packing.law) | ({} if packing.slips_known else {"slips_known": 0.0})
    more = {name: getattr(packing, name) for name in ("drag_time", "spring", "box_length")}
    return values | {name: value for name, value in more.items() if value}
