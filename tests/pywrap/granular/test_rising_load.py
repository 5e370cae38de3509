"""A load that rises, beside residual forces and particles that nothing touches, as LAMMPS has it."""

import numpy as np
import pytest

from faultgouge.analysis import stability
from faultgouge.analysis.arrays import derive_frozen

TILT = 1e-6
"""Residual force over the weight of each particle: along x, as the load that rises."""

STEP = 2e-3


@pytest.fixture(scope="module")
def bed(beds):
    """Disks at rest without a contact at Coulomb's bound, and the direction of a slope that rises."""
    from faultgouge.pywrap import from_lammps

    lmp = beds("mindlin/force", 2)
    here = from_lammps(lmp)
    return lmp, here, np.outer(here.mass, [1.0, 0.0])


def displaced(lmp, here, rise, time=40.0):
    """Root mean square displacement, length, of LAMMPS's particles by a tilt and by a load that rises by so much."""
    from faultgouge.pywrap.granular.lammps_arrays import owned_array, rows_of, set_velocity
    from faultgouge.pywrap.granular.look_in_a_copy import in_a_copy, quieten

    def follow():
        lmp.command("log none")
        quieten(lmp, drag=True)
        set_velocity(lmp, here, np.zeros(here.coordinates))
        before = owned_array(lmp, "x")[rows_of(lmp, here)].copy()
        for line in (
            f"timestep {STEP}",
            "reset_timestep 0",
            f"variable force atom mass*({TILT}+{rise / time}*step*dt)",
            "fix rise all addforce v_force 0 0",
            f"run {round(time / STEP)} post no",
        ):
            lmp.command(line)
        moved = owned_array(lmp, "x")[rows_of(lmp, here)] - before
        return float(np.sqrt(np.mean(moved[:, :2] ** 2)))

    return in_a_copy(follow)


def test_a_load_counts_from_the_rise_that_is_said(bed):
    """The tilt moves the particles as far as a rise of the same size, and twice as far before dashpots have acted."""
    lmp, here, direction = bed
    load = here.load.copy()
    load[:, 0, :2] += TILT * direction
    found = stability(derive_frozen(here, load=load), rise=direction)
    assert found.at_bound == 0
    least, drift = found.rising.least_rise, found.rising.drift
    assert 10 * TILT < least < 20 * TILT
    assert f"from a rise of {least:.1g} on, where residual forces do not count" in str(found)
    assert displaced(lmp, here, least) == pytest.approx(least * drift, rel=0.12)
    assert displaced(lmp, here, 0.1 * least) > 1.4 * 0.1 * least * drift


def test_a_load_on_what_nothing_touches_is_not_followed(bed):
    _, here, direction = bed
    touched = np.arange(len(here)) != np.argmax(here.position[:, 1])  # the one on top bears none
    c = here.contacts
    apart = derive_frozen(here, contacts=c.chosen(touched[c.i] & (touched[c.j] | c.wall)))
    apart = derive_frozen(apart, load=-apart.contact_force)
    assert len(apart.rattlers)
    found = stability(apart, rise=direction)
    assert found.stable is True
    assert found.not_followed.endswith("nothing touches: give no forces on these")
    assert stability(apart, rise=direction * touched[:, None]).rising is not None
