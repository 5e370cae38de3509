"""Files as users have them: pipes, names with blanks and quotes, links, files that others write, and read-only ones."""

import json
import os
import signal
import subprocess
import sys

import pytest
from reference_layer import LAYER, REFERENCE, toml

from faultgouge.analysis.files.atomic_write import lock_output, write_text
from faultgouge.pywrap import Engine, Scene, settle
from faultgouge.pywrap.lammps.plain_file_names import plain_name, temporary_folder

SCENE = LAYER + toml({"ramp": {"step": 1e-3, "until": 2e-3}, "output": {"dumps": True}})
STRANGE = """a 'b' "c" & <d> $x ${y} #"""
"""What a file may be called."""


@pytest.mark.parametrize("packing", ["pipe.json", "pipe.csv", "pipe.data", "pipe.dump", "pipe.xyz", "pipe.h5"])
def test_a_pipe_is_no_file(refusal, tmp_path, packing):
    os.mkfifo(tmp_path / packing)
    (tmp_path / "scene.toml").write_text(SCENE.replace(str(REFERENCE), packing))
    assert "pipe" in refusal("onset", "scene.toml")
    assert "no plain file" in refusal("onset", "scene.toml")


def test_a_pipe_is_no_scene_and_no_signal(refusal, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    assert "no plain file" in refusal("onset", "pipe")
    (tmp_path / "scene.toml").write_text(LAYER + toml({"perturb": {"fx": 0.0, "time": 1.0, "signal": "pipe"}}))
    assert "no plain file" in refusal("perturb", "scene.toml")


def test_what_is_nested_too_deeply_is_refused(refusal, tmp_path):
    (tmp_path / "scene.toml").write_text("a = " + "[" * 20_000 + "]" * 20_000)
    assert "the scene is nested too deeply" in refusal("onset", "scene.toml")


@pytest.mark.slow
def test_dumps_have_the_name_that_they_are_given(faultgouge_here, tmp_path, monkeypatch):
    (tmp_path / "with blank").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "with blank"))
    (tmp_path / "scene.toml").write_text(SCENE)
    faultgouge_here("ramp", "scene.toml", "-o", f"{STRANGE}.h5")
    kinds = ("contacts", "disks", "params")
    expected = {f"{STRANGE}.{k}.{kind}" for k in (1, 2) for kind in kinds}
    assert {path.name for path in tmp_path.iterdir()} == expected | {"scene.toml", f"{STRANGE}.h5", "with blank"}
    assert not list((tmp_path / "with blank").iterdir())
    faultgouge_here("spectrum", f"{STRANGE}.2.disks")


def test_a_restart_of_a_strange_name_and_decks_in_a_strange_folder(tmp_path, monkeypatch):
    with plain_name(tmp_path / STRANGE) as name, temporary_folder() as folder:
        assert name.name == "file"
        assert folder.replace("/", "").replace("-", "").replace("_", "").isalnum()
    from faultgouge.pywrap.lammps import plain_file_names

    decks = tmp_path / STRANGE
    decks.symlink_to(plain_file_names.DECKS)
    monkeypatch.setattr(plain_file_names, "DECKS", decks)
    plain_file_names.decks_folder.cache_clear()
    try:
        packing = settle(
            Scene.from_mapping({"packing": {"file": str(REFERENCE)}, "law": {"kn": 2e5}, "load": {"fy": 3}})
        )
        with Engine(packing.packing) as engine:
            assert engine.packing == packing.packing
    finally:
        monkeypatch.undo()
        plain_file_names.decks_folder.cache_clear()


@pytest.mark.parametrize("command", ["onset", "settle", "ramp"])
@pytest.mark.parametrize("name", ["scene.toml", "link.toml", "packing.json"])
def test_a_result_does_not_replace_what_it_is_made_of(refusal, tmp_path, command, name):
    (tmp_path / "scene.toml").write_text(SCENE.replace(str(REFERENCE), "packing.json"))
    (tmp_path / "packing.json").write_bytes(REFERENCE.read_bytes())
    (tmp_path / "link.toml").symlink_to("scene.toml")
    before = (tmp_path / name).read_bytes()
    assert "is read by this command, and its result would replace it" in refusal(
        command, "scene.toml", "-o", name, code=1
    )
    assert (tmp_path / name).read_bytes() == before


