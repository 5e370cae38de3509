"""Closed forms and results of others: the page comes out of its numbers, and these come out again."""

import json
from pathlib import Path

import pytest

from research.validation import compute
from research.validation.make import CELLS

FOLDER = Path(__file__).parents[2] / "research" / "validation"
FOUND = json.loads((FOLDER / "validation.json").read_text())


def test_the_crystal_of_duffy_and_mindlin():
    """C11 to what the present stress adds, a tenth of the overlap; C44 and C12 to half of the overlap."""
    again = compute.duffy_mindlin((0.0, 0.45), (1e-3, 1e-7))
    kept = [row for row in FOUND["duffy_mindlin"] if row["nu"] in (0.0, 0.45) and row["overlap"] != 1e-5]
    for row, stored in zip(again, kept, strict=True):
        assert row == pytest.approx(stored, rel=1e-3, abs=1e-13)  # differences of numbers of 16 digits
    for row in FOUND["duffy_mindlin"]:
        assert abs(row["c11"]) < 0.1 * row["overlap"]
        assert max(abs(row["c44"]), abs(row["c12"])) < 0.6 * row["overlap"]


def test_lattice_dynamics_of_the_crystal_in_lammps():
    """An overlap of 1e-4 is a difference of places that has twelve digits."""
    [row] = [compute.lattice_dynamics(compute.crystal_in_lammps(1e-2, CELLS), CELLS)]
    assert row["eigenvalues"] == 432
    assert row["difference"] < 1e-12
    assert all(each["difference"] < 3e-12 for each in FOUND["lattice"])


def test_sentences_of_ishima():
    for row in FOUND["ishima"]:
        # K of LAMMPS's forces at k_t = 1e-4 k_n is small beside the rounding of a slip that began at zero
        assert row["over_lammps"] == pytest.approx(1, abs=2e-5 if row["share"] == 1e-4 else 1e-6)
    frictionless, *others = FOUND["ishima"]
    for row in (each for each in others if each["share"] <= 1e-3):
        assert row["shear"] / frictionless["shear"] - 1 == pytest.approx(28 * row["share"], rel=0.1)
        assert row["band"] == row["rotating"] == row["bearing"]
    assert others[-1]["band"] == 0


def test_circle_of_hu():
    for row in FOUND["circles"]:
        assert row["off"] < (3e-2 if row["loaded"] else 1e-12)
        assert (row["overdamped"] > 100) == (row["share"] > 2)


@pytest.mark.long
@pytest.mark.slow
def test_circles_and_shear_of_disks_in_lammps_again():
    """One packing for both: it comes to rest in LAMMPS in two seconds."""
    disks = compute.disks_at_rest()
    for row, stored in zip(compute.circles(disks), FOUND["circles"], strict=True):
        assert row == pytest.approx(stored, rel=1e-3, abs=1e-13)
    (again,) = compute.ishima(disks, (1e-3,))
    disks.close()
    assert again["over_lammps"] == pytest.approx(1, abs=1e-6)
    assert again["shear"] == pytest.approx(FOUND["ishima"][2]["shear"], rel=1e-6)


def test_the_rule_of_osullivan_and_bray_is_safe():
    assert compute.time_steps((0.0,), 1e-3) == [pytest.approx(FOUND["time_steps"][0], rel=1e-9)]
    assert FOUND["time_steps"][0]["over_rule"] == pytest.approx(1.86, abs=1e-3)
    assert all(row["over_rule"] > 1.8 for row in FOUND["time_steps"])


@pytest.mark.long
def test_density_of_states_of_a_thousand_spheres():
    """Within two standard errors of all eigenvalues, of which LAPACK needs a third of a minute."""
    again = compute.density_of_states()
    assert again == pytest.approx(FOUND["density"], rel=1e-3)
    assert again["spheres"] > 1000
    assert again["motions"] == again["eigenvalues"] == 6 * again["spheres"] - 3
    assert again["difference"] < 2 * again["noise"]
