"""The onset with dissipation: loads at which the real part of an eigenvalue s changes its sign (a Hopf point).

`windows` goes along the ramp with the oracle of `all_windows`. `first_window` is the search of large packings in
slices of the spectrum, and `imaginary_axis` finds all motions that grow at one load. `perturbation_screening` names the
few modes that may grow, `modes` finds and follows modes, `load_step` compares all modes of two loads. `window_edges` is
where a window begins or ends.

May import: `factors`, `packing`, `operators`, `spectrum`, `motion`, `onset`.
"""
