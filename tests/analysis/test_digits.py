"""As many digits as an uncertainty allows."""

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from faultgouge.analysis.uncertain_digits import with_uncertainty


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.0215074560477, 1.9e-12, "0.0215074560477(19)"),
        (0.0215, 3e-3, "0.021(3)"),
        (12345.0, 200.0, "12300(200)"),
        (0.5, 9.99e-5, "0.50000(10)"),
        (1.500983228e-32, 3e-41, "1.500983228(3)e-32"),
        (-1.500983227e28, 5e19, "-1.500983227(5)e+28"),
        (0.0, 2e-7, "0(2)e-07"),
        (0.1, 0.0, "0.10000000000000001"),
        (0.1, math.inf, "0.10000000000000001"),
    ],
)
def test_digits(value, error, text):
    assert with_uncertainty(value, error) == text


@given(value=st.floats(1e-3, 1e3), error=st.floats(1e-13, 1e-1))
def test_what_is_written_contains_the_interval(value, error):
    shown, units = re.fullmatch(r"([\d.]+)\((\d+)\)", with_uncertainty(value, error)).groups()
    unit = 10.0 ** -len(shown.partition(".")[2])
    assert error / (1 + 1e-6) <= int(units) * unit <= 2.2 * error
    assert abs(float(shown) - value) <= 0.5 * unit * (1 + 1e-6) + 4e-16 * value
