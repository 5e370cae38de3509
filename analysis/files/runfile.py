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
the run: readers of H5MD step through both. fx and fy are those of the equilibrium; all other observables of such a
frame are nan, or 0 for integers. ``/faultgouge/trajectory`` has its times, so that it counts these frames, and low
parts of its positions.

The stored file is complete at any moment and has a checksum over all its bytes (:mod:`.checksummed_file`). The
attribute ``complete`` of the root is false until the run has ended; until then, an undamped run continues from the
state in ``/checkpoint``.

Datasets depend on the scene alone. The circumstances of the run (resolved scene, versions, seed, ranks) are attributes
of the root. One file contains one set of disks and one law.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from functools import cached_property
from importlib.metadata import PackageNotFoundError, version
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats
from ..errors import PackingFileError
from ..packing.contacts import Contacts
from ..packing.law import MindlinLaw
from ..packing.packing import Packing
from .checksummed_file import SealedFile, new_file, write

if TYPE_CHECKING:
    import h5py


NONE_GIVEN = "none were given"
"""The attribute tangential_forces of older files, where slips are not known."""


CREATOR = "faultgouge"

CHECKSUM = {"fletcher32": True}
"""A checksum for every chunk, for readers other than this one."""

LAW_DEFAULTS = {field.name: field.default for field in fields(MindlinLaw) if field.default is not MISSING}
"""Default parameters of the law, which a file need not have."""

COMPACT = {"shuffle": True, "compression": "gzip", "compression_opts": 1, **CHECKSUM}
"""Filters of what is stored for every disk or contact: half the size, mostly from indices and equal leading bytes, at a
few milliseconds for a thousand disks. Slower ones gain 3 % more."""


