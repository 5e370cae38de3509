"""Windows of loads on which motion grows, solved for and not scanned, with dissipation and without: one search.

- `find_onset`, `find_windows`: what a user calls; `onset`: what the search finds, in numbers and in words
- `limits`: every size and tolerance, with its reason
- `system`: the matrix of small motion at one load; `space`: the modes that are followed from load to load
- `edges`: windows, and their edges: where the growth of a motion goes through zero, or jumps
- `system_modes`: all modes of one load, and which is which at the next; `between`: where a narrow window may hide
- `search`: the walk along a ramp
- `screens`: the few motions that may change, by perturbation theory
- `slices`: large packings, in slices of the spectrum
- `pair_over_load`: one pair through many loads, its eigenvalues and its normal form
"""

from .edges import Edge, Increments, LostPairError, Window, follow_to, track
from .find_onset import find_onset, takes_all_modes
from .find_windows import complex_windows, find_windows, windows_up_to
from .limits import LIMITS, Limits
from .onset import NoGrowthError, Onset, OnsetError
from .slices.ranks import Ranks
from .space import Space
from .system import System, force_bearing, full_operator
from .system_modes import SystemModes

__all__ = [
    "LIMITS",
    "Edge",
    "Increments",
    "Limits",
    "LostPairError",
    "NoGrowthError",
    "Onset",
    "OnsetError",
    "Ranks",
    "Space",
    "System",
    "SystemModes",
    "Window",
    "complex_windows",
    "find_onset",
    "find_windows",
    "follow_to",
    "force_bearing",
    "full_operator",
    "takes_all_modes",
    "track",
    "windows_up_to",
]
