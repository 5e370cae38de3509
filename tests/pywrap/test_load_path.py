"""A loading path keeps what lies beyond the largest load, and nothing of what is asked for in between."""

from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from faultgouge.analysis import NoEquilibriumError
from faultgouge.pywrap import LoadPath

BOUND, HARDENING, ULTIMATE = 1.0, 0.5, 3.0


@dataclass(frozen=True)
class Slider:
    """A slider at rest under a load: how far it has slipped, which depends on the steps that have led here."""

    fx: float
    slip: float

    @property
    def packing(self):
        return self.slip


class SliderSolver:
    """The slip of a step is that of the bound at its beginning; friction hardens as one over one plus the slip."""

    def solve(self, load, below, beside, ahead):
        if load > ULTIMATE:
            raise NoEquilibriumError(f"the slider runs away at {load}")
        slip = below.slip if below else 0.0
        rise = load - max(below.fx if below else 0.0, BOUND)
        return Slider(load, slip + max(0.0, rise) / (HARDENING * (1 + slip)))

    def close(self):
        pass


@given(st.lists(st.floats(0, ULTIMATE), min_size=1, max_size=8))
def test_what_is_asked_in_between_changes_nothing(between):
    loads, alone, asked = [0.5, 1.5, 2.0, 3.0], LoadPath(SliderSolver()), LoadPath(SliderSolver())
    list(alone.climb(loads))
    for load in loads:
        asked(load)
        for each in between:
            if each <= load:
                asked(each)
    assert asked.equilibria == alone.equilibria
    assert [each.fx for each in asked.equilibria] == loads


def test_a_climb_ends_where_the_packing_flows():
    path = LoadPath(SliderSolver())
    assert [each.fx for each in path.climb([0.0, 2.0, 4.0, 1.0])] == [0.0, 2.0]
    with pytest.raises(NoEquilibriumError, match="runs away at 4"):
        path(4.0)
    with pytest.raises(NoEquilibriumError):  # at the first load: no path at all
        next(LoadPath(SliderSolver(), [Slider(0.0, 0.0)]).climb([4.0]))
