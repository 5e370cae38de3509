"""Select the upper layer by a number of disks, a type, IDs, a group, or a region, in one line of text."""

from __future__ import annotations

import operator
import re

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInputError
from ...packing.geometry import touching
from ..plain_file import read_plain_text
from .disks import Disks

LAYER_WAYS = (
    "12 (the highest that touch something), type:2, type:NAME, ids:1,4,7-9, ids:@FILE, group:NAME (of a restart), or a "
    'region such as "y>10"'
)

LEAST_TOUCHING_SHARE = 0.5
"""Share of disks that touch something below which a packing is not at rest yet, and contacts tell nothing."""

MOST_NAMES = 10
"""Disks that are named; more are counted."""

OPERATORS = {"<": operator.lt, ">": operator.gt, "<=": operator.le, ">=": operator.ge}
REGION = re.compile(r"\s*(x|y|radius)\s*(<=|>=|<|>)\s*([-+.\deE]+)\s*")


class UpperLayerError(BadInputError):
    """The upper layer is not given, or its text is not understood, or names what a file does not have.

    Parameters
    ----------
    layer : str or None
        The text, if one is given.
    reason : str
        What is wrong, without a stop.
    """

    def __init__(self, layer: str | None, reason: str) -> None:
        super().__init__(layer, reason)
        self.layer, self.reason = layer, reason

    def __str__(self) -> str:
        return self.sentence("--top")

    def sentence(self, key: str, sign: str = " ") -> str:
        """The sentence, with the name by which a user gives the layer, and the sign between both."""
        if self.layer is None:
            return f"{self.reason}: add {key}, {LAYER_WAYS}."
        return f"{key}{sign}{self.layer}: {self.reason}."


def upper_layer(disks: Disks, says: str | int | None) -> NDArray[np.bool_]:
    """Select the disks of the upper layer.

    Parameters
    ----------
    disks : Disks
        From a reader.
    says : str or int, optional
        A number of highest disks that touch something, ``type:K`` or ``type:NAME``, ``ids:1,4,7-9``, ``ids:@FILE``
        (numbers in a file), ``group:NAME``, or conditions on x, y and radius joined by "and". By default the upper
        layer of the file.

    Returns
    -------
    ndarray of bool, shape (N,)

    Raises
    ------
    UpperLayerError
        If no upper layer is given, the text is not understood, or it selects no disk.
    BadInputError
        If the upper layer of the file holds no disk.
    """
    if says is None:
        if disks.top is None:
            raise UpperLayerError(None, f"{disks.source} does not say which disks are the upper layer")
        if not disks.top.any():
            raise BadInputError(f"{disks.source}: its own column top holds no disk: {_extent(disks)}.")
        return disks.top
    text = str(says).strip()
    chosen = _choose_disks(disks, text)
    if not chosen.any():
        raise UpperLayerError(text, f"this layer of {disks.source} holds no disk: {_extent(disks)}")
    return chosen


def _choose_disks(disks: Disks, says: str) -> NDArray[np.bool_]:
    key, _, value = says.partition(":")
    if says.isdecimal():
        return _highest(disks, int(says))
    if key == "type" and value:
        return _of_type(disks, says, value)
    if key == "ids" and value:
        return _read_list(disks, says, value)
    if key == "group" and value:
        if value not in disks.groups:
            has = ", ".join(disks.groups) or "none; restarts alone have groups"
            raise UpperLayerError(says, f"{disks.source} has no group {value} (its groups: {has})")
        return disks.groups[value]
    return _region(disks, says)


def _of_type(disks: Disks, says: str, value: str) -> NDArray[np.bool_]:
    """Disks of a type by its name, or by its number where types have no such name."""
    if value in disks.types:
        return disks.types[value]
    if value.isdecimal() and disks.kind is not None:
        return disks.kind == int(value)
    if disks.types:
        has = ", ".join(disks.types)
        raise UpperLayerError(says, f"{disks.source} has no type {value} (its types: {has})")
    if disks.kind is None:
        raise UpperLayerError(says, f"{disks.source} has no types; take another of {LAYER_WAYS}")
    raise UpperLayerError(says, f"the types of {disks.source} have no names: give a number, as in type:2")


