"""A tenth of ``make fuzz``, with another seed."""

import pytest

from fuzz import files, kills, ramps, scenes


@pytest.mark.long
@pytest.mark.slow
def test_damaged_files(tmp_path):
    assert [pair for pair in files.run(30, tmp_path, seed=1) if pair[1]] == []


@pytest.mark.long
def test_odd_scenes(tmp_path):
    assert [pair for pair in scenes.run(100, tmp_path, seed=1, longest=5) if pair[1]] == []


@pytest.mark.ranks
@pytest.mark.long
@pytest.mark.parametrize("work", kills.WORKS)
def test_killed_commands(tmp_path, work):
    assert [pair for pair in kills.run(1, tmp_path, seed=1, only=work) if pair[1]] == []


@pytest.mark.long
def test_ramps_of_a_packing_that_creeps_agree():
    """Beyond F_x/F_y = 0.0279 this packing creeps for a quarter of a million steps before it rests again."""
    row = ramps.packing_row(12)
    assert [each["verdict"] for each in row["ramps"]] == ["agrees"] * 6
    assert all("overdamped dynamics" in each["ways"][0] for each in row["ramps"])
    assert "6 agree" in ramps.says([row])
