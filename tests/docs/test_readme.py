"""What the README and the page of decks show is what their commands print now."""

from pathlib import Path

import pytest

from docs.run_page import commands, run

ROOT = Path(__file__).parents[2]


@pytest.mark.ranks  # two ranks that share their cores with others take ten times as long
@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize(("page", "count"), [("README.md", 4), ("docs/decks.md", 4)])
def test_a_page_shows_what_its_commands_print(tmp_path, page, count):
    assert len(list(commands(ROOT / page))) == count
    assert run(ROOT / page, tmp_path) == []


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text().splitlines()) <= 150