def _highest(disks: Disks, count: int) -> NDArray[np.bool_]:
    """The highest disks that touch something; the highest of all disks if too few have a contact."""
    if count > len(disks):
        raise UpperLayerError(str(count), f"{disks.source} has {len(disks)} disks alone")
    order = np.argsort(-disks.position[:, 1], kind="stable")
    held = ~touching_nothing(disks)[order]
    if held.sum() >= max(count, LEAST_TOUCHING_SHARE * len(disks)):
        order = order[held]
    chosen = np.zeros(len(disks), dtype=np.bool_)
    chosen[order[:count]] = True
    return chosen


def touching_nothing(disks: Disks) -> NDArray[np.bool_]:
    """Disks that touch neither another disk nor the floor, shape (N,)."""
    contacts = touching(disks.position, disks.radius, disks.box_length)
    alone = np.ones(len(disks), dtype=np.bool_)
    alone[contacts.i] = alone[contacts.j[~contacts.floor]] = False
    return alone


def layer_remark(disks: Disks, says: str | None, layer: NDArray[np.bool_]) -> str:
    """A remark on disks that touch nothing, in the layer or above it; empty for none, or too many."""
    alone = touching_nothing(disks)
    if alone.mean() > 1 - LEAST_TOUCHING_SHARE:
        return ""
    loose = disks.id[layer & alone].tolist()
    if loose:
        return f"{len(loose)} of the {layer.sum()} disks of the upper layer touch nothing: {_list_ids(loose)}"
    if says is None or not says.strip().isdecimal():
        return ""
    above = disks.id[alone & (disks.position[:, 1] > disks.position[layer, 1].min())].tolist()
    return (
        f"--top {says} leaves out {len(above)} of the highest disks, which touch nothing: {_list_ids(above)}"
        if above
        else ""
    )


def _list_ids(ids: list[int]) -> str:
    return ", ".join(map(str, ids[:MOST_NAMES])) + (", ..." if len(ids) > MOST_NAMES else "")


def _read_list(disks: Disks, says: str, value: str) -> NDArray[np.bool_]:
    if value.startswith("@"):
        try:
            value = read_plain_text(value[1:])
        except (OSError, UnicodeDecodeError) as error:
            raise UpperLayerError(says, f"the file cannot be read ({error})") from None
    wanted: set[int] = set()
    for part in re.split(r"[\s,]+", value.strip()):
        match = re.fullmatch(r"(\d+)(?:-(\d+))?", part)
        if not match:
            raise UpperLayerError(says, f"{part} is no ID and no range of IDs, as in ids:1,4,7-9")
        wanted.update(range(int(match[1]), int(match[2] or match[1]) + 1))
    missing = wanted - set(disks.id.tolist())
    if missing:
        raise UpperLayerError(says, f"{disks.source} has no disk {min(missing)}")
    return np.isin(disks.id, list(wanted))


def _region(disks: Disks, says: str) -> NDArray[np.bool_]:
    values = {"x": disks.position[:, 0], "y": disks.position[:, 1], "radius": disks.radius}
    chosen = np.ones(len(disks), dtype=np.bool_)
    for part in says.split(" and "):
        match = REGION.fullmatch(part)
        try:
            limit = float(match[3]) if match else None
        except ValueError:
            limit = None
        if match is None or limit is None:
            raise UpperLayerError(says, f"it is none of {LAYER_WAYS}")
        chosen &= OPERATORS[match[2]](values[match[1]], limit)
    return chosen


def _extent(disks: Disks) -> str:
    y = disks.position[:, 1]
    types = list(disks.types) or ([] if disks.kind is None else np.unique(disks.kind).tolist())
    kinds = f", and their types are {', '.join(map(str, types))}" if types else ""
    return f"its disks go from y = {y.min():g} to {y.max():g}{kinds}"
