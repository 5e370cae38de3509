"""Format numbers with as many digits as their uncertainty allows."""

import math

LEAST_PLAIN, MOST_PLAIN = 1e-5, 1e10
"""Numbers that are written without a power of ten."""


def with_uncertainty(value: float, error: float) -> str:
    """A number and its uncertainty in units of its last digit, as in 0.02150746(3) or 1.5009(3)e-32.

    The uncertainty is rounded up, to one digit; a first digit of 1 is followed by another.

    Parameters
    ----------
    error : float
        Its uncertainty, in the same unit. Where it is 0 the number has all its digits.
    """
    if not math.isfinite(value) or not 0 < error < math.inf:
        return f"{value:.17g}"
    size = max(abs(value), error)
    if not LEAST_PLAIN <= size < MOST_PLAIN:
        power = _split(size)[1]
        return f"{with_uncertainty(value / 10.0**power, error / 10.0**power)}e{power:+03d}"
    places = 1 - _split(2 * error)[1] if _split(error)[0] < 2 else -_split(error)[1]
    units = math.ceil(error * 10.0**places * (1 - 1e-9))
    if places <= 0:
        scale = 10 ** (-places)
        return f"{round(value / scale) * scale:d}({units * scale:d})"
    return f"{value:.{places}f}({units:d})"


def _split(error: float) -> tuple[float, int]:
    """First digits and power of ten."""
    digits, _, power = f"{error:e}".partition("e")
    return float(digits), int(power)
