"""The page about JSON names every key that commands print."""

import json
import re
from pathlib import Path

import pytest
from reference_layer import LAYER, toml

PAGE = Path(__file__).parents[2] / "docs" / "json.md"


def named(command):
    """The keys that the section of a command names, in backticks or in quotes."""
    section = re.search(rf"^## {command}\n(.*?)(?=^## |\Z)", PAGE.read_text(), re.MULTILINE | re.DOTALL)[1]
    return set(re.findall(r"[`\"](\w+)[`\"]", section))


@pytest.mark.slow
def test_keys_of_commands(faultgouge_here, tmp_path):
    (tmp_path / "scene.toml").write_text(LAYER + toml({"ramp": {"step": 5.5e-3, "until": 0.022}}))
    asked = ("ramp", "scene.toml"), ("spectrum", "run.h5"), ("onset", "scene.toml", "--all")
    ramp, spectrum, onset = (json.loads(faultgouge_here(*words, "--json").stdout) for words in asked)
    assert {each.pop("faultgouge_format") for each in (ramp, spectrum, onset)} == {1}
    assert {*ramp, *ramp["equilibria"][0]} <= named("ramp")
    inner = [spectrum["stability"], spectrum["stability"]["undamped"], *spectrum["pairs"]]
    assert {key for each in (spectrum, *inner) for key in each} <= named("spectrum")
    assert {*onset, *onset["windows"][0]} <= named("onset")
