"""Compensated arithmetic against 50 decimal digits, and what must hold exactly."""

import mpmath
import numpy as np
import pytest

from faultgouge.analysis import Contacts, MindlinLaw, Packing, mean_square_displacement
from faultgouge.assessment.extremes.packings import at_rest
from faultgouge.pywrap import Engine, equilibrate

mpmath.mp.dps = 50
mpf = mpmath.mpf


def true_net_force(packing):
    """(F_x, F_y, T/R) of every disk from coordinates and slips in 50 digits: the law once more, in full."""
    law, c = packing.law, packing.contacts
    kn, kt, mu = mpf(law.kn), mpf(law.kt), mpf(law.mu)
    position = np.vectorize(mpf, otypes=[object])(packing.position) + packing.position_low
    total = np.zeros((3, len(packing)), dtype=object)
    total[0, packing.top], total[1, packing.top] = packing.fx, -packing.fy
    for i, j, s, s_low in zip(c.i.tolist(), c.j.tolist(), c.slip, c.slip_low, strict=True):
        reach = mpf(packing.radius[i]) + (mpf(packing.radius[j]) if j >= 0 else 0)
        x, y = position[i] - position[j] if j >= 0 else position[i] * [0, 1]
        x -= mpf(packing.box_length) * mpmath.nint(x / mpf(packing.box_length))
        r = mpmath.sqrt(x * x + y * y)
        overlap = reach - r
        slip, limit = mpf(s) + mpf(s_low), mu * kn / kt * overlap
        ratio = min(abs(slip) / limit, mpf(1)) if limit else mpf(1)
        normal = kn * overlap ** mpf(law.exponent)
        tangential = -mpmath.sign(slip) * mu * normal * (ratio + ratio**2 - ratio**3)
        force = np.array([(normal * x - tangential * y) / r, (normal * y + tangential * x) / r, -tangential])
        total[:, i] += force
        if j >= 0:
            total[:, j] += force * [-1, -1, 1]
    return total


@pytest.fixture(scope="module")
def equilibrium(reference_packing):
    """The reference packing at F_x = 0.01."""
    packing = reference_packing(1.0, compensated=True)
    with Engine(packing) as engine:
        return equilibrate(engine, at_rest(packing), 0.01)


@pytest.mark.parametrize("overlap", [1e-12, 1e-9, 1e-6, 1e-3, 0.3])
@pytest.mark.parametrize("radii", [(0.5, 0.7), (0.02, 1.0), (0.1, 0.3)])
@pytest.mark.parametrize("exponent", [1.5, 1.0], ids=["Hertz", "harmonic"])
@pytest.mark.parametrize("mu", [0.0, 0.5])
@pytest.mark.slow
def test_force_of_two_disks(overlap, radii, mu, exponent):
    """A force is right to its last place, at any overlap, inside of the box and across its end."""
    rng, packings = np.random.default_rng(3), []
    overlap *= min(radii)
    for angle, x in zip(rng.uniform(0, 2 * np.pi, 8), [7.3, 0.1] * 4, strict=True):
        centre = np.array([x, 4.0])
        slip = rng.uniform(-1.2, 1.2) * mu * 3.5 * overlap
        packings.append(
            Packing(
                position=np.array([centre + (sum(radii) - overlap) * np.array([np.cos(angle), np.sin(angle)]), centre]),
                position_low=1e-17 * rng.standard_normal((2, 2)),
                radius=np.array(radii),
                law=MindlinLaw(2e5, 2e5 / 3.5, mu, exponent),
                contacts=Contacts([0], [1], [slip], [1e-17 * slip]),
                box_length=11.9,
            )
        )
    # The last place of the double that is handed out. An overlap is known to 2^-77 of 2^e, e.g. to 1e-11 at 1e-12,
    # and the force to p of that.
    known = 3e-16 + 3 * exponent * packings[0].coordinate_rounding / overlap
    with Engine(packings[0]) as engine:
        for packing in packings:
            engine.displace(packing, np.zeros(6))
            force, true = engine.net_force.reshape(3, 2), true_net_force(packing).astype(np.float64)
            assert np.array_equal(force[:2, 0], -force[:2, 1])  # momentum, exactly
            assert np.abs(force - true).max() <= known * np.abs(true).max()


def test_reference_packing_is_balanced_in_truth_and_goes_through_lammps_to_the_bit(equilibrium):
    packing = equilibrium.packing
    true = true_net_force(packing).astype(np.float64)
    moved = np.delete(true, packing.rattlers, axis=1)
    assert np.linalg.norm(moved, axis=0).max() < 1e-17  # a hundred times better than 1e-15
    assert equilibrium.residual < 1e-17
    with Engine(packing) as engine:
        assert engine.displace(packing, np.zeros(3 * len(packing))) == packing
        # what LAMMPS finds differs from the truth by the rounding of 2^-77 times stiffness, and of long sums
        assert np.abs(engine.net_force - true.ravel()).max() < 1e-18 * 5
    # numpy's long doubles: 64 bits of forces of order 3
    assert np.abs(packing.net_force - true.ravel()).max() < 1e-17


@pytest.mark.slow
def test_stable_run_stays_at_the_rounding_of_low_parts(equilibrium):
    packing, moved = equilibrium.packing, []
    with Engine(packing) as engine, engine.undamped(2e-4) as dynamics:
        for _ in range(20):
            motion = dynamics.advance(2000)
            places, low = (motion.position, packing.position), (motion.position_low, packing.position_low)
            moved.append(float(mean_square_displacement(*places, packing.box_length, *low)))
    # A coordinate is known to 7e-24, a net force to 1e-19, which a mode of omega^2 = 1 would turn into 1e-38.
    assert 0 < max(moved) < 1e-38
