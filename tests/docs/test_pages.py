"""Pages show what their commands print now; and the comparison tells right from wrong."""

import re
from pathlib import Path

import pytest

from docs.run_page import commands, difference, files, run

ROOT = Path(__file__).parents[2]

SHOWN = "mu = 1: F_x^c = 0.015009832275(11)\nwritten to run.h5"


@pytest.mark.parametrize(
    ("shown", "printed", "right"),
    [
        (SHOWN, "mu = 1: F_x^c = 0.015009832275(11)\nwritten to run.h5\n", True),
        (SHOWN, "mu = 1:  F_x^c = 0.015009832999(13)\n\nwritten to run.h5", True),
        (SHOWN, "mu = 1: F_x^c = 0.0151(11)\nwritten to run.h5", False),
        (SHOWN, "mu = 1: F_x^c = 0.015009832275(11)\nwritten to other.h5", False),
        (SHOWN, "mu = 1: F_x^c = 0.015009832275(11)", False),
        (SHOWN, f"{SHOWN}\nand more", False),
        (SHOWN, f"settling: 2000 steps\nequilibria: 5 of 21\n{SHOWN}", True),  # progress of a slow machine
        ("residual 5.1e-11", "residual 7e-12", True),  # noise of rounding may differ, and stays noise
        ("residual 5.1e-11", "residual 5.1e-6", False),
        ("a 1\n...\nz 9", "a 1\nb 2\nc 3\nz 9\n", True),  # dots stand for any lines
        ("a 1\n...\nz 9", "a 1\nb 2\n", False),
    ],
)
def test_words_are_equal_and_numbers_agree(shown, printed, right):
    assert (difference(tuple(shown.split("\n")), printed) == "") is right


def test_a_page_is_run(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("```toml\n# a.toml\nx = 1\n```\n\n```console\n$ cat a.toml\n# a.toml\nx = 2\n$ false\n```\n")
    assert list(files(page)) == ["a.toml"]
    assert [command.line for command in commands(page)] == ["cat a.toml", "false"]
    wrong = run(page, tmp_path)
    assert "x = 1" in wrong[0]
    assert "exit code 1" in wrong[1]


@pytest.mark.long
@pytest.mark.parametrize(
    ("page", "count", "pictures"),
    [
        # two ranks that share their cores with others take ten times as long
        pytest.param("README.md", 4, 0, marks=pytest.mark.ranks),
        pytest.param("docs/decks.md", 4, 0, marks=pytest.mark.ranks),
        ("docs/tutorial.md", None, 5),
        ("docs/api.md", None, 1),
    ],
)
def test_a_page_shows_what_its_commands_print(tmp_path, page, count, pictures):
    path = ROOT / page
    assert count in (None, len(list(commands(path))))
    assert run(path, tmp_path) == []
    shown = re.findall(r"\]\((pictures/tutorial/[\w.]+)\)", path.read_text())
    assert all((path.parent / picture).exists() for picture in shown)
    made = [Path(picture).name for picture in shown] or [path.name for path in tmp_path.glob("*.png")]
    assert len(made) == pictures
    assert all((tmp_path / picture).stat().st_size > 10_000 for picture in made)


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text().splitlines()) <= 150