class RunFile(SealedFile):
    """A run.h5, open for reading or for appending; a context manager.

    Parameters
    ----------
    path : path
        The file.
    mode : {"r", "a"}
        Read, or read and append. :meth:`create` makes a new one.

    Raises
    ------
    PackingFileError
        If the file is missing, broken, or not written by this class.
    """

    def __init__(self, path: str | PathLike[str], mode: Literal["r", "a"] = "r") -> None:
        super().__init__(path, mode)
        self._step = self._file["particles/disks/position/step"]

    @classmethod
    def create(
        cls,
        path: str | PathLike[str],
        packing: Packing,
        attributes: Mapping[str, str | int | float] | None = None,
    ) -> RunFile:
        """Start a new file for runs of the disks of a packing; an existing file is replaced.

        Parameters
        ----------
        path : path
            The file.
        packing : Packing
            Its radii, masses, upper layer, law, inertia factor and box are those of every frame. It is not
            appended.
        attributes : mapping, optional
            Attributes of the root: the resolved scene as JSON, versions, seed, ranks.

        Returns
        -------
        RunFile
            Open for appending, without frames, and not `complete`.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        with new_file() as file:
            write_header(file, packing)
            file.attrs["complete"] = False
            for name, value in (attributes or {}).items():
                file.attrs[name] = value
            write(Path(path), file)
        return cls(path, "a")

    def __len__(self) -> int:
        """Number of equilibria; frames of a trajectory do not count."""
        trajectory = self._file.get("faultgouge/trajectory/time", ())
        return int(self._step.shape[0]) - len(trajectory)

    @property
    def fx(self) -> Floats:
        """Force along +x on each top disk in every frame, shape (T,)."""
        return self.observable("fx")

    @property
    def observables(self) -> tuple[str, ...]:
        """Names of the observables stored with a frame, besides positions."""
        return tuple(name for name in self._file["observables"] if name != "position")

    def observable(self, name: str) -> NDArray:
        """An observable in every complete frame, shape (T, ...).

        Raises
        ------
        KeyError
            If the observable is not stored.
        """
        return self._file["observables"][name]["value"][: len(self)]

    def append(self, packing: Packing, **scalars: float) -> None:
        """Add a frame; it is stored with the next saving, which takes at most `SHARE_OF_SAVING` of the time.

        Parameters
        ----------
        packing : Packing
            An equilibrium of the disks that the file was created for.
        **scalars : float or int
            Further observables, such as the force floor or the number of evaluations: the same names in every
            frame.

        Raises
        ------
        ValueError
            If disks, law or box are not those of the file, or the names differ from those of earlier frames.
        """
        self._check_same(packing)
        count = len(self)
        if count < self._step.shape[0]:
            raise ValueError(f"{self.path} has a trajectory, behind which no equilibrium can follow.")
        columns = [packing.contacts.i, packing.contacts.j, packing.contacts.slip]
        if packing.contacts.slip_low is not None:
            columns.append(packing.contacts.slip_low)
        contacts = np.column_stack(columns)
        frame: dict[str, ArrayLike] = {
            "angle": packing.angle,
            "fx": packing.fx,
            "fy": packing.fy,
            "residual": packing.residual,
            "contacts": contacts,
        }
        if packing.position_low is not None:
            frame["position_low"] = packing.position_low
        taken = frame.keys() & scalars.keys()
        if taken:
            raise ValueError(f"The name {min(taken)} is taken: the packing itself says it.")
        frame |= scalars
        if count and set(frame) != set(self.observables):
            raise ValueError(f"Frames of {self.path} have the observables {', '.join(self.observables)}, not others.")
        with self.change():
            self._put_frame(packing, frame, count)

    def cut(self, count: int) -> None:
        """Remove the frames from a number on; of a file without a trajectory."""
        observables = self._file["observables"]
        with self.change():
            for data in [observables[name]["value"] for name in self.observables]:
                data.resize(count, axis=0)
            disks = self._file["particles/disks"]
            for name in ("position/value", "position/time", "position/step", "box/edges/value"):
                if name in disks:
                    disks[name].resize(count, axis=0)

    def _put_frame(self, packing: Packing, frame: Mapping[str, ArrayLike], count: int) -> None:
        for name, value in frame.items():
            self._put(f"observables/{name}", np.asarray(value), count)
        flat = np.column_stack([packing.position, np.zeros(len(packing))])
        self._put("particles/disks/position", flat, count)
        if packing.box_length is not None:
            edges = [
                packing.box_length,
                # twice the height: readers that take every axis as periodic see no neighbours across it
                2 * (packing.position[:, 1] + packing.radius).max(),
                2 * packing.radius.max(),
            ]
            self._put("particles/disks/box/edges", np.array(edges), count)
        time = self._file["particles/disks/position/time"]
        time.resize(count + 1, axis=0)
        time[count] = count
        self._step.resize(count + 1, axis=0)
        self._step[count] = count

    def packing(self, frame: int = -1) -> Packing:
        """The packing of a frame, bitwise as it was stored.

        Parameters
        ----------
        frame : int
            Number of the frame; negative ones count from the end.

        Raises
        ------
        PackingFileError
            If there is no such frame.
        """
        count = len(self)
        if not -count <= frame < count:
            raise PackingFileError(f"{self.path} has {count} frames; there is no frame {frame}.")
        try:
            return self._packing(frame % count)
        except ValueError as error:  # numbers that no packing has
            raise PackingFileError(f"{self.path} is damaged: {error}") from error

    def _packing(self, frame: int) -> Packing:
        rows = self._file["observables/contacts/value"][frame]
        rows = rows[~np.isnan(rows[:, 0])]
        parameters = self._parameters
        low = self._file.get("observables/position_low")
        return Packing(
            position=self._file["particles/disks/position/value"][frame, :, :2],
            radius=parameters["radius"],
            angle=self._file["observables/angle/value"][frame],
            mass=parameters["mass"],
            inertia_factor=parameters["inertia_factor"],
            box_length=parameters.get("box_length"),
            top=parameters["top"].astype(np.bool_),
            contacts=Contacts(
                rows[:, 0].astype(np.int64),
                rows[:, 1].astype(np.int64),
                rows[:, 2],
                rows[:, 3] if rows.shape[1] > 3 else None,
            ),
            law=law_of_parameters(parameters),
            drag_time=parameters.get("drag_time"),
            fx=self._file["observables/fx/value"][frame],
            fy=self._file["observables/fy/value"][frame],
            position_low=low["value"][frame] if low is not None else None,
            spring=parameters.get("spring", 0.0),
            slips_known="slips_known" not in parameters and self.attributes.get("tangential_forces") != NONE_GIVEN,
        )

    def append_trajectory(self, time: ArrayLike, position: ArrayLike, position_low: ArrayLike | None = None) -> None:
        """Add frames of the undamped run that began at the last equilibrium.

        Parameters
        ----------
        time : array_like, shape (S,)
            Since the beginning of the run.
        position : array_like, shape (S, N, 2)
            Centres, length.
        position_low : array_like, shape (S, N, 2), optional
            Their low parts.
        """
        low = {} if position_low is None else {"position_low": position_low}
        place = np.asarray(position, dtype=np.float64)
        flat = np.concatenate([place, np.zeros((*place.shape[:2], 1))], axis=2)
        begin, group = self._step.shape[0], self._file["particles/disks/position"]
        end, last = begin + len(flat), len(self) - 1
        with self.change():
            self.append_series("trajectory", time=time, **low)
            rows = {"position/value": flat, "position/time": time, "position/step": np.arange(begin, end)}
            for name, values in rows.items():
                group.parent[name].resize(end, axis=0)
                group.parent[name][begin:] = values
            repeated = [self._file[f"observables/{name}/value"] for name in ("fx", "fy")]
            if "box/edges" in group.parent:
                repeated.append(group.parent["box/edges/value"])
            for data in (item["value"] for item in self._file["observables"].values()):
                data.resize(end, axis=0)
            for data in repeated:
                data.resize(end, axis=0)
                data[begin:] = data[last]

    def append_series(self, name: str, **columns: ArrayLike) -> None:
        """Add rows to a time series, which begins with the first call.

        Parameters
        ----------
        name : str
            Name of the series.
        **columns : array_like, shape (R, ...)
            Columns by name, all of the same length; each call must give the same names.

        Raises
        ------
        ValueError
            If the columns differ in length, or in name from earlier calls.
        """
        group = self._file.require_group(f"faultgouge/{name}")
        arrays = {column: np.asarray(value) for column, value in columns.items()}
        lengths = {array.shape[0] if array.ndim else -1 for array in arrays.values()}
        if len(lengths) != 1 or -1 in lengths:
            raise ValueError(f"The columns of the series {name} must be lists of one length.")
        if len(group) and set(group) != set(arrays):
            raise ValueError(f"The series {name} has the columns {', '.join(group)}, not others.")
        start, rows = _rows(group), lengths.pop()
        with self.change():
            for column, array in arrays.items():
                if column not in group:
                    shape = array.shape[1:]
                    group.create_dataset(
                        column, (0, *shape), array.dtype, maxshape=(None, *shape), chunks=True, **CHECKSUM
                    )
                group[column].resize(start + rows, axis=0)
                group[column][start:] = array

    @property
    def names_of_series(self) -> tuple[str, ...]:
        """Names of the time series."""
        return tuple(self._file.get("faultgouge", ()))

    def series(self, name: str) -> dict[str, NDArray]:
        """The columns of a time series by name.

        Raises
        ------
        PackingFileError
            If there is no such series.
        """
        group = self._file.get(f"faultgouge/{name}")
        if group is None:
            raise PackingFileError(f"{self.path} has no series {name}.")
        columns = {column: group[column][: _rows(group)] for column in group}
        if name == "trajectory":
            columns["position"] = self._file["particles/disks/position/value"][len(self) :, :, :2]
        return columns

    def _put(self, name: str, value: NDArray, frame: int) -> None:
        """Write one element of one frame; the contacts' second axis grows as it must, others stay."""
        if name not in self._file:
            group = self._file.create_group(name)
            number = np.int64 if np.issubdtype(value.dtype, np.integer) else np.float64
            group.create_dataset(
                "value",
                (0, *value.shape),
                number,
                maxshape=(None,) * (value.ndim + 1),
                chunks=(1, *value.shape) if value.size > 1 else True,
                fillvalue=np.nan if number is np.float64 else 0,
                **(COMPACT if value.ndim else CHECKSUM),
            )
            for clock in ("step", "time"):
                group[clock] = self._file[f"particles/disks/position/{clock}"]
        data = self._file[name]["value"]
        size = [max(have, need) for have, need in zip(data.shape[1:], value.shape, strict=True)]
        data.resize((frame + 1, *size))
        row = np.full(size, data.fillvalue, data.dtype)
        row[tuple(slice(extent) for extent in value.shape)] = value
        data[frame] = row

    @cached_property
    def _parameters(self) -> dict[str, Any]:
        """What all frames share: written once, when the file is made."""
        return {name: item[()] for name, item in self._file["parameters"].items()}

    def _check_same(self, packing: Packing) -> None:
        parameters, values = self._parameters, parameters_of(packing)
        for name in parameters.keys() | values.keys():
            if not (name in parameters and name in values and np.array_equal(parameters[name], values[name])):
                raise ValueError(f"{self.path} was begun for a packing with another {name}.")


