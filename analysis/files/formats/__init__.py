"""Packings from and to other codes: LAMMPS, MercuryDPM, YADE, GSD, extended XYZ, CSV, VTK.

`formats` lists the module that reads and writes each kind of file. A reader returns `Disks`, plain columns;
`packing_of` makes a packing of disks, and `upper_layer` finds the layer that carries the load. `settling.relax` brings
a packing out of balance to rest.
"""

from .disks import Disks, Slips, packing_of
from .export_quantities import Frame, ModeVectors
from .frames import choose_frames, frames_of
from .registry import format_of, is_hdf5, read_disks, write_frames, write_packing
from .upper_layer import UpperLayerError, upper_layer

__all__ = [
    "Disks",
    "Frame",
    "ModeVectors",
    "Slips",
    "UpperLayerError",
    "choose_frames",
    "format_of",
    "frames_of",
    "is_hdf5",
    "packing_of",
    "read_disks",
    "upper_layer",
    "write_frames",
    "write_packing",
]
