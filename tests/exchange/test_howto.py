"""The commands of docs/howto_own_packing.md, as they stand there."""

import re
import subprocess
from pathlib import Path

import pytest
from reference_layer import BIN

from faultgouge.analysis import RunFile

HOWTO = Path(__file__).parents[2] / "docs" / "howto_own_packing.md"


@pytest.mark.long
def test_from_a_pour_to_the_film_of_the_mode(tmp_path):
    text = HOWTO.read_text()
    deck, scene = re.findall(r"```\n(.*?)```", text, re.DOTALL)
    (tmp_path / "pour.in").write_text(deck)
    (tmp_path / "own.toml").write_text(scene)
    commands = re.findall(r"^    (\w.*)$", text, re.MULTILINE)
    assert len(commands) == 6
    said = {}
    for command in commands:
        program, *words = command.split()
        done = subprocess.run([BIN / program, *words], cwd=tmp_path, capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr
        said[" ".join([program, *words[:1]])] = done.stderr
    assert "brought to rest" in said["faultgouge import"]
    onset = re.search(r"F_x\^c = ([\d.]+)", said["faultgouge onset"])
    assert onset
    with RunFile(tmp_path / "run.h5") as run:
        assert 0 < float(onset[1]) < run.fx[-1]
    assert "complex pair" in said["faultgouge draw"]
    assert (tmp_path / "mode.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "mode.gif").read_bytes().startswith(b"GIF89a")
