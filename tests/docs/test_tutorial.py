"""The tutorial runs as it stands on the page, prints what the page shows, and leaves the pictures that the page has."""

import re
from pathlib import Path

import pytest

from docs.run_page import run

PAGE = Path(__file__).parents[2] / "docs" / "tutorial.md"


@pytest.mark.slow
@pytest.mark.long
def test_tutorial_prints_what_the_page_shows(tmp_path):
    assert run(PAGE, tmp_path) == []
    pictures = re.findall(r"\]\(pictures/tutorial/([\w.]+)\)", PAGE.read_text())
    assert len(pictures) == 5
    for picture in pictures:
        assert (tmp_path / picture).stat().st_size > 10_000
        assert (PAGE.parent / "pictures" / "tutorial" / picture).exists()
