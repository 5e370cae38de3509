"""Onset of complex eigenvalues along a ramp of the load: windows, solved for and not scanned.

- `search`: what a user calls; `limits`: every size and tolerance, with its reason; `windows`: the result
- `pair`: what a pair of modes is, and how it is followed from load to load
- `edge`: where a pair turns complex or real, the root of its discriminant; `dip`: where a narrow window may hide
- `screening`: which pairs may meet, by quasi-degenerate perturbation theory
- `basis`: the eigenbasis of one load, dense or in slices of the spectrum (`slicing`), which ranks may share (`ranks`)
- `modes`: all modes of one load, and which is which at the next
- `walk`: the walk along the ramp; its oracles are `dense` and `sliced`
"""

from .edge import Family, LostPairError
from .limits import LIMITS, Limits
from .modes import Modes, force_bearing, full_operator
from .pair import Pair, Place
from .ranks import Ranks
from .search import Onset, OnsetError, complex_windows, find_onset, seeks_all
from .windows import Window

__all__ = [
    "LIMITS",
    "Family",
    "Limits",
    "LostPairError",
    "Modes",
    "Onset",
    "OnsetError",
    "Pair",
    "Place",
    "Ranks",
    "Window",
    "complex_windows",
    "find_onset",
    "force_bearing",
    "full_operator",
    "seeks_all",
]
