"""Windows of loads on which motion grows, solved for and not scanned, with dissipation and without: one search."""

from .find_onset import complex_windows, find_onset, find_windows, takes_all_modes
from .motions import Motions, System, eigenvalues_near, force_bearing
from .onset import Edge, NoGrowthError, Onset, OnsetError, Window
from .slices import LIMITS, Limits, Ranks

__all__ = [
    "LIMITS", "Edge", "Limits", "Motions", "NoGrowthError", "Onset", "OnsetError", "Ranks", "System",
    "Window", "complex_windows", "eigenvalues_near", "find_onset", "find_windows", "force_bearing",
    "takes_all_modes",
]  # fmt: skip
