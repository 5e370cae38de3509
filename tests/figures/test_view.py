"""The page of `faultgouge view` in a browser that has no network. Without Chromium these tests are skipped."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faultgouge.analysis import stability
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.figures.browser_page import Axis, sentences_of, write_view

pytestmark = pytest.mark.slow

WIDE, NARROW = {"width": 1280, "height": 800}, {"width": 390, "height": 844}


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as p:
        chromium = shutil.which("chromium") or shutil.which("google-chrome") or p.chromium.executable_path
        if not Path(chromium).exists():
            pytest.skip("no Chromium is installed: python -m playwright install chromium")
        yield p.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])


@pytest.fixture(scope="module")
def page_of_loads(there_and_back, tmp_path_factory):
    """The page of packings over their loads."""
    path = tmp_path_factory.mktemp("page") / "page.html"
    write_view(there_and_back, path, "some packings")
    return path


@pytest.fixture
def opened(browser, tmp_path):
    """Opens a page, or that of packings; at the end nothing went wrong in the browser, and nothing was fetched."""
    wrong, pages = [], []

    def open_page(shown, viewport=WIDE, **more):
        path = shown if isinstance(shown, Path) else tmp_path / "page.html"
        if path is not shown:
            write_view(shown, path, "some packings", **more)
        scheme = "dark" if viewport is NARROW else "light"
        page = browser.new_page(viewport=viewport, color_scheme=scheme, offline=True)  # what is fetched is an error
        pages.append(page)
        page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.goto(path.as_uri())
        page.wait_for_function("document.querySelector('#plane circle')")
        return page

    yield open_page
    for page in pages:
        page.close()
    assert wrong == []


PICTURE = "document.getElementById('packing').toDataURL()"


def boxes(page, selector):
    return [each.bounding_box() for each in page.query_selector_all(selector)]


def mark(page):
    """Where the present load is marked in the plot of growth over the load, pixels."""
    return float(page.get_attribute("#growth .mark", "x1"))


def test_plots_are_in_view_at_once(page_of_loads, opened):
    page = opened(page_of_loads)
    plots = boxes(page, ".plots .plot svg")
    assert len(plots) == 6
    for box in [*plots, *boxes(page, "#packing")]:
        assert (box["y"] + box["height"] <= WIDE["height"], box["x"] + box["width"] <= WIDE["width"]) == (True, True)
        assert min(box["width"], box["height"]) > 80
    page = opened(page_of_loads, NARROW)
    assert page.evaluate("document.documentElement.scrollWidth") <= NARROW["width"]
    for box in (*boxes(page, "#verdict"), *boxes(page, "#load"), *boxes(page, ".first")):
        assert box["y"] + box["height"] <= NARROW["height"]
    assert all(box["width"] > 300 for box in boxes(page, ".plot svg"))


def test_the_page_opens_where_motion_grows_fastest_and_moves_along_the_load(page_of_loads, opened):
    page = opened(page_of_loads)
    says = page.inner_text("#verdict")
    assert "Unstable: small motion grows, D as exp(" in says
    assert "2 complex pairs." in says
    assert (page.inner_text("#where"), page.inner_text("#value")) == ("Fₓ = 0.16", "0.16")
    assert page.get_attribute("#verdict", "class") == "unstable"
    begin = mark(page)
    page.focus("#load")
    page.keyboard.press("Home")
    assert page.inner_text("#where") == "Fₓ = 0"
    assert "Stable: no motion grows" in page.inner_text("#verdict")
    assert mark(page) < begin
    page.keyboard.press("ArrowRight")
    page.locator("h1").click()
    page.keyboard.press("ArrowRight")
    assert page.inner_text("#where") == "Fₓ = 0.08"
    plot = boxes(page, "#growth svg")[0]
    page.mouse.click(plot["x"] + begin, plot["y"] + 0.5 * plot["height"])
    assert page.inner_text("#where") == "Fₓ = 0.16"
    page.click("#play")
    page.wait_for_function("document.getElementById('where').textContent != 'Fₓ = 0.16'")


def test_the_page_opens_at_a_packing_that_rests_at_a_time_or_a_load(there_and_back, opened):
    """Of a packing out of balance the verdict is not known, however fast its eigenvalues grow."""
    last = there_and_back[4]
    stiffer = derive_frozen(last, fx=0.17, law=replace(last.law, kn=4 * last.law.kn, kt=4 * last.law.kt))
    page = opened([*there_and_back[3:5], stiffer], axis=Axis("t", "time", np.arange(3.0)))
    assert page.inner_text("#where") == "t = 1"
    assert "t, time: 1" in page.inner_text("nav")
    assert "t" in [each.text_content() for each in page.query_selector_all("#growth .name")]
    page.focus("#load")
    page.keyboard.press("End")
    assert "Not known whether the packing is stable" in page.inner_text("#verdict")


def test_a_mode_moves_and_rests_and_a_press_on_an_eigenvalue_chooses_its_pair(page_of_loads, opened):
    page = opened(page_of_loads)
    for still in (False, True):
        if still:
            page.select_option("#motion", "still")
        first = page.evaluate(PICTURE)
        page.wait_for_timeout(300)
        assert (page.evaluate(PICTURE) == first) is still
    before, says = page.input_value("#pair"), page.inner_text("#members")
    page.locator("#plane circle.choice").first.click()
    assert page.input_value("#pair") != before
    assert says != page.inner_text("#members")
    assert "a complex pair" in page.inner_text("#members")


def test_nothing_is_drawn_of_a_pair_that_is_unknown(there_and_back, renumbered, opened):
    """The same disks in another order have other modes."""
    page = opened([renumbered, there_and_back[4]])

    def at(end):
        page.focus("#load")
        page.keyboard.press(end)
        return page.inner_text("#members")

    at("Home")
    at_first = page.input_value("#pair")
    assert "a complex pair" in at("End")
    assert page.input_value("#pair") != at_first  # nobody has asked for that one: another pair is shown
    assert at("Home").endswith("at another Fₓ of this page have the shapes of this pair.")
    page.select_option("#pair", at_first)
    assert at("End") == "No two modes at Fₓ = 0.16 have the shapes of the chosen pair."
    assert page.query_selector_all("#imaginary circle") == []
    assert page.input_value("#motion") == "still"


def test_a_number_has_its_noun(column):
    verdict = stability(column)
    for pairs, negative, says in ((0, 0, []), (1, 21, ["1 complex pair and 21 negative eigenvalues."])):
        undamped = type(verdict.undamped)(verdict.undamped | {"pairs": pairs, "negative": negative})
        assert sentences_of(replace(verdict, undamped=undamped))[1:] == says


def test_spheres_can_be_turned(column, opened):
    page = opened([column])
    assert page.query_selector("#load") is None
    page.select_option("#motion", "still")
    before, box = page.evaluate(PICTURE), boxes(page, "#packing")[0]
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 160, box["y"] + 100, steps=3)
    page.mouse.up()
    assert page.evaluate(PICTURE) != before
