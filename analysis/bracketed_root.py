"""A root between two bounds, without scipy.optimize, whose import takes longer than all roots of a short command."""

from collections.abc import Callable

import numpy as np


def bracketed_root(value: Callable[[float], float], low: float, high: float, width: float) -> float:
    """A root of a continuous function between two bounds at which its signs differ.

    Inverse quadratic interpolation where three values are on a monotonic curve, bisection elsewhere (Chandrupatla, Adv.
    Eng. Softw. 28, 145 (1997)).

    Parameters
    ----------
    value : callable
        The function of one number.
    low, high : float
        The bounds.
    width : float
        Width of the last bracket, in the unit of the bounds; rounding is added.

    Returns
    -------
    float
        The end of the last bracket that has the smaller value.

    Raises
    ------
    ValueError
        If the function has the same sign at both bounds.
    """
    here, there = (high, value(high)), (low, value(low))
    if here[1] == 0 or there[1] == 0:
        return here[0] if here[1] == 0 else there[0]
    if (here[1] > 0) == (there[1] > 0):
        raise ValueError(f"the function has one sign at {low:.17g} and {high:.17g}")
    share = 0.5
    while True:
        place = here[0] + share * (there[0] - here[0])
        found = value(place)
        last = here if (found > 0) == (here[1] > 0) else there
        there = there if last is here else here
        here = (place, found)
        best = min(here, there, key=lambda end: abs(end[1]))
        least = (width + 4 * float(np.spacing(abs(best[0])))) / 2 / abs(there[0] - here[0])
        if best[1] == 0 or least > 0.5:
            return best[0]
        share = min(max(_share(here, there, last), least), 1 - least)


def _share(here: tuple[float, float], there: tuple[float, float], last: tuple[float, float]) -> float:
    """The share of the bracket from here to there at which the next value is taken."""
    (a, fa), (b, fb), (c, fc) = here, there, last
    place, size = (a - b) / (c - b), (fa - fb) / (fc - fb)
    if size**2 < place and (1 - size) ** 2 < 1 - place:
        return fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
    return 0.5
