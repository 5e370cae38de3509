"""Links between pages lead somewhere, lines fit a screen, and commands print what a page shows."""

import re
from pathlib import Path

import pytest

from docs.run_page import commands, files, run

ROOT = Path(__file__).parents[2]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md"))]
PROSE = [*PAGES, *sorted((ROOT / "docs").glob("*/*.md"))]
EXPLANATIONS = ("physics", "numerics", "complex_pairs", "arithmetic", "dissipation")
NO_PROSE = re.compile(r"^(```|\$\$).*?^(```|\$\$)$|^(\||    ).*?$", re.MULTILINE | re.DOTALL)
"""Blocks of code and formulas, and rows of tables."""


def anchors(page):
    """The headings of a page as links name them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.fixture(params=PROSE, ids=lambda page: page.name)
def page(request):
    return request.param


def test_links_lead_somewhere(page):
    lost = []
    for link, anchor in re.findall(r"\]\((?!https?:)([^)#\s]*)(?:#([^)\s]*))?\)", page.read_text()):
        target = page.parent / link if link else page
        if not target.exists() or (anchor and target.suffix == ".md" and anchor not in anchors(target)):
            lost.append(f"{link}#{anchor}")
    assert lost == []


def test_no_line_of_prose_is_longer_than_a_screen(page):
    prose = NO_PROSE.sub("", page.read_text())
    assert [line for line in prose.splitlines() if len(line) > 120] == []


@pytest.mark.parametrize("page", EXPLANATIONS)
def test_explanations_are_two_screens_with_a_picture_before_any_number(page):
    text = (ROOT / "docs" / f"{page}.md").read_text()
    before = text[: text.index("![")]
    assert text.count("\n") <= 100
    assert re.findall(r"\d\.\d|10\^|\b\d\d+", before) == []


def test_films_are_small_enough_to_open_with_the_page():
    films = sorted((ROOT / "docs").rglob("pictures/**/*.gif"))
    assert films
    assert [film.name for film in films if film.stat().st_size > 2_000_000] == []


def test_a_page_is_run(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "```toml\n# a.toml\nx = 1\n```\n\n```console\n$ cat a.toml\n# a.toml\nx = 2\n$ false\n"
        "$ echo mu = 1.0000001\nmu = 1.0\n$ echo mu = 1.01\nmu = 1.0\n```\n"
    )
    assert list(files(page)) == ["a.toml"]
    assert len(list(commands(page))) == 4
    text, code, number = run(page, tmp_path)
    assert "x = 1" in text
    assert "exit code 1" in code
    assert "1.01" in number


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
