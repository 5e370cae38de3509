"""Windows of loads on which motion grows, solved for and not scanned, with dissipation and without: one search."""

from .edges import Edge, Increments, Window
from .find_onset import ALL_WINDOWS, find_onset, takes_all_modes
from .find_windows import complex_windows, find_windows, windows_up_to
from .onset import NoGrowthError, Onset, OnsetError
from .slices.ranks import Ranks
from .states import State, eigenvalues_near
from .system import System, force_bearing, full_operator

__all__ = [
    "ALL_WINDOWS",
    "Edge",
    "Increments",
    "NoGrowthError",
    "Onset",
    "OnsetError",
    "Ranks",
    "State",
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
