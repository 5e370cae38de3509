"""The page on LAMMPS's own laws: it comes out of the committed tables, and the tables bear what it says."""

import pytest

from research.lammps_laws.compute import CELLS, LAWS
from research.lammps_laws.energy_cycle import energy_cycle
from research.lammps_laws.make import check, numbers

NEVER = ("granular hooke, linear_history", "granular hertz, mindlin/force")


@pytest.mark.slow
def test_what_the_page_says_holds():
    found = numbers()
    rare, weak, pushed = found["rare"], found["weak"], found["pushed"]
    assert found["negative"] == 0
    for cell in found["cells"] + found["others"]:
        if cell["law"] in NEVER:
            assert cell["with_pairs"]["count"] <= (1 if cell.get("count", 50) > 50 else 0)
        elif "hertz" in cell["law"]:
            assert cell["with_pairs"]["count"] >= 0.5 * cell["packings"]
    assert rare["most"] == 1
    assert 0 < rare["having"] < 0.05 * rare["rows"]
    for steep in found["steep"]:
        if steep["law"] in NEVER:
            assert sum(steep["with_pairs"]) == (2 if (steep["mu"], steep["d"]) == (0.9, 3) else 0)
        elif "hertz" in steep["law"]:
            last = max(k for k, count in enumerate(steep["packings"]) if count >= 5)
            assert steep["share"][last] > steep["share"][0]
    # fits of amplitudes in which other modes beat
    assert 0.95 < weak["few"][0] <= weak["few"][1] < 1.05
    # while no contact slides LAMMPS grows as the linearised packing does; beats of pairs are left in a fit
    assert pushed["grown"] == pushed["pairs"] == pushed["packings"]
    assert all(abs(ratio - 1) < 0.05 for ratio in pushed["ratio"])


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_a_contact_creates_the_energy_of_the_formula(law):
    """Rounding of the normal work, 1e4 times the tangential one, leaves 1e-11."""
    found = energy_cycle(law)
    for name in ("closing", "parting"):
        assert found[name] == pytest.approx(found[f"{name}_formula"], abs=1e-9)
        assert found[f"{name}_left"] == pytest.approx(0, abs=1e-12)
    creates = {name for name in ("closing", "parting") if found[name] > 1e-9}
    assert creates == (
        {"parting"}
        if law == "granular hertz, mindlin/force"
        else {"closing"}
        if "hertz" in law and law != "granular hertz, mindlin_rescale/force"
        else set()
    )


@pytest.mark.long
def test_the_first_packings_come_out_again():
    """Those of the usual friction; `python -m research.lammps_laws.make check` has all."""
    assert check(CELLS[:1]) == []
