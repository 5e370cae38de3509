"""Stated errors of onsets cover the true ones where contacts change before them, as a committed table says."""

import pytest

from research.coverage.cases import draw_scene, read, restate_case
from research.coverage.make import TABLE

CASES = [case for case in read(TABLE) if case.counts]


@pytest.mark.parametrize("kind", ["undamped", "damped"])
@pytest.mark.parametrize("fresh", [False, True])
def test_all_but_a_few_are_covered(kind, fresh):
    """Of the draws on which the rule was made, and of those that came later."""
    shares = sorted(case.share for case in CASES if case.kind == kind and case.fresh == fresh)
    assert len(shares) >= 28
    assert sum(share > 1 for share in shares) <= 0.05 * len(shares)
    # an error that is stated much too large would cover, too
    assert shares[-1] <= 1.5 < 15 * shares[len(shares) // 2]


def test_the_limits_are_known_better_than_the_errors_that_they_judge():
    """In doubles rounding moves the limit as it moves the onset, by as much as is stated of it."""
    assert all(case.uncertain < 0.1 * case.stated for case in CASES if case.precision == "compensated")
    assert all(case.uncertain < 1.5 * case.stated for case in CASES)
    named = next(case for case in CASES if case.number == 0)  # of an independent code
    assert (named.kind, named.limit) == ("damped", pytest.approx(0.039834, abs=8e-6))
    assert named.share < 1


@pytest.mark.slow
def test_what_the_table_states_is_stated_today():
    case = min((case for case in CASES if case.disks == 20 and case.kind == "undamped"), key=lambda case: case.fx_c)
    again = restate_case(case)
    assert draw_scene(case.number).packing.disks == 20
    assert again.changes == case.changes
    assert again.fx_c == pytest.approx(case.fx_c, abs=case.stated)
    assert again.holds
