"""Links between pages lead somewhere, and lines fit a screen."""

import re
from pathlib import Path

import pytest

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


@pytest.mark.parametrize("page", PROSE, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    lost = []
    for link, anchor in re.findall(r"\]\((?!https?:)([^)#\s]*)(?:#([^)\s]*))?\)", page.read_text()):
        target = page.parent / link if link else page
        if not target.exists() or (anchor and target.suffix == ".md" and anchor not in anchors(target)):
            lost.append(f"{link}#{anchor}")
    assert lost == []


@pytest.mark.parametrize("page", PROSE, ids=lambda page: page.name)
def test_no_line_of_prose_is_longer_than_a_screen(page):
    prose = NO_PROSE.sub("", page.read_text())
    assert [line for line in prose.splitlines() if len(line) > 120] == []


@pytest.mark.parametrize("page", EXPLANATIONS)
def test_explanations_are_two_screens_with_a_picture_before_any_number(page):
    text = (ROOT / "docs" / f"{page}.md").read_text()
    before = text[: text.index("![")]
    assert text.count("\n") <= 100
    assert re.findall(r"\d\.\d|10\^|\b\d\d+", before) == []


def test_no_page_has_the_name_of_a_page_that_sphinx_makes():
    assert {page.stem for page in PAGES} & {"search", "genindex", "py-modindex"} == set()


def test_films_are_small_enough_to_open_with_the_page():
    films = sorted((ROOT / "docs").rglob("pictures/**/*.gif"))
    assert films
    assert [film.name for film in films if film.stat().st_size > 2_000_000] == []
