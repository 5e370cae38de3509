"""Files as users have them: pipes, names with blanks and quotes, links, files that others write, and read-only ones."""

import errno
import json
import os
import subprocess
import sys
from xml.etree import ElementTree

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image
from reference_layer import LAYER, REFERENCE, SMALL, store, toml
from table_rows import rows_of

from faultgouge.analysis.errors import OutputError
from faultgouge.analysis.files.atomic_write import lock_output, write_json, write_text
from faultgouge.analysis.files.formats import write_packing
from faultgouge.pywrap import Engine
from faultgouge.pywrap.lammps import plain_file_names
from faultgouge.pywrap.lammps.plain_file_names import plain_name, temporary_folder
from faultgouge.studies.result_rows import write_csv

SCENE = LAYER + toml({"ramp": {"step": 1e-3, "until": 2e-3}, "output": {"dumps": True}})
WEAKENING = toml({"friction": {"v0": 1e-7, "v_ss": "10 v0"}})
STRANGE = """a 'b' "c" & <d> $x ${y} #"""
"""What a file may be called."""


PIPES = [f"onset scene.toml:pipe.{suffix}" for suffix in ("json", "csv", "data", "dump", "xyz", "h5")]
PIPES += ["spectrum pipe.disks", "draw pipe", "movie pipe.h5", "view pipe -o x.html", "export pipe.h5", "import pipe"]
PIPES += ["onset pipe", "perturb scene.toml:pipe"]
"""Commands with a pipe as their file, or as the packing or the signal of their scene."""


@pytest.mark.parametrize("command", PIPES)
def test_a_pipe_is_no_file(refusal, tmp_path, command):
    """Nothing waits for a pipe, and nothing is written."""
    words, _, named = command.partition(":")
    pipe = named or next(word for word in words.split() if word.startswith("pipe"))
    os.mkfifo(tmp_path / pipe)
    scene = SCENE.replace(str(REFERENCE), named)
    if words.startswith("perturb"):
        scene = LAYER + toml({"perturb": {"fx": 0.0, "time": 1.0, "signal": named}})
    (tmp_path / "scene.toml").write_text(scene)
    said = refusal(*words.split())
    assert pipe in said
    assert "is no file" in said or "no plain file" in said
    assert {path.name for path in tmp_path.iterdir()} == {pipe, "scene.toml"}


def test_no_pipe_is_read_beside_a_file(refusal, tmp_path, reference_packing):
    write_packing(tmp_path / "packing.xyz", reference_packing(1.0))
    (tmp_path / "scene.toml").write_text(SCENE + WEAKENING)
    (tmp_path / "out").mkdir()
    for name in ("pipe", "out/trigger.jsonl"):
        os.mkfifo(tmp_path / name)
    of_import = (f"import packing.xyz {more} pipe" for more in ("--contacts", "--top ids:@pipe --scene", "--scene"))
    for command in (*of_import, "trigger scene.toml -o out"):
        assert "no plain file" in refusal(*command.split())


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
    (tmp_path / "whole.toml").write_text(SCENE + WEAKENING)
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


def test_a_restart_of_a_strange_name_and_decks_in_a_strange_folder(tmp_path, monkeypatch, reference_packing):
    with plain_name(tmp_path / STRANGE) as name, temporary_folder() as folder:
        assert name.name == "file"
        assert folder.replace("/", "").replace("-", "").replace("_", "").isalnum()
    (tmp_path / STRANGE).symlink_to(plain_file_names.DECKS)
    monkeypatch.setattr(plain_file_names, "DECKS", tmp_path / STRANGE)
    plain_file_names.decks_folder.cache_clear()
    try:
        with Engine(reference_packing(1.0)) as engine:
            assert engine.packing == reference_packing(1.0)
    finally:
        monkeypatch.undo()
        plain_file_names.decks_folder.cache_clear()


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


WRITTEN = {
    "ramp scene.toml": "new.h5",
    "onset scene.toml": "onset.json",
    "draw run.h5": "run.png",
    "movie run.h5": "run.gif",
    "view run.h5": "run.html",
    "export run.h5": "run.vtp",
}
"""What commands write to -o; `init` and `import` replace no file."""
NEW = WRITTEN | {"init": "new.toml", "import run.vtp": "new.h5", "sweep sweep.toml": "out", "trigger scene.toml": "out"}


