"""A restart file of another layout is refused in a sentence, and one of this layout is read."""

import subprocess

import pytest
from reference_layer import BIN

WRITE = """units lj
dimension 2
atom_style sphere
boundary f f p
comm_modify vel yes
region box block 0 10 0 10 -0.5 0.5
create_box 1 box
create_atoms 1 single 5.0 5.0 0.0
create_atoms 1 single 7.0 5.0 0.0
set group all diameter 1.0
pair_style mindlin/smooth 2e5 5e4 0.5
pair_coeff * *
run 0
write_restart state.restart
"""
MARK = (0x4D444C53).to_bytes(4, "little")


def run(folder, text, code):
    (folder / "deck.in").write_text(text)
    command = [BIN / "lmp", "-in", "deck.in", "-log", "none"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60)
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.mark.slow
def test_the_layout_of_another_version_is_refused(tmp_path):
    run(tmp_path, WRITE, 0)
    state = tmp_path / "state.restart"
    run(tmp_path, "read_restart state.restart\nrun 0\n", 0)
    data = state.read_bytes()
    assert data.count(MARK) == 1
    place = data.index(MARK) + 4
    state.write_bytes(data[:place] + (7).to_bytes(4, "little") + data[place + 4 :])
    assert "mindlin/smooth of another version: read the file with" in run(tmp_path, "read_restart state.restart\n", 1)
