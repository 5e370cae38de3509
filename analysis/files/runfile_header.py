"""The beginning of a run.h5, before its first frame: groups, parameters, and the storage of datasets.

The format is described in :mod:`~faultgouge.analysis.files.runfile`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np

from ..packing.law import MindlinLaw
from ..packing.packing import Packing

if TYPE_CHECKING:
    import h5py

CREATOR = "faultgouge"

CHECKSUM = {"fletcher32": True}
"""A checksum for every chunk, for readers other than this one."""

LAW_DEFAULTS = {field.name: field.default for field in fields(MindlinLaw) if field.default is not MISSING}
"""Default parameters of the law, which a file need not have."""

COMPACT = {"shuffle": True, "compression": "gzip", "compression_opts": 1, **CHECKSUM}
"""Filters of what is stored for every disk or contact: half the size, mostly from indices and equal leading bytes, at a
few milliseconds for a thousand disks. Slower ones gain 3 % more."""


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


def write_header(file: h5py.File, packing: Packing) -> None:
    """The groups and parameters of a file without frames, for the disks of a packing."""
    h5md = file.create_group("h5md")
    h5md.attrs["version"] = np.array([1, 1])
    h5md.create_group("author").attrs["name"] = CREATOR
    creator = h5md.create_group("creator")
    creator.attrs["name"], creator.attrs["version"] = CREATOR, program_version()
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
