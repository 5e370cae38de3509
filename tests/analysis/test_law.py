"""The contact law against ten lines of arithmetic, against 30-digit derivatives, and in its properties."""

from dataclasses import replace
from itertools import product

import mpmath
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from quasistatic import plain_force

from faultgouge.analysis import MindlinLaw

LAWS = [MindlinLaw(kn, kt, 0.2, exponent) for kn in (1.0, 2e5) for kt in (0.3, 5e4) for exponent in (1.5, 1.0)]
RESCALED = MindlinLaw(2e5, 6e4, 0.8, rescaled=True)
SLIDERS = [MindlinLaw(2e5, 6e4, 0.8, exponent, coulomb=True) for exponent in (1.5, 1.0)]
both_exponents = pytest.mark.parametrize("exponent", [1.5, 1.0])
OVERLAPS = (1e-9, 6e-4, 0.2)
SHARES = (-2.0, -1.0, -0.999, -1 / 3, -1e-6, 0.0, 1e-6, 0.5, 1.0, 3.0)


def derivatives(law, overlap, slip, parting=0.5, sliding=False):
    """All that the law says of one contact, as numbers."""
    found = law.derivatives(np.array([overlap]), np.array([slip]), np.array([parting]), sliding)
    return type(found)(*(float(part[0]) for part in found))


stiffness = st.floats(1e-6, 1e6)
shares = st.integers(-3000, 3000).map(lambda thousandths: thousandths / 1000)


@given(
    kn=stiffness,
    kt=st.just(0.0) | stiffness,
    mu=st.just(0.0) | st.floats(1e-3, 10),
    exponent=st.sampled_from([1.5, 1.0]),
    overlap=st.sampled_from([-0.1, 0.0]) | st.floats(1e-8, 1.0),
    share=shares,
    coulomb=st.booleans(),
)
def test_forces(kn, kt, mu, exponent, overlap, share, coulomb):
    law = MindlinLaw(kn, kt, mu, exponent, coulomb=coulomb)
    slip = share * (float(law.slip_limit(overlap)) or 1e-3)
    normal, tangential = plain_force(kn, kt, mu, overlap, slip, exponent, coulomb)
    # A handful of rounded operations each.
    assert law.normal_force(overlap) == pytest.approx(normal, rel=1e-15)
    assert law.tangential_force(overlap, slip) == pytest.approx(tangential, rel=2e-15)
    assert law.tangential_force(overlap, law.clamped(overlap, slip)) == law.tangential_force(overlap, slip)
    together = derivatives(law, overlap, slip)
    assert together[:2] == pytest.approx((normal, tangential), rel=2e-15)
    assert (kt > 0 and mu > 0) or together[3:] == (0, 0)
    assert together.slip_derivative <= 0


@pytest.mark.parametrize("law", [*LAWS, RESCALED])
@pytest.mark.parametrize("overlap", OVERLAPS)
@pytest.mark.parametrize("share", SHARES)
def test_derivatives_have_all_digits(law, overlap, share):
    """Also at the bound, where they are continuous. Rescaled slips are smaller when the overlap grows, and as they are
    when it shrinks; the mean is that of both."""
    slip = share * float(law.slip_limit(overlap))
    with mpmath.workdps(40):
        kn, kt, mu, p, d, s = (mpmath.mpf(v) for v in (law.kn, law.kt, law.mu, law.exponent, overlap, slip))
        normal = mpmath.diff(lambda v: plain_force(kn, kt, mu, v, s, p)[0], d)
        by_slip = mpmath.diff(lambda v: plain_force(kn, kt, mu, d, v, p)[1], s)
        closing = parting = mpmath.diff(lambda v: plain_force(kn, kt, mu, v, s, p)[1], d)
        if law.rescaled and abs(share) >= 1:  # what slides slides on
            closing = parting = -mpmath.sign(s) * mu * normal
        elif law.rescaled:
            closing = mpmath.diff(lambda v: plain_force(kn, kt, mu, v, s * mpmath.sqrt(d / v))[1], d)
    # Some ten rounded operations on terms of this scale, which cancel towards the bound.
    scale = 1e-14 * law.kt * overlap ** (law.exponent - 1)
    for weight, by_overlap in ((0.0, closing), (1.0, parting), (0.5, (closing + parting) / 2)):
        found = derivatives(law, overlap, slip, weight)
        assert found.normal_stiffness == law.normal_stiffness(overlap) == pytest.approx(float(normal), rel=1e-15)
        assert found.slip_derivative == pytest.approx(float(by_slip), abs=scale)
        assert found.overlap_derivative == pytest.approx(float(by_overlap), abs=scale * law.mu * law.kn / law.kt)


@pytest.mark.parametrize("law", SLIDERS)
@pytest.mark.parametrize("overlap", OVERLAPS)
def test_a_slider_has_derivatives_for_each_direction(law, overlap):
    """A spring whose force stays while a contact closes and falls with the stiffness while the contact parts; at the
    bound, and if it slides on, Coulomb's force."""
    for share, parting, sliding in product(SHARES, (0.0, 0.5, 1.0), (False, True)):
        slip = float(law.clamped(overlap, share * law.slip_limit(overlap)))
        stiffness, force = law.kt * overlap ** (law.exponent - 1), float(law.tangential_force(overlap, slip))
        a, b = -stiffness, parting * (law.exponent - 1) * force / overlap
        if sliding and abs(share) >= 1:
            a, b = 0.0, np.sign(force) * law.mu * law.normal_stiffness(overlap)
        found = derivatives(law, overlap, slip, parting, sliding)
        assert found.slip_derivative == pytest.approx(a, rel=1e-15)
        assert found.overlap_derivative == pytest.approx(b, rel=4e-15)


