"""Contacts as LAMMPS keeps them: a row for each disk in fix ``slips`` (pairs) and one in fix ``floor``.

A row of ``slips`` is [own ID, partner's ID, slip, partner's ID, slip, ...], partners in the order of their IDs, both
partners with a row for their contact; a row of ``floor`` has the columns of fix wall/mindlin/smooth. In compensated
arithmetic each slip has its low part beside it. See fix_slip_history.h and fix_wall_mindlin_smooth.h.
"""

import numpy as np

from ...analysis import FLOOR, Contacts, Packing
from ...analysis.packing.arrays import Floats
from .contact_graph import ContactGraph

FLOOR_SLIP, FLOOR_OVERLAP, FLOOR_SLIP_LOW = 2, 6, 7


class ContactRows:
    """Contacts to rows and back.

    Parameters
    ----------
    radius : ndarray, shape (N,)
        Of the disks, length.
    compensated : bool
        Whether slips have low parts.
    """

    def __init__(self, radius: Floats, compensated: bool) -> None:
        self._radius, self._compensated = radius, compensated
        self.width = 3 if compensated else 2
        self.floor_columns = (FLOOR_SLIP_LOW if compensated else FLOOR_OVERLAP) + 1
        self._seen = b""  # partners and who is on the floor, of _graph

    def slips(self, packing: Packing) -> Floats:
        """Rows of fix slips, as long as the disk with most contacts needs, shape (N, 1 + width M)."""
        contacts, width = packing.contacts, self.width
        pairs = len(contacts) - np.count_nonzero(contacts.floor)
        i, j = contacts.i[:pairs], contacts.j[:pairs]
        owner, partner = np.concatenate([j, i]), np.concatenate([i, j])
        # pairs are in lexicographic order: partners with smaller IDs come first, and both kinds in order
        order = np.argsort(owner, kind="stable")
        owner, partner, pair = owner[order], partner[order], order % max(pairs, 1)
        place = np.arange(len(owner)) - np.searchsorted(owner, owner)
        rows = np.zeros((len(packing), 1 + width * (int(place.max(initial=-1)) + 1)))
        rows[owner, 0] = owner + 1
        rows[owner, 1 + width * place] = partner + 1
        rows[owner, 2 + width * place] = contacts.slip[pair]
        if self._compensated and contacts.slip_low is not None:
            rows[owner, 3 + width * place] = contacts.slip_low[pair]
        return rows

    def floor(self, packing: Packing) -> Floats:
        """Rows of fix floor, as far as LAMMPS reads them, shape (N, floor_columns)."""
        contacts = packing.contacts
        touching = contacts.floor
        disk = contacts.i[touching]
        rows = np.zeros((len(packing), self.floor_columns))
        rows[disk, FLOOR_SLIP] = contacts.slip[touching]
        if self._compensated and contacts.slip_low is not None:
            rows[disk, FLOOR_SLIP_LOW] = contacts.slip_low[touching]
        rows[disk, FLOOR_OVERLAP] = packing.radius[disk] - packing.position[disk, 1]
        if packing.position_low is not None:
            rows[disk, FLOOR_OVERLAP] -= packing.position_low[disk, 1]
        return rows

    def read(self, slips: Floats, floor: Floats) -> tuple[ContactGraph, Floats, Floats | None]:
        """The contacts in rows of both fixes: the graph, which is the last one if nothing has changed, slips and their
        low parts, shape (C,)."""
        partners, touching = slips[:, 1 :: self.width], floor[:, FLOOR_OVERLAP] > 0
        seen = partners.tobytes() + touching.tobytes()
        if seen != self._seen:
            self._seen = seen
            i, place = np.nonzero(partners > np.arange(1, len(slips) + 1)[:, None])
            disk = np.flatnonzero(touching)
            self._place = i * slips.shape[1] + 2 + self.width * place
            self._floor_place = disk * floor.shape[1] + FLOOR_SLIP
            j = partners[i, place].astype(np.int64) - 1
            i = np.concatenate([i, disk])
            j = np.concatenate([j, np.full(len(disk), FLOOR)])
            self._graph = ContactGraph(Contacts(i, j, np.zeros(len(i))), self._radius)
        slip = np.concatenate([slips.take(self._place), floor.take(self._floor_place)])
        if not self._compensated:
            return self._graph, slip, None
        low = slips.take(self._place + 1), floor.take(self._floor_place + FLOOR_SLIP_LOW - FLOOR_SLIP)
        return self._graph, slip, np.concatenate(low)
