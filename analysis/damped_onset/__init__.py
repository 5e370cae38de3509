"""The onset with dissipation: loads at which the real part of an eigenvalue s changes its sign (a Hopf point).

`windows` walks along the ramp with the oracle of `growing`, `sliced` is the search of large packings in slices of the
spectrum. `screening` names the few modes that may grow, `modes` finds and follows modes, `step` compares all modes of
two loads. `edge` is where a window begins or ends, `weak` the limit of weak damping.

May import: `packing`, `operators`, `spectrum`, `motion`, `onset`.
"""
