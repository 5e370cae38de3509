"""How a growth rate of D is told."""

import numpy as np


def exponential(rate: float, digits: int, at_least: bool = False) -> str:
    """D as an exponential, with so many digits; where the rate is `at_least` that, with two digits, rounded down."""
    if not at_least or rate <= 0:
        return f"D as exp({rate:.{digits}g} t)"
    place = 10.0 ** (np.floor(np.log10(rate)) - 1)
    return f"D at least as exp({place * np.floor(rate / place):.2g} t), not known closer"
