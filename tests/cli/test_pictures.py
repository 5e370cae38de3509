"""draw, movie, init and --version, as a user types them; and the page of view, in a browser that has no network."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from reference_layer import BIN, LAYER, toml

from faultgouge.analysis import RunFile
from faultgouge.figures.browser_pair import follow_eigenvalues
from faultgouge.pywrap import Scene
from faultgouge.pywrap.scenes.validation import read_toml

PACKING = "F_x = 0.012, F_y = 3: 100 disks"
MODE = r"mode \d+: lambda = [\d.]+, participation ratio 0\.\d+, rotation"


@pytest.mark.parametrize(
    ("options", "name", "says", "times"),
    [
        ("--frame 2", "packing.png", PACKING, 1),
        pytest.param("--frame 2", "packing.pdf", PACKING, 1, marks=pytest.mark.long),
        pytest.param("--frame 3 --mode pair", "about_to_meet.png", MODE, 2, marks=pytest.mark.long),
    ],
)
@pytest.mark.slow
def test_a_packing_and_modes(beyond, faultgouge_here_in, options, name, says, times):
    done = faultgouge_here_in(beyond, "draw", "ramp.h5", *options.split(), "-o", name)
    assert len(re.findall(says, done.stdout)) == times
    assert (beyond / name).stat().st_size > 10_000


@pytest.mark.long
def test_films_of_a_run_a_ramp_and_a_mode(beyond, faultgouge_here_in):
    for name, more in (("perturb", ()), ("ramp", ()), ("ramp", ("--mode", "pair"))):
        command = ("movie", f"{name}.h5", *more, "--seconds", "1", "--rate", "5", "--dots", "50", "-o", "film.gif")
        faultgouge_here_in(beyond, *command)
        with Image.open(beyond / "film.gif") as gif:
            assert gif.n_frames == 5


DRIVE = {
    "damping": {"cn": 60.0, "ct": 17.0},
    "drive": {"spring": 10.0, "velocity": 2e-3, "until": 200.0, "states": 2.0, "slips": 1},
}
"""A layer that a fast spring draws until it slips."""


@pytest.mark.slow
def test_drive_is_a_table_of_slips_pictures_a_film_and_spectra(faultgouge_here, tmp_path):
    (tmp_path / "scene.toml").write_text(LAYER + toml(DRIVE))
    done = faultgouge_here("drive", "scene.toml", "-o", "drive.h5", "--json")
    result = json.loads(done.stdout)
    (slip,) = result["slips"]
    assert slip["force_before"] > slip["force_after"]
    assert slip["slip"] > 0.005
    assert slip["kinetic_energy"] > 0
    assert result["time"] < 200.0
    row = (tmp_path / "drive.csv").read_text().splitlines()[1].split(",")
    assert [float(number) for number in row[:6]] == list(slip.values())[:6]
    with RunFile(tmp_path / "drive.h5") as file:
        times = file.observable("time")
        assert times[slip["frame_before"]] <= slip["begins"]
        assert times[slip["frame_after"]] >= slip["ends"]
        assert file.packing(slip["frame_before"]).fx == pytest.approx(slip["force_before"], rel=0.05)
    again = faultgouge_here("drive", "scene.toml", "-o", "drive.h5")
    assert "1 slip up to t = " in again.stdout
    drawn = faultgouge_here("draw", "drive.h5", "-o", "force.png")
    assert drawn.stdout == "written to force.png\n"
    by_time = faultgouge_here("draw", "drive.h5", "--time", str(slip["begins"]), "-o", "packing.png").stdout
    by_frame = faultgouge_here("draw", "drive.h5", "--frame", slip["frame_before"], "-o", "packing.png").stdout
    assert by_time == by_frame
    film = ("movie", "drive.h5", "--span", "1", "9", "--seconds", "1", "--rate", "5", "--dots", "50", "-o", "film.gif")
    faultgouge_here(*film)
    with Image.open(tmp_path / "film.gif") as gif:
        assert gif.n_frames == 5
    assert "eigenvalues" in faultgouge_here("spectrum", "drive.h5", "--frame", slip["frame_before"]).stdout
    assert "floor" in faultgouge_here("explain", "scene.toml").stdout


@pytest.mark.slow
def test_init_writes_a_scene_that_holds_every_key(faultgouge_here, tmp_path):
    faultgouge_here("init")
    path = tmp_path / "scene.toml"
    assert Scene.from_toml(path).law.kn == 2e5
    # without the signs of comments every key is there, and the scene is still one
    path.write_text(re.sub(r"^# (?=\[|[A-Za-z_0-9]+ = )", "", path.read_text(), flags=re.MULTILINE))
    keys = read_toml(path, "scene")
    for name in ("relax", "ramp", "perturb", "friction", "drive", "output", "law", "load"):
        section = Scene.model_fields[name].annotation
        models = [each for each in (section, *getattr(section, "__args__", ())) if hasattr(each, "model_fields")]
        missing = set(models[0].model_fields) - set(keys[name])
        assert not missing, f"{name}: {missing}"


def test_version_in_both_ways():
    for command in ([BIN / "faultgouge"], [sys.executable, "-m", "faultgouge"]):
        done = subprocess.run([*command, "--version"], capture_output=True, text=True, timeout=100)
        assert re.fullmatch(r"faultgouge \S+ \(LAMMPS \S+\)\n", done.stdout), done.stderr


@pytest.mark.long
def test_few_eigenvalues_show_the_pair_that_all_show(beyond):
    """What a large packing has: the same pair at each load, and the eigenvalues that are closest to the pair."""
    with RunFile(beyond / "ramp.h5") as run:
        packings = [run.packing(k) for k in range(len(run))]
    some, everything = (follow_eigenvalues(packings, everything=each) for each in (False, True))
    # one pair of one matrix by two iterations: their planes agree to rounding, which a split pair takes in as its root
    scale = np.abs(everything.pair).max()
    assert np.allclose(some.pair, everything.pair, rtol=0, atol=1e-7 * scale)
    for few, values in zip(some.values, everything.values, strict=True):
        assert all(np.abs(values - each).min() < 1e-9 * values.real.max() for each in few)


@pytest.fixture(scope="module")
def pages(beyond, faultgouge_here_in):
    """The folder, with a page of either file."""
    for name in ("ramp", "perturb"):
        faultgouge_here_in(beyond, "view", f"{name}.h5", "-o", f"{name}.html")
    return beyond


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as p:
        chromium = shutil.which("chromium") or shutil.which("google-chrome") or p.chromium.executable_path
        if not Path(chromium).exists():
            pytest.skip("no Chromium is installed: python -m playwright install chromium")
        yield p.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])


DISKS = "[...Bokeh.documents[0].get_model_by_name('disks').data.x]"
MARKS = """(() => { const m = Bokeh.documents[0].get_model_by_name('marks').data
  return Array.from(m.x0, (x, k) => Math.atan2(x - m.x1[k], m.y1[k] - m.y0[k])) })()"""
"""Angles of the marks on the disks, from the vertical."""


@pytest.mark.long
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1440, 390])
@pytest.mark.parametrize("name", ["ramp", "perturb"])
def test_the_page_offline(pages, browser, name, width, scheme):
    page = browser.new_page(viewport={"width": width, "height": 800}, color_scheme=scheme)
    wrong, asked = [], []
    page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto((pages / f"{name}.html").as_uri())
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
    still, upright = page.evaluate(DISKS), page.evaluate(MARKS)
    assert max(map(abs, upright)) < 0.1
    page.select_option("#mode", "0")
    page.wait_for_timeout(300)
    assert page.evaluate(DISKS) != still
    assert max(map(abs, page.evaluate(MARKS))) > 0.1
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert wrong == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []
    page.close()
