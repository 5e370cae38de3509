"""The examples of the Python API run as they stand, and print what the page shows."""

from pathlib import Path

import pytest

from docs.run_page import run

PAGE = Path(__file__).parents[2] / "docs" / "api.md"


@pytest.mark.slow
def test_examples_print_what_the_page_shows(tmp_path):
    assert run(PAGE, tmp_path) == []
    assert (tmp_path / "packing.png").stat().st_size > 10_000
