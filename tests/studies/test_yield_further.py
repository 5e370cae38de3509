"""The page on layers that are left to themselves says what its tables hold, and other pages say the same."""

import shutil
from pathlib import Path

import pytest

from faultgouge.studies.yielding.page import write_lasting

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture
def written(tmp_path):
    """The page, made again from the tables."""
    shutil.copytree(DOCS / "yield" / "tables", tmp_path / "tables")
    return write_lasting(tmp_path).read_text()


def test_page_is_that_of_the_tables(written):
    assert (DOCS / "yield" / "further.md").read_text() == written


def test_other_pages_say_the_same(written):
    referee = " ".join((DOCS / "modes" / "referee.md").read_text().split())
    assert "restitution 0.9, 5 of 20 (11 to 47 %) layers vibrate" in " ".join(written.split())
    assert "[lossy layers](../yield/further.md), 5 of 20, vibrate" in referee
    assert "5 of 20 vibrate on" in referee
