"""The pages that `make docs` has built: what a reader sees first, and what the search finds.

`make docs` runs these tests at its end. Without built pages they are skipped: building takes minutes.
"""

import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

PAGES = Path(__file__).parents[2] / "docs" / "_build" / "html"
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not (PAGES / "live.html").exists(), reason="no pages are built: make docs"),
]

VIEWS = ("live.html", "three.html")
"""Pages of `faultgouge view`, which have no navigation."""

ASIDE = ("sidebar-drawer", "toc-drawer")
"""Classes of the navigation on the left, and of a page's own contents on the right."""


class Page(HTMLParser):
    """Text of the title and of the navigation, links, and places to which links lead."""

    def __init__(self, path):
        super().__init__()
        self.navigation, self.links, self.places = "", [], set()
        self._inside = []
        self.feed(path.read_text())

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.places |= {found[key] for key in ("id", "name") if found.get(key)}
        self.links += [found[key] for key in ("href", "src") if found.get(key)]
        if tag == "title" or (tag == "aside" and (found.get("class") or "").startswith(ASIDE)):
            self._inside.append(tag)

    def handle_endtag(self, tag):
        if self._inside and tag == self._inside[-1]:
            self._inside.pop()

    def handle_data(self, data):
        self.navigation += data if self._inside else ""


@pytest.fixture(scope="module")
def pages():
    return {path: Page(path) for path in PAGES.rglob("*.html") if path.name not in VIEWS}


def test_no_raw_formula_in_titles_and_navigation(pages):
    assert len(pages) > 100
    assert all("Install" in page.navigation for page in pages.values())
    assert [path for path, page in pages.items() if re.search(r"\\[(a-z]|\$", page.navigation)] == []


def test_no_link_between_pages_is_dead(pages):
    dead = []
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            places = pages[target].places if target in pages else ()
            if not target.exists() or (parts.fragment and target in pages and unquote(parts.fragment) not in places):
                dead.append(f"{path.relative_to(PAGES)}: {link}")
    assert dead == []
