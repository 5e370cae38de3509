"""Packings given by hand, as JSON: positions without contacts or history."""

import json
from os import PathLike
from pathlib import Path

import numpy as np

from ..errors import PackingFileError
from ..packing.geometry import touching
from ..packing.law import MindlinLaw
from ..packing.packing import Packing
from .plain_file import read_plain_text


def read_packing(
    path: str | PathLike[str],
    law: MindlinLaw,
    *,
    inertia_factor: float = 1.0,
    fy: float = 0.0,
) -> Packing:
    """Read a packing from JSON; everything that touches is in contact, with zero slip.

    Parameters
    ----------
    path : path
        A JSON object with the lists x, y, radius (length), optionally top (indices of the upper layer, from
        0) and box_length (period along x). Other keys are ignored.
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
        data = json.loads(read_plain_text(path))
        position = np.column_stack([data["x"], data["y"]])
        radius = np.asarray(data["radius"], dtype=np.float64)
        top = np.zeros(len(radius), dtype=np.bool_)
        listed = np.asarray(data.get("top", []))
        if listed.size and (
            not np.issubdtype(listed.dtype, np.integer) or listed.min() < 0 or listed.max() >= len(top)
        ):
            raise ValueError("top must hold indices of disks, counted from 0.")
        top[listed.astype(np.int64)] = True
        box_length = data.get("box_length")
        return Packing(
            position=position,
            radius=radius,
            contacts=touching(position, radius, box_length),
            law=law,
            inertia_factor=inertia_factor,
            box_length=box_length,
            top=top,
            fy=fy,
        )
    except OSError as error:
        raise PackingFileError(f"{path} cannot be read: {error.strerror}.") from error
    except KeyError as error:
        raise PackingFileError(
            f"{path} lacks the key {error}; a packing file has x, y, radius, top, box_length."
        ) from error
    except (TypeError, AttributeError, ValueError, OverflowError) as error:
        raise PackingFileError(f"{path} is not a packing file: {error}") from error
    except RecursionError as error:
        raise PackingFileError(f"{path} is not a packing file: its brackets are nested too deeply") from error
