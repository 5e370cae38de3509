"""Growth that is slow beside what dashpots do, or beside what residual forces leave open, as LAMMPS has it."""

import numpy as np
import pytest
from granular_packings import command, of_particle

import faultgouge
from faultgouge.analysis import spectrum, stability
from faultgouge.analysis.motion import linear

SPRING, HALF_SPAN = 1e3, 0.95
MASS = np.pi / 6


@pytest.mark.parametrize(
    ("height", "dashpot", "large"), [(0.1, 1e6, False), (0.2, 1e5, False), (0.1, 1e4, True), (0.1, 1e7, True)]
)
def test_strong_dashpots_hold_slow_motion_up_and_do_not_hide_it(lammps_with, monkeypatch, height, dashpot, large):
    """A shallow arch of three disks: the middle one snaps through, or rests, at one rate s of two that is small.

    Displaced by y, the middle disk has the velocity s y as soon as the dashpots hold its weight.
    """
    length = np.hypot(HALF_SPAN, height)
    force = SPRING * (1 - length)
    stiffness = 2 * SPRING * (1 / length**3 * height**2 + 1 - 1 / length)  # -d F_y / dy
    damping = 2 * dashpot * (height / length) ** 2
    expected = max(np.roots([MASS, damping, stiffness]).real)
    load = 2 * force * height / length / MASS
    told = {"height": height, "dashpot": dashpot, "load": load, "step": 0.2 * MASS / damping}
    lmp = lammps_with("\n".join(f"variable {name} string {value:.17g}" for name, value in told.items()), "arch.in")
    if large:  # as if not all eigenvalues were known
        monkeypatch.setattr(linear, "LAPACK_FIRST", 0)
    verdict = stability(faultgouge.from_lammps(lmp))
    assert (verdict.stable, verdict.free) == (bool(expected < 0), 0)
    assert verdict.growth_rate == pytest.approx(2 * expected, rel=1e-6)
    command(lmp, "displace_atoms middle move 0 1e-6 0 units box\nrun 200 post no")
    displacement = of_particle(lmp, "x", 3)[1] - height
    assert of_particle(lmp, "v", 3)[1] == pytest.approx(displacement * expected, rel=1e-3)


def test_a_small_sphere_that_rolls_hides_no_growth_of_others(taken):
    """A sphere on top of another one rolls down. Beside them a sphere of a tenth of their size feels a force that is
    left, 0.9e-4 of the mean contact force, which would be an eigenvalue of 1 of its own."""
    lmp, here = taken("", "rolls.in")
    verdict = stability(here)
    assert (verdict.stable, len(spectrum(here).negative)) == (False, 2)
    of_particle(lmp, "v", 2)[0] = 1e-7
    lmp.command("run 8000 post no")
    before = float(of_particle(lmp, "x", 2)[0])
    lmp.command("run 8000 post no")
    assert 2 * np.log(of_particle(lmp, "x", 2)[0] / before) / 4 == pytest.approx(verdict.growth_rate, rel=0.01)


def test_a_sphere_without_dashpots_bounces_on_beside_one_that_has_them(taken):
    """Its Re s is zero but for rounding, of either sign."""
    lmp, here = taken("", "bounces.in")
    verdict = stability(here)
    assert (verdict.stable, verdict.growth_rate) == (True, 0)
    assert str(verdict).startswith("stable: no motion grows, except for ")
    assert "no motion grows (`stability` says more)" in repr(spectrum(here))
    command(lmp, "velocity all set 1e-5 0 1e-5\nrun 20000 post no")  # a hundred oscillations
    speeds = []
    for _ in range(200):
        lmp.command("run 2 post no")
        speeds.append([of_particle(lmp, "v", k)[2] for k in (1, 2)])
    assert np.abs(speeds).max(axis=0) == pytest.approx([1e-5, 0.0], rel=0.01, abs=1e-10)
