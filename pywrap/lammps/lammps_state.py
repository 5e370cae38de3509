"""The state of the disks in LAMMPS: a packing goes in and out, bit for bit, and is displaced in between.

Arrays stand in the order of IDs, and every rank has the whole of them. LAMMPS's library reads and writes NumPy's
memory; by way of LAMMPS's Python module there would be copies in between. Slips travel through the per-atom arrays of
fix ``slips`` (pairs) and fix ``floor``, low parts of coordinates through that of fix ``low``, and all else through that
of fix displace/disc while there is one.

LAMMPS sees a displacement as the motion of one time step of length one, which fix displace/disc makes. The fix stays
from one displacement to the next, with LAMMPS set up for it and the load a variable, and goes when something else is
asked for.

A row of fix ``slips`` is [own ID, partner's ID, slip, partner's ID, slip, ...], partners in the order of their IDs,
both partners with a row for their contact; a row of fix ``floor`` has the columns of fix wall/mindlin/smooth. In
compensated arithmetic each slip has its low part beside it. See fix_slip_history.h and fix_wall_mindlin_smooth.h.
"""

from collections.abc import Callable, Mapping
from ctypes import POINTER, c_int
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from ...analysis import FLOOR, Contacts, Packing, touching
from ...analysis.arrays import Floats
from ...analysis.packing.compensated import exact_sum
from .contact_graph import ContactGraph
from .decks import Decks
from .trial_state import Trial

Arrays: TypeAlias = dict[str, Floats]
Channel: TypeAlias = tuple[Floats, Callable[[], None], Callable[[], None]]
"""Memory whose address is looked up once, and what takes one array of LAMMPS there and back."""

LAMMPS_DOUBLE = 1
"""The number for doubles in LAMMPS's library."""

LOW_COLUMNS, STATE_COLUMNS = 5, 10
"""Columns of fix ``low``, and of fix displace/disc."""

GIVEN_COLUMN, ANGLE_COLUMN = 0, 3
POSITION_COLUMNS, VELOCITY_COLUMNS, FORCE_COLUMNS = slice(1, 3), slice(4, 7), slice(7, 10)
"""Columns of fix displace/disc."""

FLOOR_SLIP, FLOOR_OVERLAP, FLOOR_SLIP_LOW = 2, 6, 7
"""Columns of fix wall/mindlin/smooth."""


