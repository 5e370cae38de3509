"""Numbers with their nouns."""

from faultgouge.analysis.counted import counted


def test_singular_and_plural():
    assert [counted(k, "complex pair") for k in (0, 1, 2)] == ["0 complex pairs", "1 complex pair", "2 complex pairs"]
    assert [counted(k, "equilibrium", "equilibria") for k in (1, 21)] == ["1 equilibrium", "21 equilibria"]
