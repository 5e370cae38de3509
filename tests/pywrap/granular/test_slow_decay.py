"""Contacts that slide on while vibration decays slowly: the verdict beside LAMMPS's own motion."""

import numpy as np
import pytest
from pushes import pushed

import faultgouge
from faultgouge.analysis import stability
from faultgouge.analysis.motion.pushes import PUSHES, random_pushes


@pytest.mark.long
def test_what_slides_on_as_vibration_decays_comes_to_rest(lammps_with):
    """Vibration falls as exp(-0.0026 t), so that slips of all contacts never stop in the time that is followed. D of
    LAMMPS gains ever less in equal times, and stays about the size that is told."""
    lmp = lammps_with(deck="raised_slope.in")
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
