"""Displacements of the disks, and the load meanwhile.

LAMMPS sees a displacement as the motion of one time step of length one, which fix displace/disc makes. The fix stays
from one displacement to the next, with LAMMPS set up for it and the load a variable, and goes when something else is
asked for.
"""

from ...analysis import Packing
from .decks import Decks


class Displacing:
    """Whether disks are displaced, and the load in either case.

    Parameters
    ----------
    decks : Decks
        LAMMPS.
    packing : Packing
        What it holds.

    Attributes
    ----------
    fx : float
        Force along x on each disk of the upper layer.
    on : bool
        Whether fix displace/disc is there.
    """

    def __init__(self, decks: Decks, packing: Packing) -> None:
        self._decks, self._packing = decks, packing
        self.fx = packing.fx
        self.on = False
        self._set_up = False  # whether LAMMPS is, for the next displacement

    def load(self, fx: float) -> None:
        """Set the force along x on each disk of the upper layer."""
        self.fx = float(fx)
        if self.on:
            self._decks.lammps.set_internal_variable("load", self.fx)
        else:
            self._load(repr(self.fx))

    def begin(self) -> None:
        """Make the fix, unless it is there."""
        if self.on:
            return
        self._decks.command("timestep 1.0")
        self._decks.command(f"variable load internal {self.fx!r}")
        self._load("v_load")
        rotation = "yes" if self._packing.law.frictional else "no"
        compensated = " compensated" * self._packing.compensated
        self._decks.command(f"fix move all displace/disc rotation {rotation}{compensated}")
        self.on, self._set_up = True, False

    def run(self) -> None:
        """Displace the disks by the velocities that they have."""
        setup, self._set_up = "pre no " if self._set_up else "", False
        self._decks.command(f"run 1 {setup}post no")
        self._set_up = True

    def end(self) -> None:
        """Remove the fix, if it is there."""
        if self.on:
            self.on = False
            self._decks.command("unfix move")
            self.load(self.fx)
            self._decks.command("variable load delete")

    def _load(self, fx: str) -> None:
        self._decks.command(f"fix load top addforce {fx} {-self._packing.fy!r} 0.0")
