"""What LAMMPS users expect of a style: energy and virial; test_damping.py has parameters that change."""

import numpy as np
import pytest

from faultgouge.analysis import read_dump
from faultgouge.pywrap.lammps.decks import DECKS


@pytest.mark.slow
def test_energy_is_conserved_without_friction_to_second_order(lmp, tmp_path):
    """Without friction the forces have the energy that LAMMPS reports, floor included."""
    script = f"""
include         {DECKS}/system.in
fix             move all nve/disc 1.0
timestep        ${{dt}}
unfix           load
velocity        top set 0.02 0.0 0.0
compute         ke all ke
variable        total equal pe+c_ke+f_floor
fix_modify      floor energy no
thermo_style    custom step pe
thermo_modify   norm no
fix             series all ave/time 50 1 50 v_total c_ke file series format " %.17g"
run             $(0.4/dt)
"""
    drift = []
    for dt in (4e-4, 2e-4):
        lmp(script, decks=DECKS, mu=0.0, dt=dt)
        _, total, kinetic = np.loadtxt(tmp_path / "series").T
        assert kinetic.max() > 10 * kinetic[0]  # the layer bursts apart: contact energy becomes kinetic
        drift.append(np.abs(total - total[0]).max())
    assert 3.5 < drift[0] / drift[1] < 4.5


def test_virial_is_that_of_the_contacts(lmp, tmp_path):
    script = f"""
include         {DECKS}/system.in
fix             move all nve/disc 1.0
timestep        1e-3
compute         bare all pressure NULL pair
thermo_style    custom step c_bare[1] c_bare[2] c_bare[4] vol
run             200
print           "$(c_bare[1]:%.17g) $(c_bare[2]:%.17g) $(c_bare[4]:%.17g) $(vol:%.17g)" file virial
unfix           move
variable        name index state
include         {DECKS}/write.in
"""
    lmp(script, decks=DECKS, fx=0.3)
    *pressure, volume = np.loadtxt(tmp_path / "virial")
    packing = read_dump(tmp_path / "state.disks")
    pair = ~packing.contacts.floor
    branch = packing.geometry.distance[pair, None] * packing.geometry.normal[pair]
    force = (
        packing.normal_force[pair, None] * packing.geometry.normal[pair]
        + packing.tangential_force[pair, None] * packing.geometry.tangent[pair]
    )
    # LAMMPS divides by the volume of the box, which is 1 thick; xy is tallied as x times f_y
    stress = (branch.T @ force / volume)[[0, 1, 0], [0, 1, 1]]
    # a force is known to k eps x = 1e-11 of itself, and the shear stress of a packing at rest is all cancellation
    np.testing.assert_allclose(pressure, stress, rtol=0, atol=1e-11 * np.abs(stress).max())
