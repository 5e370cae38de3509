"""draw, movie, view, init and --version, as a user types them."""

import json
import re

import pytest
from PIL import Image, ImageSequence
from reference_layer import SMALL, store, toml

from faultgouge.analysis import RunFile
from faultgouge.pywrap import Scene
from faultgouge.pywrap.scenes.scene import SECTIONS
from faultgouge.pywrap.scenes.validation import read_toml

MODE = r"mode \d+: lambda = [\d.]+, participation ratio 0\.\d+, rotation"


@pytest.mark.parametrize(
    ("options", "says", "times"),
    [
        ("--frame 2", "F_x = 0.012, F_y = 3: 100 disks", 1),
        pytest.param("--frame 3 --mode pair", MODE, 2, marks=pytest.mark.long),
    ],
)
@pytest.mark.slow
def test_a_packing_and_modes(beyond, faultgouge_here_in, options, says, times):
    done = faultgouge_here_in(beyond, "draw", "ramp.h5", *options.split(), "-o", "drawn.png")
    assert len(re.findall(says, done.stdout)) == times
    assert (beyond / "drawn.png").stat().st_size > 10_000


FILM = ("--seconds", "1", "--rate", "5", "--dots", "50", "-o", "film.gif")


def lasts(film):
    with Image.open(film) as gif:
        return sum(frame.info["duration"] for frame in ImageSequence.Iterator(gif))


@pytest.mark.long
@pytest.mark.slow
def test_drive_is_a_table_of_slips_pictures_a_film_and_spectra(faultgouge_here, tmp_path):
    """Of a small layer that a fast spring draws until it slips."""
    drawn = {"spring": 10.0, "velocity": 4e-3, "until": 200.0, "states": 2.0, "slips": 1}
    scene = {"packing": {"disks": 20, "seed": 3}, "damping": {"cn": 60.0, "ct": 17.0}, "drive": drawn}
    (tmp_path / "scene.toml").write_text(toml(SMALL | scene))
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
        for end, frame, force in (("begins", "before", "force_before"), ("ends", "after", "force_after")):
            number = slip[f"frame_{frame}"]
            assert (times[number], file.fx[number]) == (slip[end], slip[force])
    assert "1 slip up to t = " in faultgouge_here("drive", "scene.toml", "-o", "drive.h5").stdout
    assert faultgouge_here("draw", "drive.h5", "-o", "force.png").stdout == "written to force.png\n"
    of_state = ("--time", str(slip["begins"])), ("--frame", str(slip["frame_before"]))
    by_time, by_frame = (faultgouge_here("draw", "drive.h5", *which, "-o", "packing.png").stdout for which in of_state)
    assert by_time == by_frame
    faultgouge_here("movie", "drive.h5", "--span", "1", "9", *FILM)
    assert lasts(tmp_path / "film.gif") == 1000
    assert "eigenvalues" in faultgouge_here("spectrum", "drive.h5", "--frame", slip["frame_before"]).stdout
    backwards = faultgouge_here("movie", "drive.h5", "--span", "9", "1", *FILM, code=2).stderr
    assert f"has 0 of its {len(times)} states between t = 9 and 1" in backwards
    assert "is the table of the slips" in faultgouge_here("drive", "scene.toml", "-o", "slips.csv", code=1).stderr


@pytest.mark.long
@pytest.mark.parametrize("words", ["perturb.h5", "ramp.h5", "ramp.h5 --mode pair"])
def test_films_of_a_run_a_ramp_and_a_mode(beyond, faultgouge_here_in, words):
    faultgouge_here_in(beyond, "movie", *words.split(), *FILM)
    assert lasts(beyond / "film.gif") == 1000


@pytest.mark.slow
def test_init_writes_a_scene_that_holds_every_key(faultgouge_here, tmp_path):
    faultgouge_here("init")
    path = tmp_path / "scene.toml"
    assert Scene.from_toml(path).law.kn == 2e5
    # without the signs of comments every key is there, and the scene is still one
    path.write_text(re.sub(r"^# (?=\[|[A-Za-z_0-9]+ = )", "", path.read_text(), flags=re.MULTILINE))
    keys = read_toml(path, "scene")
    for name in ("relax", "ramp", "perturb", "friction", "drive", "output", "law", "load"):
        (model,) = SECTIONS[name]
        assert model.model_fields.keys() - keys[name].keys() == set(), name


def test_version(faultgouge_here):
    assert re.fullmatch(r"faultgouge \S+ \(LAMMPS \S+\)\n", faultgouge_here("--version").stdout)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "shows"),
    [
        ("ramp", ()),
        ("perturb", ['id="run"']),
        # frames that have a time: the force may rise and fall many times between them
        ("driven", ["states of a driven run of ", "t, time of the run", "<h2>Force over displacement</h2>"]),
    ],
)
def test_a_page_is_one_small_file_that_asks_for_no_other(beyond, faultgouge_here_in, name, shows):
    """tests/figures/test_view.py opens such pages in a browser."""
    with RunFile(beyond / "ramp.h5") as ramp:
        store(beyond / "driven.h5", *(ramp.packing(k) for k in (0, 2, 1, 2)), times=(0.0, 1.0, 2.5, 4.0))
    done = faultgouge_here_in(beyond, "view", f"{name}.h5", "--loads", "3", "-o", f"{name}.html")
    page = (beyond / f"{name}.html").read_text()
    assert done.stdout.startswith("1 packing, " if name == "perturb" else "3 packings, ")
    assert f"written to {name}.html" in done.stdout
    assert len(page) < 3e6
    assert re.findall(r"(?:src|href)=.(?!data:)", page) == []
    assert re.findall(r"https?://(?!www.w3.org/2000/svg)", page) == []
    assert [text for text in shows if text not in page] == []
    assert ('id="run"' in page) == (name == "perturb")
