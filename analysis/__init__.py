"""A configuration of frictional disks in; its stability operator, spectrum, onset and growth out.

Everything takes a :class:`Packing` and nothing else. The physics is in the docstrings of the modules: `law`
(the contact law), `packing` (geometry and forces), `stiffness` (the stability operator), `spectrum` (its
eigenvalues), `onset` (where they become complex; `windows`, `edges`, `modes`, `tracking`, `meetings`,
`projection`, `slices` and `large` are its parts), `growth` (what a run shows of it). `runfile`, `dumps` and
`files` read and write packings.
"""

from .dumps import read_dump
from .files import PackingFileError, read_packing
from .growth import Growth, fit_growth, fit_oscillation, mean_square_displacement
from .law import MindlinLaw
from .onset import Onset, OnsetError, find_onset, follow, scan_windows
from .packing import FLOOR, ContactGeometry, Contacts, Packing, nearest_image, touching
from .runfile import RunFile
from .spectrum import (
    ComplexPair,
    Eigenpairs,
    Spectrum,
    discrete_frequency,
    dynamical_matrix,
    eigenpairs,
    growth_rate,
    largest_frequency,
    spectrum,
    stable_timestep,
)
from .stiffness import contact_stiffness, stiffness_matrix
from .windows import Window, complex_windows

__all__ = [
    "FLOOR",
    "ComplexPair",
    "ContactGeometry",
    "Contacts",
    "Eigenpairs",
    "Growth",
    "MindlinLaw",
    "Onset",
    "OnsetError",
    "Packing",
    "PackingFileError",
    "RunFile",
    "Spectrum",
    "Window",
    "complex_windows",
    "contact_stiffness",
    "discrete_frequency",
    "dynamical_matrix",
    "eigenpairs",
    "find_onset",
    "fit_growth",
    "fit_oscillation",
    "follow",
    "growth_rate",
    "largest_frequency",
    "mean_square_displacement",
    "nearest_image",
    "read_dump",
    "read_packing",
    "scan_windows",
    "spectrum",
    "stable_timestep",
    "stiffness_matrix",
    "touching",
]
