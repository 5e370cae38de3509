"""What the README shows is what its commands print now."""

from pathlib import Path

import pytest

from docs.run_page import commands, run

PAGE = Path(__file__).parents[2] / "README.md"


@pytest.mark.ranks  # two ranks that share their cores with others take ten times as long
@pytest.mark.slow
@pytest.mark.long
def test_readme_shows_what_its_commands_print(tmp_path):
    assert len(list(commands(PAGE))) == 9
    assert run(PAGE, tmp_path) == []
