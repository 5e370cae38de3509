"""The page of `faultgouge view`, in a real browser that has no network."""

import shutil

import pytest
from reference_layer import BEYOND_ITS_ONSET

from faultgouge.figures.view import equally_spaced, followed


def test_loads_are_equally_spaced_with_first_and_last():
    assert equally_spaced(4, 60) == [0, 1, 2, 3]
    assert equally_spaced(101, 5) == [0, 25, 50, 75, 100]


def test_one_packing_has_a_pair(reference_packing):
    course = followed([reference_packing(1.0)])
    for value in course.pair[0]:
        assert abs(course.values[0] - value).min() < 1e-6 * abs(value)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, faultgouge_in):
    """A ramp through the onset 0.0218, an undamped run, and their pages."""
    made = tmp_path_factory.mktemp("view")
    (made / "scene.toml").write_text(BEYOND_ITS_ONSET)
    for name in ("ramp", "perturb"):
        for words in ((name, "scene.toml", "-o", f"{name}.h5"), ("view", f"{name}.h5", "-o", f"{name}.html")):
            done = faultgouge_in(made, *words)
            assert done.returncode == 0, done.stderr
    return made


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api")
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("no Chromium is installed")
    with playwright.sync_playwright() as p:
        yield p.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])


@pytest.mark.long
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1440, 390])
@pytest.mark.parametrize("name", ["ramp", "perturb"])
def test_the_page_offline(folder, browser, name, width, scheme):
    page = browser.new_page(viewport={"width": width, "height": 800}, color_scheme=scheme)
    wrong, asked = [], []
    page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto((folder / f"{name}.html").as_uri())
    page.wait_for_function("document.getElementById('says')?.textContent.includes('λ')")
    pair = "Object.values(Bokeh.documents[0].get_model_by_name('members').data).slice(0, 2).map((x) => [...x])"
    before = page.evaluate(pair)
    if name == "ramp":
        assert before[1] == [0, 0]
        page.focus("#load")
        page.keyboard.press("End")
        assert "complex" in page.inner_text("#says")
    after = page.evaluate(pair)
    assert after[1][0] > 0 > after[1][1]
    assert (before != after) == (name == "ramp")
    disks = "[...Bokeh.documents[0].get_model_by_name('disks').data.x]"
    still = page.evaluate(disks)
    page.select_option("#mode", "0")
    page.wait_for_timeout(300)
    assert page.evaluate(disks) != still
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert wrong == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []
    page.close()
