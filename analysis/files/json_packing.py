"""Packings as JSON, written by hand: positions without contacts or history."""

import json
import zlib
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import PackingFileError
from ..packing.geometry import touching
from ..packing.law import MindlinLaw
from ..packing.packing import Packing
from .plain_file import open_text


def read_packing(
    path: str | PathLike[str],
    law: MindlinLaw,
    *,
    inertia_factor: float = 1.0,
    fy: float = 0.0,
) -> Packing:
    """Read a packing from JSON; all disks that touch are in contact, with zero slip.

    Parameters
    ----------
    path : path
        A JSON object with the lists x, y, radius (length), optionally top (indices of the upper layer, from
        0, or true and false for each disk), mass (of each disk, or of all; 1 without) and box_length (period along x).
        Other keys are ignored. It may be compressed by gzip.
    law : MindlinLaw
        The law of its contacts.
    inertia_factor, fy : float
        As in :class:`~faultgouge.analysis.Packing`.

    Returns
    -------
    Packing

    Raises
    ------
    PackingFileError
        If the file is missing, is not JSON, lacks a key, or describes no possible packing.
    """
    path = Path(path)
    try:
        with open_text(path) as stream:
            data = json.load(stream)
        position = np.column_stack([data["x"], data["y"]])
        radius = np.asarray(data["radius"], dtype=np.float64)
        top = _upper_layer(data.get("top", []), len(radius))
        box_length, mass = data.get("box_length"), data.get("mass")
        return Packing(
            position=position,
            radius=radius,
            contacts=touching(position, radius, box_length),
            law=law,
            mass=None if mass is None else np.broadcast_to(np.asarray(mass, dtype=np.float64), radius.shape),
            inertia_factor=inertia_factor,
            box_length=box_length,
            top=top,
            fy=fy,
        )
    except (OSError, EOFError, zlib.error) as error:
        raise PackingFileError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}.") from error
    except KeyError as error:
        raise PackingFileError(
            f"{path} lacks the key {error}; a packing file has x, y, radius, top, box_length."
        ) from error
    except (TypeError, AttributeError, ValueError, OverflowError) as error:
        raise PackingFileError(f"{path} is not a packing file: {error}") from error
    except RecursionError as error:
        raise PackingFileError(f"{path} is not a packing file: its brackets are nested too deeply") from error


def _upper_layer(listed: object, disks: int) -> NDArray[np.bool_]:
    """The upper layer from indices of disks, or from true and false for each, shape (N,)."""
    says = np.asarray(listed)
    if says.dtype == np.bool_ and says.shape == (disks,):
        return says
    if says.size and (not np.issubdtype(says.dtype, np.integer) or says.min() < 0 or says.max() >= disks):
        raise ValueError("top must hold indices of disks, counted from 0, or true and false for each disk.")
    top = np.zeros(disks, dtype=np.bool_)
    top[says.astype(np.int64)] = True
    return top
