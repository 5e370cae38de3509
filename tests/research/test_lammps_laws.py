"""The page on LAMMPS's own laws: it comes out of the committed table, and the table bears what it says."""

import pytest

from research.lammps_laws.make import HERE, TABLE, check, numbers, write_page

NEVER = ("granular hooke, linear_history", "granular hertz, mindlin/force")


@pytest.mark.slow
def test_the_page_is_what_the_table_makes(tmp_path):
    assert write_page(tmp_path).read_text() == (HERE / "README.md").read_text()
    found = numbers(TABLE)
    for cell in found["cells"]:
        assert cell["negative"] == 0
        if cell["law"] in NEVER:
            assert cell["with_pairs"]["count"] == 0
        elif "hertz" in cell["law"]:
            assert cell["with_pairs"]["count"] >= 0.7 * cell["packings"]
    assert found["wall"]["power"] == pytest.approx(0.5)


@pytest.mark.long
def test_the_first_packings_come_out_again():
    assert check() == []