@pytest.mark.parametrize("command", ["onset", "settle"])
def test_a_read_only_file_is_kept(refusal, tmp_path, command):
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "kept").write_text("kept")
    (tmp_path / "kept").chmod(0o444)
    assert "kept cannot be written: it is read-only" in refusal(command, "scene.toml", "-o", "kept", code=1)
    assert (tmp_path / "kept").read_text() == "kept"


@pytest.mark.slow
def test_a_file_that_another_run_writes_is_refused_before_work(refusal, tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    code = (
        "import sys; from pathlib import Path; from faultgouge.analysis.files.atomic_write import lock_output\n"
        "with lock_output(Path('run.h5')): print('ready', flush=True); sys.stdin.read()"
    )
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path, **pipes) as other:
        assert other.stdout.readline() == b"ready\n"
        assert "another run is writing it" in refusal("ramp", "scene.toml", "-o", "run.h5", code=1)
        other.stdin.close()
    assert [path.name for path in tmp_path.iterdir()] == ["scene.toml"]
    with lock_output(tmp_path / "run.h5"):  # the lock went with the other
        pass


def test_no_link_is_followed_and_the_mode_is_kept(tmp_path):
    (tmp_path / "victim").write_text("untouched")
    (tmp_path / "l.json.part").symlink_to("victim")
    (tmp_path / "l.json").write_text("{}")
    (tmp_path / "l.json").chmod(0o640)
    write_text(tmp_path / "l.json", "new")
    assert (tmp_path / "victim").read_text() == "untouched"
    assert (tmp_path / "l.json").read_text() == "new"
    assert (tmp_path / "l.json").stat().st_mode & 0o777 == 0o640
    assert {path.name for path in tmp_path.iterdir()} == {"victim", "l.json.part", "l.json"}


@pytest.mark.parametrize(
    ("disk", "says"),
    [
        ({"radius": 1e-300}, "The radius of disk 0 is 1e-300: give one between 1e-100 and 1e+100"),
        ({"x": 1.55, "y": 0.49}, "are 0 apart"),
    ],
)
def test_a_packing_that_is_none(refusal, tmp_path, disk, says):
    disks = {"x": [0.5, 1.55], "y": [0.49, 0.49], "radius": [0.5, 0.5], "top": [0, 1], "box_length": 4.0}
    for key, value in disk.items():
        disks[key][0] = value
    (tmp_path / "packing.json").write_text(json.dumps(disks))
    (tmp_path / "scene.toml").write_text(SCENE.replace(str(REFERENCE), "packing.json"))
    assert says in refusal("onset", "scene.toml")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "code", "says"),
    [
        (signal.SIGHUP, 129, "the terminal or the connection was closed: "),
        (signal.SIGXCPU, 152, "the limit of CPU time (ulimit -t) is reached: "),
    ],
)
def test_signals_of_the_system_end_in_a_sentence(tmp_path, number, code, says):
    """SIGXCPU comes to the process that works, the child of the one that the shell started."""
    work = (
        f"import os, signal, time; os.kill(os.getp{'p' * (number == signal.SIGHUP)}id(), {int(number)}); time.sleep(9)"
    )
    script = "from faultgouge.signal_guard import guarded, keeps\n"
    script += f"def work():\n keeps('all is kept')\n {work}\nguarded(work)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=30, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (code, f"Error: {says}all is kept.\n")


@pytest.mark.slow
def test_a_folder_that_is_gone_keeps_nothing(tmp_path):
    script = (
        "import os, signal, time; from faultgouge.signal_guard import guarded, keeps\n"
        f"def work(): keeps('all is kept', {str(tmp_path / 'gone')!r}); os.kill(os.getppid(), 15); time.sleep(9)\n"
        "guarded(work)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=30, cwd=tmp_path)
    assert (
        done.stderr
        == f"Error: terminated: {tmp_path / 'gone'} is not there, and the same command starts from the beginning.\n"
    )
