"""Onset of complex eigenvalues along a ramp of the load: windows, solved for and not scanned.

- `search`: what a user calls; `limits`: every size and tolerance, with its reason
- `pair`: what a pair of modes is, and how it is followed from load to load
- `edge`: where a pair turns complex or real, the root of its discriminant; `dip`: where a narrow window may hide
- `screening`: which pairs may meet, by quasi-degenerate perturbation theory
- `basis`: the eigenbasis of one load, dense or in slices of the spectrum (`slicing`)
- `modes`: all modes of one load, and which is which at the next
- `walk`: the walk along the ramp; its oracles are `screened`, `all_modes` and `sliced`
- `windows`: the result, and the ledger of open windows

**Contacts without force.** A disk that nothing presses comes to rest touching its neighbours with an overlap that is
rounding, and a Hertzian contact has the stiffness 3/2 k_n delta^(1/2): a force of 1e-11, the balance that an
equilibrium can have, goes with a stiffness of order 1, which differs from one equilibrium to the next and would open
and shut windows at random. Such contacts are left out (`force_bearing`).
"""

from .edge import Edge, Family, LostPairError, Root, locate, smooth_root
from .limits import LIMITS, Limits
from .modes import Modes, assign, force_bearing, full_operator
from .pair import Pair, Place, continued
from .ranks import Ranks
from .search import Onset, OnsetError, complex_windows, find_onset, seeks_all
from .sliced import FirstWindow, first_window
from .windows import Window

__all__ = [
    "LIMITS",
    "Edge",
    "Family",
    "FirstWindow",
    "Limits",
    "LostPairError",
    "Modes",
    "Onset",
    "OnsetError",
    "Pair",
    "Place",
    "Ranks",
    "Root",
    "Window",
    "assign",
    "complex_windows",
    "continued",
    "find_onset",
    "first_window",
    "force_bearing",
    "full_operator",
    "locate",
    "seeks_all",
    "smooth_root",
]