def stored(law, overlap, slip):
    """Work that it takes to slip as far at constant overlap: the integral of the force."""
    x = 0.0 if law.coulomb else abs(slip) / float(law.slip_limit(overlap))
    return law.kt * overlap ** (law.exponent - 1) * slip**2 * (1 / 2 + x / 3 - x**2 / 4)


def work_along(law, path):
    """Work of a path of (overlap, slip increment), from no slip: the tangential force does none while nothing slips."""
    total, slip, before = 0.0, 0.0, path[0][0]
    for overlap, increment in path:
        start = float(law.remembered(slip, before, overlap))
        slip = float(law.clamped(overlap, start + increment))
        total += stored(law, overlap, slip) - stored(law, overlap, start)
        total -= (start + increment - slip) * float(law.tangential_force(overlap, slip))
        before = overlap
    return total


legs = st.lists(st.tuples(st.floats(1e-5, 1e-2), st.floats(-3e-2, 3e-2)), min_size=1, max_size=12)
"""In steps of up to three slip limits of the largest overlap, at overlaps over three decades."""


KINDS = [
    *({"rescaled": True, "exponent": p} for p in (1.4, 1.5, 2.0, 3.0)),
    *({"coulomb": True, "exponent": p} for p in (1.0, 1.25, 1.5, 2.0, 3.0)),
]


@pytest.fixture
def any_exponent(monkeypatch):
    """The formulas hold for any exponent; the plugin has some."""
    monkeypatch.setattr("faultgouge.analysis.packing.law.EXPONENTS", {kind["exponent"] for kind in KINDS})


@pytest.mark.parametrize("kind", KINDS, ids=str)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])  # which is the same for all examples
@given(mu=st.floats(1e-2, 10), path=legs)
def test_no_energy_is_created(any_exponent, kind, mu, path):
    """Whatever the path, closed or not: from a contact without slip nothing can be had that was not put in."""
    law = MindlinLaw(2e5, 6e4, mu, **kind)
    most = sum(abs(increment) for _, increment in path) * mu * float(law.normal_force(1e-2))
    assert work_along(law, path) >= -1e-14 * most


CYCLE = [(1e-3, 1.6e-3), (2e-3, 0.0), (2e-3, -1.6e-3), (1e-3, 0.0)]
"""Slipped, pressed, slipped back, and parted to the overlap that it began with."""


@pytest.mark.parametrize("exponent", [1.5, 2.0])
@pytest.mark.parametrize("kind", [None, "rescaled", "coulomb"])
def test_energy_of_a_closed_cycle(any_exponent, kind, exponent):
    """It is gained where the history is neither rescaled nor that of a slider."""
    law = MindlinLaw(2e5 * 1e-3 ** (1.5 - exponent), 6e4 * 1e-3 ** (1.5 - exponent), 0.8, exponent)
    work = work_along(replace(law, **({kind: True} if kind else {})), CYCLE)
    assert (work > 1e-6) if kind else (work < -1e-6)


def test_what_is_rescaled():
    slips = [RESCALED.remembered(1e-4, *overlaps) for overlaps in ((1e-3, 4e-3), (4e-3, 1e-3), (4e-3, 1e-6))]
    assert slips == pytest.approx([5e-5, 1e-4, RESCALED.slip_limit(1e-6)], rel=1e-15)
    assert LAWS[0].remembered(1e-4, 1e-3, 4e-3) == 1e-4


@both_exponents
def test_overlap_of_a_force(exponent):
    law, overlap = MindlinLaw(2e5, 6e4, 0.8, exponent), np.array(OVERLAPS)
    # 2/3 is rounded, and an error of the power counts |log(force/kn)| = 31 times
    np.testing.assert_allclose([law.overlap_of_force(f) for f in law.normal_force(overlap)], overlap, rtol=4e-15)


@both_exponents
def test_contacts_that_slide_or_are_open_have_no_dashpots(exponent):
    """test_operators.py has those of others."""
    law, same = MindlinLaw(2e5, 6e4, 0.8, exponent, cn=3.0, ct=5.0), np.full(5, 1e-3)
    slider = replace(law, coulomb=True)
    # the overlap of a contact that slides, computed again from coordinates up to 10
    clamped = law.slip_limit(1e-3 + 1e-15 * np.arange(-2, 3))
    for slip in (clamped, -clamped):
        assert not law.dashpots(same, slip)[1].any()
        assert not slider.dashpots(same, slip, sliding=True)[1].any()
        assert np.array_equal(slider.dashpots(same, slip)[1], 5.0 * law.growth(same))
    assert not np.any(law.dashpots(np.array([0.0, -1e-3]), np.zeros(2)))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *(("kn", value) for value in (0.0, -1.0, np.nan, 1e300)),
        *(("exponent", value) for value in (1.25, 0.0, np.nan)),
        ("kt", -1.0), ("kt", np.inf), ("mu", -0.1), ("cn", -1.0), ("ct", np.inf), ("rescaled", True),
    ],
)  # fmt: skip
def test_impossible_parameters(field, value):
    """Harmonic disks have no rescaled history."""
    with pytest.raises(ValueError, match=rf"^{field} = |^a {field} history needs an exponent"):
        MindlinLaw(**({"kn": 1.0, "kt": 1.0, "mu": 1.0, "exponent": 1.0} | {field: value}))