class LammpsState:
    """The disks of a LAMMPS instance; collective.

    Parameters
    ----------
    packing : Packing
        What LAMMPS holds: its radii, law and box stay.

    Attributes
    ----------
    fx : float
        Force along x on each disk of the upper layer.
    levers : ndarray, shape (3, N)
        Of forces and torques, and of displacements and turns: 1, 1 and R (length).
    """

    def __init__(self, decks: Decks, packing: Packing) -> None:
        from lammps import LMP_SIZE_COLS, LMP_STYLE_ATOM

        self._decks, self._static, self.fx = decks, packing, packing.fx
        ones = np.ones(len(packing))
        self.levers = np.stack([ones, ones, packing.radius])
        self._slip_width = 3 if packing.compensated else 2
        self._floor_columns = (FLOOR_SLIP_LOW if packing.compensated else FLOOR_OVERLAP) + 1
        self._displacing = False  # whether fix displace/disc is there
        self._set_up = False  # whether LAMMPS is, for the next displacement
        self._angle = packing.angle  # LAMMPS has none without friction
        self._known: tuple[Packing, Arrays] | None = None
        self._contacts_seen = b""  # partners and who is on the floor, of _graph
        self._library, self._channels = decks.lammps.lib, dict[tuple[str, int], Channel]()
        self._size_of_fix = LMP_STYLE_ATOM, LMP_SIZE_COLS, 0, 0
        self._extract_fix = self._library["lammps_extract_fix"]  # a function of our own: that of the module is shared
        self._extract_fix.argtypes = self._library.lammps_extract_fix.argtypes
        self._extract_fix.restype = POINTER(c_int)

    # displacements, and the load meanwhile

    def set_fx(self, fx: float) -> None:
        """Set the force along x on each disk of the upper layer."""
        self.fx = float(fx)
        if self._displacing:
            self._decks.lammps.set_internal_variable("load", self.fx)
        else:
            self._load(repr(self.fx))

    def begin_displacements(self) -> None:
        """Make the fix that displaces, unless it is there."""
        if self._displacing:
            return
        self._decks.command("timestep 1.0")
        self._decks.command(f"variable load internal {self.fx!r}")
        self._load("v_load")
        rotation = "yes" if self._static.law.frictional else "no"
        compensated = " compensated" * self._static.compensated
        self._decks.command(f"fix move all displace/disc rotation {rotation}{compensated}")
        self._displacing, self._set_up = True, False

    def displace(self, base: Packing, displacement: Floats) -> Trial:
        """Where a displacement (dx.., dy.., R dtheta..), shape (3N,), leads from a packing."""
        self.begin_displacements()
        self.write(base, (displacement.reshape(3, -1) / self.levers).T)
        setup, self._set_up = "pre no " if self._set_up else "", False
        self._decks.command(f"run 1 {setup}post no")
        self._set_up = True
        return self.read(displacement)

    def end_displacements(self) -> None:
        """Remove the fix that displaces, if it is there."""
        if self._displacing:
            self._displacing = False
            self._decks.command("unfix move")
            self.set_fx(self.fx)
            self._decks.command("variable load delete")

    def _load(self, fx: str) -> None:
        self._decks.command(f"fix load top addforce {fx} {-self._static.fy!r} 0.0")

    # a packing in

    def write_masses(self) -> None:
        """The masses of the packing."""
        self._scatter("rmass", self._static.mass)

    def clear_forces(self) -> None:
        """Set the forces to zero: until its first run LAMMPS leaves them uninitialised."""
        self._scatter("f", np.zeros((len(self._static), 3)))

    def write(self, packing: Packing, velocity: Floats | None = None) -> None:
        """Positions, angles and slips of a packing, and velocities (v_x, v_y, omega), shape (N, 3), or none; they take
        effect at the next run's setup."""
        if self._known is None or self._known[0] is not packing:
            self._known = packing, self._arrays_of(packing)
        arrays = self._known[1]
        if packing.law.frictional:
            arrays["f_slips"] = self._of_width(arrays["f_slips"], self._columns_of("slips"))
        else:
            self._angle = packing.angle if velocity is None else packing.angle + velocity[:, 2]
        state = arrays["f_move"]
        state[:, GIVEN_COLUMN], state[:, VELOCITY_COLUMNS] = 1.0, 0.0 if velocity is None else velocity
        for name, values in arrays.items():
            if name != "f_move" or self._displacing:
                self._scatter(name, values)
        if not self._displacing:
            self._scatter("x", np.column_stack([packing.position, np.zeros(len(packing))]))
            if packing.law.frictional:
                self._scatter("d_theta", packing.angle)

    def keep(self, trial: Trial) -> None:
        """Remember LAMMPS's own arrays of this trial, so that writing its packing back restores the same bits."""
        if not self._static.compensated:  # LAMMPS splits coordinates otherwise than packings do
            self._known = trial.packing, trial.arrays

    def _arrays_of(self, packing: Packing) -> Arrays:
        """The arrays of a packing that LAMMPS receives, by their names in LAMMPS."""
        state = np.zeros((len(packing), STATE_COLUMNS))
        state[:, POSITION_COLUMNS], state[:, ANGLE_COLUMN] = packing.position, packing.angle
        arrays = {"f_move": state}
        if self._static.compensated:
            arrays["f_low"] = np.zeros((len(packing), LOW_COLUMNS))
            arrays["f_low"][:, :2] = 0.0 if packing.position_low is None else packing.position_low
        if packing.law.frictional:
            arrays["f_slips"] = self._slip_rows(packing)
            arrays["f_floor"] = self._floor_rows(packing)
        return arrays

    def _slip_rows(self, packing: Packing) -> Floats:
        """Rows of fix slips, as long as the disk with most contacts needs, shape (N, 1 + width M)."""
        contacts, width = packing.contacts, self._slip_width
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
        if self._static.compensated and contacts.slip_low is not None:
            rows[owner, 3 + width * place] = contacts.slip_low[pair]
        return rows

    def _floor_rows(self, packing: Packing) -> Floats:
        """Rows of fix floor, as far as LAMMPS reads them, shape (N, floor_columns)."""
        contacts = packing.contacts
        on_floor = contacts.floor
        disk = contacts.i[on_floor]
        rows = np.zeros((len(packing), self._floor_columns))
        rows[disk, FLOOR_SLIP] = contacts.slip[on_floor]
        if self._static.compensated and contacts.slip_low is not None:
            rows[disk, FLOOR_SLIP_LOW] = contacts.slip_low[on_floor]
        rows[disk, FLOOR_OVERLAP] = packing.radius[disk] - packing.position[disk, 1]
        if packing.position_low is not None:
            rows[disk, FLOOR_OVERLAP] -= packing.position_low[disk, 1]
        return rows

    def _of_width(self, slips: Floats, columns: int) -> Floats:
        """Rows of fix slips as wide as LAMMPS has them, or LAMMPS's as wide as these."""
        missing = columns - slips.shape[1]
        if missing < 0:
            self._decks.command(f"fix_modify slips capacity {(slips.shape[1] - 1) // self._slip_width}")
        return np.pad(slips, ((0, 0), (0, missing))) if missing > 0 else slips

    # and out

    def read(self, displacement: Floats | None = None) -> Trial:
        """All that LAMMPS has, at the end of a displacement of shape (3N,)."""
        columns = self._state_columns()
        arrays = {"f_move": columns}
        if self._static.compensated:
            arrays["f_low"] = self._gather("f_low", LOW_COLUMNS)
        position, low = self._split(columns, arrays.get("f_low"))
        if self._static.law.frictional:
            angle = columns[:, ANGLE_COLUMN]
            arrays["f_slips"] = self._gather("f_slips", self._columns_of("slips"))
            arrays["f_floor"] = self._gather("f_floor", self._floor_columns)
            graph, slip, slip_low = self._contacts(arrays["f_slips"], arrays["f_floor"])
        else:
            angle, contacts = self._angle, touching(position, self._static.radius, self._static.box_length)
            graph, slip, slip_low = ContactGraph(contacts, self._static.radius), contacts.slip, None
        force = self._net_force(columns)
        return Trial(self._static, self.fx, position, low, angle, graph, slip, slip_low, force, arrays, displacement)

    def net_force(self) -> Floats:
        """Forces, (Fx.., Fy.., T/R..), shape (3N,), load included."""
        return self._net_force(self._state_columns())

    def motion(self) -> tuple[Floats, Floats | None, Floats]:
        """Positions, their low parts in compensated arithmetic, and velocities (v_x, v_y, omega)."""
        columns = self._state_columns()
        low = self._gather("f_low", LOW_COLUMNS) if self._static.compensated else None
        return *self._split(columns, low), columns[:, VELOCITY_COLUMNS]

    def _net_force(self, columns: Floats) -> Floats:
        return np.divide(columns[:, FORCE_COLUMNS].T, self.levers, order="C").ravel()

    def _state_columns(self) -> Floats:
        """The columns of fix displace/disc, whether there is one or not, shape (N, 10)."""
        if self._displacing:
            return self._gather("f_move", STATE_COLUMNS)
        columns = np.zeros((len(self._static), STATE_COLUMNS))
        columns[:, POSITION_COLUMNS] = self._gather("x", 3)[:, :2]
        velocity, force = self._gather("v", 3), self._gather("f", 3)
        if self._static.law.frictional:
            columns[:, ANGLE_COLUMN] = self._gather("d_theta", 1)[:, 0]
            velocity[:, 2], force[:, 2] = (self._gather(name, 3)[:, 2] for name in ("omega", "torque"))
        columns[:, VELOCITY_COLUMNS], columns[:, FORCE_COLUMNS] = velocity, force
        return columns

    def _contacts(self, slips: Floats, floor: Floats) -> tuple[ContactGraph, Floats, Floats | None]:
        """The contacts in rows of both fixes: the graph, which is the last one if nothing has changed, slips and their
        low parts, shape (C,)."""
        partners, on_floor = slips[:, 1 :: self._slip_width], floor[:, FLOOR_OVERLAP] > 0
        seen = partners.tobytes() + on_floor.tobytes()
        if seen != self._contacts_seen:
            self._contacts_seen = seen
            i, place = np.nonzero(partners > np.arange(1, len(slips) + 1)[:, None])
            disk = np.flatnonzero(on_floor)
            self._slip_places = i * slips.shape[1] + 2 + self._slip_width * place
            self._floor_places = disk * floor.shape[1] + FLOOR_SLIP
            j = partners[i, place].astype(np.int64) - 1
            i = np.concatenate([i, disk])
            j = np.concatenate([j, np.full(len(disk), FLOOR)])
            self._graph = ContactGraph(Contacts(i, j, np.zeros(len(i))), self._static.radius)
        slip = np.concatenate([slips.take(self._slip_places), floor.take(self._floor_places)])
        if not self._static.compensated:
            return self._graph, slip, None
        low = slips.take(self._slip_places + 1), floor.take(self._floor_places + FLOOR_SLIP_LOW - FLOOR_SLIP)
        return self._graph, slip, np.concatenate(low)

    @staticmethod
    def _split(columns: Floats, low: Floats | None) -> tuple[Floats, Floats | None]:
        """Coordinates and their low parts, if there are any, as packings have them."""
        return (
            (columns[:, POSITION_COLUMNS], None) if low is None else exact_sum(columns[:, POSITION_COLUMNS], low[:, :2])
        )

    # all that a run has, to go on from there

    def checkpoint(self) -> Arrays:
        """The state of the dynamics: arrays by their names in LAMMPS."""
        return {name: self._gather(name, columns) for name, columns in self._checkpoint_columns().items()}

    def write_checkpoint(self, arrays: Mapping[str, Floats]) -> None:
        """Write the result of `checkpoint` back into LAMMPS."""
        for name, values in arrays.items():
            if name == "f_slips":
                values = self._of_width(values, self._checkpoint_columns()[name])
            self._scatter(name, values)
        self._known = None

    def _checkpoint_columns(self) -> dict[str, int]:
        """Arrays of the state of the dynamics and their columns, as LAMMPS has them."""
        columns = {"x": 3, "v": 3}
        if self._static.compensated:
            columns["f_low"] = LOW_COLUMNS
        if self._static.law.frictional:
            columns |= {"d_theta": 1, "omega": 3, "f_floor": self._floor_columns}
            columns["f_slips"] = self._columns_of("slips")
        if self._static.law.damped:
            columns["f_dashpots"] = self._columns_of("dashpots")
        return columns

    def periods(self) -> Floats:
        """By how many periods LAMMPS has wrapped each disk along x, y and z, shape (N, 3)."""
        counts = self._decks.lammps.gather_atoms("image", 0, 3)
        return np.array(counts, dtype=np.float64).reshape(-1, 3)

    def write_periods(self, periods: Floats) -> None:
        """Write the result of `periods` back into LAMMPS."""
        counts = periods.astype(np.int32).ravel()
        self._decks.lammps.scatter_atoms("image", 0, 3, (c_int * len(counts))(*counts.tolist()))

    # LAMMPS's arrays

    def _gather(self, name: str, columns: int) -> Floats:
        """An array of LAMMPS (x, v, f ..., f_FIX, d_NAME), shape (N, columns)."""
        values, gather, _ = self._channel(name, columns)
        self._call(gather)
        return values.copy()

    def _scatter(self, name: str, values: Floats) -> None:
        """Write an array of LAMMPS, shape (N,) or (N, columns); arrays of fixes take effect with the next run."""
        memory, _, scatter = self._channel(name, values.size // len(self._static))
        memory.reshape(values.shape)[...] = values
        self._call(scatter)

    def _columns_of(self, fix: str) -> int:
        """Columns of the array of a fix."""
        return int(self._extract_fix(self._decks.lammps.lmp, fix.encode(), *self._size_of_fix)[0])

    def _channel(self, name: str, columns: int) -> Channel:
        if (name, columns) not in self._channels:
            kind = "" if name[:2] in ("f_", "d_") else "_atoms"
            values = np.zeros((len(self._static), columns))
            arguments: tuple[Any, ...] = (
                self._decks.lammps.lmp,
                name.encode(),
                LAMMPS_DOUBLE,
                columns,
                values.ctypes.data,
            )
            gather, scatter = (
                partial(getattr(self._library, f"lammps_{way}{kind}"), *arguments) for way in ("gather", "scatter")
            )
            self._channels[name, columns] = values, gather, scatter
        return self._channels[name, columns]

    def _call(self, function: Callable[[], None]) -> None:
        function()
        if self._library.lammps_has_error(self._decks.lammps.lmp):
            raise self._decks.lammps._lammps_exception
