"""Files as users have them: pipes, names with blanks and quotes, links, files that others write, and read-only ones."""

import errno
import json
import os
import subprocess
import sys
from shutil import copytree
from unittest.mock import Mock
from xml.etree import ElementTree

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image
from reference_layer import LAYER, REFERENCE, SMALL, store, toml
from table_rows import rows_of

from faultgouge.analysis.errors import OutputError
from faultgouge.analysis.files.atomic_write import lock_output, write_json
from faultgouge.analysis.files.formats import write_packing
from faultgouge.pywrap import Engine
from faultgouge.pywrap.lammps import plain_file_names
from faultgouge.studies.result_rows import write_csv

ASKED = {"ramp": {"step": 1e-3, "until": 2e-3}, "output": {"dumps": True}, "eruptions": {"load": [1e-3]}, "modes": {}}
SCENE = LAYER + toml(ASKED | {"friction": {"v0": 1e-7, "v_ss": "10 v0"}})
STRANGE = """a 'b' "c" & <d> $x ${y} #"""
"""What a file may be called."""


@pytest.mark.parametrize(("command", "pipe"), rows_of("cli/pipes.txt"))
def test_a_pipe_is_no_file(refusal, tmp_path, reference_packing, command, pipe):
    """Nothing waits for a pipe, and nothing is written."""
    write_packing(tmp_path / "packing.xyz", reference_packing(1.0))
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "piped.toml").write_text(SCENE.replace(str(REFERENCE), pipe))
    (tmp_path / "signal.toml").write_text(LAYER + toml({"perturb": {"fx": 0.0, "time": 1.0, "signal": pipe}}))
    (tmp_path / "out").mkdir()
    os.mkfifo(tmp_path / pipe)
    before = sorted(tmp_path.rglob("*"))
    said = refusal(*command.split())
    assert pipe in said
    assert "is no file" in said or "no plain file" in said
    assert sorted(tmp_path.rglob("*")) == before


DEEP = "[" * 20_000 + "]" * 20_000


@pytest.mark.parametrize(
    ("name", "text", "command", "says"),
    [
        ("scene.toml", f"a = {DEEP}", "onset scene.toml", "is nested too deeply"),
        ("sweep.toml", f"a = {DEEP}", "sweep sweep.toml", "is nested too deeply"),
        ("packing.json", f'{{"x": {DEEP}}}', "import packing.json", "nested too deeply"),
        ("trigger.jsonl", f"{DEEP}\n", "trigger whole.toml -o .", "line 1 is no result of a study"),
    ],
    ids=["scene", "sweep", "packing", "rows"],
)
def test_what_is_nested_too_deeply_is_refused(refusal, tmp_path, name, text, command, says):
    (tmp_path / "whole.toml").write_text(SCENE)
    (tmp_path / name).write_text(text)
    assert says in refusal(*command.split())


@pytest.mark.slow
def test_dumps_have_the_name_that_they_are_given(faultgouge_here, tmp_path, monkeypatch):
    (tmp_path / "with blank").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "with blank"))
    (tmp_path / "scene.toml").write_text(SCENE)
    faultgouge_here("ramp", "scene.toml", "-o", f"{STRANGE}.h5")
    expected = {f"{STRANGE}.{k}.{kind}" for k in (1, 2) for kind in ("contacts", "disks", "params")}
    assert {path.name for path in tmp_path.iterdir()} == expected | {"scene.toml", f"{STRANGE}.h5", "with blank"}
    assert not list((tmp_path / "with blank").iterdir())
    faultgouge_here("spectrum", f"{STRANGE}.2.disks")


def test_lammps_reads_decks_in_a_folder_of_a_strange_name(tmp_path, monkeypatch, request, reference_packing):
    copytree(plain_file_names.DECKS, tmp_path / STRANGE)
    monkeypatch.setattr(plain_file_names, "DECKS", tmp_path / STRANGE)
    plain_file_names.decks_folder.cache_clear()
    request.addfinalizer(plain_file_names.decks_folder.cache_clear)
    with Engine(reference_packing(1.0)) as engine:
        assert engine.packing == reference_packing(1.0)


