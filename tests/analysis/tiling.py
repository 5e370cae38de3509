"""Copies of a periodic packing side by side."""

from dataclasses import replace

import numpy as np

from faultgouge.analysis import Contacts, Packing


def tile(cell: Packing, copies: int) -> Packing:
    """Copies side by side, in balance as the packing itself is."""
    n, contacts = len(cell), cell.contacts
    index = np.arange(copies)[:, None]
    across = (cell.position[contacts.i, 0] - cell.position[contacts.j, 0]) / cell.box_length
    image = np.where(contacts.floor, 0, np.round(across).astype(int))
    j = np.where(contacts.floor, -1, contacts.j + n * ((index + image) % copies))
    shift = np.column_stack([cell.box_length * np.arange(copies), np.zeros(copies)])
    many = {name: np.tile(getattr(cell, name), copies) for name in ("radius", "angle", "mass", "top")}
    joined = Contacts((contacts.i + n * index).ravel(), j.ravel(), np.tile(contacts.slip, copies))
    position = (cell.position + shift[:, None]).reshape(-1, 2)
    return replace(cell, position=position, box_length=copies * cell.box_length, contacts=joined, **many)