def _rows(group: h5py.Group) -> int:
    """Rows that every column of a series has: a killed run may have left them uneven."""
    return min((group[column].shape[0] for column in group), default=0)


def law_parameters(law: MindlinLaw) -> dict[str, float]:
    """kn, kt, mu, and the parameters of the law that differ from `LAW_DEFAULTS`."""
    more = {name: float(getattr(law, name)) for name, other in LAW_DEFAULTS.items() if getattr(law, name) != other}
    return {"kn": law.kn, "kt": law.kt, "mu": law.mu} | more


def law_of_parameters(given: Mapping[str, Any]) -> MindlinLaw:
    """The reverse of `law_parameters`; a KeyError if kn, kt or mu is missing."""
    more = {name: given[name] for name in LAW_DEFAULTS if name in given}
    return MindlinLaw(given["kn"], given["kt"], given["mu"], **more)


def parameters_of(packing: Packing) -> dict[str, Any]:
    """The constants of a run, by their names below /parameters."""
    values: dict[str, Any] = {name: getattr(packing, name) for name in ("radius", "mass", "top", "inertia_factor")}
    values |= law_parameters(packing.law)
    if packing.drag_time is not None:
        values["drag_time"] = packing.drag_time
    if packing.spring:
        values["spring"] = packing.spring
    if not packing.slips_known:
        values["slips_known"] = 0.0
    if packing.box_length is not None:
        values["box_length"] = packing.box_length
    return values


