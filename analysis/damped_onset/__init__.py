"""The onset with dissipation: loads at which the real part of an eigenvalue s changes its sign (a Hopf point).

`windows` walks along the ramp, `modes` finds and follows modes, `step` compares two loads, `weak` is the limit of weak
damping.

May import: `packing`, `operators`, `spectrum`, `motion`, `onset`.
"""
