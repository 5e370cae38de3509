"""Particles that nearly touch others, or a wall: up to which push, and up to which load, their contacts stay open."""

import numpy as np
import pytest
from granular_packings import command, of_particle

from faultgouge.analysis import one_sided_motion, stability
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.analysis.operators.gaps import gaps_of

GAP = 1e-6


@pytest.fixture
def row(taken):
    """Three disks that do not turn, side by side, the last beside the first: gaps of 1, 1.5 and 0.5."""
    return taken("", "gaps.in")


def test_gaps_are_those_of_the_row(row):
    _, here = row
    found = gaps_of(here)
    gaps = {(min(i, j), max(i, j)): gap for i, j, gap in zip(found.i, found.j, found.gap, strict=True)}
    assert gaps == pytest.approx({(0, 1): GAP, (1, 2): 1.5 * GAP, (0, 2): 0.5 * GAP}, rel=1e-6)
    moved = 1e-8 * np.random.default_rng(0).standard_normal(here.coordinates)
    after = gaps_of(derive_frozen(here, position=here.position + moved.reshape(3, -1)[:2].T))
    np.testing.assert_allclose(found.gap - after.gap, found.rates(here) @ moved, rtol=0, atol=1e-14)
    away = 0.9 * here.contacts.overlap.max()  # along x, of the second
    apart = gaps_of(derive_frozen(here, position=here.position + np.outer([0, 1, 0], [away, 0])))
    assert apart.gap.max() == pytest.approx(away + GAP, rel=1e-6)


def test_a_push_that_closes_a_gap_is_too_large(row):
    """LAMMPS's second disk stays where it is after half of the largest push, and is hit after twice that push."""
    lmp, here = row
    velocity = np.outer([1, 0, 0], [1.0, 0.0])
    motion = one_sided_motion(here, velocity, times=np.linspace(0.01, 0.5, 50))
    most = motion.scales[1]
    # close looks take steps of 0.3 of the stable one
    assert most == pytest.approx(GAP / motion.displacement[:, 0, 0].max(), rel=0.1)
    verdict = stability(here)
    # dashpots do not count, and the last disk is nearer to the first: two disks share the energy of a gap of GAP / 2
    assert verdict.largest_energy == pytest.approx(0.25 * 300 * (GAP / 2) ** 2, rel=1e-3)
    assert "no contact opens, closes or slides" in str(verdict)
    rise = stability(here, rise=velocity).rising  # against the spring of the floor
    assert (rise["next_event"], rise["next_change"]) == ("closes", pytest.approx(300 * GAP, rel=1e-3))
    for size, hit in ((0.5, False), (2.0, True)):
        lmp.command("velocity all set 0 0 0")
        before = of_particle(lmp, "x", 2)[0]
        of_particle(lmp, "v", 1)[0] = size * most
        command(lmp, "run 200 post no")
        assert bool(abs(of_particle(lmp, "x", 2)[0] - before) > 0.01 * GAP) is hit
        command(lmp, "run 5000 post no")