def program_version() -> str:
    """The program's version; empty where the analysis runs without being installed."""
    try:
        return version(CREATOR)
    except PackageNotFoundError:
        return ""


def write_h5md(file: h5py.File) -> None:
    """The version of H5MD, and what has written the file."""
    h5md = file.create_group("h5md")
    h5md.attrs["version"] = np.array([1, 1])
    h5md.create_group("author").attrs["name"] = CREATOR
    h5md.create_group("creator").attrs.update({"name": CREATOR, "version": program_version()})


def write_header(file: h5py.File, packing: Packing) -> None:
    """The groups and parameters of a file without frames, for the disks of a packing."""
    write_h5md(file)
    disks = file.create_group("particles/disks")
    box = disks.create_group("box")
    box.attrs["dimension"] = 3
    periodic = packing.box_length is not None
    box.attrs["boundary"] = np.array(["periodic" if periodic else "none", "none", "none"], dtype="S8")
    position = disks.create_group("position")
    position.create_dataset("step", (0,), np.int64, maxshape=(None,), **CHECKSUM)
    position.create_dataset("time", (0,), np.float64, maxshape=(None,), **CHECKSUM)
    shape = (len(packing), 3)
    position.create_dataset("value", (0, *shape), np.float64, maxshape=(None, *shape), chunks=(1, *shape), **COMPACT)
    # readers of H5MD take positions as float32, and observables as they are: a link, which takes no room
    file["observables/position"] = position
    parameters = file.create_group("parameters")
    for name, value in parameters_of(packing).items():
        parameters[name] = value
    disks["mass"] = parameters["mass"]
