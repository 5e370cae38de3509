"""Contacts that slide on while vibration decays slowly: the verdict beside LAMMPS's own motion."""

import numpy as np
import pytest
from granular_packings import deck
from pushes import pushed

import faultgouge
from faultgouge.analysis import stability
from faultgouge.analysis.motion.pushes import PUSHES, random_pushes

LAW = "granular hertz 1e4 10 tangential mindlin_rescale/force 5e3 0.5 0.5 damping viscoelastic"
RAISED = """run 30000 post no
fix drag all viscous 10.0
variable slope equal ramp(0,0.3)
variable down equal -1.0
variable across equal 0.0
variable size equal sqrt(1+v_slope*v_slope)
fix load all gravity v_size vector v_slope v_across v_down
run 15000 post no
fix load all gravity 1.0440306508910551 vector 0.3 0 -1
run 60000 post no"""
POURED = """region pile block 0.2 3.0 0.2 3.0 0.6 20 units box
create_atoms 1 random 50 11 pile overlap 0.9 maxtry 2000
set group all type/fraction 2 0.5 12"""
DECK = deck(
    [], LAW, "zplane 0 NULL contacts", box="block 0 3.2 0 3.2 0 60", boundary="p p f", fill=POURED,
    diameters=(0.8, 1.0), density="density 1.9", timestep=0.002, run=RAISED,
    more="fix move all nve/sphere\nfix drag all viscous 1.0",
)  # fmt: skip
"""Fifty spheres on a slope that is raised slowly."""


@pytest.mark.long
def test_what_slides_on_as_vibration_decays_comes_to_rest(lammps_with):
    """Vibration falls as exp(-0.0026 t), so that slips of all contacts never stop in the time that is followed. D of
    LAMMPS gains ever less in equal times, and stays about the size that is told."""
    lmp = lammps_with(DECK)
    faultgouge.relax(lmp, balance=1e-11)
    found = faultgouge.from_lammps(lmp)
    told = stability(found)
    assert told.stable
    assert 0 < told.one_sided.slip_left < 0.01
    assert "of their slip is left" in str(told)
    times = np.array([25.0, 75.0, 125.0, 225.0, 325.0])
    in_lammps = pushed(lmp, found, random_pushes(found, PUSHES), times, 1e-3, 1e-7).max(axis=1)
    # followed for t = 342; a hundredth of the slip is left then
    assert in_lammps[-1] == pytest.approx(told.one_sided.amplification, rel=0.01)
    gains = np.diff(in_lammps) / np.diff(times)
    assert np.all(gains[1:] < gains[:-1])
