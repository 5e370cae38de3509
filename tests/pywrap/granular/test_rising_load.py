"""A load that rises, beside residual forces and particles that nothing touches, as LAMMPS has it."""

import numpy as np
import pytest
from pushes import in_a_quiet_copy, places

from faultgouge.analysis import stability
from faultgouge.analysis.arrays import derive_frozen

TILT = 1e-6
"""Residual force over the weight of each particle: along x, as the load that rises."""

STEP = 2e-3


@pytest.fixture
def slope(bed):
    """Disks at rest without a contact at Coulomb's bound, and the direction of a slope that rises."""
    lmp, here = bed("mindlin/force", 2)
    return lmp, here, np.outer(here.mass, [1.0, 0.0])


def displaced(lmp, here, rise, time=40.0):
    """Root mean square displacement, length, of LAMMPS's particles by a tilt and by a load that rises by so much."""

    def follow():
        before = places(lmp, here)
        lmp.command(f"run {round(time / STEP)} post no")
        return float(np.sqrt(np.mean((places(lmp, here) - before)[:, :2] ** 2)))

    force = f"variable force atom mass*({TILT}+{rise / time}*step*dt)\nfix rise all addforce v_force 0 0"
    return in_a_quiet_copy(lmp, follow, f"velocity all set 0 0 0\ntimestep {STEP}\nreset_timestep 0\n{force}")


def test_a_load_counts_from_the_rise_that_is_said(slope):
    """The tilt moves the particles as far as a rise of the same size, and twice as far before dashpots have acted."""
    lmp, here, direction = slope
    load = here.load.copy()
    load[:, 0, :2] += TILT * direction
    found = stability(derive_frozen(here, load=load), rise=direction)
    assert found.at_bound == 0
    least, drift = found.rising.least_rise, found.rising.drift
    assert 10 * TILT < least < 20 * TILT
    assert f"from a rise of {least:.1g} on, where residual forces do not count" in str(found)
    assert displaced(lmp, here, least) == pytest.approx(least * drift, rel=0.12)
    assert displaced(lmp, here, 0.1 * least) > 1.4 * 0.1 * least * drift


def test_a_load_on_what_nothing_touches_is_not_followed(slope):
    _, here, direction = slope
    touched = np.arange(len(here)) != np.argmax(here.position[:, 1])  # the one on top bears none
    c = here.contacts
    apart = derive_frozen(here, contacts=c.chosen(touched[c.i] & (touched[c.j] | c.wall)))
    apart = derive_frozen(apart, load=-apart.contact_force)
    assert len(apart.rattlers)
    found = stability(apart, rise=direction)
    assert found.stable is True
    assert found.not_followed.endswith("nothing touches: give no forces on these")
    assert stability(apart, rise=direction * touched[:, None]).rising is not None
