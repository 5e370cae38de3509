"""Select the upper layer by a number of disks, a type, IDs, a group, or a region, in one line of text."""

from __future__ import annotations

import operator
import re

import numpy as np
from numpy.typing import NDArray

from ...analysis import BadInputError
from ...analysis.files.plain_file import read_plain_text
from .disks import Disks

WAYS = '12 (the highest), type:2, ids:1,4,7-9, ids:@FILE, group:NAME (of a restart), or a region such as "y>10"'

OPERATORS = {"<": operator.lt, ">": operator.gt, "<=": operator.le, ">=": operator.ge}
CONDITION = re.compile(r"\s*(x|y|radius)\s*(<=|>=|<|>)\s*([-+.\deE]+)\s*")


def upper_layer(disks: Disks, says: str | int | None) -> NDArray[np.bool_]:
    """Select the disks of the upper layer.

    Parameters
    ----------
    disks : Disks
        From a reader.
    says : str or int, optional
        A number of highest disks, ``type:K``, ``ids:1,4,7-9``, ``ids:@FILE`` (numbers in a file), ``group:NAME``, or
        conditions on x, y and radius joined by "and". By default the upper layer of the file.

    Returns
    -------
    ndarray of bool, shape (N,)

    Raises
    ------
    BadInputError
        If no upper layer is given, the text is not understood, or it selects no disk.
    """
    if says is None:
        if disks.top is None:
            raise BadInputError(f"{disks.source} does not say which disks are the upper layer: add --top, {WAYS}.")
        chosen = disks.top
    else:
        chosen = _choose_disks(disks, str(says).strip())
    if not chosen.any():
        what = "its own column top" if says is None else f"--top {says}"
        raise BadInputError(f"{disks.source}: the upper layer holds no disk ({what}): {_extent(disks)}.")
    return chosen


def _choose_disks(disks: Disks, says: str) -> NDArray[np.bool_]:
    key, _, value = says.partition(":")
    if says.isdecimal():
        return _highest(disks, int(says))
    if key == "type" and value.isdecimal():
        if disks.kind is None:
            raise BadInputError(f"--top {says}: {disks.source} has no types; take another of {WAYS}.")
        return disks.kind == int(value)
    if key == "ids" and value:
        return _read_list(disks, says, value)
    if key == "group" and value:
        if value not in disks.groups:
            has = ", ".join(disks.groups) or "none; restarts alone have groups"
            raise BadInputError(f"--top {says}: {disks.source} has no group {value} (its groups: {has}).")
        return disks.groups[value]
    return _region(disks, says)


def _highest(disks: Disks, count: int) -> NDArray[np.bool_]:
    if count > len(disks):
        raise BadInputError(f"--top {count}: {disks.source} has {len(disks)} disks alone.")
    chosen = np.zeros(len(disks), dtype=np.bool_)
    chosen[np.argsort(-disks.position[:, 1], kind="stable")[:count]] = True
    return chosen


def _read_list(disks: Disks, says: str, value: str) -> NDArray[np.bool_]:
    if value.startswith("@"):
        try:
            value = read_plain_text(value[1:])
        except (OSError, UnicodeDecodeError) as error:
            raise BadInputError(f"--top {says}: the file cannot be read ({error}).") from None
    wanted: set[int] = set()
    for part in re.split(r"[\s,]+", value.strip()):
        match = re.fullmatch(r"(\d+)(?:-(\d+))?", part)
        if not match:
            raise BadInputError(f"--top {says}: {part} is no ID and no range of IDs, as in ids:1,4,7-9.")
        wanted.update(range(int(match[1]), int(match[2] or match[1]) + 1))
    missing = wanted - set(disks.id.tolist())
    if missing:
        raise BadInputError(f"--top {says}: {disks.source} has no disk {min(missing)}.")
    return np.isin(disks.id, list(wanted))


def _region(disks: Disks, says: str) -> NDArray[np.bool_]:
    values = {"x": disks.position[:, 0], "y": disks.position[:, 1], "radius": disks.radius}
    chosen = np.ones(len(disks), dtype=np.bool_)
    for part in says.split(" and "):
        match = CONDITION.fullmatch(part)
        try:
            limit = float(match[3]) if match else None
        except ValueError:
            limit = None
        if match is None or limit is None:
            raise BadInputError(f"--top {says}: it is none of {WAYS}.")
        chosen &= OPERATORS[match[2]](values[match[1]], limit)
    return chosen


def _extent(disks: Disks) -> str:
    y = disks.position[:, 1]
    kinds = "" if disks.kind is None else f", and their types are {', '.join(map(str, np.unique(disks.kind)))}"
    return f"its disks go from y = {y.min():g} to {y.max():g}{kinds}"
