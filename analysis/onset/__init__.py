"""Onset of complex eigenvalues along a ramp of the load: windows, solved for and not scanned.

- `search`: what a user calls; `limits`: every size and tolerance, with its reason
- `eigenvalue_pair`: what a pair of modes is, how it is followed from load to load, and where a narrow window may hide;
  `pair_form`: where it stands in the normal form
- `window_edges`: windows, and their edges: where a pair turns complex or real, the root of its discriminant
- `perturbation_screening`: which pairs may meet, by quasi-degenerate perturbation theory
- `eigenbasis`: of one load, dense or in slices of the spectrum (`block_lanczos`), which ranks may share (`ranks`) and
  keep (`slice_store`)
- `modes`: all modes of one load, and which is which at the next
- `march`: along the ramp; its oracles are those of `all_windows` and `first_window`
"""

from .eigenvalue_pair import Pair
from .first_window import Increments
from .limits import LIMITS, Limits
from .modes import Modes, force_bearing, full_operator
from .ranks import Ranks
from .search import Onset, OnsetError, complex_windows, find_onset, takes_all_modes
from .window_edges import Family, LostPairError, Window

__all__ = [
    "LIMITS",
    "Family",
    "Increments",
    "Limits",
    "LostPairError",
    "Modes",
    "Onset",
    "OnsetError",
    "Pair",
    "Ranks",
    "Window",
    "complex_windows",
    "find_onset",
    "force_bearing",
    "full_operator",
    "takes_all_modes",
]
