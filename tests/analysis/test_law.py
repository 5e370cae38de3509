"""The contact law against ten lines of arithmetic, against 30-digit derivatives, and in its properties."""

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faultgouge.analysis import MindlinLaw


def plain_force(kn, kt, mu, overlap, slip):
    """f_n and f_t, from the formulas, in whatever arithmetic the arguments bring."""
    if overlap <= 0:
        return 0, 0
    normal = kn * overlap * overlap**0.5
    if kt == 0 or mu == 0:
        return normal, 0
    limit = mu * (kn / kt) * overlap
    slip = min(max(slip, -limit), limit)
    x = abs(slip) / limit
    return normal, -kt * overlap**0.5 * (1 + x - x**2) * slip


LAWS = [MindlinLaw(kn, kt, mu) for kn in (1.0, 2e5) for kt in (0.0, 0.3, 5e4) for mu in (0.0, 0.2, 1.0)]
OVERLAPS = (1e-9, 6e-4, 0.2)
SHARES = (-2.0, -1.0, -0.999, -1 / 3, -1e-6, 0.0, 1e-6, 0.5, 1.0, 3.0)


@pytest.mark.parametrize("law", LAWS)
def test_forces(law):
    for overlap in (*OVERLAPS, 0.0, -0.1):
        for share in SHARES:
            slip = share * (float(law.slip_limit(overlap)) or 1e-3)
            normal, tangential = plain_force(law.kn, law.kt, law.mu, overlap, slip)
            # A handful of rounded operations each.
            assert law.normal_force(overlap) == pytest.approx(normal, rel=1e-15)
            assert law.tangential_force(overlap, slip) == pytest.approx(tangential, rel=2e-15)


@pytest.mark.parametrize("law", [law for law in LAWS if law.frictional])
@pytest.mark.parametrize("overlap", OVERLAPS)
@pytest.mark.parametrize("share", [s for s in SHARES if s not in (-1.0, 0.0, 1.0)])
def test_derivatives_have_all_digits(law, overlap, share):
    slip = share * float(law.slip_limit(overlap))
    with mpmath.workdps(40):
        kn, kt, mu, d, s = (mpmath.mpf(v) for v in (law.kn, law.kt, law.mu, overlap, slip))
        normal = mpmath.diff(lambda v: plain_force(kn, kt, mu, v, s)[0], d)
        by_slip = mpmath.diff(lambda v: plain_force(kn, kt, mu, d, v)[1], s)
        by_overlap = mpmath.diff(lambda v: plain_force(kn, kt, mu, v, s)[1], d)
    # Some ten rounded operations on terms of this scale, which cancel towards the bound.
    scale = law.kt * overlap**0.5
    assert law.normal_stiffness(overlap) == pytest.approx(float(normal), rel=1e-15)
    assert law.tangential_slip_derivative(overlap, slip) == pytest.approx(float(by_slip), abs=1e-14 * scale)
    assert law.tangential_overlap_derivative(overlap, slip) == pytest.approx(
        float(by_overlap), abs=1e-14 * scale * law.mu * law.kn / law.kt
    )


@pytest.mark.parametrize("law", LAWS)
def test_all_at_once(law):
    overlap, share = (grid.ravel() for grid in np.meshgrid((*OVERLAPS, 0.0, -0.1), SHARES))
    slip = share * np.where(overlap > 0, law.slip_limit(overlap), 1e-3)
    found = law.derivatives(overlap, slip)
    singly = (
        law.normal_force(overlap),
        law.tangential_force(overlap, slip),
        law.normal_stiffness(overlap),
        law.tangential_slip_derivative(overlap, slip),
        law.tangential_overlap_derivative(overlap, slip) * law.frictional,
    )
    scale = law.kt * np.sqrt(np.maximum(overlap, 0.0))
    for together, alone in zip(found, singly, strict=True):
        # the same formulas, rounded in another order
        assert np.all(
            np.abs(together - alone) <= 4e-15 * (np.abs(alone) + scale * (1 + law.mu * law.kn / max(law.kt, 1e-300)))
        )


@pytest.mark.parametrize("sign", [-1, 1])
def test_derivatives_are_continuous_at_the_bound(sign):
    law, overlap = MindlinLaw(2e5, 6e4, 0.8), 1e-3
    limit = float(law.slip_limit(overlap))
    force = float(law.tangential_force(overlap, sign * limit))
    assert force == pytest.approx(-sign * law.mu * float(law.normal_force(overlap)), rel=1e-15)
    assert law.tangential_slip_derivative(overlap, sign * limit) == 0
    # The clamped branch is f_t = -sign mu kn delta^(3/2).
    clamped = -sign * 1.5 * law.mu * law.kn * overlap**0.5
    assert law.tangential_overlap_derivative(overlap, sign * limit) == pytest.approx(clamped, rel=1e-15)
    # C1 and not C2: just inside, f' has grown by 4 (1 - x) kt delta^(1/2), to first order in 1 - x.
    inside = law.tangential_slip_derivative(overlap, sign * limit * (1 - 1e-4))
    assert inside == pytest.approx(-4e-4 * law.kt * overlap**0.5, rel=1e-4)


def test_tangential_stiffness_peaks_at_a_third():
    law, overlap = MindlinLaw(2e5, 6e4, 1.0), 1e-3
    x = np.linspace(0, 1, 301)
    stiffness = -law.tangential_slip_derivative(overlap, x * law.slip_limit(overlap))
    assert x[np.argmax(stiffness)] == pytest.approx(1 / 3, abs=1e-12)
    assert stiffness.max() == pytest.approx(4 / 3 * law.kt * overlap**0.5, rel=1e-14)


finite = st.floats(1e-6, 1e6)
share = st.integers(-3000, 3000).map(lambda thousandths: thousandths / 1000)


@given(kn=finite, kt=finite, mu=st.floats(1e-3, 10), overlap=st.floats(1e-8, 1.0), x=share, y=share)
def test_properties(kn, kt, mu, overlap, x, y):
    law = MindlinLaw(kn, kt, mu)
    limit = float(law.slip_limit(overlap))
    force = float(law.tangential_force(overlap, x * limit))
    assert law.tangential_force(overlap, -x * limit) == -force
    # mu f_n to a few roundings of the product.
    assert abs(force) <= mu * law.normal_force(overlap) * (1 + 1e-14)
    clamped = law.clamped(overlap, x * limit)
    assert law.clamped(overlap, clamped) == clamped
    assert law.tangential_force(overlap, clamped) == force
    assert law.tangential_slip_derivative(overlap, x * limit) <= 0
    # More slip, more force against it (up to rounding where the curve is flat).
    low, high = sorted((x, y))
    assert (
        law.tangential_force(overlap, high * limit)
        <= law.tangential_force(overlap, low * limit) + abs(mu * float(law.normal_force(overlap))) * 1e-14
    )
    twice = MindlinLaw(2 * kn, 2 * kt, mu)
    assert twice.tangential_force(overlap, x * limit) == 2 * force


@pytest.mark.parametrize(
    ("kn", "kt", "mu"), [(0, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -0.1), (np.nan, 1, 1), (1, np.inf, 1)]
)
def test_impossible_parameters(kn, kt, mu):
    with pytest.raises(ValueError, match=r"k[nt]|mu"):
        MindlinLaw(kn, kt, mu)
