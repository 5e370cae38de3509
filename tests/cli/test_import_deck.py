"""faultgouge import DECK.in, and what takes the file that it leaves."""

import json
from xml.etree import ElementTree

import numpy as np
import pytest

DECK = """
units lj
dimension {d}
atom_style sphere
boundary f f {z}
newton off
comm_modify vel yes
region box block -2 2 {box} units box
create_box 1 box
create_atoms 1 single -0.45 {a} units box
create_atoms 1 single 0.45 {a} units box
create_atoms 1 single 0 {b} units box
set group all diameter 1.0
set group all density 1.0
variable kn equal 1e3
pair_style gran/hertz/history ${{kn}} NULL 10 NULL 0.9 1
pair_coeff * *
fix floor all wall/gran hertz/history ${{kn}} NULL 10 NULL 0.9 1 {plane} {word}
fix load all gravity 1.0 vector {down}
fix move all nve/sphere
fix drag all viscous 1.0
timestep 0.005
run 6000
"""
FLAT = {"d": 2, "z": "p", "box": "0 4 -0.5 0.5", "a": "0.5 0", "b": "1.3 0", "plane": "yplane 0 NULL", "down": "0 -1 0"}
ROUND = {"d": 3, "z": "f", "box": "-2 2 0 4", "a": "0 0.5", "b": "0 1.3", "plane": "zplane 0 NULL", "down": "0 0 -1"}


@pytest.mark.parametrize("shape", [FLAT, ROUND], ids=["disks", "spheres"])
def test_deck(faultgouge_here, tmp_path, shape):
    from faultgouge.analysis import eigenvalues
    from faultgouge.analysis.files.snapshot_file import read_snapshot

    folder = tmp_path / "own"
    folder.mkdir()
    (folder / "pile.in").write_text(DECK.format(**shape, word="contacts"))
    done = faultgouge_here("import", "own/pile.in", "-o", "pile.h5")
    assert f"3 {'disks' if shape is FLAT else 'spheres'}, " in done.stdout
    snapshot = read_snapshot(tmp_path / "pile.h5")
    assert snapshot.residual < 1e-6
    found = json.loads(faultgouge_here("spectrum", "pile.h5", "--json").stdout)
    assert [complex(*each) for each in found["eigenvalues"]] == pytest.approx(list(eigenvalues(snapshot)), abs=1e-8)
    assert "as LAMMPS left them" in faultgouge_here("spectrum", "pile.h5").stdout

    faultgouge_here("export", "pile.h5", "--mode", "1", "-o", "pile.vtp")
    piece = ElementTree.parse(tmp_path / "pile.vtp").find(".//Piece")
    assert (piece.get("NumberOfVerts"), piece.get("NumberOfLines")) == ("3", str(len(snapshot.contacts)))
    names = {each.get("Name"): each.get("NumberOfComponents") for each in piece.find("PointData")}
    assert names["mode_1"] == names["mode_1_rotation"] == names["net_force"] == "3"
    faultgouge_here("export", "pile.h5", "-o", "pile.xyz")
    rows = np.loadtxt((tmp_path / "pile.xyz").read_text().splitlines()[2:])
    assert np.array_equal(rows[:, : snapshot.dimension], snapshot.position)
    for words in (["draw", "pile.h5"], ["view", "pile.h5"], ["movie", "pile.h5", "--mode", "0"]):
        assert "faultgouge export pile.h5" in faultgouge_here(*words, code=2).stderr


def test_refused_before_the_run(faultgouge_here, tmp_path):
    (tmp_path / "pile.in").write_text(DECK.format(**ROUND, word="") + "run 1000000000\n")
    assert "write contacts at its end" in faultgouge_here("import", "pile.in", code=2).stderr
    assert "leave all options" in faultgouge_here("import", "pile.in", "--kn", "3", code=2).stderr
    (tmp_path / "in.wrong").write_text("units nothing\n")
    assert "LAMMPS stopped: " in faultgouge_here("import", "in.wrong", code=1).stderr
    assert not (tmp_path / "packing.h5").exists()
