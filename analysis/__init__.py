"""A configuration of frictional disks in; its stability operator, spectrum, onset and growth out.

Everything takes a :class:`Packing` and nothing else. The physics is in the docstrings of the modules: `law`
(the contact law), `contacts`, `geometry`, `packing` (forces), `stiffness` (the stability operator), `spectrum` (its
eigenvalues), `damping` (the damping matrix), `onset` (where they become complex), `growth` (what a run shows of
it). `runfile`, `dumps` and `files` read and write packings.
"""

from .contacts import FLOOR, Contacts
from .damped import DampedOnsetError, DampedWindow, damped_windows
from .damping import damping_matrix, largest_damping_rate
from .dumps import read_dump
from .eigenpairs import Eigenpairs, closest_to_meeting, eigenpairs, normal_modes
from .errors import BadInputError, FaultgougeError, NoEquilibriumError, OutputError, PackingFileError
from .files import read_packing
from .geometry import ContactGeometry, nearest_image, touching
from .growth import Growth, fit_growth, mean_square_displacement
from .law import MindlinLaw
from .onset import Onset, OnsetError, Window, complex_windows, find_onset
from .packing import Packing
from .response import layer_force, linear_response
from .runfile import RunFile
from .spectrum import (
    ComplexPair,
    Spectrum,
    discrete_frequency,
    dynamical_matrix,
    growth_rate,
    largest_frequency,
    spectrum,
    stable_timestep,
)
from .stiffness import stiffness_matrix
from .transient import NoGainError, TransientGain, transient_gain

__all__ = [
    "FLOOR",
    "BadInputError",
    "ComplexPair",
    "ContactGeometry",
    "Contacts",
    "DampedOnsetError",
    "DampedWindow",
    "Eigenpairs",
    "FaultgougeError",
    "Growth",
    "MindlinLaw",
    "NoEquilibriumError",
    "NoGainError",
    "Onset",
    "OnsetError",
    "OutputError",
    "Packing",
    "PackingFileError",
    "RunFile",
    "Spectrum",
    "TransientGain",
    "Window",
    "closest_to_meeting",
    "complex_windows",
    "damped_windows",
    "damping_matrix",
    "discrete_frequency",
    "dynamical_matrix",
    "eigenpairs",
    "find_onset",
    "fit_growth",
    "growth_rate",
    "largest_damping_rate",
    "largest_frequency",
    "layer_force",
    "linear_response",
    "mean_square_displacement",
    "nearest_image",
    "normal_modes",
    "read_dump",
    "read_packing",
    "spectrum",
    "stable_timestep",
    "stiffness_matrix",
    "touching",
    "transient_gain",
]
