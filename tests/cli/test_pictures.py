"""draw, movie, init, --version and python -m faultgouge, as a user types them."""

import re
import subprocess
import sys

import pytest
from PIL import Image
from reference_layer import BIN

from faultgouge.analysis import RunFile
from faultgouge.notebook import picture
from faultgouge.pywrap import Scene
from faultgouge.pywrap.scenes.refusals import read_toml


@pytest.mark.parametrize("suffix", ["png", *(pytest.param(s, marks=pytest.mark.long) for s in ("svg", "pdf"))])
@pytest.mark.slow
def test_a_packing(beyond, suffix, faultgouge_in):
    done = faultgouge_in(beyond, "draw", "ramp.h5", "--frame", "2", "-o", f"packing.{suffix}")
    assert "F_x = 0.012, F_y = 3: 100 disks" in done.stderr
    assert (beyond / f"packing.{suffix}").stat().st_size > 10_000


@pytest.mark.long
def test_the_pair_before_and_after_the_onset(beyond, faultgouge_in):
    before = faultgouge_in(beyond, "draw", "ramp.h5", "--frame", "3", "--mode", "pair", "-o", "before.png")
    assert len(re.findall(r"mode \d+: lambda = [\d.]+, participation", before.stderr)) == 2
    after = faultgouge_in(beyond, "draw", "ramp.h5", "--mode", "pair", "-o", "after.png")
    assert re.search(r"mode \d+: lambda = [\d.]+ \+- [\d.]+ i, participation ratio 0\.\d+, rotation", after.stderr)


@pytest.mark.long
def test_films_of_a_run_a_ramp_and_a_mode(beyond, faultgouge_in):
    for name, more in (("perturb", ()), ("ramp", ()), ("ramp", ("--mode", "pair"))):
        command = ("movie", f"{name}.h5", *more, "--seconds", "1", "--rate", "5", "--dots", "50", "-o", "film.gif")
        faultgouge_in(beyond, *command)
        with Image.open(beyond / "film.gif") as gif:
            assert gif.n_frames == 5


@pytest.mark.slow
def test_init_writes_a_scene_that_holds_every_key(faultgouge, tmp_path):
    faultgouge("init")
    path = tmp_path / "scene.toml"
    assert Scene.from_toml(path).law.kn == 2e5
    # without the signs of comments every key is there, and the scene is still one
    path.write_text(re.sub(r"^# (?=\[|[A-Za-z_0-9]+ = )", "", path.read_text(), flags=re.MULTILINE))
    keys = read_toml(path, "scene")
    for name in ("relax", "ramp", "perturb", "friction", "output", "law", "load"):
        section = Scene.model_fields[name].annotation
        models = [each for each in (section, *getattr(section, "__args__", ())) if hasattr(each, "model_fields")]
        missing = set(models[0].model_fields) - set(keys[name])
        assert not missing, f"{name}: {missing}"


def test_version_in_both_ways():
    for command in ([BIN / "faultgouge"], [sys.executable, "-m", "faultgouge"]):
        done = subprocess.run([*command, "--version"], capture_output=True, text=True, timeout=100)
        assert re.fullmatch(r"faultgouge \S+ \(LAMMPS \S+\)\n", done.stdout), done.stderr


@pytest.mark.slow
def test_a_packing_shows_itself(beyond):
    with RunFile(beyond / "ramp.h5") as file:
        packing, same, other = file.packing(1), file.packing(1), file.packing(2)
    assert len(repr(packing)) < 200
    assert picture(packing).startswith(b"\x89PNG")
    assert packing == same
    assert packing != other
    assert packing.contacts == same.contacts
