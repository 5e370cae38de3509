"""Windows of loads on which motion grows, solved for and not scanned, with dissipation and without: one search."""

from .edges import Edge, Increments, LostPairError, Window
from .find_onset import find_onset, takes_all_modes
from .find_windows import complex_windows, find_windows, windows_up_to
from .limits import LIMITS, Limits
from .onset import NoGrowthError, Onset, OnsetError
from .ranks import Ranks
from .states import Motions, eigenvalues_near
from .system import System, force_bearing, full_operator

__all__ = [
    "LIMITS",
    "Edge",
    "Increments",
    "Limits",
    "LostPairError",
    "Motions",
    "NoGrowthError",
    "Onset",
    "OnsetError",
    "Ranks",
    "System",
    "Window",
    "complex_windows",
    "eigenvalues_near",
    "find_onset",
    "find_windows",
    "force_bearing",
    "full_operator",
    "takes_all_modes",
    "windows_up_to",
]