@pytest.mark.parametrize(
    ("command", "name"), [("onset", "scene.toml"), ("settle", "link.toml"), ("ramp", "packing.json")]
)
def test_a_result_does_not_replace_what_it_is_made_of(refusal, tmp_path, command, name):
    (tmp_path / "scene.toml").write_text(SCENE.replace(str(REFERENCE), "packing.json"))
    (tmp_path / "packing.json").write_bytes(REFERENCE.read_bytes())
    (tmp_path / "link.toml").symlink_to("scene.toml")
    before = (tmp_path / name).read_bytes()
    said = refusal(command, "scene.toml", "-o", name, code=1)
    assert "is read by this command, and its result would replace it" in said
    assert (tmp_path / name).read_bytes() == before


@pytest.fixture
def stored(tmp_path, reference_packing):
    """A folder with a scene, and a run.h5 of one equilibrium."""
    (tmp_path / "scene.toml").write_text(SCENE)
    store(tmp_path / "run.h5", reference_packing(1.0), floor=1e-11, evaluations=0)
    return tmp_path


OTHERS = dict(rows_of("cli/files_of_others.txt"))
"""Commands, and a file that each would replace."""


@pytest.mark.parametrize(("command", "name"), OTHERS.items())
def test_no_file_of_another_is_touched(refusal, stored, command, name):
    """Refused before any work: what another run writes, what is read-only, and what another program has written.

    The last also under a name that the user gives nowhere.
    """
    drawn = {"damping": {"cn": 60.0}, "drive": {"spring": 3.0, "velocity": 0.1, "until": 1.0}}
    (stored / "drive.toml").write_text(LAYER + toml(drawn))
    (stored / "sweep.toml").write_text('task = "onset"\n[sweep]\n"packing.seed" = [1]\n' + toml(SMALL, "scene."))
    output, own = stored / command.split()[-1], stored / name
    own.parent.mkdir(exist_ok=True)
    for _ in range(2):  # the lock goes with the other
        with lock_output(output):
            assert "another run is writing it" in refusal(*command.split(), code=1)
    own.write_text("x,y\n1,2\nwritten by faultgouge, as I believe\n")
    before = {path: path.read_bytes() for path in stored.rglob("*") if path.is_file()}
    says = f"{name} is there already, and faultgouge has not written it"
    assert says in refusal(*command.split(), code=1).replace(f"{stored}/", "")
    if own == output:
        own.chmod(0o444)
        assert f"{name} cannot be written: it is read-only" in refusal(*command.split(), code=1)
    after = {path: path.read_bytes() for path in stored.rglob("*") if path.is_file()}
    if own != output:
        after.pop(output, None)  # a run that is begun
    assert after == before


DRAWN = [each for each in OTHERS if each.split()[0] in ("draw", "movie", "view", "export") and "pvd" not in each]


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("command", DRAWN)
def test_what_the_program_has_written_is_replaced(faultgouge_here, stored, command):
    """And its mark is in no reader's way."""
    path = stored / OTHERS[command]
    for _ in range(2):
        faultgouge_here(*command.split())
        assert path.stat().st_size > 1000
    if path.suffix in (".png", ".gif"):
        with Image.open(path) as picture:
            assert path.suffix == ".gif" or picture.text["Comment"] == "faultgouge_format=1"
            assert np.asarray(picture.convert("RGB")).std() > 1
    elif path.suffix in (".svg", ".vtp"):
        assert ElementTree.parse(path).getroot().tag
    elif path.suffix == ".mp4":
        frames = imageio_ffmpeg.read_frames(str(path))
        assert next(frames)["duration"] > 1
        assert len(list(frames)) > 10


@pytest.mark.long
@pytest.mark.slow
def test_vibrations_go_into_their_folder_again(faultgouge_here, stored):
    for _ in range(2):
        faultgouge_here("vibrations", "run.h5", "--waves", "0", "-o", "out")
    found = json.loads((stored / "out" / "vibrations.json").read_text())
    assert len(found["modes"]["frequency"]) == found["counted"]
    assert (stored / "out" / "density.csv").read_text().startswith("frequency,resolution,density,")


