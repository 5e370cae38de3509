"""What LAMMPS users expect of a style: energy, virial, parameters that change, and a refusal of other versions."""

from pathlib import Path

import numpy as np
import pytest

from faultgouge.analysis import read_dump
from faultgouge.pywrap.lammps.decks import DECKS

ROOT = Path(__file__).parents[2]

MODEL = """
variable        decks index {decks}
variable        mu index {mu}
variable        fx index {fx}
include         {decks}/system.in
fix             move all nve/disc 1.0
timestep        {dt}
{extra}
thermo          1000
thermo_modify   format float %.17g
"""


def thermo(done, columns):
    """Rows of the thermo output that have so many columns of numbers."""
    rows = []
    for line in done.stdout.splitlines():
        try:
            row = [float(word) for word in line.split()]
        except ValueError:
            continue
        if len(row) == columns:
            rows.append(row)
    return np.array(rows)


@pytest.mark.slow
def test_energy_is_conserved_without_friction_to_second_order(lmp):
    """Without friction the forces have the energy that LAMMPS reports, floor included."""
    extra = """
group           bulk subtract all top
unfix           load
velocity        top set 0.02 0.0 0.0
compute         ke all ke
variable        total equal pe+c_ke+f_floor
thermo_style    custom step v_total c_ke f_floor pe
fix_modify      floor energy no
thermo_modify   norm no
"""
    drift = []
    for dt in (4e-4, 2e-4):
        script = MODEL.format(decks=DECKS, mu=0.0, fx=0.0, dt=dt, extra=extra) + f"thermo 50\nrun {round(0.4 / dt)}"
        done = lmp(script)
        assert done.returncode == 0, done.stdout[-1000:]
        rows = thermo(done, 5)
        assert rows[:, 2].max() > 10 * rows[0, 2]  # the layer bursts apart: contact energy becomes kinetic
        drift.append(np.abs(rows[:, 1] - rows[0, 1]).max())
    assert 3.5 < drift[0] / drift[1] < 4.5


def test_virial_is_that_of_the_contacts(lmp, tmp_path):
    extra = "thermo_style custom step c_bare[1] c_bare[2] c_bare[4] vol\nvariable name index state\n"
    extra = "compute bare all pressure NULL pair\n" + extra
    script = MODEL.format(decks=DECKS, mu=1.0, fx=0.3, dt=1e-3, extra=extra) + "run 200\nunfix move\n"
    done = lmp(script + f"include {DECKS}/write.in\n")
    assert done.returncode == 0, done.stdout[-1000:]
    _, xx, yy, xy, volume = thermo(done, 5)[-1]
    packing = read_dump(tmp_path / "state.disks")
    pair = ~packing.contacts.floor
    branch = packing.geometry.distance[pair, None] * packing.geometry.normal[pair]
    force = (
        packing.normal_force[pair, None] * packing.geometry.normal[pair]
        + packing.tangential_force[pair, None] * packing.geometry.tangent[pair]
    )
    stress = branch.T @ force / volume
    # LAMMPS divides by the volume of the box, which is 1 thick; xy is tallied as x times f_y
    # a force is known to k eps x = 1e-11 of itself, and the shear stress of a packing at rest is all cancellation
    scale = np.abs(stress).max()
    np.testing.assert_allclose([xx, yy, xy], [stress[0, 0], stress[1, 1], stress[0, 1]], rtol=0, atol=1e-11 * scale)


@pytest.mark.slow
def test_adapted_friction_is_friction_from_the_start(lmp, tmp_path):
    """fix adapt changes mu through extract(): the run is that of a pair style with the other mu."""
    dumps = []
    run = "run 500\nwrite_dump all custom end id x y omegaz modify sort id format float %.17g\n"
    adapt = """
variable        less equal 0.5
fix             adapt all adapt 1 pair mindlin/smooth mu * * v_less
fix_modify      floor mu v_less
"""
    for mu, extra in ((0.5, ""), (1.0, adapt)):
        done = lmp(MODEL.format(decks=DECKS, mu=mu, fx=3.0, dt=1e-3, extra=extra) + run)
        assert done.returncode == 0, done.stdout[-1000:]
        dumps.append((tmp_path / "end").read_text())
    assert dumps[0] == dumps[1]


def test_unknown_parameter_is_refused_by_adapt(said_against):
    adapt = "variable less equal 0.5\nfix adapt all adapt 1 pair mindlin/smooth nonsense * * v_less\n"
    assert "nonsense" in said_against(MODEL.format(decks=DECKS, mu=1.0, fx=0.0, dt=1e-3, extra=adapt) + "run 1")


@pytest.mark.ranks
@pytest.mark.slow
def test_weakening_friction_is_the_same_on_two_ranks(lmp, tmp_path):
    written = []
    settings = ["-var", "fx", "0.01", "-var", "time", "2.0", "-var", "amplitude", "1e-6", "-var", "v_ss", "2e-9"]
    for ranks in (1, 2):
        done = lmp(DECKS / "perturb.in", "-var", "decks", str(DECKS), *settings, ranks=ranks)
        assert done.returncode == 0, done.stdout[-1000:]
        written.append((tmp_path / "perturb.end.disks").read_text())
    assert written[0] == written[1]
