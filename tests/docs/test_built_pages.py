"""The pages that `make docs` has built: what a reader sees first, and what the search finds.

`make docs` runs these tests at its end. Without built pages they are skipped: building takes minutes.
"""

import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

PAGES = Path(__file__).parents[2] / "docs" / "_build" / "html"
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not (PAGES / "live.html").exists(), reason="no pages are built: make docs"),
]

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
        for key in ("href", "src"):
            if found.get(key):
                self.links.append(found[key])
        if tag == "title" or (tag == "aside" and (found.get("class") or "").startswith(ASIDE)):
            self._inside.append(tag)

    def handle_endtag(self, tag):
        if self._inside and tag == self._inside[-1]:
            self._inside.pop()

    def handle_data(self, data):
        if self._inside:
            self.navigation += data


@pytest.fixture(scope="module")
def pages():
    return {path: Page(path) for path in PAGES.rglob("*.html") if path.name != "live.html"}


def test_no_raw_formula_in_titles_and_navigation(pages):
    assert len(pages) > 100
    assert all("Install" in page.navigation for page in pages.values())
    assert [
        str(path.relative_to(PAGES)) for path, page in pages.items() if re.search(r"\\[(a-z]|\$", page.navigation)
    ] == []


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


@pytest.mark.parametrize("word", ["window", "wsl", "mac", "libmpi", "seed", "colab", "instal"])
def test_the_search_finds(word):
    """Sphinx searches by the stems of words."""
    index = (PAGES / "searchindex.js").read_text()
    index = json.loads(index[index.index("{") : index.rindex("}") + 1])
    numbers = set()
    for terms in (index["terms"], index["titleterms"]):
        found = terms.get(word, [])
        numbers |= set(found if isinstance(found, list) else [found])
    names = {index["docnames"][k] for k in numbers}
    assert names & {"install", "lesson", "scenes"}, names


def test_the_front_page_shows_the_demonstration_at_once():
    """On a screen of 1280 x 900 the packing, the slider and the plots of eigenvalues are seen without scrolling."""
    playwright = pytest.importorskip("playwright.sync_api")
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("no Chromium is installed")
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto((PAGES / "index.html").as_uri())
        frame = page.locator(".live iframe").bounding_box()
        live = page.frame_locator(".live iframe")
        live.locator("text=Imaginary parts of the pair").wait_for(timeout=60_000)
        plots = [live.locator(f"text={title} parts of the pair").bounding_box() for title in ("Real", "Imaginary")]
        browser.close()
    assert frame["y"] + frame["height"] <= 900
    assert all(box["y"] + 150 < 900 for box in plots)


def test_the_front_page_has_no_list_of_all_pages():
    text = (PAGES / "index.html").read_text()
    article = text[text.index("<article") : text.index("</article>")]
    assert "toctree-l1" not in article
