"""A share of ``make fuzz``, with another seed."""

import pytest

from fuzz import files, kills, scenes
from fuzz.__main__ import KINDS


def test_damaged_files(tmp_path):
    assert [pair for pair in files.run(30, tmp_path, seed=1) if pair[1]] == []


@pytest.mark.slow
def test_odd_scenes(tmp_path, share_of_all):
    count = round(share_of_all * KINDS["scenes"])
    assert [pair for pair in scenes.run(count, tmp_path, seed=1) if pair[1]] == []


@pytest.mark.ranks
@pytest.mark.slow
@pytest.mark.parametrize("work", [work.name for work in kills.WORKS])
def test_killed_commands(tmp_path, work):
    assert [pair for pair in kills.run(1, tmp_path, seed=1, only=work) if pair[1]] == []
