"""The pages that `make docs` has built: what a reader sees first, and what the search finds.

`make docs` runs these tests at its end. Without built pages they are skipped: building takes minutes.
"""

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
    return {path: Page(path) for path in PAGES.rglob("*.html") if path.name not in VIEWS}


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


@pytest.fixture
def new_page():
    """Opens an empty page of a browser; at the end nothing went wrong in the browser."""
    playwright = pytest.importorskip("playwright.sync_api")
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("no Chromium is installed")
    wrong = []
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])

        def open_page(width, height):
            page = browser.new_page(viewport={"width": width, "height": height})
            page.on("pageerror", lambda error: wrong.append(f"{page.url}: {error}"))
            page.on("console", lambda each: wrong.append(f"{page.url}: {each.text}") if each.type == "error" else None)
            return page

        yield open_page
        browser.close()
    assert wrong == []


@pytest.mark.parametrize("width", [1280, 390])
def test_no_page_is_wider_than_the_screen(new_page, pages, width):
    """A formula that is not recognised as one is."""
    page, wide = new_page(width, 900), []
    for path in sorted(pages):
        if path.is_relative_to(PAGES / "_modules"):
            continue
        page.goto(path.as_uri())
        if page.evaluate("document.documentElement.scrollWidth") > width:
            wide.append(str(path.relative_to(PAGES)))
    assert wide == []


@pytest.mark.parametrize(("width", "height"), [(1280, 900), (390, 844)])
def test_the_front_page_shows_the_demonstration_at_once(new_page, width, height):
    """On a screen the packing, the slider and the plots are seen without scrolling; on a telephone the verdict."""
    page = new_page(width, height)
    page.goto((PAGES / "index.html").as_uri())
    live = page.frame_locator(".live iframe")
    live.locator("#imaginary circle").first.wait_for(timeout=60_000)
    assert page.evaluate("document.documentElement.scrollWidth") == width
    wide = [f"text={title} parts of the chosen pair" for title in ("Real", "Imaginary")]
    for part in wide if width == 1280 else ("#verdict", "#play", "#growth"):
        box = live.locator(part).bounding_box()
        assert box["y"] + (150 if width == 1280 else box["height"]) <= height
        assert box["x"] + box["width"] <= width