@pytest.mark.parametrize("command", NEW)
def test_a_file_that_another_run_writes_or_that_is_read_only_is_kept(refusal, stored, command):
    """Both are refused before work; so is the folder of a study."""
    name = NEW[command]
    (stored / "scene.toml").write_text(SCENE + WEAKENING)
    (stored / "sweep.toml").write_text(SWEEP)
    if name == "out":
        (stored / "out").mkdir()
    before = {path.name for path in stored.iterdir()}
    for _ in range(2):  # the lock goes with the other
        with lock_output(stored / name):
            assert "another run is writing it" in refusal(*command.split(), "-o", name, code=1)
    assert {path.name for path in stored.iterdir()} == before
    if command in WRITTEN:
        (stored / name).write_text("kept")
        (stored / name).chmod(0o444)
        assert f"{name} cannot be written: it is read-only" in refusal(*command.split(), "-o", name, code=1)
        assert (stored / name).read_text() == "kept"


OTHERS = dict(rows_of("cli/files_of_others.txt"))
"""Commands, and a file that each would replace."""
SWEEP = 'task = "onset"\n[sweep]\n"packing.seed" = [1]\n' + toml(SMALL, "scene.")


@pytest.mark.parametrize("command", OTHERS)
def test_what_others_have_written_is_kept(refusal, stored, command):
    """Also a file that the user names nowhere; and it is refused before any work."""
    drawn = {"damping": {"cn": 60.0}, "drive": {"spring": 3.0, "velocity": 0.1, "until": 1.0}}
    (stored / "drive.toml").write_text(LAYER + toml(drawn))
    (stored / "scene.toml").write_text(SCENE + WEAKENING + toml({"eruptions": {"load": [1e-3]}, "modes": {}}))
    (stored / "sweep.toml").write_text(SWEEP)
    own = stored / OTHERS[command]
    own.parent.mkdir(exist_ok=True)
    own.write_text("x,y\n1,2\nwritten by faultgouge, as I believe\n")
    before = {path: path.read_bytes() for path in stored.rglob("*") if path.is_file()}
    assert f"{OTHERS[command]} is there already, and faultgouge has not written it" in refusal(
        *command.split(), code=1
    ).replace(f"{stored}/", "")
    assert own.read_bytes() == before[own]
    assert not {path.suffix for path in set(stored.rglob("*")) - set(before)} & {".csv", ".json", ".png", ".jsonl"}


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
    happened = []
    monkeypatch.setattr("os.fsync", lambda number: happened.append(os.readlink(f"/proc/self/fd/{number}")))
    replace = os.replace
    monkeypatch.setattr("os.replace", lambda new, old: (happened.append("replace"), replace(new, old)))
    write_json(tmp_path / "a.json", {"x": 1})
    part, moved, folder = happened
    assert (part.endswith(".part.json"), moved, folder) == (True, "replace", str(tmp_path))


@pytest.mark.parametrize("buffered", ["", "1"])
def test_a_full_disk_behind_standard_output_is_named(buffered):
    """Also where the output is short, so that it is written at the end."""
    command = [sys.executable, "-m", "faultgouge", "--help"]
    with open("/dev/full", "w") as full:
        environment = os.environ | {"PYTHONUNBUFFERED": buffered}
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, env=environment, check=False)
    assert (done.returncode, done.stderr) == (1, "Error: standard output: No space left on device\n")


def no_room(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.slow
@pytest.mark.parametrize("command", ["draw run.h5 -o new.png", "export run.h5 -o new.vtp"])
def test_a_picture_replaces_a_file_as_a_whole(faultgouge_here, stored, monkeypatch, command):
    """What a full disk cuts off is not there; of two hard links one is replaced: nothing is changed in place."""
    new, held = stored / command.split()[-1], "before, faultgouge_format=1"
    new.write_text(held)
    (stored / "link").hardlink_to(new)
    (stored / f"{new.name}.part").symlink_to("run.h5")
    before = {path.name for path in stored.iterdir()}
    with monkeypatch.context() as full:
        full.setattr("os.replace", no_room)
        said = faultgouge_here(*command.split(), code=1).stderr
    assert "No space left on device; what it held before is kept" in said
    assert new.read_text() == held
    faultgouge_here(*command.split())
    assert new.stat().st_size > 1000
    assert (stored / "link").read_text() == held
    assert {path.name for path in stored.iterdir()} == before


def test_no_link_is_followed_and_the_mode_is_kept(tmp_path):
    (tmp_path / "victim").write_text("untouched")
    (tmp_path / "l.json.part").symlink_to("victim")
    (tmp_path / "l.json").write_text('{"faultgouge_format": 1}')
    (tmp_path / "l.json").chmod(0o640)
    write_text(tmp_path / "l.json", "new")
    assert [(tmp_path / name).read_text() for name in ("victim", "l.json")] == ["untouched", "new"]
    assert (tmp_path / "l.json").stat().st_mode & 0o777 == 0o640
    assert {path.name for path in tmp_path.iterdir()} == {"victim", "l.json.part", "l.json"}
