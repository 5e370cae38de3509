"""A packing into LAMMPS and out of it, bit for bit.

Slips travel through the per-atom arrays of fix ``slips`` (pairs) and fix ``floor``, low parts of coordinates through
that of fix ``low``, and all else through that of fix displace/disc while there is one. Every rank sees the whole
packing.
"""

from collections.abc import Mapping

import numpy as np

from ...analysis import Packing, touching
from ...analysis.packing.arrays import Floats
from ...analysis.packing.compensated import exact_sum
from .contact_graph import ContactGraph
from .contact_rows import ContactRows
from .decks import Decks
from .disk_arrays import DiskArrays
from .displacement import Displacing
from .trial_state import Trial

Arrays = dict[str, Floats]

LOW_COLUMNS = 5
STATE_COLUMNS = 10
GIVEN, POSITION, ANGLE, VELOCITY, FORCE = 0, slice(1, 3), 3, slice(4, 7), slice(7, 10)
"""Columns of fix displace/disc."""


class Wire:
    """The state of the disks in LAMMPS.

    Parameters
    ----------
    decks : Decks
        LAMMPS.
    displacing : Displacing
        Says where the state is at this moment.
    packing : Packing
        What LAMMPS holds: its radii, law and box stay.
    """

    def __init__(self, decks: Decks, displacing: Displacing, packing: Packing) -> None:
        self._decks, self._displacing, self._static = decks, displacing, packing
        ones = np.ones(len(packing))
        self.levers = np.stack([ones, ones, packing.radius])  # of forces and torques, and of displacements and turns
        self._disks = DiskArrays(decks.lammps, len(packing))
        self._rows = ContactRows(packing.radius, packing.compensated)
        self._angle = packing.angle  # LAMMPS has none without friction
        self._known: tuple[Packing, Arrays] | None = None

    def write_masses(self) -> None:
        """The masses of the packing."""
        self._disks.scatter("rmass", self._static.mass)

    def clear_forces(self) -> None:
        """Forces of zero, until the first run: LAMMPS leaves in their place what was in memory."""
        self._disks.scatter("f", np.zeros((len(self._static), 3)))

    def write(self, packing: Packing, velocity: Floats | None = None) -> None:
        """Positions, angles and slips of a packing, and velocities (v_x, v_y, omega), shape (N, 3), or none; they take
        effect at the next run's setup."""
        if self._known is None or self._known[0] is not packing:
            self._known = packing, self._arrays_of(packing)
        arrays = self._known[1]
        if packing.law.frictional:
            arrays["f_slips"] = self._of_width(arrays["f_slips"], self._disks.columns("slips"))
        else:
            self._angle = packing.angle if velocity is None else packing.angle + velocity[:, 2]
        state = arrays["f_move"]
        state[:, GIVEN], state[:, VELOCITY] = 1.0, 0.0 if velocity is None else velocity
        for name, values in arrays.items():
            if name != "f_move" or self._displacing.on:
                self._disks.scatter(name, values)
        if not self._displacing.on:
            self._disks.scatter("x", np.column_stack([packing.position, np.zeros(len(packing))]))
            if packing.law.frictional:
                self._disks.scatter("d_theta", packing.angle)

    def keep(self, trial: Trial) -> None:
        """Have LAMMPS be given what it gave, when the packing of this trial is written."""
        if not self._static.compensated:  # LAMMPS splits coordinates otherwise than packings do
            self._known = trial.packing, trial.arrays

    def read(self, displacement: Floats | None = None) -> Trial:
        """All that LAMMPS has, at the end of a displacement of shape (3N,)."""
        state = self.state()
        arrays = {"f_move": state}
        if self._static.compensated:
            arrays["f_low"] = self._disks.gather("f_low", LOW_COLUMNS)
        position, low = self._split(state, arrays.get("f_low"))
        if self._static.law.frictional:
            angle = state[:, ANGLE]
            arrays["f_slips"] = self._disks.gather("f_slips", self._disks.columns("slips"))
            arrays["f_floor"] = self._disks.gather("f_floor", self._rows.floor_columns)
            graph, slip, slip_low = self._rows.read(arrays["f_slips"], arrays["f_floor"])
        else:
            angle, contacts = self._angle, touching(position, self._static.radius, self._static.box_length)
            graph, slip, slip_low = ContactGraph(contacts, self._static.radius), contacts.slip, None
        force = self.force(state)
        return Trial(
            self._static, self._displacing.fx, position, low, angle, graph, slip, slip_low, force, arrays, displacement
        )

    def motion(self) -> tuple[Floats, Floats | None, Floats]:
        """Positions, their low parts in compensated arithmetic, and velocities (v_x, v_y, omega)."""
        state = self.state()
        low = self._disks.gather("f_low", LOW_COLUMNS) if self._static.compensated else None
        return *self._split(state, low), state[:, VELOCITY]

    def state(self) -> Floats:
        """The columns of fix displace/disc, whether there is one or not, shape (N, 10)."""
        if self._displacing.on:
            return self._disks.gather("f_move", STATE_COLUMNS)
        state = np.zeros((len(self._static), STATE_COLUMNS))
        state[:, POSITION] = self._disks.gather("x", 3)[:, :2]
        velocity, force = self._disks.gather("v", 3), self._disks.gather("f", 3)
        if self._static.law.frictional:
            state[:, ANGLE] = self._disks.gather("d_theta", 1)[:, 0]
            velocity[:, 2], force[:, 2] = (self._disks.gather(name, 3)[:, 2] for name in ("omega", "torque"))
        state[:, VELOCITY], state[:, FORCE] = velocity, force
        return state

    def force(self, state: Floats) -> Floats:
        """Forces of such columns, (Fx.., Fy.., T/R..), shape (3N,), load included."""
        return np.divide(state[:, FORCE].T, self.levers, order="C").ravel()

    def checkpoint(self) -> Arrays:
        """All that the dynamics has at this moment, by LAMMPS's names."""
        return {name: self._disks.gather(name, columns) for name, columns in self._columns().items()}

    def write_checkpoint(self, state: Mapping[str, Floats]) -> None:
        """Such a state back into LAMMPS."""
        for name, values in state.items():
            self._disks.scatter(name, self._of_width(values, self._columns()[name]) if name == "f_slips" else values)
        self._known = None

    def _columns(self) -> dict[str, int]:
        """Arrays of the state of the dynamics and their columns, as LAMMPS has them."""
        columns = {"x": 3, "v": 3}
        if self._static.compensated:
            columns["f_low"] = LOW_COLUMNS
        if self._static.law.frictional:
            columns |= {"d_theta": 1, "omega": 3, "f_floor": self._rows.floor_columns}
            columns["f_slips"] = self._disks.columns("slips")
        if self._static.law.damped:
            columns["f_dashpots"] = self._disks.columns("dashpots")
        return columns

    def _arrays_of(self, packing: Packing) -> Arrays:
        """What LAMMPS is given of a packing, by the names it has there."""
        state = np.zeros((len(packing), STATE_COLUMNS))
        state[:, POSITION], state[:, ANGLE] = packing.position, packing.angle
        arrays = {"f_move": state}
        if self._static.compensated:
            arrays["f_low"] = np.zeros((len(packing), LOW_COLUMNS))
            arrays["f_low"][:, :2] = 0.0 if packing.position_low is None else packing.position_low
        if packing.law.frictional:
            arrays["f_slips"] = self._rows.slips(packing)
            arrays["f_floor"] = self._rows.floor(packing)
        return arrays

    def _of_width(self, slips: Floats, columns: int) -> Floats:
        """Rows of fix slips as wide as LAMMPS has them, or LAMMPS's as wide as these."""
        missing = columns - slips.shape[1]
        if missing < 0:
            self._decks.command(f"fix_modify slips capacity {(slips.shape[1] - 1) // self._rows.width}")
        return np.pad(slips, ((0, 0), (0, missing))) if missing > 0 else slips

    @staticmethod
    def _split(state: Floats, low: Floats | None) -> tuple[Floats, Floats | None]:
        """Coordinates and their low parts, if there are any, as packings have them."""
        return (state[:, POSITION], None) if low is None else exact_sum(state[:, POSITION], low[:, :2])