def test_tables_of_the_program_are_known_by_their_first_line(tmp_path):
    write_csv(tmp_path / "a.csv", ["x", "y"], [{"x": 1, "y": 2}])
    write_csv(tmp_path / "a.csv", ["x", "y"], [{"x": 1, "y": 3}])
    write_csv(tmp_path / "a.csv", ["x", "z"], [{"x": 1, "z": 3}], head="x,")
    with pytest.raises(OutputError, match="has not written it"):
        write_csv(tmp_path / "a.csv", ["x", "y"], [{"x": 1, "y": 3}])
    assert (tmp_path / "a.csv").read_text() == "x,z\n1,3\n"


@pytest.mark.slow
def test_the_folder_of_a_search_keeps_what_others_have_put_there(faultgouge_here, tmp_path):
    """Nor do links lead out of it; what a search has left goes."""
    (tmp_path / "scene.toml").write_text(LAYER + toml({"ramp": {"step": 6e-3, "until": 0.024}}))
    left = tmp_path / "o.json.slices"
    first, second = left / "0123456789abcdef", left / "fedcba9876543210"
    own = [left / "thesis.tex", first / "mine.npz", second / "1-2.npz"]
    for path in (*own, *(first / name for name in ("taken", "shifts.npz", "0-7.npz", f"{'a' * 32}.new"))):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x")
    faultgouge_here("onset", "scene.toml", "-o", "o.json")
    assert {path for path in left.rglob("*") if path.is_file()} == set(own)
    for path in own:
        path.unlink()
    (first / "taken").write_text("")
    faultgouge_here("onset", "scene.toml", "-o", "o.json")
    assert not first.exists()


def test_a_file_is_on_the_storage_device_before_it_has_its_name(tmp_path, monkeypatch):
    """The file first, then its name, then the folder that has the name."""
    happened, replace = [], os.replace
    monkeypatch.setattr("os.fsync", lambda number: happened.append(os.readlink(f"/proc/self/fd/{number}")))
    monkeypatch.setattr("os.replace", lambda new, old: (happened.append("replace"), replace(new, old)))
    write_json(tmp_path / "a.json", {"x": 1})
    assert [happened[0][-10:], *happened[1:]] == [".part.json", "replace", str(tmp_path)]


@pytest.mark.parametrize("buffered", ["", "1"])
def test_a_full_disk_behind_standard_output_is_named(buffered):
    """Also where the output is short, so that it is written at the end."""
    command = [sys.executable, "-m", "faultgouge", "--help"]
    with open("/dev/full", "w") as full:
        environment = os.environ | {"PYTHONUNBUFFERED": buffered}
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, env=environment, check=False)
    assert (done.returncode, done.stderr) == (1, "Error: standard output: No space left on device\n")


@pytest.mark.slow
@pytest.mark.parametrize("command", ["draw run.h5 -o new.png", "export run.h5 -o new.vtp"])
def test_a_file_is_replaced_as_a_whole(faultgouge_here, stored, monkeypatch, command):
    """What a full disk cuts off is not there; of two hard links one is replaced; no link is followed."""
    new, held = stored / command.split()[-1], "before, faultgouge_format=1"
    new.write_text(held)
    new.chmod(0o640)
    (stored / "link").hardlink_to(new)
    (stored / f"{new.name}.part").symlink_to("run.h5")
    before = {path.name: path.read_bytes() for path in stored.iterdir() if path != new}
    with monkeypatch.context() as full:
        full.setattr("os.replace", Mock(side_effect=OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))))
        said = faultgouge_here(*command.split(), code=1).stderr
    assert "No space left on device; what it held before is kept" in said
    assert new.read_text() == held
    faultgouge_here(*command.split())
    assert new.stat().st_size > 1000
    assert new.stat().st_mode & 0o777 == 0o640
    assert {path.name: path.read_bytes() for path in stored.iterdir() if path != new} == before
